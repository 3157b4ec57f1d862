"""Emergent self-organisation: does a swarm do better than its size explains? Eqs. (2) and (3)."""

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_option, check_sizes
from .curves import (
    FloatArray,
    Reduction,
    Variant,
    as_curves,
    as_interference,
    per_performance,
    reduce_intervals,
)
from .interference import performance_lost


def spatial_emergence(
    perf1: ArrayLike,
    t_lost1: ArrayLike,
    n1: int,
    perf2: ArrayLike,
    t_lost2: ArrayLike,
    n2: int,
    perf_one: ArrayLike | None,
    t_lost_one: ArrayLike | None,
    *,
    variant: Variant = "corrected",
    reduce: Reduction = "sum",
) -> FloatArray:
    """Spatial self-organisation E_S(N1, N2), Eq. (2): positive if the loss grows less than in proportion to the size.

        E_S = sum_t [ (N2 / N1) P_lost(N1, t) - P_lost(N2, t) ]

    The paper's figures use neighbouring sizes (marginal form) or N independent robots (interactive form: n1 = 1, with
    the one-robot curves in both places).

    For N1 > 1, the loss of one robot cancels: P_lost(N1) contains N1 P_lost(1), P_lost(N2) contains N2 P_lost(1), and
    (N2 / N1) N1 - N2 = 0. So E_S = sum_t [ (N2 / N1) P(N1, t) t_lost(N1, t) - P(N2, t) t_lost(N2, t) ], and a run of
    one robot is not needed.

    Args:
        perf1: P(N1, t), shape (..., T), objects per interval; `perf2` for the larger swarm.
        t_lost1: Interference fraction of the smaller swarm, shape (..., T); `t_lost2` for the larger.
        n1: Smaller size N1.
        perf2: P(N2, t).
        t_lost2: Interference fraction of the larger swarm.
        n2: Larger size N2.
        perf_one: P(1, t) of one robot alone. It may be None if N1 > 1.
        t_lost_one: Interference fraction of one robot alone, or None as well.
        variant: `paper` is the equation as printed. `corrected` sets P_lost(1) to zero if N1 = 1, because this is the
            loss to walls, which P_lost(N > 1) leaves out; otherwise independent robots would seem organised.
        reduce: `sum` as in the paper, `mean` or `last`.

    Returns:
        E_S, shape (...,), in the unit of `perf`. Higher is better.

    Raises:
        CurveError: As in `performance_lost`, or n1 >= n2.
        ValueError: Unknown variant or reduction.

    The paper introduces this equation as the task-based measure, but means the spatial one.

    E_S weights the time lost with performance. If performance falls from N1 to N2, the weight falls too, and E_S can be
    positive although robots lose more time. So look at `time_emergence`, too.
    """
    n1, n2 = check_sizes(n1, n2)
    if perf_one is None and t_lost_one is None and n1 > 1:
        perf_one = t_lost_one = np.zeros(np.shape(perf1)[-1:])  # their terms cancel, whatever they are
    inputs = as_curves(
        perf1=perf1, t_lost1=t_lost1, perf2=perf2, t_lost2=t_lost2, perf_one=perf_one, t_lost_one=t_lost_one
    )
    perf1, t_lost1, perf2, t_lost2, perf_one, t_lost_one = inputs
    check_option("variant", variant, Variant)
    lost1 = performance_lost(perf1, t_lost1, n1, perf_one, t_lost_one)
    lost2 = performance_lost(perf2, t_lost2, n2, perf_one, t_lost_one)
    if variant == "corrected" and n1 == 1:
        lost1 = 0.0 * lost1
    return reduce_intervals(n2 / n1 * lost1 - lost2, reduce, *inputs)


def time_emergence(
    t_lost1: ArrayLike, n1: int, t_lost2: ArrayLike, n2: int, *, reduce: Reduction = "mean"
) -> FloatArray:
    """Spatial self-organisation in robot time, E_R(N1, N2): positive if each robot of the larger swarm loses less time.

        W(N, t) = N t_lost(N, t)                    robots' worth of time lost at N
        E_R = mean_t [ (N2 / N1) W(N1, t) - W(N2, t) ] = N2 mean_t [ t_lost(N1, t) - t_lost(N2, t) ]

    Example: 2 robots deliver 8 objects and lose 0.2 of their time, 4 robots deliver 1.6 objects and lose 0.6. E_R = 4
    (0.2 - 0.6) = -1.6: avoidance costs 1.6 robots more than in two swarms of 2. E_S is +2.24 (without walls), because
    Eq. (2) weights the time lost with performance: a swarm that delivers nothing loses nothing, so E_S takes a collapse
    for organisation. E_R is Eq. (2) with time in place of performance.

    Time lost to walls, t_lost(1), is the same in both terms and cancels. So a run of one robot is not needed, and N1 =
    1 is not an exception. Robots that do not affect each other score 0 at every pair of sizes. This measure is ours.

    Args:
        t_lost1: Interference fraction of the smaller swarm, shape (..., T).
        n1: Smaller size N1.
        t_lost2: Interference fraction of the larger swarm, same intervals.
        n2: Larger size N2.
        reduce: `mean` over the run or `last` interval, both in robots, or `sum`, in robots times intervals.

    Returns:
        E_R, shape (...,), in robots, from -N2 to N2. Higher is better.

    Raises:
        CurveError: Fractions are missing, outside [0, 1] or of different length, or n1 >= n2.
        ValueError: Unknown reduction.
    """
    n1, n2 = check_sizes(n1, n2)
    t_lost1, t_lost2 = as_interference(t_lost1=t_lost1, t_lost2=t_lost2)
    return reduce_intervals(n2 * (t_lost1 - t_lost2), reduce, t_lost1, t_lost2)


def task_emergence(
    perf1: ArrayLike, n1: int, perf2: ArrayLike, n2: int, *, reduce: Reduction = "sum", relative: bool = False
) -> FloatArray:
    """Task-based self-organisation E_T(N1, N2), Eq. (3): performance beyond growth in proportion to the size.

        E_T = sum_t [ P(N2, t) - (N2 / N1) P(N1, t) ]

    Zero for linear speedup, positive for superlinear. The printed equation is correct; the authors' program took the
    last interval (reduce="last") instead of the sum. Their marginal form uses neighbouring sizes, the interactive form
    n1 = 1.

    Args:
        perf1: P(N1, t), shape (..., T), objects per interval.
        n1: Smaller size N1.
        perf2: P(N2, t), same intervals.
        n2: Larger size N2.
        reduce: `sum` as in the paper, `mean` or `last`.
        relative: Divide by the likewise reduced P(N2, t), which makes algorithms of different performance comparable
            (our addition; NaN or -inf where P(N2) is zero).

    Returns:
        E_T, shape (...,), in the unit of `perf1`; a pure number if relative. Higher is better.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length, or n1 >= n2.
        ValueError: Unknown reduction.
    """
    n1, n2 = check_sizes(n1, n2)
    perf1, perf2 = as_curves(perf1=perf1, perf2=perf2)
    gain = reduce_intervals(perf2 - n2 / n1 * perf1, reduce, perf1, perf2)
    return per_performance(gain, perf2, reduce) if relative else gain


def interference_gain(
    perf1: ArrayLike,
    t_lost1: ArrayLike,
    n1: int,
    perf2: ArrayLike,
    t_lost2: ArrayLike,
    n2: int,
    *,
    relative: bool = False,
) -> FloatArray:
    """Part of task emergence that comes from interference, E_I(N1, N2): negative if robots lose a larger share of time.

    N robots deliver P objects in a run, lose the share f of their time, and spend (1 - f) of it undisturbed. A robot
    that is undisturbed for a whole run would deliver u = P / (N (1 - f)) objects, so each robot delivers P / N = (1 -
    f) u. Task emergence is N2 times the change of this product, and splits into two parts without a rest:

        E_T = N2 [ (1 - f2) u2 - (1 - f1) u1 ] = E_I + E_U
        E_I = N2 (f1 - f2) (u1 + u2) / 2                 time lost, at the mean rate of undisturbed robots
        E_U = N2 (u2 - u1) (1 - (f1 + f2) / 2)           `undisturbed_gain`

    Each change is weighted with the mean of the other factor over both sizes, so that neither size is preferred
    (Shapley's value of two factors; our choice). Example: 2 robots deliver 8 objects and lose 0.2 of their time, 4
    robots deliver 1.6 objects and lose 0.6. Then u1 = 5, u2 = 1, E_T = -14.4, E_I = -4.8 and E_U = -9.6: avoidance
    explains a third of the loss.

    P and f are the sum and the mean over all intervals of a run, so intervals without performance or without
    undisturbed time are not exceptions. Time in which robots avoid walls is time lost, too. It is the same at both
    sizes, unless robots of larger swarms come closer to walls. This measure is ours.

    Args:
        perf1: P(N1, t), shape (..., T), objects per interval.
        t_lost1: Interference fraction of the smaller swarm, shape (..., T).
        n1: Smaller size N1.
        perf2: P(N2, t), same intervals.
        t_lost2: Interference fraction of the larger swarm.
        n2: Larger size N2.
        relative: Divide by the summed P(N2), as in `task_emergence`.

    Returns:
        E_I, shape (...,), in the unit of `perf1`; a pure number if relative; NaN where a swarm is never undisturbed.
        Higher is better.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length, a fraction above 1, or n1 >= n2.
    """
    f1, u1, f2, u2, total2 = _undisturbed(perf1, t_lost1, n1, perf2, t_lost2, n2)
    gain = n2 * (f1 - f2) * 0.5 * (u1 + u2)
    return per_performance(gain, total2) if relative else gain


def undisturbed_gain(
    perf1: ArrayLike,
    t_lost1: ArrayLike,
    n1: int,
    perf2: ArrayLike,
    t_lost2: ArrayLike,
    n2: int,
    *,
    relative: bool = False,
) -> FloatArray:
    """Part of task emergence that interference does not explain, E_U(N1, N2): what undisturbed robots achieve.

        E_U = N2 (u2 - u1) (1 - (f1 + f2) / 2),        E_T = E_I + E_U

    with u and f as in `interference_gain`, which derives the split. E_U is negative if undisturbed robots of the larger
    swarm achieve less, for example because objects are scarce or others carry them, because searches take longer, or
    because robots wait. It is positive if robots help each other. This measure is ours.

    Arguments, shapes, results and errors as in `interference_gain`.
    """
    f1, u1, f2, u2, total2 = _undisturbed(perf1, t_lost1, n1, perf2, t_lost2, n2)
    gain = n2 * (u2 - u1) * (1.0 - 0.5 * (f1 + f2))
    return per_performance(gain, total2) if relative else gain


def _undisturbed(
    perf1: ArrayLike, t_lost1: ArrayLike, n1: int, perf2: ArrayLike, t_lost2: ArrayLike, n2: int
) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray, FloatArray]:
    """Return f1, u1, f2, u2, each (...,), and the summed performance of the larger swarm, (..., 1)."""
    n1, n2 = check_sizes(n1, n2)
    perf1, t_lost1, perf2, t_lost2 = as_curves(perf1=perf1, t_lost1=t_lost1, perf2=perf2, t_lost2=t_lost2)
    as_interference(t_lost1=t_lost1, t_lost2=t_lost2)
    f1, f2 = t_lost1.mean(axis=-1), t_lost2.mean(axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        u1, u2 = (
            np.where(f < 1.0, perf.sum(axis=-1) / (n * (1.0 - f)), np.nan)
            for perf, n, f in ((perf1, n1, f1), (perf2, n2, f2))
        )
    return f1, u1, f2, u2, perf2.sum(axis=-1, keepdims=True)
