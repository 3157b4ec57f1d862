"""Performance over swarm size: scalability, Eq. (4), efficiency, and performance itself."""

import numpy as np
from numpy.typing import ArrayLike

from .checks import check_option, check_size, check_sizes
from .curves import FloatArray, Reduction, Variant, as_curves, reduce_intervals


def scalability(
    perf1: ArrayLike,
    n1: int,
    perf2: ArrayLike,
    n2: int,
    *,
    variant: Variant = "corrected",
    reduce: Reduction | None = None,
) -> FloatArray:
    """Scalability C(N1, N2), Eq. (4): one minus Karp and Flatt's serial fraction e of the swarm.

    With size ratio r = N2 / N1 and speedup S(t) = P(N2, t) / P(N1, t):

        corrected    C = 1 - (1/S - 1/r) / (1 - 1/r)         S of the performance summed over time
        paper        C = sum_t [ 1 - (S - 1/r) / (1 - 1/r) ]

    The paper names e, but prints the speedup where Karp and Flatt have its reciprocal. The printed value is -S times
    the corrected one, so it reverses the order of swarms: at r = 2, a linear gain (S = 2) gives 1 corrected and -2
    printed, and halved performance gives -2 corrected and 1 printed. The text of the paper (higher means more
    cooperative) fits the corrected form.

    The sizes must differ (r = 1 divides by zero) and be in order (otherwise a smaller swarm would score well for
    delivering less).

    Args:
        perf1: P(N1, t), shape (..., T), objects per interval.
        n1: Smaller size N1, best the size next to N2 in the sweep.
        perf2: P(N2, t), same intervals.
        n2: Larger size N2.
        variant: Which of the two above.
        reduce: Overrides the reduction of the variant: `total` takes S of the summed curves, `sum`, `mean` and `last`
            take S in each interval.

    Returns:
        C, shape (...,). Corrected: 1 for a linear gain, 0 for no gain, above 1 for a superlinear gain (below r / (r -
        1)), negative if the larger swarm delivers less (-inf if it delivers nothing), and NaN if the smaller swarm
        delivers nothing: no gain is a multiple of that, and the limit r / (r - 1) would make the best score of it.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length; n1 >= n2.
        ValueError: Unknown option.
    """
    n1, n2 = check_sizes(n1, n2)
    check_option("variant", variant, Variant)
    if reduce is None:
        reduce = "sum" if variant == "paper" else "total"
    check_option("reduce", reduce, Reduction)
    r, curves = n2 / n1, as_curves(perf1=perf1, perf2=perf2)
    if reduce == "total":
        curves = tuple(curve.sum(axis=-1, keepdims=True) for curve in curves)
    with np.errstate(divide="ignore", invalid="ignore"):
        speedup = curves[1] / curves[0]
        if variant == "corrected":
            speedup = np.where(curves[0] > 0.0, speedup, np.nan)
        fraction = (speedup if variant == "paper" else 1.0 / speedup) - 1.0 / r
        return reduce_intervals(1.0 - fraction / (1.0 - 1.0 / r), reduce, *curves)


def efficiency(perf: ArrayLike, n: int, *, reduce: Reduction = "last") -> FloatArray:
    """Performance per robot, P(N, t) / N (Hecker and Moses 2015); the authors' program reads the last interval.

    Args:
        perf: P(N, t), shape (..., T), objects per interval.
        n: Swarm size N.
        reduce: `last`, `mean`, or `sum` over the run.

    Returns:
        Objects per robot, shape (...,). Higher is better.

    Raises:
        CurveError: The curve is missing, negative or infinite, or n < 1.
        ValueError: Unknown reduction.
    """
    return raw_performance(perf, reduce=reduce) / check_size("n", n)


def raw_performance(perf: ArrayLike, *, reduce: Reduction = "last") -> FloatArray:
    """Performance P(N, t) itself as one number per run; the paper's raw figures show the last interval.

    Args:
        perf: P(N, t), shape (..., T), objects per interval.
        reduce: `last`, `mean`, or `sum` over the run.

    Returns:
        Objects, shape (...,). Higher is better.

    Raises:
        CurveError: The curve is missing, negative or infinite.
        ValueError: Unknown reduction.
    """
    (perf,) = as_curves(perf=perf)
    return reduce_intervals(perf, reduce, perf)
