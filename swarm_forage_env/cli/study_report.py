"""The command `study report`: studies, their figures and the claims about them as one page."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.study_verdict import Places

FORMS = (".html", ".md", ".txt", ".csv", ".json")


def report(
    places: Places,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE.html", help="Page to write; .md, .txt, .csv, .json: its tables.")
    ] = Path("report.html"),
    band: Annotated[
        str, typer.Option("--band", help="ci: 95 % interval of the mean; sd: mean ± 2 standard deviations of runs.")
    ] = "ci",
) -> None:
    """Write one page about studies: what they say of the paper's claims, figures, numbers, settings, versions."""
    from metrics import report as report_of
    from metrics.scoring.study_plots import checked_band
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env._internal.files import check_file
    from swarm_forage_env.cli.terminal import notes
    from swarm_forage_env.studies.study_table import read_study

    drawn = checked_band(band)
    if out.suffix not in FORMS:
        raise ConfigError(f"Expected --out as a file ending in {', '.join(FORMS)}, got {str(out)!r}.")
    tables = [read_study(place) for place in places]
    check_file(out)
    report_of(*tables, band=drawn, tell=notes().print).write(out)
    notes().print(f"written {out}")
