"""The command `study diff`: which conditions of two studies differ beyond chance."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson


def diff(
    first: Annotated[Path, typer.Argument(metavar="A", help="Folder of a study, or its packed file.")],
    second: Annotated[Path, typer.Argument(metavar="B", help="The same of the other study.")],
    columns: Annotated[
        str | None,
        typer.Option(
            "--columns", help="Recorded columns to test, separated by commas; see 'swarm-forage list columns'."
        ),
    ] = None,
    as_json: AsJson = False,
) -> None:
    """Say which conditions of two studies differ beyond chance.

    Exit code 0 if no condition differs; 1 if one does or may, or if one has no finished runs in A or in B.
    """
    from metrics import diff as diff_of
    from metrics.scoring.study_diff import COLUMNS
    from swarm_forage_env.cli.printer import show
    from swarm_forage_env.studies.study_table import read_study

    names = COLUMNS if columns is None else tuple(name.strip() for name in columns.split(","))
    found = diff_of(read_study(first), read_study(second), names)
    show(found, as_json=as_json)
    if found.differs:
        raise typer.Exit(EXIT_FAILURE)
