"""From the curves of a study to rows of scores: which experiments each measure compares, and in which order."""

import difflib
import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from metrics.curves import CurveError, FloatArray
from metrics.distance import noise_floor
from metrics.emergence import spatial_emergence, task_emergence
from metrics.environment import environment_distance
from metrics.flexibility import adaptability, reactivity
from metrics.interference import performance_lost
from metrics.population import availability, population_robustness, population_weight
from metrics.queues import PopulationRates
from metrics.robustness import mean_signed_difference, noise_robustness
from metrics.scaling import efficiency, raw_performance, scalability
from metrics.statistics import Summary, aggregate, bootstrap_measure

from .curves_table import NOISE, POPULATION, SIZE, THROTTLE, RunCurves, StudyCurves, common_runs
from .table import Score

MEASURE_CRITERIA: dict[str, str] = {
    "raw_performance": SIZE,
    "efficiency": SIZE,
    "t_lost_fraction": SIZE,
    "performance_lost": SIZE,
    "spatial_emergence": SIZE,
    "task_emergence": SIZE,
    "scalability": SIZE,
    "reactivity": THROTTLE,
    "adaptability": THROTTLE,
    "noise_robustness": NOISE,
    "population_robustness": POPULATION,
    "availability": POPULATION,
}
"""Measure -> what has to be varied for it. The order is that of score tables."""
ENOUGH_SHARE = 0.1
"""Share of the swarm that availability asks for: 5 of 50 and 20 of 200 robots (scenario 1 of the paper)."""

_BOOTSTRAP_SEED = 1
"""Fixed, so that the same runs give the same table."""
_UNDEFINED = Summary(mean=math.nan, std=math.nan, lower=math.nan, upper=math.nan, n_used=0, n_nan=0)

Values: TypeAlias = Callable[..., ArrayLike]
"""Takes the experiments of a row, restricted to their common runs; returns one value per run."""


class Uncomputable(Exception):  # noqa: N818 - no error: the table says so and goes on
    """The curves do not allow this measure; the message says why."""


def score_study(study: StudyCurves, measures: Sequence[str] | None = None) -> tuple[tuple[Score, ...], dict[str, str]]:
    """Compute the rows of all measures that the curves of a study allow.

    Args:
        study: Curves of one policy.
        measures: Names out of `MEASURE_CRITERIA`; default all.

    Returns:
        The rows, and for each measure that could not be computed the reason.

    Raises:
        CurveError: an unknown measure, or curves that a measure refuses.
    """
    scores: list[Score] = []
    missing: dict[str, str] = {}
    for measure in check_measures(measures):
        try:
            scores += list(_ROWS[measure](measure, study))
        except Uncomputable as reason:
            missing[measure] = str(reason)
    return tuple(scores), missing


def check_measures(measures: Sequence[str] | None) -> tuple[str, ...]:
    """Return measures in the order of tables, each once; None = all.

    Raises:
        CurveError: an unknown name, or none at all.
    """
    if measures is None:
        return tuple(MEASURE_CRITERIA)
    for name in measures:
        if name not in MEASURE_CRITERIA:
            close = difflib.get_close_matches(name, MEASURE_CRITERIA, n=1)
            hint = f" Did you mean {close[0]!r}?" if close else ""
            raise CurveError(f"Unknown measure {name!r}.{hint} Known: {', '.join(MEASURE_CRITERIA)}.")
    if not measures:
        raise CurveError(f"Expected one or more measures of {', '.join(MEASURE_CRITERIA)}, got none.")
    return tuple(name for name in MEASURE_CRITERIA if name in measures)


@dataclass(frozen=True, kw_only=True)
class _Row:
    """A row before its values are known."""

    measure: str
    at: str
    x: float
    unit: str
    experiments: tuple[RunCurves, ...]
    """Those that enter, reference first."""
    compared_with: int | None = None
    """Place among them of the swarm whose total performance makes the value relative."""
    beside: dict[str, float] = field(default_factory=dict[str, float])

    def score(self, values: Values, *, floor: float | None = None, order_matters: bool = False) -> Score:
        """Return the row with one value per common run.

        Args:
            values: The measure.
            floor: Noise floor.
            order_matters: Whether the measure of the mean curves is told as well.
        """
        paired = common_runs(*self.experiments)
        seeds = paired[0].seeds
        n_lost = max(experiment.n_lost + len(experiment.seeds) for experiment in self.experiments) - len(seeds)
        per_run = np.atleast_1d(np.asarray(values(*paired), dtype=np.float64)) if seeds else np.empty(0)
        relative = None
        if self.compared_with is not None and seeds:
            total = paired[self.compared_with].performance.sum(axis=-1)
            relative = np.divide(per_run, total, out=np.full(len(seeds), math.nan), where=total > 0.0)
        return Score(
            measure=self.measure,
            at=self.at,
            criterion=self.experiments[-1].criterion,
            x=self.x,
            n_robots=tuple(dict.fromkeys(experiment.n_robots for experiment in self.experiments)),
            unit=self.unit,
            summary=aggregate(per_run) if seeds else _UNDEFINED,
            per_seed=dict(zip(seeds, per_run.tolist(), strict=True)),
            relative_per_seed={} if relative is None else dict(zip(seeds, relative.tolist(), strict=True)),
            n_lost=n_lost,
            noise_floor=floor,
            of_mean_curves=_of_mean_curves(values, paired) if order_matters and seeds else None,
            beside=self.beside,
            note=_note(per_run, n_lost, relative),
        )


def _of_mean_curves(values: Values, paired: tuple[RunCurves, ...]) -> Summary:
    """The measure of mean performance curves, with runs of each experiment resampled on their own."""

    def of_curves(*curves: FloatArray) -> ArrayLike:
        return values(*(e.averaged(curve) for e, curve in zip(paired, curves, strict=True)))

    performances = [experiment.performance for experiment in paired]
    return bootstrap_measure(of_curves, *performances, order="mean_curve", seed=_BOOTSTRAP_SEED)


def _note(per_run: FloatArray, n_lost: int, relative: FloatArray | None) -> str:
    notes: list[str] = []
    n_nan, n_infinite = int(np.isnan(per_run).sum()), int(np.isinf(per_run).sum())
    if n_lost:
        notes.append(f"{n_lost} of {len(per_run) + n_lost} runs failed or have no partner of the same seed")
    if n_nan:
        notes.append(f"undefined in {n_nan} of {len(per_run)} runs, in which neither swarm achieved anything")
    if n_infinite:
        notes.append(f"infinite in {n_infinite} of {len(per_run)} runs, in which one swarm achieved nothing")
    if relative is not None and (n_idle := int(np.isnan(relative).sum())):
        notes.append(f"says nothing in {n_idle} of {len(per_run)} runs: the performance it compares with is zero")
    return "; ".join(notes)


# ------------------------------------------------------------------------------------------------- swarm sizes


def _raw_performance(runs: RunCurves) -> FloatArray:
    return raw_performance(runs.performance, reduce="sum")


def _efficiency(runs: RunCurves) -> FloatArray:
    return efficiency(runs.performance, runs.n_robots, reduce="sum")


def _t_lost_fraction(runs: RunCurves) -> FloatArray:
    return runs.interference.mean(axis=-1)


def _performance_lost(one: RunCurves, runs: RunCurves) -> FloatArray:
    lost = performance_lost(runs.performance, runs.interference, runs.n_robots, one.performance, one.interference)
    return lost.sum(axis=-1)


def _spatial_emergence(one: RunCurves, few: RunCurves, many: RunCurves) -> FloatArray:
    return spatial_emergence(
        few.performance,
        few.interference,
        few.n_robots,
        many.performance,
        many.interference,
        many.n_robots,
        one.performance,
        one.interference,
    )


def _task_emergence(few: RunCurves, many: RunCurves) -> FloatArray:
    return task_emergence(few.performance, few.n_robots, many.performance, many.n_robots)


def _scalability(few: RunCurves, many: RunCurves) -> FloatArray:
    return scalability(few.performance, few.n_robots, many.performance, many.n_robots)


@dataclass(frozen=True, kw_only=True)
class _SizeMeasure:
    """How a measure of swarm sizes is applied."""

    values: Values
    """Takes the one-robot run if `from_one`, the next smaller swarm if `of_neighbours`, and the swarm itself."""
    unit: str
    """With {span} for the length of a run."""
    from_one: bool = False
    of_neighbours: bool = False
    needs_interference: bool = False
    is_gain: bool = False
    """Whether the value is an amount of performance, to be put in relation to that of the swarm."""
    order_matters: bool = False


_SIZE_MEASURES: dict[str, _SizeMeasure] = {
    "raw_performance": _SizeMeasure(values=_raw_performance, unit="objects {span}"),
    "efficiency": _SizeMeasure(values=_efficiency, unit="objects per robot {span}"),
    "t_lost_fraction": _SizeMeasure(values=_t_lost_fraction, unit="share of robot time", needs_interference=True),
    "performance_lost": _SizeMeasure(
        values=_performance_lost, unit="objects {span}", from_one=True, needs_interference=True, is_gain=True
    ),
    "spatial_emergence": _SizeMeasure(
        values=_spatial_emergence,
        unit="objects {span}",
        from_one=True,
        of_neighbours=True,
        needs_interference=True,
        is_gain=True,
    ),
    "task_emergence": _SizeMeasure(values=_task_emergence, unit="objects {span}", of_neighbours=True, is_gain=True),
    "scalability": _SizeMeasure(values=_scalability, unit="1 = linear", of_neighbours=True, order_matters=True),
}


def _size_rows(name: str, study: StudyCurves) -> Iterator[Score]:
    measure = _SIZE_MEASURES[name]
    sizes = _sizes(study, measure)
    one = sizes[0]
    span = "per run" if study.horizon_s is None else f"in {study.horizon_s:,.0f} s"
    for smaller, larger in zip((None, *sizes), sizes, strict=False):
        if smaller is None and (measure.from_one or measure.of_neighbours):
            continue  # the first size has nothing to be compared with
        experiments = (larger,)
        at = f"N = {larger.n_robots}"
        if measure.of_neighbours and smaller is not None:
            experiments = (smaller, larger)
            at = f"N = {smaller.n_robots} to {larger.n_robots}"
        if measure.from_one:
            experiments = (one, *experiments)
        yield _Row(
            measure=name,
            at=at,
            x=larger.n_robots,
            unit=measure.unit.format(span=span),
            experiments=experiments,
            compared_with=len(experiments) - 1 if measure.is_gain else None,
        ).score(measure.values, order_matters=measure.order_matters)


def _sizes(study: StudyCurves, measure: _SizeMeasure) -> tuple[RunCurves, ...]:
    sizes = study.sizes()
    if not sizes:
        raise Uncomputable(f"there are no runs with criterion {SIZE}")
    smallest = sizes[0].n_robots
    if measure.needs_interference and any("interference_fraction" not in e.curves and e.seeds for e in sizes):
        raise Uncomputable("there is no column interference_fraction for every swarm size")
    if measure.from_one and smallest != 1:
        raise Uncomputable(f"there is no reference run of one robot, the smallest swarm has {smallest}")
    if len(sizes) < 2 and (measure.from_one or measure.of_neighbours):
        raise Uncomputable(f"there is one swarm size only, N = {smallest}")
    return sizes


# --------------------------------------------------------------------------------------------------- adversity

_WORDS = {THROTTLE: "throttle", NOISE: "sigma", POPULATION: "population"}


def _levels(study: StudyCurves, criterion: str) -> tuple[tuple[RunCurves, RunCurves], ...]:
    levels = study.levels(criterion)
    if not levels:
        raise Uncomputable(f"there are no runs with criterion {criterion} and a value other than 0")
    return levels


def _level_row(measure: str, pair: tuple[RunCurves, RunCurves], *, unit: str, beside: dict[str, float]) -> _Row:
    """A row that compares a level with its reference."""
    level = pair[1]
    at = f"{_WORDS[level.criterion]} {level.value:.4g}"
    return _Row(measure=measure, at=at, x=level.value, unit=unit, experiments=pair, compared_with=0, beside=beside)


def _reactivity(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
    return reactivity(
        ideal.performance, disturbed.performance, disturbed.curves["adversity"], ideal.curves["adversity"]
    )


def _adaptability(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
    return adaptability(ideal.performance, disturbed.performance)


def _noise_robustness(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
    return noise_robustness(ideal.performance, disturbed.performance)


_DISTANCES: dict[str, Values] = {
    "reactivity": _reactivity,
    "adaptability": _adaptability,
    "noise_robustness": _noise_robustness,
}


def _distance_rows(name: str, study: StudyCurves) -> Iterator[Score]:
    levels = _levels(study, MEASURE_CRITERIA[name])
    if name == "reactivity" and any("adversity" not in e.curves and e.seeds for pair in levels for e in pair):
        raise Uncomputable("there is no column adversity for the reference run and every level")
    for reference, level in levels:
        floor = float(noise_floor(reference.performance).mean()) if len(reference.seeds) > 1 else None
        row = _level_row(name, (reference, level), unit="objects (DTW)", beside=_beside_distance(reference, level))
        yield row.score(_DISTANCES[name], floor=floor, order_matters=True)


def _beside_distance(reference: RunCurves, level: RunCurves) -> dict[str, float]:
    """What the distance does not tell: its sign, and how far the conditions were from the ideal ones."""
    ideal, disturbed = common_runs(reference, level)
    if not ideal.seeds:
        return {}
    difference = mean_signed_difference(ideal.performance, disturbed.performance)
    beside = {"signed_difference": float(np.mean(difference))}
    if level.criterion == THROTTLE and "adversity" in ideal.curves and "adversity" in disturbed.curves:
        applied, wanted = disturbed.curves["adversity"].mean(axis=0), ideal.curves["adversity"].mean(axis=0)
        beside["environment_distance"] = environment_distance(applied, wanted)
    return beside


def _population_rows(name: str, study: StudyCurves) -> Iterator[Score]:
    levels = _levels(study, POPULATION)
    horizon_s = study.horizon_s
    if horizon_s is None:
        raise Uncomputable("there is no column t_end_s, which gives the length of a run")
    for reference, level in levels:
        weight = population_weight(_rates(level), horizon=horizon_s, n=level.n_robots, ideal_rates=reference.rates)

        def values(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
            return population_robustness(
                disturbed.performance,
                ideal.performance,
                _rates(disturbed),
                horizon=horizon_s,
                n=disturbed.n_robots,
                ideal_rates=ideal.rates,
            )

        row = _level_row(name, (reference, level), unit=f"objects in {horizon_s:,.0f} s", beside={"weight": weight})
        yield row.score(values)


def _rates(level: RunCurves) -> PopulationRates:
    if level.rates is None:
        raise Uncomputable(f"there are no rates (deaths_per_s, malfunctions_per_s, ...) for {level.describe()}")
    return level.rates


def _availability_rows(name: str, study: StudyCurves) -> Iterator[Score]:
    """One row per ratio of rates: a number of the rates alone, the same for every policy."""
    seen: set[tuple[int, float]] = set()
    for _, level in _levels(study, POPULATION):
        rates, n_robots = _rates(level), level.n_robots
        ratio_out = 0.0 if rates.lam == 0.0 else math.inf if rates.mu == 0.0 else round(rates.lam / rates.mu, 6)
        if (n_robots, ratio_out) in seen:
            continue
        seen.add((n_robots, ratio_out))
        enough = max(1, round(ENOUGH_SHARE * n_robots))
        value = availability(n_robots, enough, ratio_out)
        yield Score(
            measure=name,
            at=f"{enough} or more at work, lambda/mu {ratio_out:.4g}",
            criterion=POPULATION,
            x=ratio_out,
            n_robots=(n_robots,),
            unit="probability",
            summary=Summary(mean=value, std=math.nan, lower=math.nan, upper=math.nan, n_used=0, n_nan=0),
            per_seed={},
            note="from the rates alone, the same for every policy, in an equilibrium that runs need not reach",
        )


_ROWS: dict[str, Callable[[str, StudyCurves], Iterator[Score]]] = {
    **dict.fromkeys(_SIZE_MEASURES, _size_rows),
    **dict.fromkeys(_DISTANCES, _distance_rows),
    "population_robustness": _population_rows,
    "availability": _availability_rows,
}
