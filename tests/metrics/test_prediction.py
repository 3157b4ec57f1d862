"""Prediction from swarm size: laws by hand, known parameters found again, intervals that hold what they promise."""

import math

import numpy as np
import pytest
from scipy.optimize import least_squares

from metrics import CurveError, SizeLaw, fit_law, forward_error, predict_performance
from metrics.laws import LAWS

SIZES = [1, 2, 4, 8, 16, 32]
LINEAR = SizeLaw(name="linear", a=5.0)
CONTENTION = SizeLaw(name="contention", a=5.0, contention=0.05)
UNIVERSAL = SizeLaw(name="universal", a=5.0, contention=0.02, coherency=0.002)


def poisson_runs(law, seed, *, sizes=SIZES, scale=10.0, n_runs=4):
    rng = np.random.default_rng(seed)
    return [rng.poisson(scale * mean, n_runs) / scale for mean in law.performance(sizes)]


def test_laws_by_hand():
    law = SizeLaw(name="universal", a=2.0, contention=0.1, coherency=0.01)
    # Ten robots: 2 * 10 / (1 + 0.1 * 9 + 0.01 * 90) = 20 / 2.8; the peak is at sqrt(0.9 / 0.01).
    assert law.performance([1, 10]).tolist() == pytest.approx([2.0, 20.0 / 2.8])
    assert law.peak == pytest.approx(math.sqrt(90.0))
    assert law.performance(law.peak) > max(law.performance([9.0, 10.0]))
    # Without coherency: 2 * 10 / 1.9, and never above a / s = 20.
    assert SizeLaw(name="contention", a=2.0, contention=0.1).performance(10) == pytest.approx(20.0 / 1.9)
    assert SizeLaw(name="contention", a=2.0, contention=0.1).peak == math.inf
    assert SizeLaw(name="linear", a=2.0).performance(10) == 20.0


def test_a_linear_fit_by_hand():
    # The root of a makes (2 - r)^2 + (2 - 2 r)^2 smallest: r = (2 + 4) / 5.
    assert fit_law("linear", [1, 4], [4.0, 4.0]).a == pytest.approx(1.44)


@pytest.mark.parametrize("law", [LINEAR, CONTENTION, UNIVERSAL], ids=LAWS)
def test_exact_data_give_the_parameters_back(law):
    found = fit_law("universal", SIZES, law.performance(SIZES))
    assert (found.a, found.contention, found.coherency) == pytest.approx((5.0, law.contention, law.coherency), abs=1e-9)
    assert found.n_parameters == 3
    prediction = predict_performance(
        SIZES, np.repeat(law.performance(SIZES)[:, None], 2, axis=1), [64, 128], n_resamples=5, seed=1
    )
    assert prediction.law.name == law.name
    assert prediction.value == pytest.approx(law.performance([64, 128]))
    assert prediction.lower == pytest.approx(prediction.value, rel=1e-5)
    assert prediction.upper == pytest.approx(prediction.value, rel=1e-5)


@pytest.mark.parametrize("seed", range(3))
def test_the_fit_is_the_least_squares_fit_of_roots(seed):
    means = np.array([runs.mean() for runs in poisson_runs(UNIVERSAL, seed)])

    def differences(parameters):
        a, s, k = parameters
        law = SizeLaw(name="universal", a=a, contention=s, coherency=k)
        return np.sqrt(law.performance(SIZES)) - np.sqrt(means)

    bounds = ([0.0, 0.0, 0.0], [np.inf, 1.0, np.inf])
    best = least_squares(differences, [5.0, 0.1, 0.01], bounds=bounds, xtol=1e-14, ftol=1e-14, gtol=1e-14)
    found = fit_law("universal", SIZES, means)
    assert (found.a, found.contention, found.coherency) == pytest.approx(best.x, rel=1e-3, abs=1e-5)


def test_noisy_data_give_parameters_and_critical_size_nearly():
    sizes = [*SIZES, 64]
    prediction = predict_performance(sizes, poisson_runs(UNIVERSAL, 1, sizes=sizes), [128], seed=1, n_resamples=100)
    assert prediction.law.name == "universal"
    assert prediction.law.a == pytest.approx(5.0, rel=0.05)
    assert prediction.critical == pytest.approx(UNIVERSAL.peak, rel=0.1)  # 22.1
    assert prediction.critical_lower <= UNIVERSAL.peak <= prediction.critical_upper < 32.0
    assert prediction.critical_share > 0.95
    assert sum(prediction.law_shares.values()) == pytest.approx(1.0)


def test_intervals_hold_the_truth_as_often_as_they_say():
    """Means of as many new runs, predicted at twice and four times the size; 24 studies of known laws."""
    inside = []
    sizes = [1, 2, 4, 8, 16]
    for seed in range(24):
        law = (LINEAR, CONTENTION, UNIVERSAL)[seed % 3]
        prediction = predict_performance(sizes, poisson_runs(law, seed, sizes=sizes), [32, 64], seed=1, n_resamples=40)
        truth = np.array([runs.mean() for runs in poisson_runs(law, 1000 + seed, sizes=[32, 64])])
        inside += ((prediction.lower <= truth) & (truth <= prediction.upper)).tolist()
    assert 0.85 <= np.mean(inside) <= 1.0
    assert len(inside) == 48


PEAKED = {16: 150, 32: 280, 64: 470, 128: 600, 256: 300, 512: 60}
"""Swarm size -> mean deliveries of a swarm that jams, without a run of one robot."""


@pytest.mark.parametrize("seed", range(4))
def test_a_swarm_that_jams_is_predicted_without_a_run_of_one_robot(seed):
    rng = np.random.default_rng(seed)
    runs = [rng.poisson(mean, 4) for mean in PEAKED.values()]
    prediction = predict_performance(list(PEAKED), runs, [1024], seed=1, n_resamples=40)
    assert prediction.law.name == "universal"
    assert 64.0 < prediction.critical < 256.0
    assert 0.0 <= prediction.lower[0] <= prediction.value[0] < 150.0
    assert math.isfinite(prediction.upper[0])


def test_one_robot_that_was_not_measured_has_at_most_ten_times_the_best_performance_per_robot():
    # 1 / (N - 1) is N / (N (N - 1)): without a bound the best fit has w = 1 and u = v = 0, an infinite a = 1 / (u + v).
    found = fit_law("universal", [2, 4, 8, 16], [1.0, 1.0 / 3.0, 1.0 / 7.0, 1.0 / 15.0])
    assert found.a == pytest.approx(5.0)  # the best is two robots with 1, 0.5 each
    # P(N) = 1 / (0.2 / N + w (N - 1)) with w a bit below 1.
    assert found.performance([2, 16]) == pytest.approx([1.0, 1.0 / 15.0], rel=0.1)
    # What does not need the bound is fitted as before: performance that is constant has s = 1.
    flat = fit_law("universal", [2, 4, 8, 16], [3.0, 3.0, 3.0, 3.0])
    assert (flat.a, flat.contention, flat.coherency) == pytest.approx((3.0, 1.0, 0.0), abs=1e-6)


def test_peaked_performance_never_breaks_a_fit():
    """Means that rise to a peak at any place and fall at any rate, fitted to sizes that leave one robot out."""
    rng = np.random.default_rng(5)
    sizes = np.array([4, 8, 16, 32, 64])
    for _study in range(100):
        peak, rise, fall = rng.uniform(4.0, 64.0), rng.uniform(0.5, 3.0), rng.uniform(0.5, 6.0)
        means = 100.0 * np.where(sizes < peak, (sizes / peak) ** rise, (sizes / peak) ** -fall)
        for name in LAWS:
            law = fit_law(name, sizes.tolist(), means)
            assert 0.0 < law.a <= 10.0 * (means / sizes).max() * (1.0 + 1e-9)
            assert 0.0 <= law.contention <= 1.0
            assert law.coherency >= 0.0


def test_no_critical_size_where_performance_only_rises():
    prediction = predict_performance(SIZES, poisson_runs(LINEAR, 2), [64], seed=1, n_resamples=60)
    assert prediction.critical == math.inf
    assert prediction.limit == 128.0
    assert prediction.critical_share < 0.5


def test_a_peak_beyond_what_is_looked_at_is_none():
    far = SizeLaw(name="universal", a=5.0, contention=0.1, coherency=1e-6)
    assert far.peak == pytest.approx(948.7, abs=0.1)
    runs = np.repeat(far.performance(SIZES)[:, None], 2, axis=1)
    assert predict_performance(SIZES, runs, [64], n_resamples=3, seed=1).critical == math.inf


def test_a_law_is_judged_by_predicting_the_next_sizes():
    # Roots 1, 2, 3 at N = 1, 4, 9 are linear with a = 1, which predicts 4 at N = 16, twice the root that is measured.
    assert forward_error("linear", [1, 4, 9, 16], [1.0, 4.0, 9.0, 4.0]) == pytest.approx(2.0)
    # Sizes more than four times the largest fitted one are not asked for.
    assert forward_error("linear", [1, 4, 9, 37], [1.0, 4.0, 9.0, 4.0]) == math.inf


def test_swarms_without_performance_at_small_sizes_are_fitted():
    runs = [[0, 0], [0, 0], [0, 0], [1, 3], [6, 4], [11, 9]]
    prediction = predict_performance(SIZES, runs, [64], seed=1, n_resamples=20)
    assert np.isfinite(prediction.value).all()
    assert prediction.value[0] > 0.0


@pytest.mark.parametrize(
    ("sizes", "runs", "reason"),
    [
        ([1, 2, 4], [[1, 2]] * 3, "4 or more swarm sizes to fit, got 3"),
        ([1, 2, 4, 4], [[1, 2]] * 4, "rising order, got 1, 2, 4, 4"),
        ([0, 2, 4, 8], [[1, 2]] * 4, ">= 1 robot"),
        (SIZES, [[1, 2]] * 5, "the runs of 6 swarm sizes, got those of 5"),
        (SIZES, [[1]] * 6, "two or more runs with 1 robots"),
        (SIZES, [[1, -2]] * 6, "finite performances >= 0"),
        (SIZES, [[0, 0]] * 6, "above 0 at some swarm size"),
    ],
)
def test_what_cannot_be_fitted_is_refused(sizes, runs, reason):
    with pytest.raises(CurveError, match=reason):
        predict_performance(sizes, runs, [64])


def test_a_fit_refuses_what_it_cannot_use():
    with pytest.raises(CurveError, match="3 or more different sizes for the universal law, got 2"):
        fit_law("universal", [1, 2], [1.0, 2.0])
    for function in (fit_law, forward_error):
        with pytest.raises(CurveError, match="for each of 4 sizes"):
            function("linear", [1, 2, 4, 8], [1.0, -2.0, 3.0, 4.0])
    with pytest.raises(ValueError, match="'hamann', got 'cubic'"):
        fit_law("cubic", [1, 2, 3], [1.0, 2.0, 3.0])
