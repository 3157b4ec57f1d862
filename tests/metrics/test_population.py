"""Queues of robots away from work, and availability: by hand, by generator matrices, by the study's own numbers."""

import math

import numpy as np
import pytest

from metrics import PopulationRates, availability, mean_away, queue_statistics, ratio_for_team
from tests.reference.measures import (
    generator,
    mean_away_by_exponential,
    stationary_by_null_vector,
)

HALF = PopulationRates(lambda_bd=0.001, mu_bd=0.002)
INF = math.inf


def warehouse(n, k):
    """The study's k-th rate of malfunctions in a warehouse, per tick."""
    return PopulationRates(lambda_bd=0.001 * k, mu_bd={50: 0.001022222, 200: 0.001005556}[n] * k)


def test_a_queue_by_hand():
    queue = queue_statistics(HALF, 10)
    assert (queue.rho, queue.stable, queue.length_printed, queue.length) == (0.5, True, 0.5, 1.0)
    assert (queue.time, queue.time_printed) == pytest.approx((1000.0, 1500.0))
    assert queue.truncated_length == pytest.approx(1 - 11 * 2**-11 / (1 - 2**-11), abs=1e-12)
    assert queue.truncated_distribution.shape == (11,)
    alone = queue_statistics(HALF)
    assert (alone.truncated_length, alone.truncated_distribution) == (None, None)


@pytest.mark.parametrize("q", [0.3, 0.5, 0.999999, 1.0, 1.000001, 2.5])
def test_shares_of_robots_away_are_the_null_vector_of_the_generator(q):
    expected = stationary_by_null_vector(generator(q, 1.0, 9))
    found = queue_statistics(PopulationRates(lambda_bd=q, mu_bd=1.0), 9).truncated_distribution
    assert found == pytest.approx(expected, abs=1e-12)
    for n_min in range(1, 10):
        assert availability(9, n_min, q) == pytest.approx(expected[: 9 - n_min + 1].sum(), abs=1e-12)


def test_large_swarms_do_not_overflow():
    queue = queue_statistics(PopulationRates(lambda_bd=0.003, mu_bd=0.001), 16384)
    assert queue.truncated_distribution.sum() == pytest.approx(1.0, abs=1e-12)
    assert queue.truncated_length == pytest.approx(16384 - 0.5, abs=1e-6)  # 1 / (rho - 1) at work
    assert availability(16_384, 100, 1.5) == pytest.approx(1.5**-100, rel=1e-9)
    assert availability(16_384, 8_193, 1 + 1e-13) == pytest.approx(8192 / 16385, rel=1e-6)
    assert availability(16_384, 8_192, 0.5) == 1.0


def test_nobody_leaves_or_nobody_returns():
    for rates in (PopulationRates(), PopulationRates(mu_bd=0.001)):
        queue = queue_statistics(rates, 3)
        assert (queue.rho, queue.stable, queue.length, queue.truncated_length) == (0.0, True, 0.0, 0.0)
        assert mean_away(rates, 3, 1000) == 0.0
    queue = queue_statistics(PopulationRates(lambda_d=0.001), 3)
    assert (queue.rho, queue.stable, queue.truncated_length) == (INF, False, 3.0)
    for mu in (0.001, 0.0005, 0.0):
        queue = queue_statistics(PopulationRates(lambda_bd=0.001, mu_bd=mu))
        assert not queue.stable
        assert {queue.length, queue.length_printed, queue.time, queue.time_printed} == {INF}


def test_mean_away_of_one_robot():
    rates = PopulationRates(lambda_bd=0.001, mu_bd=0.001)
    assert mean_away(rates, 1, 1000) == pytest.approx(0.5 * (1 - (1 - math.exp(-2)) / 2), abs=1e-12)
    assert mean_away(HALF, 10, 50_000) == pytest.approx(0.956239568, abs=1e-9)


@pytest.mark.parametrize(("lam", "mu"), [(0.001, 0.002), (0.002, 0.002), (0.005, 0.001), (0.001, 0.0)])
def test_mean_away_is_the_integrated_matrix_exponential(lam, mu):
    for horizon in (10.0, 5_000.0):
        expected = mean_away_by_exponential(generator(lam, mu, 7), horizon)
        assert mean_away(PopulationRates(lambda_bd=lam, mu_bd=mu), 7, horizon) == pytest.approx(expected, rel=1e-9)


def test_numbers_of_the_errata():
    for n, textbook, finite, away in ((50, 45.0, 20.3, {1: 4.6, 8: 12.3}), (200, 180.0, 81.7, {1: 4.8, 8: 14.0})):
        queue = queue_statistics(warehouse(n, 1), n)
        assert queue.length == pytest.approx(textbook, rel=1e-3)
        assert queue.truncated_length == pytest.approx(finite, abs=0.05)
        for k, robots in away.items():
            assert mean_away(warehouse(n, k), n, 50_000) == pytest.approx(robots, abs=0.05)
    for n, ticks in ((50, 253_000), (200, 4_000_000)):
        decay = np.sort(-np.linalg.eigvals(generator(warehouse(n, 1).lam, warehouse(n, 1).mu, n)).real)
        assert 1 / decay[1] == pytest.approx(ticks, rel=0.02)  # decay[0] = 0 is equilibrium itself
    # Reading 0.40 off the figure decides between rho / (1 - rho) = 5 and the printed rho^2 / (1 - rho) = 5.
    assert availability(50, 5, 1.2) == pytest.approx(0.4018, abs=1e-4)
    assert availability(50, 5, 2.0 / (-5 + math.sqrt(5**2 + 4 * 5))) == pytest.approx(0.454, abs=1e-3)


@pytest.mark.parametrize(
    ("n", "n_min", "q", "expected"),
    [
        *((2, 1, 0.5, 6 / 7), (2, 2, 0.5, 4 / 7), (2, 1, 2.0, 3 / 7), (10, 4, 1.0, 7 / 11), (5, 0, 2.0, 1.0)),
        *((5, -1, INF, 1.0), (5, 6, 0.0, 0.0), (5, 3, 0.0, 1.0), (5, 3, INF, 0.0), (5, 5, 0.5, 0.5 / (1 - 0.5**6))),
        (5, 6, 0.5, 0.0),
    ],
)
def test_availability_by_hand(n, n_min, q, expected):
    assert availability(n, n_min, q) == pytest.approx(expected, abs=1e-12)


@pytest.mark.parametrize(
    ("n", "team", "shares"),
    [
        (50, 5, [0.833, 0.402, 0.161, 0.026, 0.001]),
        (50, 20, [0.948, 0.764, 0.579, 0.320, 0.064]),
        (200, 20, [0.952, 0.784, 0.614, 0.377, 0.142]),
    ],
)
def test_availability_of_the_papers_teams(n, team, shares):
    ratio = ratio_for_team(team)
    assert [availability(n, needed, ratio) for needed in (1, 5, 10, 20, 40)] == pytest.approx(shares, abs=0.0005)
    # The sum over all k is the mean number at work, below M, which a swarm without a size limit would have.
    at_work = n - queue_statistics(PopulationRates(lambda_bd=ratio, mu_bd=1.0), n).truncated_length
    assert sum(availability(n, needed, ratio) for needed in range(1, n + 1)) == pytest.approx(at_work, rel=1e-9)
    assert at_work < team
