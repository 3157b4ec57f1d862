"""Scores: which measures can be scored and in which forms, what a score is, and how it is made of runs."""

import difflib
import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, TypeAlias, get_args

import numpy as np
from numpy.typing import ArrayLike

from swarm_forage_env._internal.wording import limits, number, percent, plain
from swarm_forage_env.wrappers.world import SIZE

from ..catalog import METRICS
from ..checks import CurveError
from ..curves import FloatArray, Form, Variant
from ..significance import ROUNDING
from ..statistics import Summary, aggregate, bootstrap_measure
from .run_curves import HANDLING, NOISE, POPULATION, THROTTLE, RunCurves, common_runs

MEASURE_CRITERIA: dict[str, str] = {
    "raw_performance": SIZE,
    "efficiency": SIZE,
    "t_lost_fraction": SIZE,
    "performance_lost": SIZE,
    "spatial_emergence": SIZE,
    "time_emergence": SIZE,
    "task_emergence": SIZE,
    "interference_gain": SIZE,
    "undisturbed_gain": SIZE,
    "scalability": SIZE,
    "reactivity": THROTTLE,
    "adaptability": THROTTLE,
    "noise_robustness": NOISE,
    "population_robustness": POPULATION,
    "recorded_population_robustness": POPULATION,
    "availability": POPULATION,
}
"""Measure -> what has to be varied for it. The order is that of score tables."""
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
"""Measures of the usual picture: the paper's, without the parts and variants of ours."""
_WORDS = {"t_lost_fraction": "time lost"}
"""Measures whose names are no words."""
DISTURBANCES = (THROTTLE, HANDLING)
"""Kinds of disturbance over time, the paper's two, under which reactivity and adaptability can be scored."""
_NO_AMOUNT = 1e-12
"""Smaller amounts are rounding errors and are shown as zero."""
HEADER = ("measure", "at", "robots", "value", "95 % interval", "noise floor", "relative", "runs", "better", "unit")
"""Headings of `Score.cells`."""
BAND = "mean ± 2 sd"
"""Heading of the column that `Score.cells` adds for the authors' bands."""
DOUBTFUL = "?"
"""Mark of a value that misleads; its note says why."""
_BOOTSTRAP_SEED = 1
"""Fixed, so that the same runs give the same table."""
Values: TypeAlias = Callable[..., ArrayLike]
"""A measure of experiments: it takes their common runs and returns one value per run."""


def criteria_of(measures: Sequence[str], disturbance: str) -> set[str]:
    """Return what has to be varied for some measures, with one of `DISTURBANCES` in place of the throttle.

    Raises:
        CurveError: an unknown kind of disturbance.
    """
    if disturbance not in DISTURBANCES:
        raise CurveError(f"Expected disturbance to be one of {', '.join(DISTURBANCES)}, got {disturbance!r}.")
    criteria = (MEASURE_CRITERIA[name] for name in measures)
    return {disturbance if criterion == THROTTLE else criterion for criterion in criteria}


@dataclass(frozen=True, kw_only=True, slots=True)
class ScoreForms:
    """The forms in which measures are scored: every variant with every form that a measure has."""

    variants: tuple[Variant, ...] = ("corrected",)
    """Variants as in docs/metrics.md; a measure that has none of them is scored in the corrected one."""
    forms: tuple[Form, ...] = ("marginal",)
    """For measures that compare two sizes."""
    band: bool = False
    """Whether tables and pictures have the authors' bands, too: mean plus and minus two standard deviations."""

    def __post_init__(self) -> None:
        _check_words("variant", self.variants, get_args(Variant))
        _check_words("form", self.forms, get_args(Form))

    def of(self, measure: str) -> Iterator[tuple[Variant, Form]]:
        """Yield each variant and form of a measure that was asked for, once."""
        has = METRICS[measure].variants
        wanted: list[Variant] = [variant if variant in has else "corrected" for variant in self.variants]
        forms: tuple[Form, ...] = self.forms if "two sizes" in METRICS[measure].needs else ("marginal",)
        for variant in dict.fromkeys(wanted):
            for form in dict.fromkeys(forms):
                yield variant, form


def label_of(measure: str, variant: Variant, form: Form) -> str:
    """Return the name of a measure with what differs from the usual form: "spatial_emergence, interactive, paper"."""
    words = (measure, "interactive" if form == "interactive" else "", "" if variant == "corrected" else variant)
    return ", ".join(word for word in words if word)


def words_of(label: str) -> str:
    """Return a name of `label_of` in words for people: "spatial emergence, against lone robots"."""
    measure, comma, rest = label.partition(",")
    return _WORDS.get(measure, measure).replace("_", " ") + comma + rest.replace("interactive", "against lone robots")


def check_measures(measures: Sequence[str] | None) -> tuple[str, ...]:
    """Return measures in the order of tables, each once; None = all.

    Raises:
        CurveError: an unknown name, or none at all.
    """
    if measures is None:
        return tuple(MEASURE_CRITERIA)
    _check_words("measure", measures, tuple(MEASURE_CRITERIA))
    return tuple(name for name in MEASURE_CRITERIA if name in measures)


def _check_words(what: str, words: Sequence[str], known: Sequence[str]) -> None:
    for word in words:
        if word not in known:
            close = difflib.get_close_matches(word, known, n=1)
            hint = f" Did you mean {close[0]!r}?" if close else ""
            raise CurveError(f"Unknown {what} {word!r}.{hint} Known: {', '.join(known)}.")
    if not words:
        raise CurveError(f"Expected one or more {what}s of {', '.join(known)}, got none.")


def interval(summary: Summary) -> str:
    """Return the bounds of an interval."""
    return limits(summary.lower, summary.upper)


def spread(summary: Summary, *, is_share: bool = False) -> str:
    """Return a mean with half of its interval, to two digits of the latter."""
    factor, unit = (100.0, " %") if is_share else (1.0, "")
    mean, half = factor * summary.mean, factor * (summary.upper - summary.mean)
    if not (math.isfinite(mean) and math.isfinite(half)):
        return number(mean) + (unit if math.isfinite(mean) else "")
    if half <= max(ROUNDING * abs(mean), _NO_AMOUNT):
        return f"{number(0.0 if abs(mean) <= _NO_AMOUNT else mean)} ± 0{unit}"
    decimals = max(0, 1 - math.floor(math.log10(half)))
    mean = round(mean, decimals) + 0.0  # no "-0"
    return f"{mean:.{decimals}f} ± {half:.{decimals}f}{unit}"


def bounds(summary: Summary | None) -> list[float | None] | None:
    """Return mean, lower and upper bound as plain values; None where there is no summary."""
    return None if summary is None else [plain(value) for value in (summary.mean, summary.lower, summary.upper)]


@dataclass(frozen=True, kw_only=True, eq=False)
class Score:
    """One measure at one level of what it varies."""

    measure: str
    """Name in `METRICS`."""
    at: str
    """The level in words: "N = 25 to 50", "throttle 0.4"."""
    criterion: str
    """What is varied."""
    x: float
    """The level as a number: the larger swarm size, or the criterion's value."""
    n_robots: tuple[int, ...]
    """Swarm sizes of the runs that are used, the reference run's included."""
    unit: str
    summary: Summary
    """Mean over seeds with Student's interval."""
    per_seed: Mapping[int, float]
    """Seed -> value of the runs with this seed, one run of each experiment that is used."""
    n_lost: int = 0
    """Runs that failed or have no partner of the same seed."""
    variant: Variant = "corrected"
    form: Form = "marginal"
    is_doubtful: bool = False
    """Whether the value misleads: it weights the time lost with a performance that falls with the size."""
    noise_floor: float | None = None
    """For distances: mean distance between two different reference runs, what a perfect swarm scores by chance."""
    relative_floor: float | None = None
    """The noise floor over the mean performance that relative values are compared with."""
    floor_per_seed: Mapping[int, float] = field(default_factory=dict[int, float])
    """For distances: that of each reference run to the next one, a sample of what the noise floor is the mean of."""
    compared_total: float = math.nan
    """Mean total performance that relative values are compared with; NaN for measures without them."""
    relative_per_seed: Mapping[int, float] = field(default_factory=dict[int, float])
    """For amounts and distances: the values over the total performance that they are compared with, which makes
    policies of different performance comparable; NaN where that performance is zero."""
    of_mean_curves: Summary | None = None
    """For scalability and distances: the measure of the mean curves with a bootstrap interval."""
    mean_curves_per_seed: Mapping[int, float] = field(default_factory=dict[int, float])
    """The same as one number per seed, its pseudo-value, so that it can be tested like a mean; see `pseudo_values`."""
    relative_mean_curves_per_seed: Mapping[int, float] = field(default_factory=dict[int, float])
    """The same of the measure over the total performance that it is compared with."""
    beside: Mapping[str, float] = field(default_factory=dict[str, float])
    """Further numbers to read with the value."""
    note: str = ""
    """What to know before reading the value; empty if nothing."""

    @property
    def higher_is_better(self) -> bool:
        """Direction of the measure."""
        return METRICS[self.measure].higher_is_better

    @property
    def relative(self) -> Summary | None:
        """Mean over runs of `relative_per_seed` with its interval; None for measures that are relative themselves."""
        return aggregate(list(self.relative_per_seed.values())) if self.relative_per_seed else None

    @property
    def band(self) -> tuple[float, float]:
        """Mean minus and plus two standard deviations of single runs, which the paper shades; NaN for one run."""
        mean, std = self.summary.mean, self.summary.std
        return mean - 2.0 * std, mean + 2.0 * std

    @property
    def label(self) -> str:
        """Name of the measure, with its variant and form where they are not the usual ones."""
        return label_of(self.measure, self.variant, self.form)

    @property
    def key(self) -> tuple[str, str, tuple[int, ...]]:
        """What the score is about, the same for all policies."""
        return self.label, self.at, self.n_robots

    def cells(self, *, band: bool = False) -> tuple[str, ...]:
        """Return the score as texts under `HEADER`; with `band`, one more column after the interval."""
        summary = self.summary
        runs = str(summary.n_used) + (f" of {summary.n_used + summary.n_nan + self.n_lost}" if self.is_partial else "")
        enters = bool(self.per_seed) or self.is_partial  # a measure that follows from rates alone uses no runs
        return (
            self.label,
            self.at,
            ", ".join(map(str, self.n_robots)),
            number(summary.mean) + (f" {DOUBTFUL}" if self.is_doubtful else ""),
            interval(summary),
            *([limits(*self.band)] if band else []),
            self.floor_cell(),
            self.relative_cell(),
            runs if enters else "-",
            "higher" if self.higher_is_better else "lower",
            self.unit,
        )

    def floor_cell(self) -> str:
        """Return the noise floor, and in brackets relative to performance; empty for measures without one."""
        if self.noise_floor is None:
            return ""
        return number(self.noise_floor) + ("" if self.relative_floor is None else f" ({percent(self.relative_floor)})")

    def relative_cell(self) -> str:
        """Return the relative value, and in brackets per robot; of a performance its share of the limit; else empty."""
        if self.relative is None:
            return f"{percent(self.beside['of_limit'])} of the limit" if "of_limit" in self.beside else ""
        per_robot = self.beside.get("per_robot")
        return percent(self.relative.mean) + ("" if per_robot is None else f" ({percent(per_robot)} per robot)")

    @property
    def is_partial(self) -> bool:
        """Whether runs are missing from the value."""
        return self.summary.n_nan + self.n_lost > 0

    def to_mapping(self) -> dict[str, Any]:
        """Return the score as plain values; numbers that JSON does not have are None."""
        summary, means, relative = self.summary, self.of_mean_curves, self.relative
        return {
            "measure": self.measure,
            "variant": self.variant,
            "form": self.form,
            "label": self.label,
            "symbol": METRICS[self.measure].symbol,
            "at": self.at,
            "criterion": self.criterion,
            "x": self.x,
            "n_robots": list(self.n_robots),
            "unit": self.unit,
            "higher_is_better": self.higher_is_better,
            "neutral": METRICS[self.measure].neutral,
            "value": plain(summary.mean),
            "std": plain(summary.std),
            "lower": plain(summary.lower),
            "upper": plain(summary.upper),
            "two_sd": [plain(bound) for bound in self.band],
            "doubtful": self.is_doubtful,
            "n_runs": summary.n_used,
            "n_nan": summary.n_nan,
            "n_lost": self.n_lost,
            "noise_floor": plain(self.noise_floor),
            "relative_floor": plain(self.relative_floor),
            "relative": bounds(relative),
            "of_mean_curves": bounds(means),
            "beside": {name: plain(value) for name, value in self.beside.items()},
            "per_seed": {str(seed): plain(value) for seed, value in self.per_seed.items()},
            "note": self.note,
        }


class Uncomputable(Exception):  # noqa: N818 - not an error: the table notes it and continues
    """The curves do not allow this measure; the message says why."""


def score_runs(
    values: Values,
    experiments: Sequence[RunCurves],
    *,
    compared_with: int | None = None,
    floor: float | None = None,
    order_matters: bool = False,
    remark: str = "",
    **told: Any,
) -> Score:
    """Return the score of experiments, with one value per run that all of them have.

    Args:
        values: The measure.
        experiments: Those that are used, the reference first.
        compared_with: Which of them has the total performance that divides relative values; None: no relative values.
        floor: Noise floor, for distances.
        order_matters: Whether to add the measure of the mean curves, which differs from the mean of the measures.
        remark: What to know before reading the value, whatever the runs are.
        told: Fields of `Score` that no run tells: measure, level, unit and others.
    """
    paired = common_runs(*experiments)
    seeds = paired[0].seeds
    n_lost = max(experiment.n_lost + len(experiment.seeds) for experiment in experiments) - len(seeds)
    per_run = np.atleast_1d(np.asarray(values(*paired), dtype=np.float64)) if seeds else np.empty(0)
    relative = relative_floor = None
    mean_total = math.nan
    of_means = pseudo_values(values, paired, compared_with) if order_matters and len(seeds) > 1 else ()
    if compared_with is not None and seeds:
        total = paired[compared_with].performance.sum(axis=-1)
        mean_total = float(total.mean())
        relative_floor = None if floor is None or mean_total == 0.0 else floor / mean_total
        relative = np.divide(per_run, total, out=np.full(len(seeds), math.nan), where=total > 0.0)
    return Score(
        criterion=experiments[-1].criterion,
        n_robots=tuple(dict.fromkeys(experiment.n_robots for experiment in experiments)),
        summary=aggregate(per_run) if seeds else Summary.without_interval(),
        per_seed=dict(zip(seeds, per_run.tolist(), strict=True)),
        relative_per_seed={} if relative is None else dict(zip(seeds, relative.tolist(), strict=True)),
        n_lost=n_lost,
        noise_floor=floor,
        relative_floor=relative_floor,
        compared_total=mean_total,
        of_mean_curves=_of_mean_curves(values, paired) if order_matters and seeds else None,
        **{
            name: dict(zip(seeds, found.tolist(), strict=True))
            for name, found in zip(_OF_MEANS, of_means, strict=False)
        },
        note="; ".join(filter(None, (remark, _note(per_run, n_lost, relative)))),
        **told,
    )


def _of_mean_curves(values: Values, paired: tuple[RunCurves, ...]) -> Summary:
    """The measure of mean performance curves, with runs of each experiment resampled on their own."""

    def of_curves(*curves: FloatArray) -> ArrayLike:
        return values(*(e.averaged(curve) for e, curve in zip(paired, curves, strict=True)))

    performances = [experiment.performance for experiment in paired]
    return bootstrap_measure(of_curves, *performances, order="mean_curve", seed=_BOOTSTRAP_SEED)


_OF_MEANS = ("mean_curves_per_seed", "relative_mean_curves_per_seed")


def pseudo_values(values: Values, paired: tuple[RunCurves, ...], compared_with: int | None) -> Iterator[FloatArray]:
    """Yield the pseudo-values of the measure of mean curves, (R,), and of its shares of performance if it has such.

    With R runs, v of all and v_i without run i they are v + (R - 1) (m - v_i), where m is the mean of all v_i. Their
    mean is v, and they scatter like R independent values of which v is the mean (Miller 1974), on average no less than
    v does (Efron and Stein 1981). The usual ones, R v - (R - 1) v_i, have a mean with less bias. But a distance has
    bends, where curves cross and where its path through time turns, and at these that mean varies several times as much
    as the pseudo-values tell.
    """
    whole = [
        replace(e, curves={name: curve.mean(axis=0, keepdims=True) for name, curve in e.curves.items()}) for e in paired
    ]
    parts = [e.without_each() for e in paired]
    of_all, without = (np.asarray(values(*curves), dtype=np.float64) for curves in (whole, parts))
    yield _pseudo(of_all, without)
    if compared_with is not None:
        totals = [curves[compared_with].performance.sum(axis=-1) for curves in (whole, parts)]
        shares = [
            np.divide(found, total, out=np.full(found.shape, math.nan), where=total > 0.0)
            for found, total in zip((of_all, without), totals, strict=True)
        ]
        yield _pseudo(*shares)


def _pseudo(of_all: FloatArray, without: FloatArray) -> FloatArray:
    with np.errstate(invalid="ignore"):  # infinite without each run
        return of_all + (without.size - 1) * (without.mean() - without)


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
