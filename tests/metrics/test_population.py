"""Robustness to a changing population and availability: by hand, and against generator matrices."""

import math

import numpy as np
import pytest

from metrics import (
    CurveError,
    PopulationError,
    PopulationRates,
    availability,
    population_robustness,
    population_weight,
    queue_statistics,
    ratio_for_team,
    recorded_population_robustness,
)
from tests.reference.population_chain import generator, stationary_by_null_vector

HALF = PopulationRates(lambda_bd=0.001, mu_bd=0.002)
DEATHS = PopulationRates(lambda_d=0.001)


def robustness(weight, **options):
    return population_robustness([0.9, 0.9], [1.0, 1.0], HALF, horizon=50_000, n=10, weight=weight, **options)


@pytest.mark.parametrize(
    ("weight", "expected"),
    [("paper", -0.14), ("transient", -0.008752086)],
)
def test_by_hand(weight, expected):
    assert robustness(weight) == pytest.approx(expected, abs=1e-9)


def test_weights_by_hand():
    assert population_weight(HALF, horizon=50_000, weight="paper") == pytest.approx(0.97, abs=1e-12)
    assert population_weight(HALF, horizon=50_000, n=10) == pytest.approx(1 - 0.0956239568, abs=1e-9)


def test_reductions():
    options = {"horizon": 50_000, "weight": "paper"}
    assert population_robustness([0.9, 1.0], [1.0, 1.0], HALF, reduce="mean", **options) == pytest.approx(-0.02)
    assert population_robustness([0.9, 1.0], [1.0, 1.0], HALF, reduce="last", **options) == pytest.approx(0.03)


@pytest.mark.parametrize("weight", ["paper", "transient"])
@pytest.mark.parametrize("rates", [PopulationRates(), PopulationRates(mu_bd=0.001)])
def test_nobody_leaves(weight, rates):
    assert population_weight(rates, horizon=1000, n=5, weight=weight) == 1.0


@pytest.mark.parametrize("weight", ["paper", "transient"])
def test_weight_relative_to_a_disturbed_ideal(weight):
    options = {"horizon": 50_000, "n": 10, "weight": weight}
    rare = PopulationRates(lambda_bd=0.0001, mu_bd=0.002)
    expected = population_weight(HALF, **options) / population_weight(rare, **options)
    assert population_weight(HALF, ideal_rates=rare, **options) == pytest.approx(expected, rel=1e-12)
    assert population_weight(HALF, ideal_rates=HALF, **options) == 1.0


@pytest.mark.parametrize(
    "rates",
    [
        DEATHS,
        PopulationRates(lambda_bd=0.001),
        PopulationRates(lambda_bd=0.001, mu_bd=0.001),
        PopulationRates(lambda_bd=0.002, mu_bd=0.001),
    ],
)
def test_an_infinite_time_away_has_no_printed_weight(rates):
    with pytest.raises(PopulationError, match="transient"):
        population_weight(rates, horizon=1000, n=5, weight="paper")


def test_pure_death_during_a_run():
    rates = PopulationRates(lambda_d=0.0001)
    assert population_weight(rates, horizon=50_000, n=115) == pytest.approx(1 - 0.0001 * 50_000 / 230, abs=1e-9)


def test_what_a_weight_needs():
    with pytest.raises(ValueError, match="swarm size n"):
        population_weight(HALF, horizon=1000)
    with pytest.raises(PopulationError, match="horizon"):
        population_weight(HALF, horizon=0, weight="paper")


@pytest.mark.parametrize(
    ("n", "n_min", "q", "expected"),
    [(2, 1, 0.5, 6 / 7), (2, 2, 0.5, 4 / 7), (2, 1, 2.0, 3 / 7), (10, 4, 1.0, 7 / 11), (50, 5, 1.2, 0.401822797)],
)
def test_availability_by_hand(n, n_min, q, expected):
    assert availability(n, n_min, q) == pytest.approx(expected, abs=1e-9)


@pytest.mark.parametrize(
    ("n", "n_min", "q", "expected"),
    [
        (5, 0, 2.0, 1.0),
        (5, -1, math.inf, 1.0),
        (5, 6, 0.0, 0.0),
        (5, 3, 0.0, 1.0),
        (5, 3, math.inf, 0.0),
        (5, 5, 0.5, 0.5 / (1 - 0.5**6)),
    ],
)
def test_availability_at_its_ends(n, n_min, q, expected):
    assert availability(n, n_min, q) == pytest.approx(expected, abs=1e-15)


PAPER_TABLE = {
    (50, 5): [0.833, 0.402, 0.161, 0.026, 0.001],
    (50, 10): [0.908, 0.618, 0.381, 0.142, 0.014],
    (50, 20): [0.948, 0.764, 0.579, 0.320, 0.064],
    (200, 5): [0.833, 0.402, 0.162, 0.026, 0.001],
    (200, 10): [0.909, 0.621, 0.386, 0.149, 0.022],
    (200, 20): [0.952, 0.784, 0.614, 0.377, 0.142],
}
"""(robots, mean team M) -> availability of 1, 5, 10, 20, 40 robots with q = (1 + M) / M."""


@pytest.mark.parametrize(("n", "team"), PAPER_TABLE)
def test_availability_of_the_papers_teams(n, team):
    found = [availability(n, needed, ratio_for_team(team)) for needed in (1, 5, 10, 20, 40)]
    assert found == pytest.approx(PAPER_TABLE[n, team], abs=0.0005)


def test_availability_of_a_team_by_hand():
    # M = 1: q = 2. Two robots: weights 1, 1/2, 1/4 of 0, 1, 2 at work.
    assert ratio_for_team(1) == 2.0
    assert [availability(2, needed, 2.0) for needed in (0, 1, 2, 3)] == pytest.approx([1.0, 3 / 7, 1 / 7, 0.0])


@pytest.mark.parametrize("n", [2, 50, 200])
def test_the_sum_of_availabilities_is_the_mean_number_at_work(n):
    # Mean = sum over k >= 1 of the probability of at least k; below M, which a swarm without a size limit would have.
    ratio = ratio_for_team(20)
    at_work = n - queue_statistics(PopulationRates(lambda_bd=ratio, mu_bd=1.0), n).truncated_length
    assert sum(availability(n, needed, ratio) for needed in range(1, n + 1)) == pytest.approx(at_work, rel=1e-9)
    assert at_work < 20


@pytest.mark.parametrize("team", [0.0, -1.0, math.inf, math.nan])
def test_teams_are_positive_and_finite(team):
    with pytest.raises(PopulationError, match="more than 0 robots at work"):
        ratio_for_team(team)


def test_the_paper_took_the_queue_length_for_the_number_at_work():
    # Reading 0.40 off the figure decides between rho / (1 - rho) = 5 and the printed rho^2 / (1 - rho) = 5.
    printed_rho = (-5 + math.sqrt(5**2 + 4 * 5)) / 2
    assert availability(50, 5, 1.2) == pytest.approx(0.4018, abs=1e-4)
    assert availability(50, 5, 1 / printed_rho) == pytest.approx(0.454, abs=1e-3)


@pytest.mark.parametrize("q", [0.3, 0.999999, 1.0, 1.000001, 4.0])
def test_availability_is_a_sum_over_the_null_vector_of_the_generator(q):
    distribution = stationary_by_null_vector(generator(q, 1.0, 9))  # over robots away
    for n_min in range(1, 10):
        assert availability(9, n_min, q) == pytest.approx(distribution[: 9 - n_min + 1].sum(), abs=1e-12)


def test_availability_of_large_swarms():
    assert availability(16_384, 100, 1.5) == pytest.approx(1.5**-100, rel=1e-9)
    assert availability(16_384, 8_193, 1 + 1e-13) == pytest.approx(8192 / 16385, rel=1e-6)
    assert availability(16_384, 8_192, 0.5) == 1.0


@pytest.mark.parametrize("q", [-0.1, math.nan])
def test_ratios_are_not_negative(q):
    with pytest.raises(PopulationError, match="lambda / mu"):
        availability(5, 3, q)


def test_robots_needed_are_a_whole_number():
    for n_min in (4.5, math.nan):
        with pytest.raises(CurveError, match="n_min as a whole number"):
            availability(50, n_min, 1.2)


def test_one_weight_serves_all_runs():
    runs = np.full((3, 2), 0.9)
    assert population_robustness(runs, [1.0, 1.0], HALF, horizon=50_000, n=10).shape == (3,)


def test_robots_recorded_at_work_weigh_each_interval():
    """8 and 5 of 10 robots at work: 8 - 0.8 * 10 = 0 and 6 - 0.5 * 10 = 1."""
    perf, active, ideal = [8.0, 6.0], [8.0, 5.0], [10.0, 10.0]
    values = {"sum": 1.0, "mean": 0.5, "last": 1.0}
    for reduce, expected in values.items():
        value = recorded_population_robustness(perf, active, ideal, 10.0, reduce=reduce)
        assert value == pytest.approx(expected, abs=1e-12)
    assert recorded_population_robustness(perf, active, ideal, [10.0, 5.0]) == pytest.approx(-4.0, abs=1e-12)
    assert recorded_population_robustness(perf, active, ideal, 10.0, relative=True) == pytest.approx(0.05, abs=1e-12)


def test_an_unlucky_run_of_a_proportional_swarm_is_as_robust_as_a_lucky_one():
    active = np.array([[9.0, 9.0], [6.0, 2.0]])
    np.testing.assert_allclose(recorded_population_robustness(active, active, [[10.0, 10.0]] * 2, 10.0), 0.0)
    expected_share = population_robustness(active, [[10.0, 10.0]] * 2, HALF, horizon=50_000, n=10)
    assert expected_share[0] - expected_share[1] == pytest.approx(10.0, abs=1e-9)


def test_relative_population_robustness():
    assert robustness("transient", relative=True) == pytest.approx(robustness("transient") / 2.0, abs=1e-12)


@pytest.mark.parametrize(("active", "ideal"), [([5.0], [0.0]), ([-1.0], [5.0])])
def test_robots_at_work_are_checked(active, ideal):
    with pytest.raises(CurveError, match="n_active_ideal > 0"):
        recorded_population_robustness([1.0], active, [1.0], ideal)
