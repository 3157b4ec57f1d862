"""From the table of a study to curves that can be scored: one set of curves per line of its figures.

A study of `swarm_forage_env.studies` has cells: a policy in a reading at one value of each axis. The cells that differ
on the last axis alone are a line of a figure, and one of them is the reference of the others.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from swarm_forage_env.scenarios.performance import PERFORMANCE_COLUMNS, performance_curve, performance_of
from swarm_forage_env.studies.study import value_words

from .columns import INTERVAL_COLUMNS, SIZE
from .runs import run_curves, study_curves
from .studies import RunCurves, StudyCurves

if TYPE_CHECKING:
    from swarm_forage_env.studies.study import Cell, Value
    from swarm_forage_env.studies.study_table import StudyTable


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyLine:
    """The cells of a study that differ on the last axis alone."""

    reading: str
    """Which rules: "described" or "program"."""
    policy: str
    """Label of the policy."""
    others: "Mapping[str, Value]"
    """Value on each axis but the last, by its name."""
    words: Mapping[str, str]
    """How these values are shown."""
    cells: "tuple[Cell, ...]"
    """In the order of the last axis."""
    curves: StudyCurves
    """One experiment per cell, in the same order; `score_study` takes it."""


def study_lines(table: "StudyTable", performance: str | None = None) -> tuple[StudyLine, ...]:
    """Return the lines of a study, in the order of its cells.

    Args:
        table: From `swarm_forage_env.read_study`. Failed and missing runs count as planned and lost.
        performance: What P(N, t) is, by a name as in `score_policy`; default that of the scenario.

    Raises:
        ValueError: no such performance.
    """
    spec = table.spec
    names = [axis.name for axis in spec.axes[:-1]]
    words = [value_words(axis.values) for axis in spec.axes[:-1]]
    cells_of: dict[tuple[object, ...], list[Cell]] = {}
    for cell in spec.cells:
        cells_of.setdefault((cell.reading, cell.policy, cell.values[:-1]), []).append(cell)
    lines: list[StudyLine] = []
    for cells in cells_of.values():
        first = cells[0]
        read_as = performance_of(performance or spec.world(first).scenario.performance)
        experiments = tuple(_runs(table, cell, performance) for cell in cells)
        lines.append(
            StudyLine(
                reading=first.reading,
                policy=first.policy,
                others=dict(zip(names, first.values, strict=False)),
                words={name: of[value] for name, of, value in zip(names, words, first.values, strict=False)},
                cells=tuple(cells),
                curves=study_curves(
                    experiments,
                    spec.world(first),
                    controller=first.policy,
                    read_as=read_as,
                    reference_value=_reference_value(table, cells),
                    where=f"study {spec.name}",
                ),
            )
        )
    return tuple(lines)


def _runs(table: "StudyTable", cell: "Cell", performance: str | None) -> RunCurves:
    """The finished runs of a cell."""
    seeds, columns = table.curves(cell, *{*INTERVAL_COLUMNS, *PERFORMANCE_COLUMNS})
    if performance is not None and seeds:
        columns["performance"] = performance_curve(performance, columns)
    return run_curves(table.spec.world(cell), (seeds, columns), len(table.spec.seeds))


def _reference_value(table: "StudyTable", cells: "list[Cell]") -> float:
    """Value of the criterion at the reference of a line; sizes have no other reference than each other."""
    reference = table.spec.reference_of(cells[0])
    if reference is None or table.spec.world(reference).criterion == SIZE:
        return 0.0
    return table.spec.world(reference).value
