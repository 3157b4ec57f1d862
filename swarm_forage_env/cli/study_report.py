"""The command `study report`: studies, their figures and the claims about them as one page."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import Band
from swarm_forage_env.cli.study_verdict import Places

FORMS = (".html", ".md", ".txt", ".csv", ".json")


def report(
    places: Places,
    file: Annotated[
        Path, typer.Option("--file", help="Page to write, .html; .md, .txt, .csv, .json: its tables.")
    ] = Path("report.html"),
    band: Band = False,
) -> None:
    """Write one page about studies: what they say of the paper's claims, figures, numbers, settings, versions."""
    from metrics import report as report_of
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env._internal.files import check_file
    from swarm_forage_env.cli.terminal import notes
    from swarm_forage_env.studies.study_table import read_study

    if file.suffix not in FORMS:
        raise ConfigError(f"Expected --file as a file ending in {', '.join(FORMS)}, got {str(file)!r}.")
    tables = [read_study(place) for place in places]
    check_file(file)
    report_of(*tables, band="sd" if band else "ci", tell=notes().print).write(file)
    notes().print(f"written {file}")
