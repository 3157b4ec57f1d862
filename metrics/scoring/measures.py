"""The measures, each one row of one table: symbol, what it varies, how to read it, and its formula over runs.

A new measure is a formula (`metrics.emergence` and others) and a row of `MEASURES`. What it compares is decided here,
too: swarm sizes with the next smaller one, levels of an adversity with the undisturbed swarm.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.wrappers.world import SIZE

from ..checks import CurveError, PopulationError
from ..curves import FloatArray, Form, Variant
from ..distance import noise_floor
from ..emergence import interference_gain, spatial_emergence, task_emergence, time_emergence, undisturbed_gain
from ..environment import environment_distance
from ..flexibility import adaptability, noise_robustness, reactivity
from ..interference import performance_lost
from ..population import availability, population_robustness, recorded_population_robustness
from ..queues import PopulationRates
from ..scaling import efficiency, raw_performance, scalability
from .run_curves import HANDLING, NOISE, POPULATION, THROTTLE, RunCurves, StudyCurves, common_runs

DISTURBANCES = (THROTTLE, HANDLING)
"""Kinds of disturbance over time, the paper's two, under which reactivity and adaptability can be scored."""
ENOUGH_SHARE = 0.1
"""Share of the swarm that availability asks for: 5 of 50 and 20 of 200 robots (scenario 1 of the paper)."""
FALLING = (
    "performance is lower than that of the next smaller swarm, and it weights the time lost, so that a collapse counts "
    "as organisation; read time_emergence beside it"
)
"""Remark on a value that misleads: see erratum 16 in docs/errata.md."""
_WORDS = {THROTTLE: "throttle", HANDLING: "handling cost", NOISE: "sigma", POPULATION: "population"}
"""Criterion -> its word in the name of a level."""


class Compared(NamedTuple):
    """Runs that a formula takes, paired by seed."""

    one: RunCurves | None
    """Those of one robot; None if there are none, or they are not needed."""
    base: RunCurves
    """Those of the smaller swarm, or of the undisturbed one; `runs` again where a measure compares nothing."""
    runs: RunCurves
    variant: Variant


class Uncomputable(Exception):  # noqa: N818 - not an error: it is noted, and other measures go on
    """The curves do not allow this measure; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One measure."""

    symbol: str
    """Symbol in the paper."""
    varies: str
    """What has to be varied for it."""
    of: Callable[[Compared], FloatArray]
    """The formula; returns one value per run, (R,)."""
    unit: str
    """Unit of the value; {amount} stands for what performance counts, {span} for the length of a run."""
    higher_is_better: bool = True
    """Direction of the corrected form."""
    neutral: float | None = 0.0
    """Value that separates better from worse: robots that do not affect each other, or an undisturbed swarm."""
    lowest: float = -math.inf
    """Lower end of the range."""
    highest: float = math.inf
    """Upper end of the range."""
    columns: tuple[str, ...] = ()
    """Columns that it needs besides the performance."""
    compares: bool = False
    """Whether it compares a swarm size with a smaller one."""
    from_one: bool = False
    """Whether it needs runs of one robot."""
    is_amount: bool = False
    """Whether it is an amount of performance, which is also given as a share of that which it is compared with."""
    weights: bool = False
    """Whether it weights the time lost with the performance, which misleads where performance falls with the size."""
    is_distance: bool = False
    """Whether it is a distance of two curves, which has a noise floor, and whose normal form changes sign."""
    variants: tuple[Variant, ...] = ("corrected",)
    """Its variants that give different numbers."""


def _performance_lost(c: Compared) -> FloatArray:
    assert c.one is not None
    return performance_lost(*_losses(c.runs), c.one.performance, c.one.interference).sum(axis=-1)


def _spatial_emergence(c: Compared) -> FloatArray:
    lone = (None, None) if c.one is None else (c.one.performance, c.one.interference)
    return spatial_emergence(*_losses(c.base), *_losses(c.runs), *lone, variant=c.variant)


def _losses(runs: RunCurves) -> tuple[FloatArray, FloatArray, int]:
    return runs.performance, runs.interference, runs.n_robots


def _conditions(runs: RunCurves, disturbance: str, variant: Variant) -> FloatArray:
    """V(t), (R, T): the mean over each interval, or its value at the end of each, as in the paper's waveforms.

    What robots deliver in an interval depends on the conditions in all of it, so the corrected form uses the mean. The
    column of the values at the end has the name of the disturbance.
    """
    sampled = runs.curves.get(disturbance)
    return runs.curves["adversity"] if sampled is None or variant == "corrected" else sampled


def _reactivity(c: Compared) -> FloatArray:
    disturbance, variant = c.runs.criterion, c.variant
    wanted, given = (_conditions(each, disturbance, variant) for each in (c.base, c.runs))
    if disturbance == HANDLING and min(wanted.min(), given.min()) <= 0.0:
        raise Uncomputable("the conditions under a handling cost are the ticks that handling takes, and 0 or less here")
    if variant == "paper" and (wanted == 0.0).any():
        raise Uncomputable("the printed form divides by the ideal conditions, which are 0 here")
    # Twice the ticks that handling takes halve the performance of a perfect swarm.
    model = "paper" if variant == "paper" else "reciprocal" if disturbance == HANDLING else "linear"
    return reactivity(c.base.performance, c.runs.performance, v=given, i_ec=wanted, model=model)


def _rates(runs: RunCurves) -> PopulationRates:
    if runs.rates is None:
        raise Uncomputable(f"there are no rates (deaths_per_s, malfunctions_per_s, ...) for {runs.describe()}")
    return runs.rates


def _population_robustness(c: Compared) -> FloatArray:
    runs, ideal = c.runs, c.base
    rates = _rates(runs)
    if runs.horizon_s is None:
        raise Uncomputable("there is no column t_end_s, which gives the length of a run")
    try:
        return population_robustness(
            runs.performance,
            ideal.performance,
            rates,
            horizon=runs.horizon_s,
            n=runs.n_robots,
            ideal_rates=ideal.rates,
            weight="paper" if c.variant == "paper" else "transient",
        )
    except PopulationError as error:
        raise Uncomputable(str(error)) from error


def _recorded_population_robustness(c: Compared) -> FloatArray:
    at_work = c.base.curves["n_active"]
    if (at_work <= 0.0).any():
        raise Uncomputable("no robot of the reference run was at work in some interval")
    return recorded_population_robustness(c.runs.performance, c.runs.curves["n_active"], c.base.performance, at_work)


_LOST = ("interference_fraction",)
MEASURES: dict[str, Measure] = {
    "raw_performance": Measure(
        symbol="P(N)",
        varies=SIZE,
        of=lambda c: raw_performance(c.runs.performance, reduce="sum"),
        unit="{amount} {span}",
        neutral=None,
        lowest=0.0,
    ),
    "efficiency": Measure(
        symbol="P(N) / N",
        varies=SIZE,
        of=lambda c: efficiency(c.runs.performance, c.runs.n_robots, reduce="sum"),
        unit="{amount} per robot {span}",
        neutral=None,
        lowest=0.0,
    ),
    "t_lost_fraction": Measure(
        symbol="t_lost(N, t)",
        varies=SIZE,
        of=lambda c: c.runs.interference.mean(axis=-1),
        unit="share of robot time",
        higher_is_better=False,
        lowest=0.0,
        highest=1.0,
        columns=_LOST,
    ),
    "performance_lost": Measure(
        symbol="P_lost(N, t)",
        varies=SIZE,
        of=_performance_lost,
        unit="{amount} {span}",
        higher_is_better=False,
        columns=_LOST,
        from_one=True,
        is_amount=True,
        weights=True,
    ),
    "spatial_emergence": Measure(
        symbol="E_S(N1, N2)",
        varies=SIZE,
        of=_spatial_emergence,
        unit="{amount} {span}",
        columns=_LOST,
        compares=True,
        is_amount=True,
        weights=True,
        variants=("corrected", "paper"),
    ),
    "time_emergence": Measure(
        symbol="E_R(N1, N2)",
        varies=SIZE,
        of=lambda c: time_emergence(c.base.interference, c.base.n_robots, c.runs.interference, c.runs.n_robots),
        unit="robots",
        columns=_LOST,
        compares=True,
    ),
    "task_emergence": Measure(
        symbol="E_T(N1, N2)",
        varies=SIZE,
        of=lambda c: task_emergence(c.base.performance, c.base.n_robots, c.runs.performance, c.runs.n_robots),
        unit="{amount} {span}",
        compares=True,
        is_amount=True,
    ),
    "interference_gain": Measure(
        symbol="E_I(N1, N2)",
        varies=SIZE,
        of=lambda c: interference_gain(*_losses(c.base), *_losses(c.runs)),
        unit="{amount} {span}",
        columns=_LOST,
        compares=True,
        is_amount=True,
    ),
    "undisturbed_gain": Measure(
        symbol="E_U(N1, N2)",
        varies=SIZE,
        of=lambda c: undisturbed_gain(*_losses(c.base), *_losses(c.runs)),
        unit="{amount} {span}",
        columns=_LOST,
        compares=True,
        is_amount=True,
    ),
    "scalability": Measure(
        symbol="C(N1, N2)",
        varies=SIZE,
        of=lambda c: scalability(
            c.base.performance, c.base.n_robots, c.runs.performance, c.runs.n_robots, variant=c.variant
        ),
        unit="1 = linear",
        neutral=1.0,
        compares=True,
        variants=("corrected", "paper"),
    ),
    "reactivity": Measure(
        symbol="R(N)",
        varies=THROTTLE,
        of=_reactivity,
        unit="{amount} (DTW)",
        higher_is_better=False,
        lowest=0.0,
        columns=("adversity",),
        is_amount=True,
        is_distance=True,
        variants=("corrected", "paper"),
    ),
    "adaptability": Measure(
        symbol="A(N)",
        varies=THROTTLE,
        of=lambda c: adaptability(c.base.performance, c.runs.performance),
        unit="{amount} (DTW)",
        higher_is_better=False,
        lowest=0.0,
        is_amount=True,
        is_distance=True,
    ),
    "noise_robustness": Measure(
        symbol="B_sa",
        varies=NOISE,
        of=lambda c: noise_robustness(c.base.performance, c.runs.performance),
        unit="{amount} (DTW)",
        higher_is_better=False,
        lowest=0.0,
        is_amount=True,
        is_distance=True,
    ),
    "population_robustness": Measure(
        symbol="B_pd",
        varies=POPULATION,
        of=_population_robustness,
        unit="{amount} {span}",
        is_amount=True,
        variants=("corrected", "paper"),
    ),
    "recorded_population_robustness": Measure(
        symbol="B_pd'",
        varies=POPULATION,
        of=_recorded_population_robustness,
        unit="{amount} {span}",
        columns=("n_active",),
        is_amount=True,
    ),
    "availability": Measure(
        symbol="p_v",
        varies=POPULATION,
        of=lambda c: np.array([availability(c.runs.n_robots, _enough(c.runs), ratio_out(c.runs))]),
        unit="probability",
        neutral=1.0,
        lowest=0.0,
        highest=1.0,
    ),
}
"""Public function name -> the measure. The order is that of tables."""
PICTURED = (
    "raw_performance",
    "t_lost_fraction",
    "spatial_emergence",
    "task_emergence",
    "scalability",
    "reactivity",
    "adaptability",
    "noise_robustness",
    "population_robustness",
)
"""Measures of the usual table and picture: the paper's, without the parts and variants of ours."""
_NO_SUM = "this performance is no sum over robots, and the measure compares with growth in proportion to them"


@dataclass(frozen=True, kw_only=True, eq=False)
class Level:
    """What a measure compares at one level, and what is told of it besides the values of runs."""

    at: str
    """The level in words: "N = 25 to 50", "throttle 0.4"."""
    x: float
    """The level as a number: the larger swarm size, or the criterion's value."""
    compared: Compared
    """All runs that it compares, not yet paired."""
    misleads: bool = False
    floor: float | None = None
    """Of distances: mean distance between two undisturbed runs, what a perfect swarm scores by chance."""
    distance: float | None = None
    """Distance of the conditions from the ideal ones, the paper's x axis; None where it is not known."""

    def paired(self) -> Compared:
        """Return the runs with those seeds alone that all of them have."""
        one, base, runs, variant = self.compared
        paired = common_runs(*(each for each in (one, base, runs) if each is not None))
        return Compared(None if one is None else paired[0], paired[-2], paired[-1], variant)


def levels(name: str, study: StudyCurves, variant: Variant, form: Form) -> Iterator[Level]:
    """Yield what a measure compares in the runs of a policy.

    Args:
        name: Of the measure.
        study: Runs of one policy.
        variant: Of the measure.
        form: "marginal": sizes with the next smaller one; "interactive": with as many lone robots.

    Raises:
        Uncomputable: the curves do not allow the measure.
    """
    measure = MEASURES[name]
    yield from _sizes(measure, study, variant, form) if measure.varies == SIZE else _disturbed(name, study, variant)


def _sizes(measure: Measure, study: StudyCurves, variant: Variant, form: Form) -> Iterator[Level]:
    sizes = study.sizes()
    if not sizes:
        raise Uncomputable(f"there are no runs with criterion {SIZE}")
    _require_columns(measure, sizes)
    smallest = sizes[0]
    one = smallest if smallest.n_robots == 1 else None
    if one is None and (measure.from_one or (measure.compares and form == "interactive")):
        raise Uncomputable(f"there is no reference run of one robot, the smallest swarm has {smallest.n_robots}")
    if len(sizes) < 2 and (measure.from_one or measure.compares):
        raise Uncomputable(f"there is one swarm size only, N = {smallest.n_robots}")
    for previous, larger in zip((None, *sizes), sizes, strict=False):
        if previous is None and (measure.from_one or measure.compares):
            continue  # the first size has nothing to be compared with
        smaller = one if form == "interactive" else previous
        base = smaller if measure.compares and smaller is not None else larger
        yield Level(
            at=f"N = {base.n_robots} to {larger.n_robots}" if base is not larger else f"N = {larger.n_robots}",
            x=larger.n_robots,
            compared=Compared(one if measure.from_one or measure.weights else None, base, larger, variant),
            misleads=measure.weights and previous is not None and _falls(previous, larger),
        )


def _falls(previous: RunCurves, larger: RunCurves) -> bool:
    """Whether the mean performance is lower than that of the next smaller swarm."""
    few, many = common_runs(previous, larger)
    return bool(few.seeds) and float(many.performance.sum()) < float(few.performance.sum())


def _disturbed(name: str, study: StudyCurves, variant: Variant) -> Iterator[Level]:
    measure = MEASURES[name]
    criteria = DISTURBANCES if measure.varies in DISTURBANCES else (measure.varies,)
    pairs = tuple(pair for criterion in criteria for pair in study.levels(criterion))
    if not pairs:
        raise Uncomputable(f"there are no runs with criterion {' or '.join(criteria)} and a value other than 0")
    _require_columns(measure, [each for pair in pairs for each in pair])
    if name == "availability":
        yield from _ratios([runs for _, runs in pairs])
        return
    for ideal, runs in pairs:
        is_known = measure.is_distance and len(ideal.seeds) > 1
        yield Level(
            at=f"{_WORDS[runs.criterion]} {runs.value:.4g}",
            x=runs.value,
            compared=Compared(None, ideal, runs, variant),
            floor=float(noise_floor(ideal.performance).mean()) if is_known else None,
            distance=_environment_distance(ideal, runs) if measure.is_distance else None,
        )


def _environment_distance(ideal: RunCurves, runs: RunCurves) -> float | None:
    wanted, applied = common_runs(ideal, runs)
    is_known = all("adversity" in each.curves for each in (wanted, applied))
    if not wanted.seeds or runs.criterion not in DISTURBANCES or not is_known:
        return None
    # Sampled at interval ends, which gives the paper's x axis.
    means = [_conditions(each, runs.criterion, "paper").mean(axis=0) for each in (applied, wanted)]
    return environment_distance(*means)


def _ratios(experiments: Sequence[RunCurves]) -> Iterator[Level]:
    """Yield one level per ratio of rates: availability follows from the rates alone."""
    seen: set[tuple[int, float]] = set()
    for runs in experiments:
        x = ratio_out(runs)
        if (runs.n_robots, x) not in seen:
            seen.add((runs.n_robots, x))
            at = f"{_enough(runs)} or more at work, lambda/mu {x:.4g}"
            yield Level(at=at, x=x, compared=Compared(None, runs, runs, "corrected"))


def ratio_out(runs: RunCurves) -> float:
    """Return lambda / mu of a population: how much oftener robots leave than come."""
    rates = _rates(runs)
    return 0.0 if rates.lam == 0.0 else math.inf if rates.mu == 0.0 else round(rates.lam / rates.mu, 6)


def _enough(runs: RunCurves) -> int:
    return max(1, round(ENOUGH_SHARE * runs.n_robots))


def _require_columns(measure: Measure, experiments: Sequence[RunCurves]) -> None:
    absent = [name for name in measure.columns if any(name not in e.curves and e.seeds for e in experiments)]
    if absent:
        raise Uncomputable(f"there is no column {', '.join(absent)} for every run that is compared")


def unit_of(name: str, study: StudyCurves, variant: Variant) -> str:
    """Return the unit of a measure of some runs: "objects in 4,000 s", "robots summed over intervals"."""
    if name == "scalability" and variant == "paper":
        return "printed form, summed over intervals"
    over = "per run" if study.horizon_s is None else f"in {study.horizon_s:,.0f} s"
    span = over if study.read_as.is_total else "summed over intervals"
    return MEASURES[name].unit.format(amount=study.read_as.amount, span=span)


def remark_on(name: str, study: StudyCurves, variant: Variant, *, misleads: bool) -> str:
    """Return what to know before reading values; empty if nothing."""
    measure = MEASURES[name]
    compares = measure.compares or measure.from_one or measure.varies == POPULATION
    in_proportion = name == "efficiency" or (compares and name not in ("time_emergence", "availability"))
    remarks = {
        FALLING: misleads,
        "minus the speedup times the corrected form, so it reverses the order of swarms": (name, variant)
        == ("scalability", "paper"),
        "from the rates alone, the same for every policy, in an equilibrium that runs need not reach": name
        == "availability",
        _NO_SUM: in_proportion and not study.read_as.adds_up,
    }
    return "; ".join(remark for remark, holds in remarks.items() if holds)


def check_measures(measures: Sequence[str] | None) -> tuple[str, ...]:
    """Return measures in the order of tables, each once; None = all. Raises CurveError on unknown ones, or none."""
    if measures is not None:
        check_words("measure", measures, tuple(MEASURES))
    return tuple(name for name in MEASURES if measures is None or name in measures)


def check_words(what: str, words: Sequence[str], known: Sequence[str]) -> None:
    """Refuse unknown words, or none; raises CurveError."""
    for word in words:
        if word not in known:
            raise CurveError(f"Unknown {what} {word!r}.{suggestion(word, known)} Known: {', '.join(known)}.")
    if not words:
        raise CurveError(f"Expected one or more {what}s of {', '.join(known)}, got none.")


def criteria_of(measures: Sequence[str], disturbance: str) -> set[str]:
    """Return what has to be varied for some measures, with one of `DISTURBANCES` in place of the throttle.

    Raises:
        CurveError: an unknown kind of disturbance.
    """
    if disturbance not in DISTURBANCES:
        raise CurveError(f"Expected disturbance to be one of {', '.join(DISTURBANCES)}, got {disturbance!r}.")
    criteria = (MEASURES[name].varies for name in measures)
    return {disturbance if criterion == THROTTLE else criterion for criterion in criteria}
