"""The measures, each one row of one table: symbol, what it varies, its formula over runs, and how to read it.

A new measure is a formula (`metrics.emergence` and others) and a row of `MEASURES`. What it compares is decided here,
too: swarm sizes with the next smaller one, levels of an adversity with the undisturbed swarm.
"""

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import KW_ONLY, dataclass
from typing import Any, NamedTuple, get_args

import numpy as np

from swarm_forage_env._internal.wording import suggestion
from swarm_forage_env.wrappers.world import SIZE

from ..checks import CurveError, PopulationError
from ..curves import FloatArray, Form, Variant
from ..emergence import interference_gain, spatial_emergence, task_emergence, time_emergence, undisturbed_gain
from ..environment import environment_distance
from ..flexibility import adaptability, noise_robustness, reactivity
from ..interference import performance_lost
from ..population import availability, population_robustness, recorded_population_robustness
from ..queues import PopulationRates
from ..scaling import efficiency, raw_performance, scalability
from .run_curves import HANDLING, NOISE, POPULATION, THROTTLE, RunCurves, StudyCurves, shared_seeds

DISTURBANCES = (THROTTLE, HANDLING)
"""Kinds of disturbance over time, the paper's two, under which reactivity and adaptability can be scored."""
ENOUGH_SHARE = 0.1
"""Share of the swarm that availability asks for: 5 of 50 and 20 of 200 robots (scenario 1 of the paper)."""
_WORDS = {THROTTLE: "throttle", HANDLING: "handling cost", NOISE: "sigma", POPULATION: "population"}
"""Criterion -> its word in the name of a level."""


class Uncomputable(Exception):  # noqa: N818 - not an error: it is noted, and other measures go on
    """The curves do not allow this measure; the message says why."""


class Compared(NamedTuple):
    """What a measure compares at one level."""

    one: RunCurves | None
    """Runs of one robot; None if there are none, or they are not needed."""
    base: RunCurves
    """Those of the smaller swarm, or of the undisturbed one; `runs` again where a measure compares nothing."""
    runs: RunCurves
    variant: Variant
    at: str = ""
    """The level in words: "N = 25 to 50", "throttle 0.4"."""
    x: float = math.nan
    """The level as a number: the larger swarm size, or the criterion's value."""
    misleads: bool = False

    @property
    def curves(self) -> tuple[FloatArray, FloatArray]:
        """Performance of the base and of the runs, (R, T) each."""
        return self.base.performance, self.runs.performance

    @property
    def achieved(self) -> tuple[FloatArray, int, FloatArray, int]:
        """Performance and swarm size of both."""
        return self.base.performance, self.base.n_robots, self.runs.performance, self.runs.n_robots

    @property
    def lost(self) -> tuple[FloatArray, int, FloatArray, int]:
        """Share of time lost and swarm size of both."""
        return self.base.interference, self.base.n_robots, self.runs.interference, self.runs.n_robots

    @property
    def losses(self) -> tuple[FloatArray, FloatArray, int, FloatArray, FloatArray, int]:
        """Performance, share of time lost and swarm size of both."""
        base, runs = self.base, self.runs
        return base.performance, base.interference, base.n_robots, runs.performance, runs.interference, runs.n_robots

    def paired(self) -> "Compared":
        """Return the runs with those seeds alone that all of them have."""
        seeds = shared_seeds([each for each in (self.one, self.base, self.runs) if each is not None])
        one = None if self.one is None else self.one.at_seeds(seeds)
        return self._replace(one=one, base=self.base.at_seeds(seeds), runs=self.runs.at_seeds(seeds))


@dataclass(frozen=True)
class Measure:
    """One measure."""

    symbol: str
    """Symbol in the paper."""
    of: Callable[[Compared], FloatArray]
    """The formula, of runs that are paired by seed; returns one value per run, (R,)."""
    varies: str
    """What has to be varied for it."""
    unit: str
    """Unit of the value; {amount} stands for what performance counts, {span} for the length of a run."""
    _: KW_ONLY
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
    weights: bool = False
    """Whether it weights the time lost with the performance, which misleads where performance falls with the size."""
    variants: tuple[Variant, ...] = ("corrected",)
    """Its variants that give different numbers."""

    @property
    def better(self) -> str:
        """Which values are better, "higher" or "lower"."""
        return "higher" if self.higher_is_better else "lower"

    @property
    def is_amount(self) -> bool:
        """Whether it is an amount of performance, which is also given as a share of that which it is compared with."""
        return "{amount}" in self.unit and self.neutral is not None

    @property
    def is_distance(self) -> bool:
        """Whether it is a distance of two curves, which has a noise floor."""
        return self.unit == _DISTANCE


def _conditions(runs: RunCurves, disturbance: str, variant: Variant) -> FloatArray:
    """V(t), (R, T): the mean over each interval, or its value at the end of each, as in the paper's waveforms.

    What robots deliver in an interval depends on the conditions in all of it, so the corrected form uses the mean. The
    column of the values at the end has the name of the disturbance.
    """
    sampled = runs.curves.get(disturbance)
    return runs.curves["adversity"] if sampled is None or variant == "corrected" else sampled


def conditions_apart(compared: Compared) -> float | None:
    """Return the distance of the conditions from the ideal ones, the paper's x axis; None where it is not known.

    They are sampled at the ends of intervals, mean over runs.
    """
    paired = compared.paired()
    sides, disturbance = (paired.runs, paired.base), paired.runs.criterion
    if disturbance not in DISTURBANCES or not all("adversity" in each.curves and each.seeds for each in sides):
        return None
    return environment_distance(*(_conditions(each, disturbance, "paper").mean(axis=0) for each in sides))


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


def _performance_lost(c: Compared) -> FloatArray:
    assert c.one is not None
    return performance_lost(*c.losses[3:], c.one.performance, c.one.interference).sum(axis=-1)


def _spatial_emergence(c: Compared) -> FloatArray:
    lone = (None, None) if c.one is None else (c.one.performance, c.one.interference)
    return spatial_emergence(*c.losses, *lone, variant=c.variant)


def _rates(runs: RunCurves) -> PopulationRates:
    if runs.rates is None:
        raise Uncomputable(f"there are no rates (deaths_per_s, malfunctions_per_s, ...) for {runs.describe()}")
    return runs.rates


def _population_robustness(c: Compared) -> FloatArray:
    rates, horizon_s = _rates(c.runs), c.runs.horizon_s
    if horizon_s is None:
        raise Uncomputable("there is no column t_end_s, which gives the length of a run")
    weight = "paper" if c.variant == "paper" else "transient"
    about: dict[str, Any] = {"n": c.runs.n_robots, "horizon": horizon_s, "ideal_rates": c.base.rates, "weight": weight}
    try:
        return population_robustness(c.runs.performance, c.base.performance, rates, **about)
    except PopulationError as error:
        raise Uncomputable(str(error)) from error


def _recorded_population_robustness(c: Compared) -> FloatArray:
    at_work = c.base.curves["n_active"]
    if (at_work <= 0.0).any():
        raise Uncomputable("no robot of the reference run was at work in some interval")
    return recorded_population_robustness(c.runs.performance, c.runs.curves["n_active"], c.base.performance, at_work)


def _availability(c: Compared) -> FloatArray:
    return np.array([availability(c.runs.n_robots, _enough(c.runs), _ratio_out(c.runs))])


def _enough(runs: RunCurves) -> int:
    return max(1, round(ENOUGH_SHARE * runs.n_robots))


def _ratio_out(runs: RunCurves) -> float:
    """Return lambda / mu of a population: how much oftener robots leave than come."""
    rates = _rates(runs)
    return 0.0 if rates.lam == 0.0 else math.inf if rates.mu == 0.0 else round(rates.lam / rates.mu, 6)


_TOTAL, _DISTANCE = "{amount} {span}", "{amount} (DTW)"
_BOTH: tuple[Variant, ...] = ("corrected", "paper")
_TIME_LOST = ("interference_fraction",)
_SIZES: dict[str, Any] = {"varies": SIZE, "compares": True}
_DISTANCES: dict[str, Any] = {"unit": _DISTANCE, "higher_is_better": False, "lowest": 0.0}
MEASURES: dict[str, Measure] = {
    "raw_performance": Measure(
        "P(N)", lambda c: raw_performance(c.runs.performance, reduce="sum"), SIZE, _TOTAL, neutral=None, lowest=0.0
    ),
    "efficiency": Measure(
        "P(N) / N",
        lambda c: efficiency(c.runs.performance, c.runs.n_robots, reduce="sum"),
        SIZE,
        "{amount} per robot {span}",
        neutral=None,
        lowest=0.0,
    ),
    "t_lost_fraction": Measure(
        "t_lost(N, t)",
        lambda c: c.runs.interference.mean(axis=-1),
        SIZE,
        "share of robot time",
        higher_is_better=False,
        lowest=0.0,
        highest=1.0,
        columns=_TIME_LOST,
    ),
    "performance_lost": Measure(
        "P_lost(N, t)",
        _performance_lost,
        SIZE,
        _TOTAL,
        higher_is_better=False,
        columns=_TIME_LOST,
        from_one=True,
        weights=True,
    ),
    "spatial_emergence": Measure(
        "E_S(N1, N2)", _spatial_emergence, **_SIZES, unit=_TOTAL, columns=_TIME_LOST, weights=True, variants=_BOTH
    ),
    "time_emergence": Measure(
        "E_R(N1, N2)", lambda c: time_emergence(*c.lost), **_SIZES, unit="robots", columns=_TIME_LOST
    ),
    "task_emergence": Measure("E_T(N1, N2)", lambda c: task_emergence(*c.achieved), **_SIZES, unit=_TOTAL),
    "interference_gain": Measure(
        "E_I(N1, N2)", lambda c: interference_gain(*c.losses), **_SIZES, unit=_TOTAL, columns=_TIME_LOST
    ),
    "undisturbed_gain": Measure(
        "E_U(N1, N2)", lambda c: undisturbed_gain(*c.losses), **_SIZES, unit=_TOTAL, columns=_TIME_LOST
    ),
    "scalability": Measure(
        "C(N1, N2)",
        lambda c: scalability(*c.achieved, variant=c.variant),
        **_SIZES,
        unit="1 = linear",
        neutral=1.0,
        variants=_BOTH,
    ),
    "reactivity": Measure("R(N)", _reactivity, THROTTLE, **_DISTANCES, columns=("adversity",), variants=_BOTH),
    "adaptability": Measure("A(N)", lambda c: adaptability(*c.curves), THROTTLE, **_DISTANCES),
    "noise_robustness": Measure("B_sa", lambda c: noise_robustness(*c.curves), NOISE, **_DISTANCES),
    "population_robustness": Measure("B_pd", _population_robustness, POPULATION, _TOTAL, variants=_BOTH),
    "recorded_population_robustness": Measure(
        "B_pd'", _recorded_population_robustness, POPULATION, _TOTAL, columns=("n_active",)
    ),
    "availability": Measure("p_v", _availability, POPULATION, "probability", neutral=1.0, lowest=0.0, highest=1.0),
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


def levels(name: str, study: StudyCurves, variant: Variant, form: Form) -> Iterator[Compared]:
    """Yield what a measure compares in the runs of a policy, level by level.

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


def _sizes(measure: Measure, study: StudyCurves, variant: Variant, form: Form) -> Iterator[Compared]:
    sizes = study.sizes()
    if not sizes:
        raise Uncomputable(f"there are no runs with criterion {SIZE}")
    _require_columns(measure, sizes)
    smallest = sizes[0]
    one = smallest if smallest.n_robots == 1 else None
    has_base = measure.from_one or measure.compares
    if one is None and (measure.from_one or (measure.compares and form == "interactive")):
        raise Uncomputable(f"there is no reference run of one robot, the smallest swarm has {smallest.n_robots}")
    if len(sizes) < 2 and has_base:
        raise Uncomputable(f"there is one swarm size only, N = {smallest.n_robots}")
    for previous, larger in zip((smallest, *sizes), sizes, strict=False):
        if larger is smallest and has_base:
            continue  # it has nothing to be compared with
        smaller = smallest if form == "interactive" else previous
        base = smaller if measure.compares else larger
        yield Compared(
            one=one if measure.weights else None,
            base=base,
            runs=larger,
            variant=variant,
            at=f"N = {base.n_robots} to {larger.n_robots}" if measure.compares else f"N = {larger.n_robots}",
            x=larger.n_robots,
            misleads=measure.weights and _falls(previous, larger),
        )


def _falls(previous: RunCurves, larger: RunCurves) -> bool:
    """Whether the mean performance is lower than that of the next smaller swarm."""
    seeds = shared_seeds((previous, larger))
    few, many = (float(each.at_seeds(seeds).performance.sum()) if seeds else 0.0 for each in (previous, larger))
    return many < few


def _disturbed(name: str, study: StudyCurves, variant: Variant) -> Iterator[Compared]:
    measure = MEASURES[name]
    criteria = DISTURBANCES if measure.varies == THROTTLE else (measure.varies,)
    pairs = tuple(pair for criterion in criteria for pair in study.levels(criterion))
    if not pairs:
        raise Uncomputable(f"there are no runs with criterion {' or '.join(criteria)} and a value other than 0")
    _require_columns(measure, [each for pair in pairs for each in pair])
    if name == "availability":  # it follows from the rates alone: one level per ratio of them
        ratios: dict[tuple[int, float], RunCurves] = {}
        for _, runs in pairs:
            ratios.setdefault((runs.n_robots, _ratio_out(runs)), runs)
        for (_, x), runs in ratios.items():
            at = f"{_enough(runs)} or more at work, lambda/mu {x:.4g}"
            yield Compared(None, runs, runs, "corrected", at=at, x=x)
        return
    for ideal, runs in pairs:
        yield Compared(None, ideal, runs, variant, at=f"{_WORDS[runs.criterion]} {runs.value:.4g}", x=runs.value)


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


def remark_on(name: str, study: StudyCurves, compared: Compared) -> str:
    """Return what to know before reading values; empty if nothing."""
    measure = MEASURES[name]
    is_sum = "{amount}" in measure.unit and name != "raw_performance"
    in_proportion = measure.varies in (SIZE, POPULATION) and (is_sum or name == "scalability")
    remarks = {
        # erratum 16 in docs/errata.md
        "performance is lower than that of the next smaller swarm, and it weights the time lost, so that a collapse "
        "counts as organisation; read time_emergence beside it": compared.misleads,
        "minus the speedup times the corrected form, so it reverses the order of swarms": name == "scalability"
        and compared.variant == "paper",
        "the smaller swarm delivers nothing in some runs, which have no value": name == "scalability"
        and compared.variant == "corrected"
        and bool(compared.base.seeds)
        and bool((compared.base.performance.sum(axis=-1) == 0.0).any()),
        "from the rates alone, the same for every policy, in an equilibrium that runs need not reach": name
        == "availability",
        "this performance is no sum over robots, and the measure compares with growth in proportion to "
        "them": in_proportion and not study.read_as.adds_up,
    }
    return "; ".join(remark for remark, holds in remarks.items() if holds)


def checked_request(
    measures: Sequence[str] | None, variants: Sequence[Variant], forms: Sequence[Form]
) -> tuple[str, ...]:
    """Return the measures in the order of tables, each once; None = all.

    Raises:
        CurveError: an unknown measure, variant or form, or none.
    """
    check_words("variant", variants, get_args(Variant))
    check_words("form", forms, get_args(Form))
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
