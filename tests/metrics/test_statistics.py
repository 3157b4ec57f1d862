"""Statistics over runs: by hand, beside what other programs give, and by how often an interval covers the truth."""

import math

import numpy as np
import pytest
from scipy import stats

from metrics import (
    CurveError,
    aggregate,
    fit_law,
    interquartile_mean,
    normalize,
    paired_tests,
    probability_of_improvement,
)
from metrics.statistics import holm, paired_p

NAN = math.nan
FIRST = [[1.0, 5, 9, 2, 7, 11, 3, 30], [0, 2, 4, 6, 8, 10, 12, 1]]
SECOND = [[2.0, 4, 6, 2, 1, 12, 0, 3], [3, 2, 5, 5, 9, 10, 15, 0]]


def test_normalize_by_hand():
    sigmoid = 1 / (1 + np.exp(-np.array([-2.0, 0.3, 1.0])))
    assert normalize([-2.0, 0.3, 1.0]) == pytest.approx(2 * sigmoid - 1, abs=1e-12)
    assert normalize([0.0, 1e6], distance=True).tolist() == [0.0, -1.0], "no overflow"


def test_students_interval_is_scipys_and_the_bands_are_two_deviations():
    values = np.array([1.0, 2, 3, 4, 5])
    found = aggregate([*values, NAN])
    assert (found.mean, found.n_used, found.n_nan) == (3.0, 5, 1)
    assert (found.std, found.lower, found.upper) == pytest.approx((1.58113883, 1.0367568, 4.9632432), abs=1e-7)
    expected = stats.t.interval(0.9, 4, loc=3.0, scale=stats.sem(values))
    found = aggregate(values, level=0.9)
    assert (found.lower, found.upper) == pytest.approx(expected, abs=1e-12)
    bands = aggregate([*values, NAN], method="two_sd")
    assert (bands.lower, bands.upper) == pytest.approx((-0.16227766, 6.16227766), abs=1e-8)


@pytest.mark.parametrize(("runs", "mean"), [([1.0, NAN], 1.0), ([NAN, NAN], NAN), ([1.0, -math.inf], -math.inf)])
def test_where_runs_have_no_scatter_only_the_mean_is_known(runs, mean):
    found = aggregate(runs)
    assert found.mean == pytest.approx(mean, nan_ok=True)
    assert np.isnan([found.std, found.lower, found.upper]).all()


@pytest.mark.parametrize(
    ("values", "expected"),
    [([0.0, 0.0, 0.0], 1.0), ([2.0, 2.0, 2.0], 0.25), ([1.0], NAN), ([], NAN), ([math.inf, 1.0], NAN)],
)
def test_where_students_t_does_not_exist(values, expected):
    assert paired_p(np.array(values)) == pytest.approx(expected, nan_ok=True)


def test_holms_example_by_hand():
    # Sorted 0.01, 0.03, 0.04 times 3, 2, 1: 0.03, 0.06, 0.04, never falling.
    np.testing.assert_allclose(holm(np.array([0.04, 0.01, NAN, 0.03])), [0.06, 0.03, NAN, 0.06])
    np.testing.assert_allclose(holm(np.array([0.9, 0.8])), [1.0, 1.0])
    assert holm(np.empty(0)).size == 0


def test_levels_are_tested_together_and_a_missing_run_takes_its_partner_along():
    first = np.array([[4.0, 6.0, 8.0, NAN], [5.0, 5.0, 6.0, 7.0]])
    second = np.array([[1.0, 2.0, 3.0, 9.0], [5.0, 6.0, 5.0, NAN]])
    # Differences 3, 4, 5 and 0, -1, 1: p values of scipy, the smaller one times two.
    p = [stats.ttest_rel(a[:3], b[:3]).pvalue for a, b in zip(first, second, strict=True)]
    np.testing.assert_allclose(paired_tests(first, second), [2 * p[0], p[1]])
    np.testing.assert_allclose(paired_tests(first[0], second[0]), p[0])
    np.testing.assert_allclose(paired_tests([first[0], [1.0, NAN, NAN, NAN]], second), [p[0], NAN])


def test_the_interquartile_mean_is_that_of_rliable_and_scipy():
    # rliable 1.2.0: aggregate_iqm(scores.T) = 5.5, interval of 50,000 resamples [2.875, 8.625].
    found = interquartile_mean(FIRST, seed=1)
    assert (found.value, found.n_runs) == (5.5, 16)
    assert (found.lower, found.upper) == pytest.approx((2.875, 8.625), abs=0.25)
    assert found.holds(5.5)
    assert not found.holds(9.0)
    assert interquartile_mean(SECOND[0]).value == 2.75 == stats.trim_mean(SECOND[0], 0.25)
    # 14 values: a quarter of them, 3.5, is rounded down. rliable: 4.5.
    assert interquartile_mean([level[:7] for level in SECOND]).value == 4.5


def test_runs_are_resampled_within_their_level():
    # Both runs of each level are alike, so that no resample can differ; mixing the levels would give 0 to 10.
    found = interquartile_mean([[0.0, 0.0], [10.0, 10.0]], seed=1)
    assert (found.value, found.lower, found.upper) == (5.0, 5.0, 5.0)


def test_missing_runs_are_left_out_and_levels_may_differ_in_runs():
    found = interquartile_mean([[1.0, NAN, 3.0], [5.0, 7.0]], seed=1)
    assert (found.value, found.n_runs) == (4.0, 4)
    alone = interquartile_mean([3.0, NAN])
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


@pytest.mark.parametrize(
    ("call", "message"),
    [
        *((lambda v=values: aggregate(v), "one value per run") for values in ([], [[1.0, 2.0]], 1.0)),
        *((lambda x=level: aggregate([1.0, 2.0], level=x), "level") for level in (0.0, 1.0, 95.0, NAN)),
        *((lambda v=v: interquartile_mean(v), "at least one run") for v in ([], [NAN], [[1.0], [NAN]], [[[1.0]]])),
        (lambda: probability_of_improvement(FIRST, FIRST[:1]), "2 and 1 levels"),
        (lambda: paired_tests([1.0, 2.0], [1.0]), "same shape"),
        (lambda: paired_tests(1.0, 1.0), "same shape"),
    ],
)
def test_what_does_not_fit_is_refused(call, message):
    with pytest.raises(ValueError, match=message) as raised:
        call()
    assert message == "level" or isinstance(raised.value, CurveError)


SIZES = (1, 2, 4, 8, 16, 32)


def law(n, a=2.0, s=0.1, k=0.01):
    return a * n / (1.0 + s * (n - 1.0) + k * n * (n - 1.0))


def test_the_worked_example():
    found = fit_law(SIZES, law(np.array(SIZES)))
    assert found.performance(10) == pytest.approx(20.0 / 2.8, rel=1e-6)
    assert found.peak == pytest.approx(np.sqrt(90.0), rel=1e-4)


def test_a_swarm_that_never_hinders_itself_has_no_peak():
    assert fit_law(SIZES, 3.0 * np.array(SIZES)).performance(100) == pytest.approx(300.0, rel=1e-3)


def test_the_interval_holds_the_truth_nineteen_times_in_twenty():
    rng = np.random.default_rng(4)
    truth = law(48.0, a=20.0)
    held = 0
    for _ in range(100):
        runs = rng.poisson(law(np.array(SIZES)[:, None], a=20.0), (len(SIZES), 8))
        low, high = fit_law(SIZES, runs).interval(48)
        held += low <= truth <= high
    assert 90 <= held <= 99


@pytest.mark.parametrize(
    ("sizes", "values", "told"),
    [
        ((1, 2, 4), (1.0, 2.0, 3.0), "four or more"),
        (SIZES, (1.0, 2.0), "each of 6 sizes"),
        (SIZES, (0.0,) * 6, "some above 0"),
        (SIZES, (1.0, np.nan, 1.0, 1.0, 1.0, 1.0), "finite"),
    ],
)
def test_what_is_no_performance_is_refused(sizes, values, told):
    with pytest.raises(CurveError, match=told):
        fit_law(sizes, values)
