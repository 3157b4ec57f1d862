"""Laws beside a ladder of swarm sizes: known parameters found again, critical sizes, classes of scaling."""

import math

import numpy as np
import pytest
from scipy.optimize import curve_fit

from metrics import CurveError, SizeLaw, fit_ladder, fit_law
from metrics.laws import ALL_LAWS, PARAMETERS

SIZES = [1, 2, 4, 8, 16, 32, 64]
LAWS = {
    "linear": SizeLaw(name="linear", a=5.0),
    "contention": SizeLaw(name="contention", a=5.0, contention=0.05),
    "universal": SizeLaw(name="universal", a=5.0, contention=0.02, coherency=0.002),
    "power": SizeLaw(name="power", a=5.0, exponent=0.8),
    "hamann": SizeLaw(name="hamann", a=5.0, exponent=1.3, decay=-0.05),
}


def poisson_runs(law, seed, *, n_runs=6, scale=10.0):
    rng = np.random.default_rng(seed)
    return [rng.poisson(scale * mean, n_runs) / scale for mean in law.performance(SIZES)]


def test_the_two_further_laws_by_hand():
    assert SizeLaw(name="power", a=3.0, exponent=0.5).performance([1, 4, 16]).tolist() == [3.0, 6.0, 12.0]
    assert SizeLaw(name="power", a=3.0, exponent=0.5).peak == math.inf
    law = SizeLaw(name="hamann", a=2.0, exponent=2.0, decay=-0.1)
    assert law.performance(10) == pytest.approx(2.0 * 100.0 / math.e)
    assert law.peak == pytest.approx(20.0)
    assert law.performance(law.peak) > max(law.performance([19.0, 21.0]))
    assert law.n_parameters == 3


@pytest.mark.parametrize("name", ALL_LAWS)
def test_exact_data_give_the_parameters_back(name):
    law = LAWS[name]
    found = fit_law(name, SIZES, law.performance(SIZES))
    for parameter in PARAMETERS[name]:
        assert getattr(found, parameter) == pytest.approx(getattr(law, parameter), rel=1e-5, abs=1e-9)


def test_the_law_of_hamann_is_the_least_squares_fit_of_roots():
    means = np.array([runs.mean() for runs in poisson_runs(LAWS["hamann"], 1)])

    def root(n, a, b, c):
        return np.sqrt(a * n**b * np.exp(c * n))

    expected, _ = curve_fit(root, np.array(SIZES, dtype=float), np.sqrt(means), p0=(4.0, 1.0, -0.02))
    found = fit_law("hamann", SIZES, means)
    assert (found.a, found.exponent, found.decay) == pytest.approx(expected, rel=1e-4)


def test_a_ladder_with_a_peak():
    found = fit_ladder(SIZES, poisson_runs(LAWS["universal"], 2), n_resamples=40, seed=1)
    fit = found.laws["universal"]
    truth = {"a": 5.0, "contention": 0.02, "coherency": 0.002}
    assert all(fit.parameters[name].holds(value) for name, value in truth.items())
    assert fit.peak.holds(math.sqrt(0.98 / 0.002))  # 22.1
    assert fit.peak.upper - fit.peak.lower < 10.0
    assert found.best_size in (16, 32)
    assert found.falling_share == 1.0
    assert found.closest in ("universal", "hamann")
    assert found.laws["linear"].error > 5.0 * fit.error
    assert found.laws["linear"].peak.value == math.inf
    assert found.exponent.n_runs == 6 * len(SIZES)


@pytest.mark.parametrize(
    ("exponent", "scaling"), [(0.8, "sublinear"), (1.0, "linear"), (1.2, "superlinear")], ids=["below", "one", "above"]
)
def test_classes_of_scaling(exponent, scaling):
    law = SizeLaw(name="power", a=20.0, exponent=exponent)
    found = fit_ladder(SIZES, poisson_runs(law, 3), n_resamples=40, seed=1)
    assert found.scaling == scaling
    assert found.exponent.value == pytest.approx(exponent, abs=0.02)
    assert found.falling_share == 0.0


def test_few_scattered_runs_leave_the_class_undecided():
    runs = [[0.5 * mean, 1.5 * mean] for mean in LAWS["linear"].performance(SIZES[:4])]
    assert fit_ladder(SIZES[:4], runs, n_resamples=40, seed=1).scaling == "undecided"


def test_a_ladder_that_cannot_be_fitted_is_refused():
    runs = [[1.0, 2.0]] * 4
    with pytest.raises(CurveError, match="rising order"):
        fit_ladder([1, 4, 2, 8], runs)
    with pytest.raises(CurveError, match="4 or more"):
        fit_ladder([1, 2, 4], runs[:3])
    with pytest.raises(CurveError, match="two or more runs"):
        fit_ladder([1, 2, 4, 8], [[1.0], *runs[1:]])
    with pytest.raises(ValueError, match="confidence level"):
        fit_ladder([1, 2, 4, 8], runs, level=0.0)
