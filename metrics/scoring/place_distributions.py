"""What a mean hides: how the runs of each condition of a study spread, and how many of them broke down.

Near its critical size a swarm has two phases, near the best or broken down, and the mean of both describes no run.
"""

import math
from typing import TYPE_CHECKING, Any

from ..breakdown import breakdown_probability, find_breakdowns, time_to_breakdown
from ..checks import CurveError
from ..curves import FloatArray
from ..distributions import interquartile_mean
from .columns import SIZE
from .studies import RunCurves
from .study_tables import StudyLine, study_lines

if TYPE_CHECKING:
    import polars as pl

    from swarm_forage_env.studies.study_table import StudyTable

ENOUGH = 20.0
"""What the reference must achieve in a window: with fewer objects, breakdowns are chance (`find_breakdowns`)."""
LEAST_WINDOW = 5
"""Intervals: deliveries come in bursts, and a single poor interval at the end of a run is no breakdown."""
_SEED = 1
"""Fixed, so that the same runs give the same table."""


def place_distributions(table: "StudyTable") -> "pl.DataFrame":
    """Return one row per condition of a study: spread of its runs, breakdown probability and time to breakdown.

    Performance is summed over a run where it is a total, else its mean. Breakdowns are judged against the best swarm
    where sizes vary, in conditions of that size or larger, and else against the reference of the study; where there is
    none, or it achieves less than `ENOUGH` in half of a run, they are empty.

    Args:
        table: From `swarm_forage_env.read_study`.

    Returns:
        Columns: the place of the condition; `n_runs`; `mean`, `lowest`, `highest`; `interquartile_mean` with its 95 %
        interval `iqm_lower`, `iqm_upper`; `broken`, the probability of a breakdown, with Wilson's interval
        `broken_lower`, `broken_upper`; `half_broken_s`, the time by which half of the runs broke down, infinite where
        fewer did. Empty where nothing can be said.
    """
    import polars as pl

    rows: list[dict[str, Any]] = []
    for line in study_lines(table):
        for at, (place, runs) in enumerate(zip(line.places, line.curves.experiments, strict=True)):
            values = dict(zip((axis.name for axis in table.spec.axes), place.values, strict=True))
            where = {"rules": line.rules, "policy": line.policy, **values}
            reference = _reference(table, line, at)
            rows.append({**where, **_spread(line, runs), **_breakdowns(table, line, runs, reference)})
    return pl.DataFrame(rows, infer_schema_length=None).fill_nan(None)


def _totals(line: StudyLine, runs: RunCurves) -> FloatArray:
    return runs.performance.sum(axis=-1) if line.curves.is_total else runs.performance.mean(axis=-1)


def _spread(line: StudyLine, runs: RunCurves) -> dict[str, float | int]:
    """Numbers about the runs of a condition."""
    names = ("mean", "lowest", "highest", "interquartile_mean", "iqm_lower", "iqm_upper")
    if not runs.seeds:
        return {"n_runs": 0, **dict.fromkeys(names, math.nan)}
    totals = _totals(line, runs)
    middle = interquartile_mean(totals, seed=_SEED)
    numbers = (totals.mean(), totals.min(), totals.max(), middle.value, middle.lower, middle.upper)
    return {"n_runs": len(runs.seeds), **dict(zip(names, map(float, numbers), strict=True))}


def _reference(table: "StudyTable", line: StudyLine, at: int) -> RunCurves | None:
    """The runs that those of a condition are held against; None if they cannot have broken down, or nobody can tell."""
    experiments, place = line.curves.experiments, line.places[at]
    if table.spec.axes and table.spec.axes[-1].name == SIZE:
        known = [runs for runs in experiments if runs.seeds]
        best = max(known, key=lambda runs: float(_totals(line, runs).mean()), default=None)
        return best if best is not None and experiments[at].n_robots >= best.n_robots else None
    reference = table.spec.reference_of(place)
    return None if reference is None else experiments[line.places.index(reference)]


def _breakdowns(table: "StudyTable", line: StudyLine, runs: RunCurves, reference: RunCurves | None) -> dict[str, float]:
    if reference is None or not runs.seeds or not reference.seeds:
        return _numbers(math.nan, math.nan, math.nan, math.nan)
    level = reference.performance.mean(axis=0)
    half = max(1, level.size // 2)
    # Deliveries grow in the course of a run or fade: the window must hold enough where there is least, but the start.
    per_interval = float(level[-half:].mean()) if line.curves.is_total else ENOUGH
    window = max(LEAST_WINDOW, math.ceil(ENOUGH / per_interval)) if per_interval > 0.0 else math.inf  # NaN: no window
    if window > half:
        return _numbers(math.nan, math.nan, math.nan, math.nan)
    try:
        found = find_breakdowns(
            runs.performance, reference.performance, window=int(window), interval_s=table.spec.interval_s
        )
        share, time = breakdown_probability(found), time_to_breakdown(found).median.value
    except CurveError:  # NaN in all runs: nothing can be judged
        return _numbers(math.nan, math.nan, math.nan, math.nan)
    return _numbers(share.value, share.lower, share.upper, time)


def _numbers(share: float, lower: float, upper: float, half_s: float) -> dict[str, float]:
    return {"broken": share, "broken_lower": lower, "broken_upper": upper, "half_broken_s": half_s}
