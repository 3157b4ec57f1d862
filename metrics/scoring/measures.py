"""Scores of all measures that curves allow. Those that vary the swarm size are here: which sizes each compares."""

import re
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import partial

from swarm_forage_env.wrappers.world import SIZE

from ..catalog import METRICS
from ..curves import FloatArray, Form, Variant
from ..emergence import interference_gain, spatial_emergence, task_emergence, time_emergence, undisturbed_gain
from ..interference import performance_lost
from ..scaling import efficiency, raw_performance, scalability
from .by_adversity import BY_ADVERSITY
from .run_curves import RunCurves, StudyCurves, common_runs
from .scores import Score, ScoreForms, Uncomputable, Values, check_measures, label_of, score_runs

FALLING = (
    "performance is lower than that of the next smaller swarm, and it weights the time lost, so that a collapse counts "
    "as organisation; read time_emergence beside it"
)
"""Note of a doubtful score: see erratum 16 in docs/errata.md."""
UPSIDE_DOWN = (
    "this form of scalability is minus the speedup times the corrected one, so it reverses the order of swarms"
)
_OVER_A_RUN = re.compile(r"(per run|in [\d,]+ s)$")
"""End of a unit of what is summed over a run."""
SHARES = "share of performance"
"""Unit of amounts that are divided by performance."""
_NO_SUM = "this performance is no sum over robots, and the measure compares with growth in proportion to them"
_OTHER_SWARMS = {"one robot", "two sizes", "rates", "robots at work"}
"""Input of measures that know how many robots made a performance, and expect it of as many others."""


def _raw_performance(runs: RunCurves) -> FloatArray:
    return raw_performance(runs.performance, reduce="sum")


def _efficiency(runs: RunCurves) -> FloatArray:
    return efficiency(runs.performance, runs.n_robots, reduce="sum")


def _t_lost_fraction(runs: RunCurves) -> FloatArray:
    return runs.interference.mean(axis=-1)


def _performance_lost(one: RunCurves, runs: RunCurves) -> FloatArray:
    lost = performance_lost(runs.performance, runs.interference, runs.n_robots, one.performance, one.interference)
    return lost.sum(axis=-1)


def _spatial_emergence(*swarms: RunCurves, variant: Variant) -> FloatArray:
    """Of one robot, the smaller and the larger swarm; without the first where there is no run of one robot."""
    one = swarms[0] if len(swarms) == 3 else None
    few, many = swarms[-2:]
    return spatial_emergence(
        few.performance,
        few.interference,
        few.n_robots,
        many.performance,
        many.interference,
        many.n_robots,
        None if one is None else one.performance,
        None if one is None else one.interference,
        variant=variant,
    )


def _time_emergence(few: RunCurves, many: RunCurves) -> FloatArray:
    return time_emergence(few.interference, few.n_robots, many.interference, many.n_robots)


def _task_emergence(few: RunCurves, many: RunCurves) -> FloatArray:
    return task_emergence(few.performance, few.n_robots, many.performance, many.n_robots)


def _gain(few: RunCurves, many: RunCurves, *, formula: Callable[..., FloatArray]) -> FloatArray:
    return formula(few.performance, few.interference, few.n_robots, many.performance, many.interference, many.n_robots)


def _scalability(few: RunCurves, many: RunCurves, *, variant: Variant) -> FloatArray:
    return scalability(few.performance, few.n_robots, many.performance, many.n_robots, variant=variant)


_LOST = ("interference_fraction",)


@dataclass(frozen=True, kw_only=True)
class _SizeMeasure:
    """How a measure of swarm sizes is applied."""

    values: Values
    """Computes it. Arguments: the runs of one robot if `from_one`, of the smaller swarm if `of_two_sizes`, and of the
    swarm itself; `variant` if the measure has more than one."""
    unit: str
    """Unit of the value; {span} stands for the length of a run."""
    from_one: bool = False
    one_drops_out: bool = False
    """Whether the marginal form has the run of one robot on both sides of a difference, and can do without it."""
    of_two_sizes: bool = False
    columns: tuple[str, ...] = ()
    """Columns that it needs besides the performance."""
    is_gain: bool = False
    """Whether the value is an amount of performance, which is also given relative to that of the swarm."""
    is_part: bool = False
    """Whether it is task emergence or a part of it, which is also given per robot."""
    weighted_in: tuple[Variant, ...] = ()
    """Variants that weight the time lost with the performance achieved, which misleads where performance falls."""
    order_matters: bool = False
    """As in `score_runs`."""


BY_SIZE: dict[str, _SizeMeasure] = {
    "raw_performance": _SizeMeasure(values=_raw_performance, unit="objects {span}"),
    "efficiency": _SizeMeasure(values=_efficiency, unit="objects per robot {span}"),
    "t_lost_fraction": _SizeMeasure(values=_t_lost_fraction, unit="share of robot time", columns=_LOST),
    "performance_lost": _SizeMeasure(
        values=_performance_lost,
        unit="objects {span}",
        from_one=True,
        columns=_LOST,
        is_gain=True,
        weighted_in=("corrected", "paper"),
    ),
    "spatial_emergence": _SizeMeasure(
        values=_spatial_emergence,
        unit="objects {span}",
        from_one=True,
        one_drops_out=True,
        of_two_sizes=True,
        columns=_LOST,
        is_gain=True,
        weighted_in=("corrected", "paper"),
    ),
    "time_emergence": _SizeMeasure(values=_time_emergence, unit="robots", of_two_sizes=True, columns=_LOST),
    "task_emergence": _SizeMeasure(
        values=_task_emergence, unit="objects {span}", of_two_sizes=True, is_gain=True, is_part=True
    ),
    "interference_gain": _SizeMeasure(
        values=partial(_gain, formula=interference_gain),
        unit="objects {span}",
        of_two_sizes=True,
        columns=_LOST,
        is_gain=True,
        is_part=True,
    ),
    "undisturbed_gain": _SizeMeasure(
        values=partial(_gain, formula=undisturbed_gain),
        unit="objects {span}",
        of_two_sizes=True,
        columns=_LOST,
        is_gain=True,
        is_part=True,
    ),
    "scalability": _SizeMeasure(values=_scalability, unit="1 = linear", of_two_sizes=True, order_matters=True),
}
"""Measure of swarm sizes -> how it is applied."""


def _size_scores(name: str, study: StudyCurves, variant: Variant, form: Form) -> Iterator[Score]:
    measure = BY_SIZE[name]
    values = partial(measure.values, variant=variant) if len(METRICS[name].variants) > 1 else measure.values
    sizes = _sizes(study, measure, form)
    one = sizes[0]
    for previous, larger in zip((None, *sizes), sizes, strict=False):
        if previous is None and (measure.from_one or measure.of_two_sizes):
            continue  # the first size has nothing to be compared with
        experiments = (larger,)
        at = f"N = {larger.n_robots}"
        if measure.of_two_sizes and previous is not None:
            smaller = one if form == "interactive" else previous
            experiments = (smaller, larger)
            at = f"N = {smaller.n_robots} to {larger.n_robots}"
        if measure.from_one and not _without_one(measure, one, form):
            experiments = (one, *experiments)
        falls = variant in measure.weighted_in and previous is not None and _falls(previous, larger)
        score = score_runs(
            values,
            experiments,
            measure=name,
            variant=variant,
            form=form,
            at=at,
            x=larger.n_robots,
            unit=_unit(name, study, variant),
            compared_with=len(experiments) - 1 if measure.is_gain else None,
            is_doubtful=falls,
            remark=FALLING if falls else UPSIDE_DOWN if name == "scalability" and variant != "corrected" else "",
            order_matters=measure.order_matters,
        )
        yield _per_robot(score, *experiments) if measure.is_part and variant == "corrected" else score


def _unit(name: str, study: StudyCurves, variant: Variant) -> str:
    measure = BY_SIZE[name]
    if name == "scalability" and variant == "paper":
        return "printed form, summed over intervals"
    return measure.unit.format(span="per run" if study.horizon_s is None else f"in {study.horizon_s:,.0f} s")


def _falls(previous: RunCurves, larger: RunCurves) -> bool:
    """Whether the mean performance is lower than that of the next smaller swarm."""
    few, many = common_runs(previous, larger)
    return bool(few.seeds) and float(many.performance.sum()) < float(few.performance.sum())


def _per_robot(score: Score, smaller: RunCurves, larger: RunCurves) -> Score:
    """Return the score with what it is per robot: its share of the performance of N2 robots as good as each of N1."""
    few, _ = common_runs(smaller, larger)
    proportional = larger.n_robots / smaller.n_robots * float(few.performance.sum()) if few.seeds else 0.0
    if proportional == 0.0:
        return score
    total = sum(score.per_seed.values())
    return replace(score, beside={"per_robot": total / proportional})


def _sizes(study: StudyCurves, measure: _SizeMeasure, form: Form) -> tuple[RunCurves, ...]:
    sizes = study.sizes()
    if not sizes:
        raise Uncomputable(f"there are no runs with criterion {SIZE}")
    smallest = sizes[0].n_robots
    absent = [name for name in measure.columns if any(name not in e.curves and e.seeds for e in sizes)]
    if absent:
        raise Uncomputable(f"there is no column {', '.join(absent)} for every swarm size")
    with_runs = [e for e in sizes if e.seeds]
    if "n_caches" in measure.columns and with_runs and not any(e.curves["n_caches"].any() for e in with_runs):
        raise Uncomputable("there is no cache in any run")
    needs_one = (measure.from_one or form == "interactive") and not _without_one(measure, sizes[0], form)
    if needs_one and smallest != 1:
        raise Uncomputable(f"there is no reference run of one robot, the smallest swarm has {smallest}")
    if len(sizes) < 2 and (measure.from_one or measure.of_two_sizes):
        raise Uncomputable(f"there is one swarm size only, N = {smallest}")
    return sizes


def _without_one(measure: _SizeMeasure, smallest: RunCurves, form: Form) -> bool:
    """Whether a measure is computed without a run of one robot: there is none, and it drops out."""
    return measure.one_drops_out and smallest.n_robots != 1 and form == "marginal"


_SCORES: dict[str, Callable[[str, StudyCurves, Variant, Form], Iterator[Score]]] = {
    **dict.fromkeys(BY_SIZE, _size_scores),
    **BY_ADVERSITY,
}
"""Measure -> what computes its scores, in one variant and form."""


def score_study(
    study: StudyCurves, measures: Sequence[str] | None = None, forms: ScoreForms | None = None
) -> tuple[tuple[Score, ...], dict[str, str]]:
    """Compute the scores of all measures that the curves of a study allow.

    Args:
        study: Curves of one policy.
        measures: Names out of `MEASURE_CRITERIA`; default all.
        forms: Variants and forms; default the corrected marginal one.

    Returns:
        The scores, and for each measure (in a form of it) that could not be computed the reason.

    Raises:
        CurveError: an unknown measure, or curves that a measure refuses.
    """
    scores: list[Score] = []
    missing: dict[str, str] = {}
    for measure in check_measures(measures):
        for variant, form in (forms or ScoreForms()).of(measure):
            try:
                scores += list(_SCORES[measure](measure, study, variant, form))
            except Uncomputable as reason:
                missing[label_of(measure, variant, form)] = str(reason)
    return tuple(_told(score, study) for score in scores), missing


def _told(score: Score, study: StudyCurves) -> Score:
    """Return the score in the unit of the performance, with a note if the measure expects another kind.

    Measures write units for deliveries, "objects in 4,000 s". With robots carrying, a mean over each interval, it is
    "robots summed over intervals".
    """
    unit = score.unit.replace("objects", study.read_as.amount)
    if not study.read_as.is_total:
        unit = _OVER_A_RUN.sub("summed over intervals", unit)
    note = score.note
    if not study.read_as.adds_up and _is_in_proportion(score.measure):
        note = f"{note}; {_NO_SUM}" if note else _NO_SUM
    return replace(score, unit=unit, note=note)


def _is_in_proportion(measure: str) -> bool:
    """Whether a measure compares with performance in proportion to the robots: of other sizes, at work, or each."""
    needs = METRICS[measure].needs
    return measure == "efficiency" or ("performance" in needs and not _OTHER_SWARMS.isdisjoint(needs))
