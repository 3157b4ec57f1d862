"""Distance between two curves: exact dynamic time warping, and the sum of differences without warping."""

from collections.abc import Callable
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike

from . import numba_settings  # noqa: F401  # pyright: ignore[reportUnusedImport]  (before numba)

# isort: split
from numba import njit

from .checks import CurveError
from .curves import FloatArray, as_curve, as_curves, check_broadcast


def dtw(x: ArrayLike, y: ArrayLike) -> FloatArray:
    """Exact dynamic time warping distance between the curves x and y.

        D(0, 0) = 0,  D(i, 0) = D(0, j) = inf
        D(i, j) = |x_i - y_j| + min( D(i-1, j), D(i, j-1), D(i-1, j-1) )

    Slopes are not weighted, and the sum is neither divided by the path length nor put under a root. The distance is
    symmetric, and 0 for identical curves. It is not a metric, because the triangle inequality does not hold. It grows
    with T, the sampling rate and the scale of the curves, so compare only curves of the same kind and length. The paper
    cites the method but does not give the cost; a shift in time costs nothing here.

    Args:
        x: Curve or curves, shape (..., T); negative values are fine.
        y: Curve or curves of any length; leading axes broadcast with those of x.

    Returns:
        Distances, shape (...,), in the unit of the cost times samples. A pair with a NaN gives NaN. Lower is closer.

    Raises:
        CurveError: A curve is missing, empty or infinite, or leading axes do not broadcast.
    """
    x, y = as_curve("x", x, signed=True), as_curve("y", y, signed=True)
    check_broadcast(x, y)
    n, m = int(x.shape[-1]), int(y.shape[-1])
    shape = np.broadcast_shapes(x.shape[:-1], y.shape[:-1])
    all_x = np.ascontiguousarray(np.broadcast_to(x, (*shape, n))).reshape(-1, n)
    all_y = np.ascontiguousarray(np.broadcast_to(y, (*shape, m))).reshape(-1, m)
    distances: FloatArray = np.empty(all_x.shape[0])
    diagonals: FloatArray = np.empty((3, n + 2))
    for pair in range(len(distances)):
        distances[pair] = _warping_cost(all_x[pair], all_y[pair, ::-1].copy(), diagonals)
    distances[np.isnan(all_x).any(axis=1) | np.isnan(all_y).any(axis=1)] = np.nan
    return distances.reshape(shape)[()]


def aligned_l1(x: ArrayLike, y: ArrayLike) -> FloatArray:
    """Distance without warping, sum_t |x_t - y_t|.

    Args:
        x: Curve or curves, shape (..., T).
        y: The same, equal T.

    Returns:
        Distances, shape (...,).

    Raises:
        CurveError: A curve is missing, empty or infinite, or the shapes do not fit.
    """
    x, y = as_curves(signed=True, x=x, y=y)
    return np.abs(x - y).sum(axis=-1)


def noise_floor(perf_ideal: ArrayLike, maps: ArrayLike | None = None) -> FloatArray:
    """Distances between all pairs of ideal runs of the same map: what a perfect swarm would score by chance alone.

    Reactivity, adaptability and noise robustness compare single runs, which scatter independently, so they are above 0
    even for a perfect swarm. Without warping, the floor is about 1.13 sigma T, where sigma is the standard deviation of
    an interval. Report the floor together with these measures.

    Args:
        perf_ideal: P_ideal of all R >= 2 runs, shape (R, T).
        maps: Number of the map of each run, (R,); runs of different maps differ by more than chance, and are not
            paired. None: all runs have the same map.

    Returns:
        Distances, shape (pairs,); R (R - 1) / 2 of one map, none where each run has its own.

    Raises:
        CurveError: Fewer than two runs, or no valid curves.
    """
    runs = as_curve("perf_ideal", perf_ideal)
    if runs.ndim != 2 or runs.shape[0] < 2:
        raise CurveError(f"Expected perf_ideal of at least two runs, shape (R, T), got {runs.shape}.")
    first, second = np.triu_indices(runs.shape[0], k=1)
    if maps is not None:
        same = np.equal(*np.asarray(maps)[np.array([first, second])])
        first, second = first[same], second[same]
    return dtw(runs[first], runs[second]) if first.size else np.empty(0)


def _njit(**options: bool) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Compile functions that allocate nothing: without numba's memory runtime, calls with arrays take half the time."""
    return cast(Any, njit)(_nrt=False, **options)


def _compiled(function: Callable[..., float]) -> Callable[..., float]:
    """Compile a function that allocates nothing, and keep the result where a folder can be written to."""
    try:
        return _njit(cache=True)(function)
    except RuntimeError:  # no folder can be; compiling then takes a second in every process
        return _njit()(function)


@_njit(forceinline=True)
def _next_diagonal(
    x: FloatArray,
    y: FloatArray,
    diagonal: FloatArray,
    above: FloatArray,
    left: FloatArray,
    now: FloatArray,
) -> None:
    """Fill a diagonal of D, `now` (L,), from the costs and the three neighbours of each of its cells."""
    for t in range(now.shape[0]):
        cost = abs(x[t] - y[t])
        least = above[t] if above[t] < left[t] else left[t]
        least = diagonal[t] if diagonal[t] < least else least
        now[t] = cost + least


@_compiled
def _warping_cost(
    x: FloatArray,
    y: FloatArray,
    diagonals: FloatArray,
) -> float:
    """D(n, m) of one pair of curves x (n,) and y (m,); both arrays of y are given backwards.

    The table is filled diagonal by diagonal, k = i + j: cells of one diagonal do not depend on each other, so that the
    processor works out several at a time. `diagonals` (3, n + 2) is workspace for D on the diagonals k, k - 1 and
    k - 2 by i; beside the cells of a diagonal stands infinity.
    """
    n, m = x.shape[0], y.shape[0]
    diagonals[:, :] = np.inf
    diagonals[0, 0] = 0.0
    earlier, before, now = diagonals[0], diagonals[1], diagonals[2]
    for k in range(2, n + m + 1):
        low = max(1, k - m)
        high = min(n, k - 1)
        first, last = low + m - k, high + m - k + 1
        _next_diagonal(
            x[low - 1 : high],
            y[first:last],
            earlier[low - 1 : high],
            before[low - 1 : high],
            before[low : high + 1],
            now[low : high + 1],
        )
        now[low - 1] = np.inf
        now[max(low, high + 1)] = np.inf
        earlier, before, now = before, now, earlier
    return before[n]
