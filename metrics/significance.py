"""Whether a difference is significant: the paired t test, and the correction for many tests at once."""

import math

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import stdtr  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from .checks import CurveError
from .curves import FloatArray

ROUNDING = 1e-9
"""Differences that vary by less than this share of their mean are equal up to rounding."""
SIGNIFICANT = 0.05
"""Largest p value that is called significant. After Holm's correction it is the probability that chance makes one or
more of the tests so that are corrected together."""


def paired_p(differences: FloatArray) -> float:
    """Two-sided p value of the paired t test that the mean difference is zero.

    Args:
        differences: One per pair of runs, (R,).

    Returns:
        The p value; NaN for fewer than two pairs or a difference that is not finite. If all differences are equal (up
        to rounding), Student's t does not exist; the value is then 1 if they are zero, else that of the sign test,
        2^(1 - R).
    """
    n_pairs = differences.size
    if n_pairs < 2 or not np.isfinite(differences).all():
        return math.nan
    std = float(differences.std(ddof=1))
    mean = float(differences.mean())
    if std <= ROUNDING * abs(mean):
        return 1.0 if mean == 0.0 else 2.0 ** (1 - n_pairs)
    t = abs(mean) * math.sqrt(n_pairs) / std
    return 2.0 * float(stdtr(n_pairs - 1, -t))


def holm(p_values: FloatArray) -> FloatArray:
    """Adjust p values of one family for testing many at once (Holm 1979); NaN values do not count and stay NaN.

    Args:
        p_values: (K,).

    Returns:
        Adjusted values (K,), at most 1: rejecting where they are at most alpha keeps the probability of any false
        rejection at alpha.
    """
    adjusted = np.full(p_values.shape, math.nan)
    tests = np.flatnonzero(~np.isnan(p_values))
    order = tests[np.argsort(p_values[tests], kind="stable")]
    factors = np.arange(order.size, 0, -1)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(factors * p_values[order]))
    return adjusted


def paired_tests(first: ArrayLike, second: ArrayLike) -> FloatArray:
    """Two-sided p values that two policies are equally good at each level, after Holm's correction over the levels.

        paired_tests([[4, 6, 8], [5, 5, 6]], [[1, 2, 3], [5, 6, 5]])  # levels (2,), three runs each: 0.040 and 1

    Args:
        first: One value per level and run, (L, R), or (R,) for one level. NaN marks a run without a value.
        second: The same of the other policy; run i of both has the same seed.

    Returns:
        Adjusted values of `paired_p`, (L,); NaN for a level with fewer than two pairs.

    Raises:
        CurveError: The arrays differ in shape, or have no axis of runs.
    """
    a, b = (np.asarray(values, dtype=np.float64) for values in (first, second))
    if a.shape != b.shape or a.ndim not in (1, 2):
        raise CurveError(
            f"Expected two arrays of the same shape, (levels, runs), got {a.shape} and {b.shape}; runs are paired by "
            "seed, so mark a missing run with NaN."
        )
    with np.errstate(invalid="ignore"):  # infinite values of both, whose test is NaN
        differences = np.atleast_2d(a - b)
    missing = np.atleast_2d(np.isnan(a) | np.isnan(b))
    return holm(np.array([paired_p(level[~gone]) for level, gone in zip(differences, missing, strict=True)]))
