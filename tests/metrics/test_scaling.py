"""Scalability and its three forms, by hand."""

import numpy as np
import pytest

from metrics import CurveError, efficiency, raw_performance, scalability

INF, NAN = np.inf, np.nan


@pytest.mark.parametrize(
    ("speedup", "printed", "karp_flatt"),
    [(0.0, 2.0, -INF), (0.5, 1.0, -2.0), (1.0, 0.0, 0.0), (1.5, -1.0, 2 / 3), (2.0, -2.0, 1.0), (3.0, -4.0, 4 / 3)],
)
def test_the_print_ranks_swarms_upside_down(speedup, printed, karp_flatt):
    assert scalability([2.0], 3, [2.0 * speedup], 6, variant="paper") == pytest.approx(printed, abs=1e-12)
    assert scalability([2.0], 3, [2.0 * speedup], 6) == pytest.approx(karp_flatt, abs=1e-12)


def test_linear_swarm():
    assert scalability([1, 1], 1, [2, 2], 2, variant="paper") == pytest.approx(-4.0, abs=1e-9)
    assert scalability([1, 1], 1, [2, 2], 2, reduce="sum") == pytest.approx(2.0, abs=1e-9)
    assert scalability([1, 1], 1, [2, 2], 2) == pytest.approx(1.0, abs=1e-9)


def test_uneven_intervals():
    perf1, perf2 = [1, 3], [2, 3]
    assert scalability(perf1, 4, perf2, 8, variant="paper") == pytest.approx(-2.0, abs=1e-9)
    assert scalability(perf1, 4, perf2, 8, reduce="sum") == pytest.approx(1.0, abs=1e-9)
    assert scalability(perf1, 4, perf2, 8, reduce="mean") == pytest.approx(0.5, abs=1e-9)
    assert scalability(perf1, 4, perf2, 8, reduce="last") == pytest.approx(0.0, abs=1e-9)
    assert scalability(perf1, 4, perf2, 8, variant="paper", reduce="total") == pytest.approx(-0.5, abs=1e-9)
    assert scalability(perf1, 4, perf2, 8) == pytest.approx(0.4, abs=1e-9)


@pytest.mark.parametrize(
    ("perf1", "perf2", "paper", "corrected"),
    [(0.0, 1.0, -INF, 4 / 3), (0.0, 0.0, NAN, NAN), (1.0, 0.0, 4 / 3, -INF)],
)
def test_swarms_without_performance(perf1, perf2, paper, corrected):
    for variant, expected in (("paper", paper), ("corrected", corrected)):
        value = scalability([perf1], 1, [perf2], 4, variant=variant)
        assert value == pytest.approx(expected, abs=1e-12, nan_ok=True), variant


@pytest.mark.parametrize("variant", ["corrected", "paper"])
@pytest.mark.parametrize(("n1", "n2"), [(4, 4), (8, 4), (8, 1)])
def test_sizes_that_are_equal_or_in_the_wrong_order_are_refused_in_every_form(variant, n1, n2):
    with pytest.raises(CurveError, match=f"n1 < n2, got n1 = {n1} and n2 = {n2}"):
        scalability([1.0], n1, [2.0], n2, variant=variant)


def test_zeros_count():
    assert scalability([0.0, 1.0], 1, [1.0, 2.0], 2, variant="paper") == -INF
    assert np.isnan(scalability([0.0, 1.0], 1, [0.0, 2.0], 2, variant="paper"))
    assert scalability([0.0, 1.0], 1, [1.0, 2.0], 2, reduce="sum") == pytest.approx(2.0 + 1.0, abs=1e-12)


def test_performance_per_robot():
    assert efficiency([4.0, 8.0], 4) == 2.0
    assert efficiency([4.0, 8.0], 4, reduce="sum") == 3.0
    assert raw_performance([4.0, 8.0]) == 8.0
    assert raw_performance([4.0, 8.0], reduce="mean") == 6.0
