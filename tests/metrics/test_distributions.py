"""Interquartile mean and probability of improvement: by hand, and beside what other programs give."""

import math

import numpy as np
import pytest
from scipy import stats

from metrics import CurveError, interquartile_mean, probability_of_improvement
from metrics.distributions import optimality_gap, performance_profile

FIRST = [[1.0, 5, 9, 2, 7, 11, 3, 30], [0, 2, 4, 6, 8, 10, 12, 1]]
SECOND = [[2.0, 4, 6, 2, 1, 12, 0, 3], [3, 2, 5, 5, 9, 10, 15, 0]]


def test_the_interquartile_mean_is_that_of_rliable_and_scipy():
    # rliable 1.2.0: aggregate_iqm(scores.T) = 5.5, interval of 50,000 resamples [2.875, 8.625].
    found = interquartile_mean(FIRST, seed=1)
    assert found.value == 5.5
    assert (found.lower, found.upper) == pytest.approx((2.875, 8.625), abs=0.25)
    assert found.n_runs == 16
    assert found.holds(5.5)
    assert not found.holds(9.0)
    assert interquartile_mean(SECOND[0]).value == 2.75 == stats.trim_mean(SECOND[0], 0.25)
    # 14 values: a quarter of them, 3.5, is rounded down. rliable: 4.5.
    assert interquartile_mean([level[:7] for level in SECOND]).value == 4.5


def test_runs_are_resampled_within_their_level():
    # Both runs of each level are alike, so that no resample can differ; mixing the levels would give 0 to 10.
    found = interquartile_mean([[0.0, 0.0], [10.0, 10.0]], seed=1)
    assert (found.value, found.lower, found.upper) == (5.0, 5.0, 5.0)


def test_one_broken_run_moves_the_mean_but_not_the_middle():
    calm, broken = [10.0] * 8, [10.0] * 7 + [0.0]
    assert interquartile_mean(calm).value == interquartile_mean(broken).value == 10.0


def test_missing_runs_are_left_out_and_levels_may_differ_in_runs():
    found = interquartile_mean([[1.0, math.nan, 3.0], [5.0, 7.0]], seed=1)
    assert (found.value, found.n_runs) == (4.0, 4)
    alone = interquartile_mean([3.0, math.nan])
    assert alone.value == 3.0
    assert math.isnan(alone.lower)


def test_the_probability_of_improvement_is_that_of_rliable():
    # rliable 1.2.0: probability_of_improvement(first.T, second.T) = 0.57421875, interval of 20,000 resamples
    # [0.375, 0.76953125]; with five runs of the first 0.49375.
    found = probability_of_improvement(FIRST, SECOND, seed=1)
    assert found.value == 0.57421875
    assert (found.lower, found.upper) == pytest.approx((0.375, 0.76953125), abs=0.02)
    fewer = probability_of_improvement([level[:5] for level in FIRST], SECOND)
    assert (fewer.value, fewer.n_runs) == (0.49375, 10)


def test_improvement_by_hand_in_both_directions():
    # 3 beats 1 and 2; 4 beats 1 and 2 and ties 4; 5 beats all: 2 + 2.5 + 3 of 9.
    assert probability_of_improvement([3, 4, 5], [1, 2, 4]).value == pytest.approx(7.5 / 9)
    assert probability_of_improvement([3, 4, 5], [1, 2, 4], higher_is_better=False).value == pytest.approx(1.5 / 9)
    apart = probability_of_improvement([3, 4], [1, 2], seed=1)
    assert (apart.value, apart.lower, apart.upper) == (1.0, 1.0, 1.0)
    assert math.isnan(probability_of_improvement([3.0], [1.0, 2.0]).lower)


def test_intervals_hold_the_truth_as_often_as_they_say():
    rng = np.random.default_rng(3)
    truth = stats.norm.cdf(1.0 / math.sqrt(2.0))  # of two normal variables, one of them shifted by 1
    hits = [
        probability_of_improvement(rng.normal(1.0, 1.0, 16), rng.normal(0.0, 1.0, 16), seed=k, n_resamples=400).holds(
            truth
        )
        for k in range(200)
    ]
    assert 0.87 < np.mean(hits) < 0.99


@pytest.mark.parametrize("values", [[], [math.nan], [[1.0], [math.nan]], [[[1.0]]]], ids=["none", "nan", "level", "3d"])
def test_levels_without_runs_are_refused(values):
    with pytest.raises(CurveError, match="Expected values with at least one run"):
        interquartile_mean(values)


def test_nonsense_is_refused():
    with pytest.raises(CurveError, match="got 2 and 1 levels"):
        probability_of_improvement(FIRST, FIRST[:1])
    with pytest.raises(ValueError, match="confidence level"):
        interquartile_mean([1.0], level=1.0)
    with pytest.raises(ValueError, match="n_resamples"):
        probability_of_improvement([1.0], [2.0], n_resamples=0)


def test_the_optimality_gap_is_that_of_rliable():
    # rliable 1.2.0: aggregate_optimality_gap(scores, gamma) = gamma - mean of min(scores, gamma)
    scores = np.array([[0.2, 0.9, 1.4], [0.5, 2.0, 1.0]])
    assert optimality_gap(scores) == pytest.approx(1.0 - np.minimum(scores, 1.0).mean())
    assert optimality_gap([0.5, math.nan, 1.5]) == 0.25
    with pytest.raises(CurveError, match="at least one run"):
        optimality_gap([math.nan])


def test_the_profile_is_the_share_of_runs_above_each_threshold():
    runs = np.array([0.5, 1.0, math.nan, 2.0, 2.0])
    np.testing.assert_array_equal(performance_profile(runs, [0.0, 0.5, 1.0, 1.5, 2.0]), [1.0, 0.75, 0.5, 0.5, 0.0])
    with pytest.raises(CurveError, match="at least one run"):
        performance_profile([], [0.0])
