"""The command `curves`."""

from pathlib import Path
from typing import Annotated

import typer

from metrics.controllers import PAPER_POLICIES
from swarm_forage_env.cli.options import EXIT_FAILURE, Jobs, complain, no_picture

PICTURE_FILE = "curves.png"


def curves(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR ...", help="Folders of trainings in one scenario.")],
    beside: Annotated[
        str, typer.Option("--beside", help="Policies to compare with, separated by commas; none for no others.")
    ] = ",".join(PAPER_POLICIES),
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help=f"Picture; default {PICTURE_FILE} in the first folder.")
    ] = None,
    jobs: Jobs = None,
) -> None:
    """Draw how trainings went, beside the scripted controllers on the same axes.

    The others make the runs of the trainings' evaluations: same world, same seeds, the caches that they are made for.
    """
    from swarm_forage_env.cli.scenario_options import split_names
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.training.curves import curves as curves_of
    from swarm_forage_env.training.curves import read_trainings

    picture = out or folders[0] / PICTURE_FILE
    read_trainings(folders)  # refuses folders before it looks at the place of the picture
    check_picture(picture)
    found = curves_of(folders, beside=() if beside == "none" else split_names(beside), jobs=jobs)
    typer.echo(found.text())
    try:
        found.draw(picture)
    except ImportError as error:
        raise typer.Exit(complain(str(error), EXIT_FAILURE)) from None
    except OSError as error:  # the table was shown, but a picture was asked for
        raise typer.Exit(complain(no_picture(picture, error), EXIT_FAILURE)) from None
    typer.echo(f"wrote {picture}")
