"""Slow twins of measures: the population chain as a matrix with its events, time warping as a whole matrix."""

from collections.abc import Callable, Iterator

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm, null_space

Matrix = NDArray[np.float64]


def generator(lam: float, mu: float, n: int) -> Matrix:
    """Generator Q over the number of robots away, 0 ... n."""
    q = np.zeros((n + 1, n + 1))
    for away in range(n + 1):
        if away < n:
            q[away, away + 1] = lam
        if away > 0:
            q[away, away - 1] = mu
        q[away, away] = -q[away].sum()
    return q


def stationary_by_null_vector(q: Matrix) -> Matrix:
    """The distribution with pi Q = 0."""
    vector = null_space(q.T)[:, 0]
    return vector / vector.sum()


def mean_away_by_exponential(q: Matrix, horizon: float) -> float:
    """(1 / T) times the integral of the mean number away, starting with no robot away."""
    size = q.shape[0]
    block = np.zeros((2 * size, 2 * size))
    block[:size, :size] = q
    block[:size, size:] = np.eye(size)
    integral = expm(block * horizon)[:size, size:]
    return float(integral[0] @ np.arange(size)) / horizon


Cost = Callable[[int, int], float]


def dtw_by_matrix(n: int, m: int, cost: Cost) -> float:
    """D(n, m) of the recursion, written out; cost(i, j) takes zero-based samples."""
    table = np.full((n + 1, m + 1), np.inf)
    table[0, 0] = 0.0
    for i in range(1, n + 1):
        for j in range(1, m + 1):
            table[i, j] = cost(i - 1, j - 1) + min(table[i - 1, j], table[i, j - 1], table[i - 1, j - 1])
    return float(table[n, m])


def dtw_by_enumeration(n: int, m: int, cost: Cost) -> float:
    """Cheapest of all monotone paths from the first to the last pair of samples."""
    return min(sum(cost(i, j) for i, j in path) for path in warping_paths(n, m))


def warping_paths(n: int, m: int) -> Iterator[list[tuple[int, int]]]:
    """All paths from (0, 0) to (n - 1, m - 1) in steps (1, 0), (0, 1), (1, 1)."""

    def extend(path: list[tuple[int, int]]) -> Iterator[list[tuple[int, int]]]:
        i, j = path[-1]
        if (i, j) == (n - 1, m - 1):
            yield path
            return
        for step_i, step_j in ((1, 0), (0, 1), (1, 1)):
            if i + step_i < n and j + step_j < m:
                yield from extend([*path, (i + step_i, j + step_j)])

    yield from extend([(0, 0)])
