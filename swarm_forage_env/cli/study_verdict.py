"""The command `study verdict`: the paper's claims and intuitions held against studies."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import AsJson

Places = Annotated[list[Path], typer.Argument(metavar="DIR|FILE...", help="Folders of studies, or their packed files.")]


def verdict(
    places: Places,
    file: Annotated[
        Path | None, typer.Option("--file", help="Write it, too: .txt, .md, .csv or .json, with more numbers.")
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Hold the claims of the paper against runs of its sets: what they support, contradict or leave open.

    Below them the same for its intuitions, what it expected of each algorithm before the experiments.
    """
    from metrics import verdict as verdict_of
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env._internal.files import check_file
    from swarm_forage_env.cli.terminal import notes, show_boxed
    from swarm_forage_env.runs.answer import FORMS
    from swarm_forage_env.studies.study_table import read_study

    if file is not None and file.suffix not in FORMS:
        raise ConfigError(f"Expected --file as a file ending in {', '.join(FORMS)}, got {str(file)!r}.")
    aside = notes()
    tables = [read_study(place) for place in places]
    if file is not None:
        check_file(file)
    found = verdict_of(*tables, tell=aside.print)
    for remark in found.remarks:
        aside.print(f"note: {remark}")
    if as_json:
        typer.echo(found.json())
    else:
        show_boxed(found)
    if file is not None:
        found.write(file)
        aside.print(f"written {file}")
