"""Breakdowns: which runs of a cell end far below the best cell and stay there, how often, and after what time.

A *cell* is one setting of a study with its runs: a policy, a swarm size, a level of a disturbance. Near the critical
size of a swarm its runs are of two kinds: some stay near the best, others jam and do not recover. Their mean describes
no run; the share that broke down and the time until then do.

A run has broken down if its performance, summed over a window of intervals, falls below a share of that of the
reference cell in the same intervals, and stays below in every later window (our choice, for these reasons):

- Half of the reference: far enough from it that no ordinary scatter reaches it, see `window` of `find_breakdowns`.
- The same intervals: at the start of a run no swarm has delivered anything, and that is no breakdown.
- Until the end: a jam that dissolves is interference, and is in the mean already.
"""

import math
from dataclasses import dataclass
from operator import index
from typing import Literal, TypeAlias

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import ArrayLike
from scipy.special import betaincinv, ndtri  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from .checks import CurveError, check_level, check_option
from .curves import FloatArray, as_curve
from .statistics import Estimate

ProportionMethod: TypeAlias = Literal["wilson", "clopper_pearson"]


@dataclass(frozen=True, kw_only=True, eq=False)
class Breakdowns:
    """Which runs of a cell broke down, and when; row i is run i."""

    broken: np.ndarray[tuple[int], np.dtype[np.bool_]]
    """Whether the run broke down, (R,)."""
    time: FloatArray
    """Time of the breakdown, else the end of observation, (R,); NaN for a run that cannot be judged."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Survival:
    """Kaplan and Meier's estimate: the share of runs that have not broken down, over time."""

    times: FloatArray
    """Times at which runs broke down, rising, (K,); the share is 1 before the first and constant between them."""
    surviving: FloatArray
    """Share from each of these times on, (K,)."""
    lower: FloatArray
    """Lower bounds, (K,)."""
    upper: FloatArray
    """Upper bounds, (K,)."""
    median: Estimate
    """Time by which half of the runs broke down; infinite if fewer did while they were observed, and so its bounds."""


def find_breakdowns(
    perf: ArrayLike, reference: ArrayLike, *, window: int = 5, share: float = 0.5, interval_s: float = 1.0
) -> Breakdowns:
    """Find the runs of a cell that broke down, by the rule at the head of this module.

        find_breakdowns([[9, 9, 9, 9, 9, 9], [9, 9, 9, 1, 0, 0]], 10.0, window=2).broken  # [False, True]

    The time is the middle of the first of these windows, which for a sudden end of all deliveries is right within one
    interval; 0 if already the first window of the run is below. Observation ends half a window before the run.

    Args:
        perf: Performance P(N, t) of the cell, shape (R, T) or (T,), objects per interval.
        reference: Performance of the reference cell: the best one if the cells are swarms of critical size or larger,
            the undisturbed one if they are disturbed. Its runs (R', T), whose mean is taken, or one number. A smaller
            swarm than the best delivers less without being broken: compare it with what its size promises.
        window: Number of intervals that are summed. Take enough that the reference delivers 20 objects or more in a
            window: of independent deliveries fewer than half come with a probability of 0.5 % then.
        share: Share of the reference below which a window counts, in (0, 1).
        interval_s: Length of an interval in s; without it, times are in intervals.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length, a reference that never achieves
            anything, or a window that does not fit into the run.
        ValueError: A share outside (0, 1), or an interval that is not positive and finite.
    """
    runs = np.atleast_2d(as_curve("perf", perf))
    best = np.atleast_2d(as_curve("reference", reference))
    n_intervals, width = runs.shape[-1], index(window)
    if runs.ndim != 2 or best.ndim != 2 or best.shape[-1] not in (1, n_intervals):
        raise CurveError(f"Expected runs (R, T) and a reference of the same T, got {runs.shape} and {best.shape}.")
    if not 1 <= width <= n_intervals:
        raise CurveError(f"Expected a window of 1 to {n_intervals} intervals, the length of the run, got {window}.")
    if not 0.0 < share < 1.0:
        raise ValueError(f"Expected a share of the reference in (0, 1), got {share}.")
    if not (math.isfinite(interval_s) and interval_s > 0.0):
        raise ValueError(f"Expected an interval of more than 0 s, got {interval_s}.")
    level = np.broadcast_to(best.mean(axis=0), (n_intervals,))
    if not level.sum() > 0.0:
        raise CurveError("Expected a reference that achieves something, got none, or NaN in one of its runs.")
    achieved = sliding_window_view(runs, width, axis=-1).sum(axis=-1)
    below = achieved < share * sliding_window_view(level, width).sum(axis=-1)
    # Windows below at the end of each run, counted backwards until the first that is not.
    n_last = np.logical_and.accumulate(below[:, ::-1], axis=1).sum(axis=1)
    broken = n_last > 0
    start = below.shape[1] - n_last
    observed = n_intervals - 0.5 * width
    time = np.where(broken, np.where(start == 0, 0.0, start + 0.5 * width), observed) * interval_s
    unknown = np.isnan(runs).any(axis=1)
    return Breakdowns(broken=broken & ~unknown, time=np.where(unknown, math.nan, time))


def breakdown_probability(
    breakdowns: Breakdowns, *, method: ProportionMethod = "wilson", level: float = 0.95
) -> Estimate:
    """Share of the runs of a cell that broke down, with an interval for the probability behind it.

        breakdown_probability(find_breakdowns([[0.0], [9.0], [8.0]], 10.0, window=1)).value  # 1 of 3

    Args:
        breakdowns: Of `find_breakdowns`. Runs that cannot be judged are left out.
        method: `wilson`: holds the level on average over probabilities, narrow also where no run or every run broke
            down. `clopper_pearson`: holds it at every probability, and is wider for it.
        level: Confidence level.

    Raises:
        CurveError: No run that can be judged.
        ValueError: Unknown method, or a level outside (0, 1).

    Source: Wilson 1927; Clopper and Pearson 1934.
    """
    check_option("method", method, ProportionMethod)
    check_level(level)
    broken, _ = _judged(breakdowns)
    n, k = broken.size, int(broken.sum())
    if method == "wilson":
        z = float(ndtri(0.5 + 0.5 * level))
        centre = (k + 0.5 * z * z) / (n + z * z)
        half = z * math.sqrt(k * (n - k) / n + 0.25 * z * z) / (n + z * z)
        lower, upper = centre - half, centre + half
    else:
        tail = 0.5 - 0.5 * level
        lower = float(betaincinv(k, n - k + 1, tail)) if k > 0 else 0.0
        upper = float(betaincinv(k + 1, n - k, 1.0 - tail)) if k < n else 1.0
    # At 0 and n the formula of Wilson gives exactly 0 and 1, up to rounding.
    return Estimate(value=k / n, lower=lower if k else 0.0, upper=upper if k < n else 1.0, n_runs=n)


def time_to_breakdown(breakdowns: Breakdowns, *, level: float = 0.95) -> Survival:
    """Share of the runs of a cell that have not broken down, over time, and the median time to breakdown.

    Runs that did not break down are censored at the end of observation: all that is known is that they would have taken
    longer. Leaving them out would make every breakdown look early.

    Args:
        breakdowns: Of `find_breakdowns`. Runs that cannot be judged are left out.
        level: Confidence level of the bounds, at each time.

    Returns:
        The estimate of Kaplan and Meier, with Greenwood's variance on the scale of log(-log S), which keeps the bounds
        inside [0, 1]. The bounds of the median are the times at which these bounds reach one half.

    Raises:
        CurveError: No run that can be judged.
        ValueError: A level outside (0, 1).

    Source: Kaplan and Meier 1958.
    """
    check_level(level)
    broken, time = _judged(breakdowns)
    times = np.unique(time[broken])
    at_risk: FloatArray = (time >= times[:, None]).sum(axis=1, dtype=np.float64)
    falling: FloatArray = ((time == times[:, None]) & broken).sum(axis=1, dtype=np.float64)
    surviving: FloatArray = np.cumprod(1.0 - falling / at_risk, dtype=np.float64)
    z = float(ndtri(0.5 + 0.5 * level))
    with np.errstate(divide="ignore", invalid="ignore"):  # the last run breaks down: nothing survives
        spread = np.sqrt(np.cumsum(falling / (at_risk * (at_risk - falling)))) / -np.log(surviving)
        lower, upper = (np.where(surviving > 0.0, surviving ** np.exp(sign * z * spread), 0.0) for sign in (1.0, -1.0))
    median = Estimate(
        value=_first_half(times, surviving),
        lower=_first_half(times, lower),
        upper=_first_half(times, upper),
        n_runs=time.size,
    )
    return Survival(times=times, surviving=surviving, lower=lower, upper=upper, median=median)


def _judged(breakdowns: Breakdowns) -> tuple[np.ndarray[tuple[int], np.dtype[np.bool_]], FloatArray]:
    """Return `broken` and `time` of the runs that can be judged."""
    known = ~np.isnan(breakdowns.time)
    if not known.any():
        raise CurveError("Expected at least one run that can be judged, got none; each has a NaN in its curve.")
    return breakdowns.broken[known], breakdowns.time[known]


def _first_half(times: FloatArray, share: FloatArray) -> float:
    """Time at which a falling share reaches one half; infinite if it does not."""
    reached = times[share <= 0.5]
    return float(reached[0]) if reached.size else math.inf
