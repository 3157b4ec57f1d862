"""The command `study diff`: which conditions of two studies differ beyond chance."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import EXIT_FAILURE, AsJson

if TYPE_CHECKING:
    from metrics.scoring.study_diff import Shift, StudyDiff

ROWS_SHOWN = 20
"""Differences that are listed, and conditions that are not compared; `--json` has all."""


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
    from metrics.scoring.study_diff import COLUMNS, diff_studies
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.studies.study_table import read_study

    names = COLUMNS if columns is None else tuple(name.strip() for name in columns.split(","))
    mine, other = read_study(first), read_study(second)
    try:
        found = diff_studies(mine, other, names)
    except ValueError as error:  # studies that cannot be compared
        raise ConfigError(str(error)) from error
    header = ("rules", "policy", *(axis.name for axis in mine.spec.axes))
    typer.echo(json.dumps(found.to_mapping(), indent=1) if as_json else diff_report(found, header))
    if found.differs:
        raise typer.Exit(EXIT_FAILURE)


def diff_report(found: "StudyDiff", header: Sequence[str]) -> str:
    """Return what was found in words: how many conditions differ, the tests that say so, and what was not compared.

    Args:
        found: From `metrics.scoring.diff_studies`.
        header: Names of what a condition is placed by.
    """
    from metrics.scoring.study_diff import TEST
    from swarm_forage_env._internal.wording import aligned, counted

    words = {
        "identical": "identical to the last bit",
        "alike": "alike: other bits, no difference beyond chance",
        "different": "different",
        "open": "open: other bits, and too few runs to say more",
    }
    counts = [(str(found.count(state)), text) for state, text in words.items() if found.count(state)]  # type: ignore[arg-type] - its keys are the states
    lines = [f"{counted(len(found.places), 'cell')} compared", *(f"  {row}" for row in aligned(counts))]
    lines += [f"not the same: {text}" for text in found.settings]
    of_places = [shift for place in found.places for shift in place.shifts if shift.is_significant]
    shown = sorted(of_places, key=lambda shift: shift.p)
    if shown:
        heads = (*header, "column", "A", "B", "B - A", "95 % interval", "runs", "p (Holm)")
        lines += ["", *aligned([heads, *map(_row, shown[:ROWS_SHOWN])])]
        lines += _more(len(shown))
    if found.lines:
        lines += ["", "all conditions of a policy together, in shares of each condition's mean:"]
        lines += aligned(
            [("rules", "policy", "column", "B - A", "95 % interval", "p (Holm)"), *map(_line, found.lines)]
        )
    if found.lacking:
        lines += ["", f"{counted(len(found.lacking), 'cell')} not compared:"]
        lines += aligned([(*header, "why"), *((*one.words, one.why) for one in found.lacking[:ROWS_SHOWN])])
        lines += _more(len(found.lacking))
    return "\n".join([*lines, *(["", TEST] if found.shifts else [])])


def _more(n_rows: int) -> list[str]:
    return [f"and {n_rows - ROWS_SHOWN:,} more; --json has all"] if n_rows > ROWS_SHOWN else []


def _row(shift: "Shift") -> tuple[str, ...]:
    from swarm_forage_env._internal.wording import limits, number

    runs = str(shift.n_first) if shift.n_first == shift.n_second else f"{shift.n_first}, {shift.n_second}"
    means = (number(value) for value in (shift.first, shift.second, shift.difference))
    return (*shift.words, shift.column, *means, limits(shift.lower, shift.upper), runs, f"{shift.p_holm:.2g}")


def _line(shift: "Shift") -> tuple[str, ...]:
    from swarm_forage_env._internal.wording import percent

    mark = " *" if shift.is_significant else ""
    between = f"{percent(shift.lower)} to {percent(shift.upper)}"
    return (*shift.words, shift.column, percent(shift.difference), between, f"{shift.p_holm:.2g}{mark}")
