"""The command `curves`."""

from pathlib import Path
from typing import Annotated

import typer

from metrics.controllers import PAPER_POLICIES
from swarm_forage_env.cli.options import EXIT_FAILURE, Jobs, Picture, complain, no_picture

PICTURE_FILE = "curves.png"


def curves(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR ...", help="Folders of trainings in one scenario.")],
    policies: Annotated[
        str,
        typer.Option("--policy", help="Policies to compare with, separated by commas; none for no others."),
    ] = ",".join(PAPER_POLICIES),
    picture: Picture = None,
    jobs: Jobs = None,
) -> None:
    """Draw how trainings went, beside the scripted controllers on the same axes.

    The others make the runs of the trainings' evaluations: same world, same seeds, the caches that they are made for.
    """
    from swarm_forage_env.cli.scenario_options import split_names
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.training.curves import curves as curves_of
    from swarm_forage_env.training.curves import read_trainings

    file = picture or folders[0] / PICTURE_FILE
    read_trainings(folders)  # refuses folders before it looks at the place of the picture
    check_picture(file)
    found = curves_of(folders, beside=() if policies == "none" else split_names(policies), jobs=jobs)
    typer.echo(found.text())
    try:
        found.draw(file)
    except ImportError as error:
        raise typer.Exit(complain(str(error), EXIT_FAILURE)) from None
    except OSError as error:  # the table was shown, but a picture was asked for
        raise typer.Exit(complain(no_picture(file, error), EXIT_FAILURE)) from None
    typer.echo(f"wrote {file}")
