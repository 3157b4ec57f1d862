"""The universal law of swarm sizes is found again in what it made."""

import numpy as np
import pytest

from metrics import CurveError, fit_law

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
    for _ in range(200):
        runs = rng.poisson(law(np.array(SIZES)[:, None], a=20.0), (len(SIZES), 8))
        low, high = fit_law(SIZES, runs).interval(48)
        held += low <= truth <= high
    assert 180 <= held <= 199


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
