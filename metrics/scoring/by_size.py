"""Scores of the measures that vary the swarm size: which sizes each compares."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass

from metrics.curves import FloatArray
from metrics.emergence import spatial_emergence, task_emergence
from metrics.interference import performance_lost
from metrics.scaling import efficiency, raw_performance, scalability

from .columns import SIZE
from .draft import ScoreDraft, Uncomputable, Values
from .studies import RunCurves, StudyCurves
from .table import Score


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
    """Computes it. Arguments: the runs of one robot if `from_one`, of the next smaller swarm if `of_neighbours`, and of
    the swarm itself."""
    unit: str
    """Unit of the value; {span} stands for the length of a run."""
    from_one: bool = False
    of_neighbours: bool = False
    needs_interference: bool = False
    is_gain: bool = False
    """Whether the value is an amount of performance, which is also given relative to that of the swarm."""
    order_matters: bool = False
    """As in `ScoreDraft.score`."""


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


def _size_scores(name: str, study: StudyCurves) -> Iterator[Score]:
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
        yield ScoreDraft(
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


BY_SIZE: dict[str, Callable[[str, StudyCurves], Iterator[Score]]] = dict.fromkeys(_SIZE_MEASURES, _size_scores)
"""Measure -> what computes its scores."""
