"""Queues of robots away from work: by hand, against generator matrices, and against the study's own numbers."""

import math

import numpy as np
import pytest

from metrics import (
    PopulationError,
    PopulationRates,
    mean_away,
    queue_statistics,
)
from tests.reference.population_chain import (
    generator,
    mean_away_by_exponential,
    share_of_time_by_events,
    stationary_by_null_vector,
)

HALF = PopulationRates(lambda_bd=0.001, mu_bd=0.002)
WAREHOUSE_RETURNS = {50: 0.001022222, 200: 0.001005556}
"""Swarm size -> returns per tick in the study's lowest-rate experiment; departures are 0.001."""


def warehouse(n, k):
    return PopulationRates(lambda_bd=0.001 * k, mu_bd=WAREHOUSE_RETURNS[n] * k)


def test_by_hand():
    queue = queue_statistics(HALF, 10)
    assert (queue.lam, queue.mu, queue.rho, queue.stable) == (0.001, 0.002, 0.5, True)
    assert queue.length_printed == pytest.approx(0.5, abs=1e-9)
    assert queue.waiting == pytest.approx(0.5, abs=1e-9)
    assert queue.length == pytest.approx(1.0, abs=1e-9)
    assert queue.time == pytest.approx(1000.0, abs=1e-9)
    assert queue.waiting_time == pytest.approx(500.0, abs=1e-9)
    assert queue.time_printed == pytest.approx(1500.0, abs=1e-9)
    assert queue.truncated_length == pytest.approx(1 - 11 * 2**-11 / (1 - 2**-11), abs=1e-12)
    assert queue.truncated_length == pytest.approx(0.994626282, abs=1e-9)
    assert queue.truncated_distribution.shape == (11,)


def test_all_four_processes_merge():
    rates = PopulationRates(0.001, 0.002, 0.003, 0.004)
    assert (rates.lambda_d, rates.lambda_bd, rates.mu_b, rates.mu_bd) == (0.001, 0.002, 0.003, 0.004)
    assert rates.lam == pytest.approx(0.003, abs=1e-15)
    assert rates.mu == pytest.approx(0.007, abs=1e-15)


def test_without_a_size_nothing_is_truncated():
    queue = queue_statistics(HALF)
    assert queue.truncated_length is None
    assert queue.truncated_distribution is None


@pytest.mark.parametrize(("n", "away"), [(50, 45.0), (200, 180.0)])
def test_the_study_set_its_rates_by_the_textbook_length(n, away):
    assert queue_statistics(warehouse(n, 1)).length == pytest.approx(away, rel=1e-3)


@pytest.mark.parametrize(("n", "away"), [(50, 20.3), (200, 81.7)])
def test_a_finite_swarm_has_far_fewer_robots_away(n, away):
    assert queue_statistics(warehouse(n, 1), n).truncated_length == pytest.approx(away, abs=0.05)


@pytest.mark.parametrize("rho", [0.1, 0.9, 1.0, 1.1, 20.0])
def test_truncated_length_is_the_closed_form(rho):
    n = 12
    closed = n / 2 if rho == 1.0 else rho / (1 - rho) - (n + 1) * rho ** (n + 1) / (1 - rho ** (n + 1))
    queue = queue_statistics(PopulationRates(lambda_bd=0.001 * rho, mu_bd=0.001), n)
    assert queue.truncated_length == pytest.approx(closed, abs=1e-9)


@pytest.mark.parametrize(("lam", "mu"), [(0.001, 0.002), (0.002, 0.002), (0.005, 0.002)])
def test_truncated_distribution_is_the_null_vector_of_the_generator(lam, mu):
    queue = queue_statistics(PopulationRates(lambda_bd=lam, mu_bd=mu), 8)
    expected = stationary_by_null_vector(generator(lam, mu, 8))
    assert queue.truncated_distribution == pytest.approx(expected, abs=1e-12)


def test_truncated_distribution_is_the_share_of_time_in_a_simulation():
    queue = queue_statistics(PopulationRates(lambda_bd=0.0009, mu_bd=0.001), 6)
    assert queue.truncated_distribution == pytest.approx(share_of_time_by_events(0.9, 1.0, 6, 200_000, 11), abs=0.01)


def test_large_swarms_do_not_overflow():
    queue = queue_statistics(PopulationRates(lambda_bd=0.003, mu_bd=0.001), 16384)
    assert queue.truncated_distribution.sum() == pytest.approx(1.0, abs=1e-12)
    assert queue.truncated_length == pytest.approx(16384 - 0.5, abs=1e-6)  # 1 / (rho - 1) at work


def test_nobody_leaves():
    for rates in (PopulationRates(), PopulationRates(mu_bd=0.001)):
        queue = queue_statistics(rates, 3)
        assert (queue.rho, queue.stable, queue.length, queue.truncated_length) == (0.0, True, 0.0, 0.0)
        assert mean_away(rates, 3, 1000) == 0.0


def test_nobody_returns():
    queue = queue_statistics(PopulationRates(lambda_d=0.001), 3)
    assert (queue.rho, queue.stable, queue.length, queue.time) == (math.inf, False, math.inf, math.inf)
    assert queue.truncated_distribution.tolist() == [0.0, 0.0, 0.0, 1.0]


@pytest.mark.parametrize("mu", [0.001, 0.0005])
def test_an_unlimited_queue_that_is_not_stable_grows_for_ever(mu):
    queue = queue_statistics(PopulationRates(lambda_bd=0.001, mu_bd=mu))
    assert not queue.stable
    assert {queue.length, queue.waiting, queue.time, queue.waiting_time, queue.time_printed} == {math.inf}


def test_mean_away_of_one_robot():
    rates = PopulationRates(lambda_bd=0.001, mu_bd=0.001)
    expected = 0.5 * (1 - (1 - math.exp(-2)) / 2)
    assert mean_away(rates, 1, 1000) == pytest.approx(expected, abs=1e-12)
    assert mean_away(rates, 1, 1000) == pytest.approx(0.283833821, abs=1e-9)
    assert mean_away(HALF, 10, 50_000) == pytest.approx(0.956239568, abs=1e-9)


@pytest.mark.parametrize(("lam", "mu"), [(0.001, 0.002), (0.002, 0.002), (0.005, 0.001), (0.001, 0.0)])
@pytest.mark.parametrize("horizon", [10.0, 5_000.0])
def test_mean_away_is_the_integrated_matrix_exponential(lam, mu, horizon):
    value = mean_away(PopulationRates(lambda_bd=lam, mu_bd=mu), 7, horizon)
    expected = mean_away_by_exponential(generator(lam, mu, 7), horizon)
    assert value == pytest.approx(expected, rel=1e-9)


@pytest.mark.parametrize(("n", "k", "away"), [(50, 1, 4.6), (50, 8, 12.3), (200, 1, 4.8), (200, 8, 14.0)])
def test_most_of_the_studys_swarm_is_at_work_throughout(n, k, away):
    assert mean_away(warehouse(n, k), n, 50_000) == pytest.approx(away, abs=0.05)


@pytest.mark.parametrize(("n", "ticks"), [(50, 253_000), (200, 4_000_000)])
def test_the_studys_queues_relax_far_more_slowly_than_its_runs_last(n, ticks):
    rates = warehouse(n, 1)
    decay = np.sort(-np.linalg.eigvals(generator(rates.lam, rates.mu, n)).real)
    assert 1 / decay[1] == pytest.approx(ticks, rel=0.02)  # decay[0] = 0 is equilibrium itself


def test_long_runs_reach_equilibrium():
    assert mean_away(HALF, 10, 10_000_000) == pytest.approx(queue_statistics(HALF, 10).truncated_length, abs=1e-3)


def test_rare_deaths_add_up_linearly():
    rates = PopulationRates(lambda_d=0.0001)
    assert mean_away(rates, 115, 50_000) == pytest.approx(0.0001 * 50_000 / 2, abs=1e-9)


@pytest.mark.parametrize("rate", [-0.001, math.nan, math.inf])
def test_rates_are_finite_and_not_negative(rate):
    with pytest.raises(PopulationError, match="mu_b "):
        PopulationRates(mu_b=rate)


@pytest.mark.parametrize("horizon", [0.0, -1.0, math.inf, math.nan])
def test_horizon_is_a_length(horizon):
    with pytest.raises(PopulationError, match="horizon"):
        mean_away(HALF, 10, horizon)
