"""Performance of larger swarms, predicted from runs of smaller ones, and compared with held-back runs."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swarm_forage_env._internal.wording import counted, number, percent, plain
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.policy_spec import PolicyLike
from swarm_forage_env.runs.table import Table
from swarm_forage_env.scenarios.performance import performance_of
from swarm_forage_env.scenarios.presets import SEARCH_AND_RESCUE_OBJECTS, search_and_rescue
from swarm_forage_env.scenarios.presets import scenario as preset
from swarm_forage_env.studies.ladders import SIZE_SWEEP_OBJECTS, size_ladder
from swarm_forage_env.wrappers.world import SIZE, World, WorldLike, world_of

from ..checks import CurveError
from ..laws import LAWS, MIN_SIZES, SizeLaw
from ..prediction import SizePrediction, predict_performance
from ..statistics import Summary, aggregate
from .curves_file import read_curves
from .plots import draw_predictions
from .question import Question, ask, plan_totals, run_totals, unit_text
from .run_curves import PerformanceLike
from .scores import bounds

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from swarm_forage_env.scenarios.config import ScenarioConfig

FIT_SIZES = (1, 2, 4, 8, 16, 32)
"""Swarm sizes that are fitted unless others are given (our choice); for power-law clusters see `fit_sizes`."""
N_ARENAS = 5
"""How many arenas are fitted unless sizes are given, where the arena grows with the swarm (our choice)."""
AHEAD = (2, 4)
"""The largest fitted size times these is always predicted."""
_RESAMPLING_SEED = 1
"""Fixed, so that the same runs give the same prediction."""
_BAND_POINTS = 40
_NO_SUM = "note: this performance is no sum over robots, and the laws are about what robots achieve together"
_HEADER = ("robots", "runs", "measured", "law", "95 % interval", "used", "inside")


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionTable(Answer):
    """The prediction for one policy, and the results of its runs."""

    policy: str
    scenario: str
    """The world for people: the scenario, and what differs from its preset; empty if it is not known."""
    horizon_s: float | None
    """Length of a run in seconds, where known."""
    totals: Mapping[int, tuple[float, ...]]
    """Swarm size -> performance of each run, summed over time; held-back sizes included."""
    fit: tuple[int, ...]
    """Sizes that are fitted."""
    hold: tuple[int, ...]
    """Sizes that were run but held back."""
    unit: str
    """Of performance, such as "objects in 10,000 s"."""
    prediction: SizePrediction
    """At the held-back sizes, at `AHEAD`, and at sizes between, for a picture."""
    left_out: tuple[int, ...] = ()
    """Sizes that were to be fitted, and have fewer than two finished runs."""
    adds_up: bool = True
    """Whether a swarm has what its robots have together, as the laws expect."""
    failures: tuple[str, ...] = ()
    """Why runs failed, a line per reason."""

    @property
    def predicted_sizes(self) -> tuple[int, ...]:
        """Held-back sizes, and `AHEAD` times the largest fitted one."""
        return tuple(sorted({*self.hold, *(factor * self.fit[-1] for factor in AHEAD)}))

    def interval(self, n_robots: int) -> tuple[float, float, float]:
        """Return prediction, lower and upper bound at one of `predicted_sizes`."""
        place = self.prediction.at.index(n_robots)
        found = self.prediction
        return float(found.value[place]), float(found.lower[place]), float(found.upper[place])

    def measured(self, n_robots: int) -> Summary | None:
        """Return the mean over the runs of a size; None if there are none."""
        return aggregate(self.totals[n_robots]) if self.totals.get(n_robots) else None

    def is_inside(self, n_robots: int) -> bool | None:
        """Return whether the mean of two or more held-back runs lies in the interval; None if there are no such."""
        truth = self.measured(n_robots) if n_robots in self.hold else None
        if truth is None or truth.n_used < 2:
            return None
        _, lower, upper = self.interval(n_robots)
        return lower <= truth.mean <= upper

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON; numbers that do not exist are null."""
        found = self.prediction
        return {
            "policy": self.policy,
            "scenario": self.scenario,
            "horizon_s": self.horizon_s,
            "unit": self.unit,
            "adds_up": self.adds_up,
            "fit": [self._runs_mapping(size) for size in self.fit],
            "left_out": [self._runs_mapping(size) for size in self.left_out],
            "law": _law_mapping(found.law),
            "laws": {
                name: {**_law_mapping(law), "error": plain(found.errors[name]), "share": found.law_shares[name]}
                for name, law in found.laws.items()
            },
            "predictions": [self._prediction_mapping(size) for size in self.predicted_sizes],
            "critical_size": {
                "value": plain(found.critical),
                "lower": plain(found.critical_lower),
                "upper": plain(found.critical_upper),
                "share_of_resamples": found.critical_share,
                "looked_for_up_to": found.limit,
            },
            "failures": list(self.failures),
        }

    def _runs_mapping(self, size: int) -> dict[str, Any]:
        return {"n_robots": size, "runs": list(self.totals[size]), "measured": bounds(self.measured(size))}

    def _prediction_mapping(self, size: int) -> dict[str, Any]:
        value, lower, upper = self.interval(size)
        is_held = size in self.hold
        return {
            "n_robots": size,
            "value": value,
            "lower": lower,
            "upper": upper,
            "held_back": list(self.totals[size]) if is_held else [],
            "measured": bounds(self.measured(size)) if is_held else None,
            "inside": self.is_inside(size),
        }

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the sizes with law, critical size and errors, and runs that failed."""
        where = f" in {self.scenario}" if self.scenario else ""
        sizes = sorted({*self.fit, *self.left_out, *self.predicted_sizes})
        notes = (
            f"law: {law_text(self.prediction.law)}",
            f"critical size: {self.critical_text()}",
            self.laws_text(),
            *(() if self.adds_up else (_NO_SUM,)),
        )
        title = f"{self.policy}{where}: {self.unit}, fitted to {', '.join(map(str, self.fit))} robots"
        table = Sheet(title=title, header=_HEADER, rows=[self._row(size) for size in sizes], notes=notes)
        return table, Sheet(notes=[f"failed: {failure}" for failure in self.failures])

    @property
    def has_picture(self) -> bool:
        """Always."""
        return True

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw the prediction, see `draw_predictions`."""
        draw_predictions([self], path, style=style)

    def critical_text(self) -> str:
        """Return the critical size with its interval in words, or that there is none within reach."""
        found = self.prediction
        share = f"{percent(found.critical_share)} of the resamples have one"
        if math.isinf(found.critical):
            return (
                f"none up to {found.limit:g} robots, {found.limit / self.fit[-1]:g} times the largest fitted; {share}"
            )
        upper = "none" if math.isinf(found.critical_upper) else f"{found.critical_upper:.0f}"
        lower = "none" if math.isinf(found.critical_lower) else f"{found.critical_lower:.0f}"
        return f"{found.critical:.0f} robots (interval {lower} to {upper}; {share} up to {found.limit:g} robots)"

    def laws_text(self) -> str:
        """Return the error of each law in predicting the next fitted sizes, and how often resamples choose it."""
        found = self.prediction
        told = [f"{name} {found.errors[name]:.3f} ({percent(found.law_shares[name])})" for name in LAWS]
        return f"error of each law in roots of objects, and share of resamples that choose it: {', '.join(told)}"

    def _row(self, size: int) -> tuple[str, ...]:
        truth = self.measured(size)
        cells = (str(size), str(len(self.totals.get(size, ()))), "-" if truth is None else number(truth.mean))
        law = number(float(self.prediction.law.performance(size)))
        if size not in self.predicted_sizes:
            return (*cells, law, "", "fitted" if size in self.fit else "left out", "")
        _, lower, upper = self.interval(size)
        used = "held back" if size in self.hold else "left out" if size in self.left_out else "predicted"
        inside = {True: "yes", False: "NO", None: ""}[self.is_inside(size)]
        return (*cells, law, f"{number(lower)} to {number(upper)}", used, inside)


@dataclass(frozen=True, kw_only=True, eq=False)
class Predictions(Answer):
    """The predictions for several policies."""

    tables: tuple[PredictionTable, ...]

    @property
    def inside_text(self) -> str:
        """How many held-back sizes lie in their intervals, in words; empty if none was held back."""
        answers = [table.is_inside(size) for table in self.tables for size in table.hold]
        known = [answer for answer in answers if answer is not None]
        return f"{sum(known)} of {counted(len(known), 'held-back mean')} inside the interval" if known else ""

    def sheets(self) -> tuple[Sheet, ...]:
        """Return those of all policies, and how many held-back sizes lie in their intervals."""
        return *(sheet for table in self.tables for sheet in table.sheets()), Sheet(title=self.inside_text)

    def to_mapping(self) -> dict[str, Any]:
        """Return all predictions as plain values."""
        return {"tables": [table.to_mapping() for table in self.tables]}

    @property
    def has_picture(self) -> bool:
        """Always."""
        return True

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw one panel per policy, see `draw_predictions`."""
        draw_predictions(self.tables, path, style=style)


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionQuestion(Question[Predictions]):
    """The runs of a prediction, one world per size, and what becomes of each size; the answer is a table per policy."""

    world: World
    """What the worlds of the plan are variants of."""
    fit: tuple[int, ...]
    hold: tuple[int, ...]

    def answer(self, table: Table) -> Predictions:
        """Return one prediction per policy."""
        return Predictions(tables=tuple(self._prediction(table, policy.label) for policy in self.plan.policies))

    def _prediction(self, table: Table, policy: str) -> PredictionTable:
        totals = {
            condition.world.n_robots: tuple(run_totals(table, condition).values())
            for condition in self.plan.of_policy(policy)
        }
        failures = table.failure_lines(policy)
        usable = tuple(size for size in self.fit if len(totals[size]) > 1)
        if len(usable) < MIN_SIZES:
            raise CurveError(
                f"Expected two or more finished runs at {MIN_SIZES} or more sizes for {policy}, got them at "
                f"{len(usable)}; the first failure: {failures[0]}"
            )
        scenario = self.world.scenario
        read_as = performance_of(scenario.performance)
        return _table(
            policy=policy,
            scenario=self.world.title(),
            horizon_s=scenario.horizon_s,
            totals=totals,
            fit=usable,
            hold=self.hold,
            unit=unit_text(read_as, scenario.horizon_s),
            adds_up=read_as.adds_up,
            left_out=tuple(size for size in self.fit if size not in usable),
            failures=failures,
        )


def predict_policy(
    policy: PolicyLike,
    world: WorldLike = "warehouse_small",
    *,
    fit: Sequence[int] | None = None,
    hold: Sequence[int] = (),
    seeds: int | Sequence[int] = 4,
    name: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> PredictionTable:
    """Run a policy in small swarms, predict larger ones, and compare the prediction with held-back runs.

    Args:
        policy: See `PolicyLike`.
        world: Name of a preset, a complete configuration, or a world with wrappers, which then act in all runs. As in
            scores, warehouses have enough objects for the largest swarm, and the arena of search and rescue grows with
            the swarm. The world also defines the performance.
        fit: Swarm sizes to fit, `MIN_SIZES` or more; default see `fit_sizes`.
        hold: Larger sizes to run but not to fit.
        seeds: Their number, at least two, or a list.
        name: As in `score_policy`, and so are all further arguments.
        parameters: Keyword arguments of a registered policy or a class.
        caches: "none", "static", "dynamic".
        out: Folder for run records; runs that it already holds are not made again.
        jobs: Processes; default one per core.
        executor: Makes the runs in place of the processes.
        progress: Show progress and an estimate on stderr.

    Raises:
        CurveError: too few sizes, sizes that are not rising or do not exist, or too few finished runs.
        ValueError: an unknown policy or scenario.
        swarm_forage_env.runs.runner.RunsInterrupted: Ctrl-C; finished runs are in `out`.
    """
    question = prediction_question(
        {name: policy} if name else [policy],
        world,
        fit=fit,
        hold=hold,
        seeds=seeds,
        parameters=parameters,
        caches=caches,
    )
    return ask(question, out=out, jobs=jobs, executor=executor, progress=progress).tables[0]


def prediction_question(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    world: WorldLike = "warehouse_small",
    *,
    fit: Sequence[int] | None = None,
    hold: Sequence[int] = (),
    seeds: int | Sequence[int] = 4,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
) -> PredictionQuestion:
    """Return the question of `predict_policy`; arguments and errors as there."""
    chosen = world_of(world)
    fitted, held = _checked_sizes(fit_sizes(chosen.scenario) if fit is None else fit, hold)
    worlds = [
        World(with_robots(chosen.scenario, size), chosen.wrappers, criterion=SIZE, value=size)
        for size in (*fitted, *held)
    ]
    plan = plan_totals(policies, worlds, seeds=seeds, parameters=parameters, caches=caches)
    return PredictionQuestion(plan=plan, world=chosen, fit=fitted, hold=held)


def fit_sizes(scenario: "ScenarioConfig") -> tuple[int, ...]:
    """Return the sizes that are fitted unless others are given: `FIT_SIZES`, or those that fill the smallest arenas.

    With power-law clusters, arenas grow with the swarm. One robot is then left out, because its density differs.
    """
    if scenario.objects.placement != "power_law":
        return FIT_SIZES
    return tuple(size for size in sorted(_growing_worlds(scenario)) if size > 1)[:N_ARENAS]


def predict_curves(
    path: str | Path,
    *,
    fit: Sequence[int] | None = None,
    hold: Sequence[int] = (),
    performance: PerformanceLike | None = None,
) -> tuple[PredictionTable, ...]:
    """Predict from curves of any simulator, one table per policy in the file.

    Args:
        path: CSV or Parquet file with the columns of `CURVE_COLUMNS`; rows of criterion population_size are used.
        fit: Sizes to fit; default all below the held-back ones.
        hold: Sizes to hold back.
        performance: As in `score_curves`.

    Raises:
        CurveError: a file with an error, or sizes that it does not have.
    """
    tables: list[PredictionTable] = []
    for study in read_curves(path, performance):
        totals = {runs.n_robots: tuple(runs.performance.sum(axis=-1).tolist()) for runs in study.sizes()}
        smallest_held = min(hold, default=math.inf)
        wanted = [size for size in totals if size < smallest_held] if fit is None else fit
        fitted, held = _checked_sizes(wanted, hold)
        missing = [size for size in (*fitted, *held) if size not in totals]
        if missing:
            raise CurveError(
                f"Expected swarm sizes that {study.controller} has in {path}, {', '.join(map(str, totals))}, "
                f"got {', '.join(map(str, missing))}."
            )
        known = study.horizon_s is not None or not study.read_as.is_total
        tables.append(
            _table(
                policy=study.controller,
                scenario="",
                horizon_s=study.horizon_s,
                totals=totals,
                fit=fitted,
                hold=held,
                unit=unit_text(study.read_as, study.horizon_s) if known else "performance per run",
                adds_up=study.read_as.adds_up,
            )
        )
    return tuple(tables)


def law_text(law: SizeLaw) -> str:
    """Return a law with its numbers, such as "universal, P(N) = 5 N / (1 + 0.02 (N - 1) + 0.002 N (N - 1))"."""
    parts = [f"{number(law.contention)} (N - 1)", f"{number(law.coherency)} N (N - 1)"][: law.n_parameters - 1]
    divisor = f" / ({' + '.join(['1', *parts])})" if parts else ""
    return f"{law.name}, P(N) = {number(law.a)} N{divisor}"


def _law_mapping(law: SizeLaw) -> dict[str, Any]:
    return {
        "name": law.name,
        "a": law.a,
        "contention": law.contention,
        "coherency": law.coherency,
        "peak": plain(law.peak),
    }


def _checked_sizes(fit: Sequence[int], hold: Sequence[int]) -> tuple[tuple[int, ...], tuple[int, ...]]:
    fitted, held = tuple(sorted(set(fit))), tuple(sorted(set(hold)))
    if len(fitted) < MIN_SIZES:
        raise CurveError(
            f"Expected {MIN_SIZES} or more different swarm sizes to fit, got {', '.join(map(str, fitted)) or 'none'}."
        )
    if fitted[0] < 1:
        raise CurveError(f"Expected swarms of 1 robot or more, got {fitted[0]}.")
    if held and held[0] <= fitted[-1]:
        raise CurveError(f"Expected to hold back larger swarms than the fitted {fitted[-1]} robots, got {held[0]}.")
    return fitted, held


def with_robots(scenario: "ScenarioConfig", n_robots: int) -> "ScenarioConfig":
    """Return the scenario for a swarm size, as scores have it in their size sweep."""
    if scenario.objects.placement == "power_law":
        worlds = _growing_worlds(scenario)
        if n_robots not in worlds:
            raise CurveError(
                f"Expected swarm sizes of {scenario.name} that fill one of its arenas, "
                f"{', '.join(map(str, sorted(worlds)))}, got {n_robots}."
            )
        return worlds[n_robots]
    objects = scenario.objects
    enough = SIZE_SWEEP_OBJECTS.get(scenario.name)
    if enough is not None and objects.n_objects == preset(scenario.name).objects.n_objects:
        objects = replace(objects, n_objects=enough)
    return replace(scenario, robots=replace(scenario.robots, n_robots=n_robots), objects=objects)


def _growing_worlds(scenario: "ScenarioConfig") -> "dict[int, ScenarioConfig]":
    """Return the worlds of power-law clusters by swarm size: one robot in the smallest arena, and all arenas filled."""
    series = [search_and_rescue(side_m=float(side)) for side in SEARCH_AND_RESCUE_OBJECTS]
    if (scenario.arena, scenario.objects.n_objects) not in [(each.arena, each.objects.n_objects) for each in series]:
        raise CurveError(
            f"Expected {scenario.name} with an arena and objects of search_and_rescue, because those grow with the "
            f"swarm, got an arena {scenario.arena.width_m:g} m wide with {scenario.objects.n_objects} objects."
        )
    # The ladder goes by the name of the preset, not by the placement.
    ladder = size_ladder(replace(scenario, name="search_and_rescue"), None)
    return {world.robots.n_robots: replace(world, name=scenario.name) for world in ladder}


def _table(
    *, totals: Mapping[int, tuple[float, ...]], fit: tuple[int, ...], hold: tuple[int, ...], **told: Any
) -> PredictionTable:
    """Predict from the totals of runs; `told` are all other fields of a table."""
    last = max(*hold, AHEAD[-1] * fit[-1]) if hold else AHEAD[-1] * fit[-1]
    between = np.geomspace(fit[0], last, _BAND_POINTS).round().astype(int).tolist()
    at = sorted({*hold, *(factor * fit[-1] for factor in AHEAD), *between})
    prediction = predict_performance(fit, [totals[size] for size in fit], at, seed=_RESAMPLING_SEED)
    return PredictionTable(totals=totals, fit=fit, hold=hold, prediction=prediction, **told)
