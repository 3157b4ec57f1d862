"""Slow twins of measures: the population chain as a matrix with its events, time warping as a whole matrix."""

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


def dtw_by_matrix(x: Matrix, y: Matrix) -> float:
    """D(n, m) of the recursion, written out."""
    table = np.full((len(x) + 1, len(y) + 1), np.inf)
    table[0, 0] = 0.0
    for i in range(1, len(x) + 1):
        for j in range(1, len(y) + 1):
            table[i, j] = abs(x[i - 1] - y[j - 1]) + min(table[i - 1, j], table[i, j - 1], table[i - 1, j - 1])
    return float(table[-1, -1])
