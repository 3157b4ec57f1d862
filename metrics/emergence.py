"""Emergent self-organisation: does the swarm do better than its size alone explains? Eqs. (2) and (3)."""

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_option, check_size, check_size_order
from .curves import FloatArray, Reduction, Variant, as_curves, last_interval_only, reduce_intervals
from .interference import InterferenceReading, fractional_loss, performance_lost


def spatial_emergence(
    perf1: ArrayLike,
    t_lost1: ArrayLike,
    n1: int,
    perf2: ArrayLike,
    t_lost2: ArrayLike,
    n2: int,
    perf_one: ArrayLike,
    t_lost_one: ArrayLike,
    *,
    variant: Variant = "corrected",
    reduce: Reduction = "sum",
    t_lost_as: InterferenceReading = "fraction",
    n_reference: int = 1,
) -> FloatArray:
    """Spatial self-organisation E_S(N1, N2), Eq. (2): positive if the loss grows less than in proportion to the size.

        E_S = sum_t [ (N2 / N1) P_lost(N1, t) - P_lost(N2, t) ]

    The paper's figures use neighbouring sizes (marginal form) or N independent robots (interactive form: n1 = 1, with
    the one-robot curves in both places).

    Args:
        perf1: P(N1, t), shape (..., T), objects per interval; `perf2` for the larger swarm.
        t_lost1: Interference fraction of the smaller swarm, shape (..., T); `t_lost2` for the larger.
        n1: Smaller size N1.
        perf2: P(N2, t).
        t_lost2: Interference fraction of the larger swarm.
        n2: Larger size N2.
        perf_one: P(1, t) of one robot alone.
        t_lost_one: Interference fraction of one robot alone.
        variant: `paper` as printed. `corrected` sets P_lost(1) to zero when N1 = 1: it is the loss to walls, which
            P_lost(N > 1) does not contain, and with it independent robots would seem organised. `sierra` uses
            fractional losses of the last interval, takes sizes in any order, and is 0 for N2 = 1; independent robots
            seem organised under it.
        reduce: `sum` as in the paper, `mean` or `last`. `sierra` always reads the last interval.
        t_lost_as: As in `performance_lost`.
        n_reference: As in `performance_lost`.

    Returns:
        E_S, shape (...,), in the unit of `perf` (a pure number for `sierra`). Higher is better.

    Raises:
        CurveError: As in `performance_lost`, or n1 >= n2 outside `sierra`.
        ValueError: Unknown variant, reading or reduction, or `sierra` with another reduction than the last interval.

    The paper's sentence introducing this equation calls it the task-based measure; it means the spatial one.
    """
    n1, n2 = check_size("n1", n1), check_size("n2", n2)
    perf1, t_lost1, perf2, t_lost2, perf_one, t_lost_one = as_curves(
        perf1=perf1, t_lost1=t_lost1, perf2=perf2, t_lost2=t_lost2, perf_one=perf_one, t_lost_one=t_lost_one
    )
    inputs = (perf1, t_lost1, perf2, t_lost2, perf_one, t_lost_one)
    if variant == "sierra":
        last_interval_only(reduce)
        reduce = "last"
        loss1 = fractional_loss(perf1, t_lost1, n1, perf_one, t_lost_one, variant=variant, n_reference=n_reference)
        loss2 = fractional_loss(perf2, t_lost2, n2, perf_one, t_lost_one, variant=variant, n_reference=n_reference)
        return reduce_intervals((n2 / n1 * loss1 - loss2) * (n2 > 1), reduce, *inputs)
    check_option("variant", variant, Variant)
    check_size_order(n1, n2)
    lost1 = performance_lost(
        perf1, t_lost1, n1, perf_one, t_lost_one, variant=variant, t_lost_as=t_lost_as, n_reference=n_reference
    )
    lost2 = performance_lost(
        perf2, t_lost2, n2, perf_one, t_lost_one, variant=variant, t_lost_as=t_lost_as, n_reference=n_reference
    )
    if variant == "corrected" and n1 == 1:
        lost1 = 0.0 * lost1
    return reduce_intervals(n2 / n1 * lost1 - lost2, reduce, *inputs)


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
    n1, n2 = check_size("n1", n1), check_size("n2", n2)
    check_size_order(n1, n2)
    perf1, perf2 = as_curves(perf1=perf1, perf2=perf2)
    gain = reduce_intervals(perf2 - n2 / n1 * perf1, reduce, perf1, perf2)
    if not relative:
        return gain
    with np.errstate(divide="ignore", invalid="ignore"):
        return gain / reduce_intervals(perf2, reduce, perf2)
