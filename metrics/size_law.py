"""The universal law of swarm sizes: how performance grows, and where it is largest.

With a = 2, s = 0.1 and k = 0.01, ten robots deliver 20 / (1 + 0.9 + 0.9) = 7.14 objects, and a swarm of
sqrt(0.9 / 0.01) = 9.49 robots delivers most:

    P(N) = a N / (1 + s (N - 1) + k N (N - 1))

a is the performance of one robot, s (contention) the share of the work that robots can only do one after the other, and
k (coherency) the cost per pair of robots. Source: Gunther 1993, who extends Amdahl 1967.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any, cast

import numpy as np
from numpy.typing import ArrayLike
from scipy.optimize import curve_fit  # type: ignore[import-untyped] - scipy ships no types

from .checks import CurveError
from .curves import FloatArray

_DRAWS = 2_000
"""Parameters that are drawn for an interval (our choice)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class SizeLaw:
    """A fitted law; see `fit_law`."""

    a: float
    """Performance of one robot, above 0."""
    contention: float
    """s, at least 0."""
    coherency: float
    """k, at least 0."""
    drawn: FloatArray = field(repr=False)
    """a, s and k as they may be by chance, (draws, 3)."""

    @property
    def peak(self) -> float:
        """Swarm size of the largest performance; infinite where performance never falls."""
        if self.coherency == 0.0 or self.contention >= 1.0:
            return math.inf
        return math.sqrt((1.0 - self.contention) / self.coherency)

    def performance(self, sizes: ArrayLike) -> FloatArray:
        """Return P(N) for swarm sizes N of any shape."""
        return _law(np.asarray(sizes, np.float64), self.a, self.contention, self.coherency)

    def interval(self, sizes: ArrayLike) -> FloatArray:
        """Return the lower and upper ends of the 95 % interval of P(N), (2, ...) for sizes of any shape."""
        n = np.asarray(sizes, np.float64)
        a, s, k = (column.reshape(-1, *[1] * n.ndim) for column in self.drawn.T)
        return np.quantile(_law(n, a, s, k), (0.025, 0.975), axis=0)


def fit_law(sizes: Sequence[float], values: ArrayLike) -> SizeLaw:
    """Fit the law to performances by least squares of their square roots.

    Deliveries are counts: their variance grows with their mean, that of their square roots does not (our choice).

    Args:
        sizes: Swarm sizes, (S,): four or more different ones, since three fix the law.
        values: Performance of each run at each size, (S, R), or one mean per size, (S,).

    Raises:
        CurveError: fewer sizes, or values that do not fit to them, are negative or not finite, or all 0.
    """
    n = np.asarray(sizes, np.float64)
    found = np.asarray(values, np.float64)
    if len(set(n.tolist())) < 4 or n.min() < 1.0:
        raise CurveError(f"Expected four or more swarm sizes from 1 up, got {n.tolist()}.")
    if found.shape[:1] != n.shape or not np.isfinite(found).all() or found.min() < 0.0 or not found.any():
        raise CurveError(
            f"Expected finite performances of at least 0 for each of {len(n)} sizes, some above 0, got an array of "
            f"shape {found.shape}."
        )
    runs = found.reshape(len(n), -1)
    at, roots = np.repeat(n, runs.shape[1]), np.sqrt(runs).ravel()
    start = (float((roots**2 / at).max()), 0.01, 1e-4)
    lowest = (1e-12, 0.0, 0.0)
    bounds = lowest, np.inf
    fitted = curve_fit(_root, at, roots, p0=start, bounds=bounds)  # pyright: ignore[reportUnknownVariableType] - scipy
    best, covariance = cast("tuple[FloatArray, FloatArray]", fitted)
    drawn = np.random.default_rng(0).multivariate_normal(best, covariance, _DRAWS).clip(lowest)
    return SizeLaw(a=float(best[0]), contention=float(best[1]), coherency=float(best[2]), drawn=drawn)


def _law(n: FloatArray, a: Any, s: Any, k: Any) -> FloatArray:
    return a * n / (1.0 + s * (n - 1.0) + k * n * (n - 1.0))


def _root(n: FloatArray, a: float, s: float, k: float) -> FloatArray:
    return np.sqrt(_law(n, a, s, k))
