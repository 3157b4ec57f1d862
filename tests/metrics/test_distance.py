"""Exact dynamic time warping: by hand, against the whole matrix, every path, and an independent library."""

import dtaidistance.dtw
import numpy as np
import pytest

from metrics import aligned_l1, dtw, noise_floor
from tests.reference.naive_dtw import dtw_by_enumeration, dtw_by_matrix


def test_by_hand():
    assert dtw([0, 2, 0], [0, 1, 1, 0]) == 2.0
    assert dtw([1, 2, 3, 4, 5], [2, 3, 4]) == 2.0
    assert dtw([3.0], [1.0]) == 2.0


def test_a_late_step_is_forgiven():
    early, late = [0, 0, 1, 1], [0, 1, 1, 1]
    assert dtw(early, late) == 0.0
    assert aligned_l1(early, late) == 1.0


def test_constant_offset():
    assert dtw(np.zeros(40), np.full(40, 0.25)) == 10.0


@pytest.mark.parametrize(("n", "m"), [(1, 1), (1, 7), (6, 1), (5, 8), (30, 30), (40, 23)])
def test_kernel_is_bit_equal_to_the_whole_matrix(n, m):
    rng = np.random.default_rng(n * 100 + m)
    for _ in range(5):
        x, y = rng.normal(size=n), rng.normal(size=m)
        assert dtw(x, y) == dtw_by_matrix(n, m, lambda i, j, x=x, y=y: abs(x[i] - y[j]))


@pytest.mark.parametrize(("n", "m"), [(3, 3), (4, 6), (5, 5), (6, 4)])
def test_kernel_finds_the_cheapest_of_all_paths(n, m):
    rng = np.random.default_rng(n * 10 + m)
    for _ in range(5):
        x, y = rng.random(n), rng.random(m)
        assert dtw(x, y) == pytest.approx(dtw_by_enumeration(n, m, lambda i, j, x=x, y=y: abs(x[i] - y[j])), abs=1e-12)


@pytest.mark.parametrize(("n", "m"), [(10, 10), (50, 50), (80, 37)])
def test_agrees_with_an_independent_library(n, m):
    rng = np.random.default_rng(n + m)
    for _ in range(10):
        x, y = rng.random(n), rng.random(m)
        # Its default is the root of summed squares, a different number.
        assert dtw(x, y) == pytest.approx(dtaidistance.dtw.distance(x, y, inner_dist="euclidean"), abs=1e-9)


def test_runs_broadcast():
    rng = np.random.default_rng(3)
    x, y = rng.random((4, 1, 9)), rng.random((5, 6))
    values = dtw(x, y)
    assert values.shape == (4, 5)
    assert values[2, 3] == dtw(x[2, 0], y[3])


def test_a_nan_spoils_its_own_pair_only():
    x = np.zeros((2, 3))
    x[0, 1] = np.nan
    values = dtw(x, [1.0, 1.0])
    assert np.isnan(values[0])
    assert values[1] == 3.0


def test_noise_floor_pairs_different_runs():
    assert noise_floor([[0.0, 0.0], [1.0, 1.0], [4.0, 4.0]]).tolist() == [2.0, 8.0, 6.0]
    assert noise_floor([[0.0, 0.0], [1.0, 1.0], [4.0, 4.0]], maps=[1, 2, 1]).tolist() == [8.0]
    assert noise_floor([[0.0], [1.0]], maps=[1, 2]).tolist() == []
