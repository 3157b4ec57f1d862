"""Performance of larger swarms, predicted from the runs of smaller ones and held against runs that were held back."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from metrics.checks import CurveError
from metrics.prediction import LAWS, MIN_SIZES, SizeLaw, SizePrediction, predict_performance
from metrics.statistics import Summary, aggregate

from .columns import SIZE
from .contestants import PolicyLike
from .curves_file import read_curves
from .plan import ScoringPlan
from .texts import aligned, bounds, counted, number, paragraph, percent, plain
from .totals import PolicyTotals, plan_conditions, run_totals

if TYPE_CHECKING:
    from concurrent.futures import Executor

    from swarm_forage_env.scenarios.config import ScenarioConfig

FIT_SIZES = (1, 2, 4, 8, 16, 32)
"""Swarm sizes that are fitted unless others are given (our choice)."""
AHEAD = (2, 4)
"""The largest fitted size times these is always predicted."""
_RESAMPLING_SEED = 1
"""Fixed, so that the same runs give the same prediction."""
_BAND_POINTS = 40
_HEADER = ("robots", "runs", "measured", "law", "95 % interval", "used", "inside")


@dataclass(frozen=True, kw_only=True, eq=False)
class PredictionTable:
    """The prediction for one policy, beside what its runs showed."""

    policy: str
    scenario: str
    """Name of the scenario; empty if it is not known."""
    horizon_s: float | None
    """Length of a run in seconds, where known."""
    totals: Mapping[int, tuple[float, ...]]
    """Swarm size -> performance of each run, summed over time; held-back sizes included."""
    fit: tuple[int, ...]
    """Sizes that are fitted."""
    hold: tuple[int, ...]
    """Sizes that were run but held back."""
    prediction: SizePrediction
    """At the held-back sizes, at `AHEAD`, and at sizes between, for a picture."""
    failures: tuple[str, ...] = ()
    """Runs that failed, one line each."""

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
        """Return whether the mean of the held-back runs lies in the interval; None without such runs."""
        truth = self.measured(n_robots)
        if truth is None:
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
            "fit": [
                {"n_robots": size, "runs": list(self.totals[size]), "measured": bounds(self.measured(size))}
                for size in self.fit
            ],
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

    def _prediction_mapping(self, size: int) -> dict[str, Any]:
        value, lower, upper = self.interval(size)
        return {
            "n_robots": size,
            "value": value,
            "lower": lower,
            "upper": upper,
            "held_back": list(self.totals.get(size, ())),
            "measured": bounds(self.measured(size)),
            "inside": self.is_inside(size),
        }

    def __str__(self) -> str:
        where = f" in {self.scenario}" if self.scenario else ""
        unit = "performance per run" if self.horizon_s is None else f"objects in {self.horizon_s:,g} s"
        lines = [
            f"{self.policy}{where}: {unit}, fitted to {', '.join(map(str, self.fit))} robots",
            *aligned([_HEADER, *(self._row(size) for size in (*self.fit, *self.predicted_sizes))]),
            f"law: {law_text(self.prediction.law)}",
            f"critical size: {self.critical_text()}",
            self.laws_text(),
        ]
        return "\n".join([*lines, *paragraph([f"failed: {failure}" for failure in self.failures])])

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
        if size in self.fit:
            return (*cells, number(float(self.prediction.law.performance(size))), "", "fitted", "")
        value, lower, upper = self.interval(size)
        inside = self.is_inside(size)
        words = ("predicted", "") if inside is None else ("held back", "yes" if inside else "NO")
        return (*cells, number(value), f"{number(lower)} to {number(upper)}", *words)


def predict_policy(
    policy: PolicyLike,
    scenario: "str | ScenarioConfig" = "warehouse_small",
    *,
    fit: Sequence[int] = FIT_SIZES,
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
    """Run a policy in small swarms, predict larger ones, and hold the prediction against runs that are not fitted.

    Args:
        policy: See `PolicyLike`.
        scenario: Name of a preset, or a complete configuration. As in scores, warehouses have enough objects for the
            largest swarm, and the arena of search and rescue grows with the swarm.
        fit: Swarm sizes that are fitted, `MIN_SIZES` or more.
        hold: Larger sizes that are run, too, and not fitted.
        seeds: How many, at least two, or which.
        name: As in `score_policy`, and so are all further arguments.
        parameters: Keyword arguments of a registered policy or a class.
        caches: "none", "static", "dynamic".
        out: Folder for run records; runs that it holds are not repeated.
        jobs: Processes; default one per core.
        executor: Runs the work instead.
        progress: Show progress and an estimate on stderr.

    Raises:
        CurveError: too few sizes, sizes that are not rising or do not exist, too few runs that did not fail.
        ValueError: an unknown policy or scenario.
        swarm_forage_env.study.runner.StudyInterrupted: Ctrl-C; finished runs are in `out`.
    """
    plan = plan_prediction(
        {name: policy} if name else [policy],
        scenario,
        fit=fit,
        hold=hold,
        seeds=seeds,
        parameters=parameters,
        caches=caches,
    )
    return run_predictions(plan, fit, hold, out=out, jobs=jobs, executor=executor, progress=progress)[0]


def plan_prediction(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    scenario: "str | ScenarioConfig" = "warehouse_small",
    *,
    fit: Sequence[int] = FIT_SIZES,
    hold: Sequence[int] = (),
    seeds: int | Sequence[int] = 4,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
) -> ScoringPlan:
    """Return the runs that `predict_policy` makes; arguments and errors as there."""
    from swarm_forage_env.scenarios.presets import scenario as preset
    from swarm_forage_env.study.experiments import Experiment

    fitted, held = _checked_sizes(fit, hold)
    chosen = preset(scenario) if isinstance(scenario, str) else scenario
    experiments = [
        Experiment(criterion=SIZE, value=size, scenario=_with_robots(chosen, size)) for size in (*fitted, *held)
    ]
    return plan_conditions(policies, chosen, experiments, seeds=seeds, parameters=parameters, caches=caches)


def run_predictions(
    plan: ScoringPlan,
    fit: Sequence[int],
    hold: Sequence[int] = (),
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> tuple[PredictionTable, ...]:
    """Carry out a plan of `plan_prediction` and return one table per policy; arguments and errors as there."""
    fitted, held = _checked_sizes(fit, hold)
    found = run_totals(plan, out=out, jobs=jobs, executor=executor, progress=progress)
    return tuple(_table_of_runs(plan, totals, fitted, held) for totals in found)


def predict_curves(
    path: str | Path, *, fit: Sequence[int] | None = None, hold: Sequence[int] = ()
) -> tuple[PredictionTable, ...]:
    """Predict from curves of any simulator, one table per policy in the file.

    Args:
        path: CSV or Parquet file with the columns of `CURVE_COLUMNS`; rows of criterion population_size are used.
        fit: Sizes that are fitted; default all below the held-back ones.
        hold: Sizes that are held back.

    Raises:
        CurveError: whatever is wrong with the file, or sizes that it does not have.
    """
    tables: list[PredictionTable] = []
    for study in read_curves(path):
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
        tables.append(_table(study.controller, "", study.horizon_s, totals, fitted, held))
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


def _with_robots(scenario: "ScenarioConfig", n_robots: int) -> "ScenarioConfig":
    """Return the scenario for a swarm size, as scores have it in their size sweep."""
    from swarm_forage_env.scenarios import presets
    from swarm_forage_env.study.experiments import SIZE_SWEEP_OBJECTS

    robots = replace(scenario.robots, n_robots=n_robots)
    if scenario.name in SIZE_SWEEP_OBJECTS:
        objects = scenario.objects
        if objects.n_objects == presets.scenario(scenario.name).objects.n_objects:
            objects = replace(objects, n_objects=SIZE_SWEEP_OBJECTS[scenario.name])
        return replace(scenario, robots=robots, objects=objects)
    usual = presets.search_and_rescue()
    if (scenario.arena, scenario.objects.n_objects) != (usual.arena, usual.objects.n_objects):
        raise CurveError(
            f"Expected {scenario.name} with its own arena and objects, which grow with the swarm, got an arena "
            f"{scenario.arena.width_m:g} m wide with {scenario.objects.n_objects} objects."
        )
    sides = {
        presets.robots_at_density(side * side, presets.DENSITY): side for side in presets.SEARCH_AND_RESCUE_OBJECTS
    }
    side_m = min(sides.values()) if n_robots == 1 else sides.get(n_robots)
    if side_m is None:
        raise CurveError(
            f"Expected swarm sizes of {scenario.name} that fill one of its arenas, 1, {', '.join(map(str, sides))}, "
            f"got {n_robots}."
        )
    arena = presets.search_and_rescue(side_m=float(side_m))
    objects = replace(scenario.objects, n_objects=arena.objects.n_objects)
    return replace(scenario, arena=arena.arena, robots=robots, objects=objects)


def _table_of_runs(
    plan: ScoringPlan, found: PolicyTotals, fit: tuple[int, ...], hold: tuple[int, ...]
) -> PredictionTable:
    totals = {size: tuple(of_seeds.values()) for size, of_seeds in zip((*fit, *hold), found.totals, strict=True)}
    usable = tuple(size for size in fit if len(totals[size]) > 1)
    if len(usable) < MIN_SIZES:
        raise CurveError(
            f"Expected two or more finished runs at {MIN_SIZES} or more sizes for {found.policy}, got them at "
            f"{len(usable)}; the first failure: {found.failures[0]}"
        )
    return _table(
        found.policy, plan.scenario.name, plan.scenario.horizon_s, totals, usable, hold, failures=found.failures
    )


def _table(
    policy: str,
    scenario: str,
    horizon_s: float | None,
    totals: Mapping[int, tuple[float, ...]],
    fit: tuple[int, ...],
    hold: tuple[int, ...],
    *,
    failures: tuple[str, ...] = (),
) -> PredictionTable:
    last = max(*hold, AHEAD[-1] * fit[-1]) if hold else AHEAD[-1] * fit[-1]
    between = np.geomspace(fit[0], last, _BAND_POINTS).round().astype(int).tolist()
    at = sorted({*hold, *(factor * fit[-1] for factor in AHEAD), *between})
    prediction = predict_performance(fit, [totals[size] for size in fit], at, seed=_RESAMPLING_SEED)
    return PredictionTable(
        policy=policy,
        scenario=scenario,
        horizon_s=horizon_s,
        totals=totals,
        fit=fit,
        hold=hold,
        prediction=prediction,
        failures=failures,
    )


def counted_inside(tables: Sequence[PredictionTable]) -> str:
    """Return how many held-back sizes lie in their intervals, in words; empty if none was held back."""
    answers = [table.is_inside(size) for table in tables for size in table.hold]
    known = [answer for answer in answers if answer is not None]
    return f"{sum(known)} of {counted(len(known), 'held-back mean')} inside the interval" if known else ""
