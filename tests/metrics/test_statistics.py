"""Normalisation, intervals over runs, bootstrap, by hand and by counting how often an interval covers the truth."""

import math

import numpy as np
import pytest
from scipy import stats

from metrics import CurveError, adaptability, aggregate, bootstrap_measure, normalize, scalability, spatial_emergence


def test_normalize_by_hand():
    assert normalize(1.0) == pytest.approx(0.462117157, abs=1e-9)
    assert normalize(1.0, distance=True) == pytest.approx(-0.462117157, abs=1e-9)
    sigmoid = 1 / (1 + np.exp(-np.array([-2.0, 0.3])))
    assert normalize([-2.0, 0.3]) == pytest.approx(2 * sigmoid - 1, abs=1e-12)


def test_normalize_does_not_overflow():
    assert normalize([-1e6, 1e6]).tolist() == [-1.0, 1.0]
    assert normalize([0.0, 1e6], distance=True).tolist() == [0.0, -1.0]


def test_student_interval_by_hand():
    summary = aggregate([1, 2, 3, 4, 5])
    assert (summary.mean, summary.n_used, summary.n_nan) == (3.0, 5, 0)
    assert summary.std == pytest.approx(1.58113883, abs=1e-8)
    assert (summary.lower, summary.upper) == pytest.approx((1.0367568, 4.9632432), abs=1e-7)


def test_student_interval_is_scipys():
    values = np.random.default_rng(1).normal(size=12)
    expected = stats.t.interval(0.9, 11, loc=values.mean(), scale=stats.sem(values))
    summary = aggregate(values, level=0.9)
    assert (summary.lower, summary.upper) == pytest.approx(expected, abs=1e-12)


def test_bands_of_the_paper_by_hand():
    summary = aggregate([1, 2, 3, 4, 5], method="two_sd")
    assert (summary.lower, summary.upper) == pytest.approx((-0.16227766, 6.16227766), abs=1e-8)


def test_bands_of_the_paper_are_fourteen_times_wider():
    values = np.random.default_rng(2).normal(size=192)
    bands, interval = aggregate(values, method="two_sd"), aggregate(values)
    assert (bands.upper - bands.lower) / (interval.upper - interval.lower) == pytest.approx(14, abs=0.1)


def test_intervals_cover_the_true_mean_as_often_as_they_say():
    rng = np.random.default_rng(3)
    n_studies = 300
    covered = 0
    for _ in range(n_studies):
        summary = aggregate(rng.normal(5.0, 2.0, size=40), level=0.9)
        covered += summary.lower <= 5.0 <= summary.upper
    assert covered / n_studies == pytest.approx(0.9, abs=0.055)  # three standard errors of a share of 0.9


@pytest.mark.parametrize("method", ["t", "two_sd"])
def test_runs_that_cannot_be_scored_are_left_out_and_counted(method):
    summary = aggregate([1.0, math.nan, 3.0, math.nan], method=method)
    assert (summary.mean, summary.n_used, summary.n_nan) == (2.0, 2, 2)
    assert summary.lower < 2.0 < summary.upper


@pytest.mark.parametrize("method", ["t", "two_sd"])
def test_one_run_says_nothing_about_the_spread(method):
    summary = aggregate([1.0, math.nan], method=method)
    assert summary.mean == 1.0
    assert np.isnan([summary.std, summary.lower, summary.upper]).all()


def test_no_run_at_all():
    summary = aggregate([math.nan, math.nan])
    assert math.isnan(summary.mean)
    assert (summary.n_used, summary.n_nan) == (0, 2)


def test_infinite_values_stay_visible():
    summary = aggregate([1.0, -math.inf])
    assert summary.mean == -math.inf
    assert math.isnan(summary.std)


@pytest.mark.parametrize("values", [[], [[1.0, 2.0]], 1.0])
def test_aggregate_wants_one_value_per_run(values):
    with pytest.raises(CurveError, match="one value per run"):
        aggregate(values)


@pytest.mark.parametrize("level", [0.0, 1.0, 95.0, math.nan])
def test_levels_are_probabilities(level):
    with pytest.raises(ValueError, match="level"):
        aggregate([1.0, 2.0], level=level)


def noisy_runs(seed, n_runs=24, n_intervals=10, level=5.0):
    return level + np.random.default_rng(seed).uniform(-1, 1, size=(n_runs, n_intervals))


def test_bootstrap_per_run_is_the_mean_of_the_measure():
    ideal, observed = noisy_runs(1), noisy_runs(2)
    summary = bootstrap_measure(adaptability, ideal, observed, seed=1, n_resamples=200)
    values = adaptability(ideal, observed)
    assert summary.mean == pytest.approx(values.mean(), abs=1e-12)
    assert summary.std == pytest.approx(values.std(ddof=1), abs=1e-12)
    assert summary.lower < summary.mean < summary.upper
    assert (summary.n_used, summary.n_nan) == (24, 0)


def test_bootstrap_of_mean_curves_lowers_the_noise_floor():
    ideal, observed = noisy_runs(1), noisy_runs(2)
    options = {"seed": 1, "n_resamples": 200}
    mean_curve = bootstrap_measure(adaptability, ideal, observed, order="mean_curve", **options)
    assert mean_curve.mean == pytest.approx(adaptability(ideal.mean(axis=0), observed.mean(axis=0)), abs=1e-12)
    assert math.isnan(mean_curve.std)
    assert mean_curve.upper < bootstrap_measure(adaptability, ideal, observed, **options).lower


@pytest.mark.parametrize("order", ["per_run", "mean_curve"])
def test_bootstrap_covers_the_truth_as_often_as_it_says(order):
    def gain(small, large):
        return large[..., 0] - 2 * small[..., 0]

    n_studies = 100
    covered = 0
    for seed in range(n_studies):
        small, large = noisy_runs(2 * seed, level=5.0), noisy_runs(2 * seed + 1, level=11.0)
        summary = bootstrap_measure(gain, small, large, order=order, level=0.9, seed=seed, n_resamples=200)
        covered += summary.lower <= 1.0 <= summary.upper
    assert covered / n_studies == pytest.approx(0.9, abs=0.09)  # three standard errors of a share of 0.9


def test_bootstrap_keeps_curves_of_the_same_runs_together():
    perf, lost = noisy_runs(1), np.random.default_rng(9).random((24, 10)) * 0.2
    one = (np.full((24, 10), 1.0), np.full((24, 10), 0.1))

    def spatial(small, large, alone):
        return spatial_emergence(*small, 2, *large, 4, *alone)

    small, large = (perf, lost), (2 * perf, lost)
    summary = bootstrap_measure(spatial, small, large, one, seed=1, n_resamples=50)
    expected = spatial_emergence(perf, lost, 2, 2 * perf, lost, 4, *one)
    assert summary.mean == pytest.approx(expected.mean(), abs=1e-12)


def test_bootstrap_of_unequal_experiments_needs_mean_curves():
    def theta(small, large):
        return scalability(small, 1, large, 2)

    few, many = noisy_runs(1, n_runs=8), noisy_runs(2, n_runs=24)
    with pytest.raises(CurveError, match="equally many runs"):
        bootstrap_measure(theta, few, many)
    summary = bootstrap_measure(theta, few, many, order="mean_curve", seed=1)
    assert summary.n_used == 8
    assert summary.lower < summary.mean < summary.upper


def test_bootstrap_leaves_out_runs_that_cannot_be_scored():
    ideal, observed = noisy_runs(1), noisy_runs(2)
    observed[3, 4] = math.nan
    summary = bootstrap_measure(adaptability, ideal, observed, seed=1, n_resamples=50)
    assert (summary.n_used, summary.n_nan) == (23, 1)
    assert math.isfinite(summary.lower)
    assert math.isnan(bootstrap_measure(adaptability, ideal, observed, order="mean_curve", n_resamples=5).mean)


def test_bootstrap_works_where_hardly_a_resample_is_without_such_runs():
    ideal, observed = noisy_runs(1), noisy_runs(2)
    observed[::2, 0] = math.nan
    summary = bootstrap_measure(adaptability, ideal, observed, seed=1, n_resamples=50)
    assert summary.n_nan == 12
    assert summary.lower < summary.mean < summary.upper


def test_bootstrap_resamples_experiments_on_their_own():
    """Runs of equal number would cancel, which is chance where experiments have nothing to do with each other."""
    runs = noisy_runs(1)
    summary = bootstrap_measure(lambda few, many: many.mean(axis=-1) - few.mean(axis=-1), runs, runs, seed=1)
    assert summary.mean == 0.0
    assert summary.upper - summary.lower > 0.1


@pytest.mark.parametrize("order", ["per_run", "mean_curve"])
def test_bootstrap_of_one_run_has_no_bounds(order):
    summary = bootstrap_measure(adaptability, noisy_runs(1, n_runs=1), noisy_runs(2, n_runs=1), order=order)
    assert math.isfinite(summary.mean)
    assert np.isnan([summary.lower, summary.upper]).all()


def test_bootstrap_refuses_what_it_cannot_resample():
    with pytest.raises(CurveError, match="same runs"):
        bootstrap_measure(adaptability, [1.0, 2.0], [1.0, 2.0])
    with pytest.raises(CurveError, match="same runs"):
        bootstrap_measure(adaptability, (noisy_runs(1, n_runs=3), noisy_runs(1, n_runs=4)), noisy_runs(2, n_runs=3))
    with pytest.raises(ValueError, match="n_resamples"):
        bootstrap_measure(adaptability, noisy_runs(1), noisy_runs(2), n_resamples=0)
    with pytest.raises(ValueError, match="experiment"):
        bootstrap_measure(adaptability)
