"""From the table of a study to curves that can be scored: one set of curves per line of its figures.

A study of `swarm_forage_env.studies` has conditions: a policy under some rules at one value of each axis. Those that
differ on the last axis alone are a line of a figure, and one of them is the reference of the others.
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
    from swarm_forage_env.studies.study import Place, Value
    from swarm_forage_env.studies.study_table import StudyTable


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyLine:
    """The conditions of a study that differ on the last axis alone."""

    rules: str
    """Which rules: "described" or "program"."""
    policy: str
    """Label of the policy."""
    others: "Mapping[str, Value]"
    """Value on each axis but the last, by its name."""
    words: Mapping[str, str]
    """How these values are shown."""
    places: "tuple[Place, ...]"
    """In the order of the last axis."""
    curves: StudyCurves
    """One experiment per condition, in the same order; `score_study` takes it."""


def study_lines(table: "StudyTable", performance: str | None = None) -> tuple[StudyLine, ...]:
    """Return the lines of a study, in the order of its conditions.

    Args:
        table: From `swarm_forage_env.read_study`. Failed and missing runs count as planned and lost.
        performance: What P(N, t) is, by a name as in `score_policy`; default that of the scenario.

    Raises:
        ValueError: no such performance.
    """
    spec = table.spec
    names = [axis.name for axis in spec.axes[:-1]]
    words = [value_words(axis.values) for axis in spec.axes[:-1]]
    places_of: dict[tuple[object, ...], list[Place]] = {}
    for place in spec.places:
        places_of.setdefault((place.rules, place.policy, place.values[:-1]), []).append(place)
    lines: list[StudyLine] = []
    for places in places_of.values():
        first = places[0]
        read_as = performance_of(performance or spec.world(first).scenario.performance)
        experiments = tuple(_runs(table, place, performance) for place in places)
        lines.append(
            StudyLine(
                rules=first.rules,
                policy=first.policy,
                others=dict(zip(names, first.values, strict=False)),
                words={name: of[value] for name, of, value in zip(names, words, first.values, strict=False)},
                places=tuple(places),
                curves=study_curves(
                    experiments,
                    spec.world(first),
                    controller=first.policy,
                    read_as=read_as,
                    reference_value=_reference_value(table, places),
                    where=f"study {spec.name}",
                ),
            )
        )
    return tuple(lines)


def _runs(table: "StudyTable", place: "Place", performance: str | None) -> RunCurves:
    """The finished runs of a condition."""
    seeds, columns = table.curves(place, *{*INTERVAL_COLUMNS, *PERFORMANCE_COLUMNS})
    if performance is not None and seeds:
        columns["performance"] = performance_curve(performance, columns)
    return run_curves(table.spec.world(place), (seeds, columns), len(table.spec.seeds))


def _reference_value(table: "StudyTable", places: "list[Place]") -> float:
    """Value of the criterion at the reference of a line; sizes have no other reference than each other."""
    reference = table.spec.reference_of(places[0])
    if reference is None or table.spec.world(reference).criterion == SIZE:
        return 0.0
    return table.spec.world(reference).value
