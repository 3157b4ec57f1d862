"""Measures of the authors' earlier papers, by hand."""

import math

import numpy as np
import pytest

from metrics import CurveError, fractional_maintenance, projective_performance, weighted_combination


def test_fractional_maintenance():
    assert fractional_maintenance([0.0, 1.0]) == pytest.approx([1 - 1 / math.e, 0.0], abs=1e-15)


def test_projective_performance():
    assert projective_performance([5.0, 2.0], 2, [9.0, 6.0], 6) == 1.0
    assert projective_performance([5.0, 2.0], 2, [9.0, 6.0], 6, direction="negative") == -1.5
    assert projective_performance([3.0, 2.0], 2, [9.0, 6.0], 6, reduce="sum") == 2.0
    assert projective_performance([0.0], 2, [6.0], 6) == math.inf


@pytest.mark.parametrize(("x1", "x2"), [(0, 1), (-1, 1), (4, 2)])
def test_projection_needs_growing_positive_values(x1, x2):
    with pytest.raises(CurveError, match="neighbouring values"):
        projective_performance([1.0], x1, [1.0], x2)


def test_negative_projection_needs_two_values():
    assert projective_performance([1.0], 2, [1.0], 2) == 1.0
    with pytest.raises(CurveError, match="neighbouring values"):
        projective_performance([1.0], 2, [1.0], 2, direction="negative")


def test_weighted_combination():
    assert weighted_combination([0.4, np.nan], -0.2, weights=(0.75, 0.25)) == pytest.approx([0.25, np.nan], nan_ok=True)
    with pytest.raises(CurveError, match="normalize first"):
        weighted_combination(0.4, 12.0)
