"""The runs of an experiment as arrays (runs, intervals), with what it varied: of a table of runs, or of a study.

Run records of `swarm_forage_env` and curves from other sources share the names of columns.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from swarm_forage_env.runs.plan import Curves, Table
from swarm_forage_env.scenarios.columns import ALL_COLUMNS, Column
from swarm_forage_env.scenarios.performance import (
    Performance,
    performance_of,
)
from swarm_forage_env.studies.study_file import value_words
from swarm_forage_env.wrappers.world import SIZE, UNDISTURBED, World

from ..checks import CurveError
from ..curves import FloatArray
from ..queues import PopulationRates

if TYPE_CHECKING:
    from swarm_forage_env.studies.results import StudyTable
    from swarm_forage_env.studies.study import Place
    from swarm_forage_env.studies.study_file import Value

DELIVERIES = performance_of("collected")
"""What performance is unless something else is told."""
THROTTLE, NOISE, POPULATION, HANDLING = "throttle", "noise", "population_dynamics", "handling_cost"
CRITERIA = (SIZE, THROTTLE, HANDLING, NOISE, POPULATION, UNDISTURBED)
"""What a study varies, in column `criterion`."""

RATE_COLUMNS = {
    "lambda_d": "deaths_per_s",
    "lambda_bd": "malfunctions_per_s",
    "mu_b": "births_per_s",
    "mu_bd": "repairs_per_s",
}
"""Field of `PopulationRates` -> column; one value per run. They are no part of records: specifications tell them."""
CURVE_COLUMNS: Mapping[str, Column] = {
    **{
        name: ALL_COLUMNS[name]
        for name in (
            "controller",
            "criterion",
            "criterion_value",
            "n_robots",
            "seed",
            "interval",
            "performance",
            "t_end_s",
            "interference_fraction",
            "n_active",
            "adversity",
            "throttle",
            "handling_cost",
        )
    },
    **{
        name: Column("amount", "1/s", "rate of the whole swarm, the same in each row") for name in RATE_COLUMNS.values()
    },
}
"""Columns that measures read -> what they hold. Further columns are ignored."""
INTERVAL_COLUMNS = tuple(
    name
    for name, column in CURVE_COLUMNS.items()
    if column.kind in ("amount", "fraction", "number") and name not in ("criterion_value", *RATE_COLUMNS.values())
)
"""Columns with one value per interval."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RunCurves:
    """The runs of one experiment: one criterion at one value with one swarm size."""

    criterion: str
    """One of `CRITERIA`."""
    value: float
    n_robots: int
    seeds: tuple[int, ...]
    """Number of each run, rising, (R,)."""
    curves: dict[str, FloatArray]
    """Column -> values, (R, T); only columns that the table has."""
    rates: PopulationRates | None = None
    """Rates of change of the population, per second."""
    n_planned: int | None = None
    """How many runs were planned; None = as many as there are."""
    horizon_s: float | None = None
    """Length of a run, s, where known."""
    maps_differ: bool = False
    """Whether each seed draws clusters, a map of its own, so that two undisturbed runs differ by more than chance."""

    @property
    def performance(self) -> FloatArray:
        """P(N, t), (R, T)."""
        return self.curves["performance"]

    @property
    def interference(self) -> FloatArray:
        """t_lost(N, t), (R, T)."""
        return self.curves["interference_fraction"]

    @property
    def n_lost(self) -> int:
        """Runs that were planned and are not there."""
        return 0 if self.n_planned is None else self.n_planned - len(self.seeds)

    def describe(self) -> str:
        """Return the experiment in a few words."""
        size = f"N = {self.n_robots}"
        return size if self.criterion == SIZE else f"{self.criterion} {self.value:g}, {size}"

    def at_seeds(self, seeds: Sequence[int]) -> "RunCurves":
        """Return the same experiment with some of its runs only."""
        places = [self.seeds.index(seed) for seed in seeds]
        return replace(self, seeds=tuple(seeds), curves={name: curve[places] for name, curve in self.curves.items()})


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyCurves:
    """All experiments of one policy, on one clock."""

    controller: str
    experiments: tuple[RunCurves, ...]
    t_end_s: FloatArray | None
    """Ends of the intervals, (T,); None if the table has no such column."""
    read_as: Performance = DELIVERIES
    """What performance is."""
    reference_value: float = 0.0
    """Value of a criterion at its reference runs; the authors compare population dynamics with the lowest level."""
    where: str = "the table"
    """Name of the table in error messages."""
    note: str = ""
    """How a table became curves, for readers, where that changed numbers."""

    @property
    def horizon_s(self) -> float | None:
        """Length of a run in seconds, where known."""
        return None if self.t_end_s is None else float(self.t_end_s[-1])

    def sizes(self) -> tuple[RunCurves, ...]:
        """Return the experiments that vary the swarm size, smallest first."""
        return tuple(sorted((e for e in self.experiments if e.criterion == SIZE), key=lambda e: e.n_robots))

    def levels(self, criterion: str) -> tuple[tuple[RunCurves, RunCurves], ...]:
        """Return (reference, disturbed) for each level of a criterion, by swarm size and value.

        Raises:
            CurveError: levels without a reference run of the same swarm size.
        """
        mine = [e for e in self.experiments if e.criterion == criterion and e.value != self.reference_value]
        return tuple(
            (self._reference(level), level) for level in sorted(mine, key=lambda level: (level.n_robots, level.value))
        )

    def _reference(self, level: RunCurves) -> RunCurves:
        same_size = [e for e in self.experiments if e.n_robots == level.n_robots]
        own = [e for e in same_size if e.criterion == level.criterion and e.value == self.reference_value]
        shared = [e for e in same_size if e.criterion == UNDISTURBED]
        for reference in (*own, *shared):
            return reference
        raise CurveError(
            f"Expected a reference run for {level.describe()} of {self.controller} in {self.where}: the same swarm "
            f"size with criterion {level.criterion} and value {self.reference_value:g}, or with criterion "
            f"{UNDISTURBED}; got neither."
        )


def shared_seeds(experiments: Sequence[RunCurves]) -> list[int]:
    """Return the numbers of the runs that all experiments have."""
    first, *others = (experiment.seeds for experiment in experiments)
    return [seed for seed in first if all(seed in seeds for seeds in others)]


def curves_in_worlds(
    runs: Sequence[tuple[World, Curves]], n_planned: int, *, controller: str, read_as: Performance, **told: Any
) -> StudyCurves:
    """Return the runs of a policy in several worlds as measures take them.

    Args:
        runs: Worlds of one clock, with seeds and columns as tables of runs give them. Criterion and value of a world
            say what its runs are to the measures.
        n_planned: How many runs were planned in each.
        controller: Name of the policy.
        read_as: What performance is.
        told: Further fields of `StudyCurves`.
    """
    scenario = runs[0][0].scenario
    n_intervals = round(scenario.horizon_s / scenario.interval_s)
    return StudyCurves(
        controller=controller,
        experiments=tuple(
            RunCurves(
                criterion=world.criterion,
                value=world.value,
                n_robots=world.n_robots,
                seeds=seeds,
                curves={name: curve for name, curve in columns.items() if name in INTERVAL_COLUMNS},
                rates=rates_of(world),
                n_planned=n_planned,
                horizon_s=scenario.horizon_s,
                maps_differ=world.scenario.objects.is_drawn,
            )
            for world, (seeds, columns) in runs
        ),
        t_end_s=scenario.interval_s * np.arange(1.0, n_intervals + 1.0),
        read_as=read_as,
        **told,
    )


def policy_curves(table: Table, policy: str) -> StudyCurves:
    """Return all runs of a policy in a table by its label; worlds without a finished run are there, without runs."""
    conditions = table.plan.of_policy(policy)
    read_as = performance_of(conditions[0].world.scenario.performance)
    runs = [(condition.world, table.curves(condition, *INTERVAL_COLUMNS)) for condition in conditions]
    return curves_in_worlds(runs, len(table.plan.seeds), controller=policy, read_as=read_as)


def rates_of(world: World) -> PopulationRates | None:
    """Return the rates at which the population of a world changes, per second; None where it stays as it is."""
    config = world.population
    if config is None:
        return None
    dt_s = world.scenario.dt_s
    return PopulationRates(
        lambda_d=config.death_per_tick / dt_s,
        lambda_bd=config.malfunction_per_tick / dt_s,
        mu_b=config.birth_per_tick / dt_s,
        mu_bd=config.repair_per_tick / dt_s,
    )


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
    """One experiment per condition, in the same order; `scores` takes it."""


def study_lines(table: "StudyTable") -> tuple[StudyLine, ...]:
    """Return the lines of a study from `read_study`, in the order of its conditions.

    Failed and missing runs count as planned and lost.
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
        runs = [(spec.world(place), table.curves(place, *INTERVAL_COLUMNS)) for place in places]
        lines.append(
            StudyLine(
                rules=first.rules,
                policy=first.policy,
                others=dict(zip(names, first.values, strict=False)),
                words={name: of[value] for name, of, value in zip(names, words, first.values, strict=False)},
                places=tuple(places),
                curves=curves_in_worlds(
                    runs,
                    len(spec.seeds),
                    controller=first.policy,
                    read_as=performance_of(runs[0][0].scenario.performance),
                    reference_value=_reference_value(table, places),
                    where=f"study {spec.name}",
                ),
            )
        )
    return tuple(lines)


def _reference_value(table: "StudyTable", places: "list[Place]") -> float:
    """Value of the criterion at the reference of a line; sizes have no other reference than each other."""
    reference = table.spec.reference_of(places[0])
    if reference is None or table.spec.world(reference).criterion == SIZE:
        return 0.0
    return table.spec.world(reference).value
