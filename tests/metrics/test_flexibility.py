"""Reactivity, adaptability and robustness to noise, by hand."""

import numpy as np
import pytest

from metrics import CurveError, adaptability, mean_signed_difference, noise_robustness, reactivity

IDEAL = [1.0, 1.0, 1.0, 1.0]
THROTTLE = [0.0, 0.5, 0.5, 0.0]
ONE_SAMPLE_LATE = [1.0, 1.0, 0.5, 0.5]
IN_TIME = [1.0, 0.5, 0.5, 1.0]


def test_a_swarm_that_reacts_late():
    assert reactivity(IDEAL, ONE_SAMPLE_LATE, THROTTLE, 0.0) == pytest.approx(0.5, abs=1e-9)
    assert adaptability(IDEAL, ONE_SAMPLE_LATE) == pytest.approx(1.0, abs=1e-9)
    assert noise_robustness(IDEAL, ONE_SAMPLE_LATE) == pytest.approx(1.0, abs=1e-9)


def test_perfect_swarms():
    assert reactivity(IDEAL, IN_TIME, THROTTLE, np.zeros(4)) == 0.0
    assert adaptability(IDEAL, IN_TIME) == pytest.approx(1.0, abs=1e-12)  # perfectly reactive is not adaptable
    assert adaptability(IDEAL, IDEAL) == 0.0
    assert reactivity(IDEAL, IDEAL, THROTTLE, 0.0) == pytest.approx(1.0, abs=1e-12)


def test_relative_distances_are_shares_of_the_ideal_performance():
    """Two intervals of four lost half: 1 object of 4, a quarter."""
    assert adaptability(IDEAL, IN_TIME, relative=True) == pytest.approx(0.25, abs=1e-12)
    assert noise_robustness(IDEAL, IN_TIME, relative=True) == pytest.approx(0.25, abs=1e-12)
    assert reactivity(IDEAL, IDEAL, THROTTLE, 0.0, relative=True) == pytest.approx(0.25, abs=1e-12)
    assert np.isnan(adaptability([0.0], [0.0], relative=True))
    assert np.isposinf(adaptability([0.0], [1.0], relative=True))


def test_the_printed_factor_rewards_gaining_from_adversity():
    observed = [5.0, 5.0]
    assert reactivity([1.0, 1.0], observed, 0.5, 0.1, model="paper") == pytest.approx(0.0, abs=1e-12)
    assert reactivity([1.0, 1.0], observed, 0.5, 0.1) == pytest.approx(2 * 4.4, abs=1e-12)
    with pytest.raises(CurveError, match="model='linear'"):
        reactivity([1.0, 1.0], observed, 0.5, 0.0, model="paper")


def test_reciprocal_factor_for_penalties():
    assert reactivity([4.0, 4.0], [2.0, 2.0], [2.0, 2.0], 1.0, model="reciprocal") == 0.0


def test_without_deviation_reactivity_is_adaptability():
    rng = np.random.default_rng(2)
    ideal, observed, waves = rng.random((3, 6, 20))
    assert np.array_equal(reactivity(ideal, observed, waves, waves), adaptability(ideal, observed))


def test_one_waveform_serves_all_runs():
    ideal, observed = np.ones((5, 4)), np.tile(ONE_SAMPLE_LATE, (5, 1))
    assert reactivity(ideal, observed, THROTTLE, 0.0).tolist() == [0.5] * 5


def test_waveforms_of_other_runs_are_refused():
    with pytest.raises(CurveError, match=r"axes that broadcast, got perf_ideal \(2, 4\), perf \(2, 4\), v \(3, 4\)"):
        reactivity(np.ones((2, 4)), np.ones((2, 4)), np.ones((3, 4)), 0.0)


def test_a_swarm_that_gains_from_noise_scores_as_badly_as_one_that_loses():
    assert noise_robustness(IDEAL, [1.5] * 4) == noise_robustness(IDEAL, [0.5] * 4) == 2.0
    assert mean_signed_difference(IDEAL, [1.5] * 4) == 0.5
    assert mean_signed_difference(IDEAL, [0.5] * 4) == -0.5
