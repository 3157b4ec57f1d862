"""Measures of the authors' earlier papers and programs: kept for comparison, not part of the paper.

`docs/references.md` lists these papers.
"""

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .checks import CurveError, check_option
from .curves import FloatArray, Reduction, as_curves, reduce_intervals

Direction: TypeAlias = Literal["positive", "negative"]


def fractional_maintenance(loss: ArrayLike) -> FloatArray:
    """Share of performance kept in spite of interference, M(N) = 1 - exp(FL(N) - 1) (2019 and 2020).

    M is 1 - 1/e = 0.632 without loss, and 0 if the loss is 1.

    Args:
        loss: FL from `fractional_loss`, any shape.
    """
    return -np.expm1(np.asarray(loss, dtype=np.float64) - 1.0)


def projective_performance(
    perf1: ArrayLike,
    x1: float,
    perf2: ArrayLike,
    x2: float,
    *,
    direction: Direction = "positive",
    reduce: Reduction = "last",
) -> FloatArray:
    """Performance at x2 relative to the performance projected from x1, with s = x2 / x1 (2019).

        positive    P2 / (P1 s)          1 = grows in proportion to x
        negative    P2 / (P1 (1 - s))

    Args:
        perf1: Performance at the lower x value of the sweep, shape (..., T), objects per interval.
        x1: That x value, above 0.
        perf2: Performance at the next x value, same intervals.
        x2: That x value.
        direction: Which of the two.
        reduce: `last`, `mean` or `sum` of the ratio over intervals.

    Returns:
        Ratios, shape (...,); inf or NaN where P1 is 0.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length; x1 <= 0 or x2 < x1, or x2 = x1 in the
            negative direction.
        ValueError: Unknown direction or reduction.
    """
    check_option("direction", direction, Direction)
    perf1, perf2 = as_curves(perf1=perf1, perf2=perf2)
    if not 0.0 < x1 <= x2 or (direction == "negative" and x1 == x2):
        raise CurveError(f"Expected 0 < x1 < x2, neighbouring values of the sweep, got {x1} and {x2}.")
    s = x2 / x1
    projected = perf1 * (s if direction == "positive" else 1.0 - s)
    with np.errstate(divide="ignore", invalid="ignore"):
        return reduce_intervals(perf2 / projected, reduce, perf1, perf2)


def weighted_combination(
    first: ArrayLike, second: ArrayLike, *, weights: tuple[float, float] = (0.5, 0.5)
) -> FloatArray:
    """Two measures of a property as one number, alpha_1 M_1 + alpha_2 M_2 (2020; the authors dropped it in 2021).

    The weights were, for task and spatial self-organisation, (0.5, 0.5) in scenario 1 and (0.75, 0.25) in scenario 2;
    reactivity and adaptability (0.5, 0.5); noise and population robustness (0.1, 0.9) and (0.6, 0.4).

    Args:
        first: First measure after `normalize`, any shape.
        second: Second measure after `normalize`, broadcasting with the first.
        weights: alpha_1 and alpha_2.

    Raises:
        CurveError: Values outside [-1, 1]: a raw distance (lower is better) must not be added to a gain.
    """
    first, second = np.asarray(first, dtype=np.float64), np.asarray(second, dtype=np.float64)
    largest = max(float(np.nanmax(np.abs(values), initial=0.0)) for values in (first, second))
    if largest > 1.0:
        raise CurveError(f"Expected normalised measures in [-1, 1], got magnitude {largest}; apply normalize first.")
    return weights[0] * first + weights[1] * second
