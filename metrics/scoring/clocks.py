"""Runs of other simulators and of real robots on one clock: deliveries binned, curves cut or resampled."""

from collections.abc import Mapping
from typing import TypeAlias

import numpy as np

from swarm_forage_env._internal.wording import counted

from ..checks import CurveError
from ..curves import FloatArray
from .run_curves import HANDLING, THROTTLE

TIME, END = "time_s", "t_end_s"
"""Columns: when a delivery was, and where an interval ends."""
MOST_INTERVALS = 1_000_000
"""Most intervals of a run of deliveries; our choice: some measures need a table of so many by so many."""
_AT_THE_END = (THROTTLE, HANDLING)
"""Columns of values at the end of an interval; others hold means, and performance totals, over the interval."""
_NEAR = 1e-9
"""Relative difference of times that are the same."""

RunKey: TypeAlias = tuple[str, str, float, int, int]
"""Policy, criterion, its value, number of robots, seed."""
Runs: TypeAlias = Mapping[RunKey, Mapping[str, FloatArray]]
"""Run -> column -> its values, (T,) each: in intervals that end at `END`, where that is known, or of deliveries."""


def binned(runs: Runs, interval_s: float, where: str) -> tuple[Runs, FloatArray, str]:
    """Add up the deliveries in each interval.

    Returns:
        The runs, all as long as the latest delivery tells, the ends of the intervals, and what was done.

    Raises:
        CurveError: there would be too many intervals.
    """
    latest = max(float(run[TIME].max()) for run in runs.values())
    n_intervals = max(1, int(np.ceil(latest / interval_s * (1.0 - _NEAR))))
    if n_intervals > MOST_INTERVALS:
        raise CurveError(
            f"Expected times from the start of each run in {where}, got {latest:g} s, which would be {n_intervals:,} "
            f"intervals of {interval_s:g} s."
        )
    clock = interval_s * np.arange(1.0, n_intervals + 1.0)
    found: dict[RunKey, dict[str, FloatArray]] = {}
    for key, run in runs.items():
        places = np.minimum((run[TIME] / interval_s).astype(np.intp), n_intervals - 1)
        delivered = np.bincount(places, run["performance"], n_intervals).astype(np.float64)
        found[key] = {"performance": delivered, END: clock}
    note = (
        f"deliveries are counted in {counted(n_intervals, 'interval')} of {interval_s:g} s; all runs are taken to last "
        f"{clock[-1]:g} s, as the latest delivery tells"
    )
    return found, clock, note


def on_one_clock(
    runs: Runs, interval_s: float | None, *, is_total: bool, where: str
) -> tuple[Runs, FloatArray | None, str]:
    """Cut runs to the shortest, and resample them where their intervals differ.

    Args:
        runs: As they were given; all with ends of intervals, or none.
        interval_s: Length of the intervals that all get; None = those of the shortest run if all have the same, else
            the longest that a run has.
        is_total: Whether performance is a total over its interval; totals are kept in sum, others in mean over time.
        where: Name of the table in messages.

    Returns:
        The runs, the ends of the intervals if they are known, and what was done, empty if nothing was.

    Raises:
        CurveError: the shortest run has no whole interval.
    """
    lengths = [len(run["performance"]) for run in runs.values()]
    least, most = min(lengths), max(lengths)
    note = f"runs have from {least} to {most} intervals and are cut to the first {least}" if least < most else ""
    ends = [run[END] for run in runs.values() if END in run]
    if not ends:
        clock = None if interval_s is None else interval_s * np.arange(1.0, least + 1.0)
        return _cut(runs, least, clock), clock, note
    clock = min(ends, key=len)
    steps = [float(np.median(np.diff(each, prepend=0.0))) for each in ends]
    if interval_s is not None or not all(_begins_with(each, clock) for each in ends):
        step = max(steps) if interval_s is None else interval_s
        shortest = min(float(each[-1]) for each in ends)
        clock = step * np.arange(1.0, np.floor(shortest / step * (1.0 + _NEAR)) + 1.0)
        if not len(clock):
            raise CurveError(
                f"Expected an interval of at most {shortest:g} s, the shortest run of {where}, got {step:g} s."
            )
    if all(_begins_with(each, clock) for each in ends):
        return _cut(runs, len(clock), clock), clock, note
    kept = "totals of performance are kept" if is_total else "performance is a mean over time"
    note = (
        f"runs with intervals of {min(steps):g} to {max(steps):g} s are resampled to {counted(len(clock), 'interval')} "
        f"of {clock[0]:g} s: {kept}"
    )
    return {key: _resampled(run, clock, is_total=is_total) for key, run in runs.items()}, clock, note


def _begins_with(ends_s: FloatArray, clock: FloatArray) -> bool:
    return len(ends_s) >= len(clock) and np.allclose(ends_s[: len(clock)], clock, rtol=_NEAR, atol=0.0)


def _cut(runs: Runs, n_intervals: int, clock: FloatArray | None) -> Runs:
    ends = {} if clock is None else {END: clock}
    return {key: {name: curve[:n_intervals] for name, curve in run.items()} | ends for key, run in runs.items()}


def _resampled(run: Mapping[str, FloatArray], clock: FloatArray, *, is_total: bool) -> dict[str, FloatArray]:
    """Return a run on another clock, which ends no later than the run."""
    ends, edges = np.concatenate(([0.0], run[END])), np.concatenate(([0.0], clock))
    curves: dict[str, FloatArray] = {}
    for name, curve in run.items():
        if name in _AT_THE_END:
            curves[name] = curve[np.searchsorted(run[END], clock * (1.0 - _NEAR))]
            continue
        is_sum = is_total and name == "performance"
        sums = np.concatenate(([0.0], np.cumsum(curve if is_sum else curve * np.diff(ends))))
        parts = np.diff(np.interp(edges, ends, sums))
        # A difference of sums can be off by a rounding error, and no mean lies outside of its values.
        curves[name] = np.maximum(parts, 0.0) if is_sum else np.clip(parts / np.diff(edges), curve.min(), curve.max())
    return {**curves, END: clock}
