"""Rules that each measure obeys for any curves; each measure of the catalogue is listed, or left out for a reason."""

import dtaidistance.dtw
import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

import metrics
from metrics import MEASURES, PopulationRates, dtw, noise_floor
from tests.reference.measures import dtw_by_matrix

N_INTERVALS = 6

performance = arrays(np.float64, N_INTERVALS, elements=st.floats(0.0, 100.0))
working = arrays(np.float64, N_INTERVALS, elements=st.floats(0.01, 100.0))
fraction = arrays(np.float64, N_INTERVALS, elements=st.floats(0.0, 1.0))
sizes = st.tuples(st.integers(1, 64), st.integers(1, 64)).map(lambda pair: (pair[0], pair[0] + pair[1]))
rate = st.floats(1e-5, 1e-1)
scale = st.floats(0.01, 100.0)
close = {"rel": 1e-9, "abs": 1e-7}
law = settings(max_examples=40)
"""The measures are smooth functions of few arguments: more examples find nothing that these do not."""


def from_ideal_and_observed(name):
    """A measure as a function of an ideal and an observed curve alone."""
    if name == "reactivity":
        return lambda ideal, observed, **options: metrics.reactivity(ideal, observed, 0.3, 0.3, **options)
    if name == "population_robustness":
        return lambda ideal, observed: metrics.population_robustness(observed, ideal, PopulationRates(), horizon=100)
    if name == "recorded_population_robustness":
        return lambda ideal, observed: metrics.recorded_population_robustness(observed, 7.0, ideal, 7.0)
    return getattr(metrics, name)


COMPARISONS = [
    "reactivity",
    "adaptability",
    "noise_robustness",
    "population_robustness",
    "recorded_population_robustness",
]
SIZE_MEASURES = [
    "spatial_emergence",
    "time_emergence",
    "task_emergence",
    "interference_gain",
    "undisturbed_gain",
    "scalability",
]
NOT_LISTED = {
    "t_lost_fraction": "an input of the others, not a comparison",
    "performance_lost": "an input of spatial_emergence; its laws are there",
    "availability": "no curves; its laws are below",
    "efficiency": "one curve, no comparison",
    "raw_performance": "one curve, no comparison",
}


def test_every_measure_is_in_a_list_or_left_out_for_a_reason():
    assert sorted([*COMPARISONS, *SIZE_MEASURES, *NOT_LISTED]) == sorted(MEASURES)


@pytest.mark.parametrize("name", COMPARISONS)
@law
@given(curve=performance)
def test_identical_curves_score_zero(name, curve):
    assert from_ideal_and_observed(name)(curve, curve) == 0.0


@pytest.mark.parametrize("name", COMPARISONS)
@law
@given(ideal=performance, observed=performance, factor=scale)
def test_comparisons_scale_with_the_unit_of_performance(name, ideal, observed, factor):
    measure = from_ideal_and_observed(name)
    assert measure(factor * ideal, factor * observed) == pytest.approx(factor * measure(ideal, observed), **close)


@pytest.mark.parametrize("name", [name for name in COMPARISONS if MEASURES[name].is_distance])
@law
@given(ideal=working, observed=performance, factor=scale)
def test_relative_distances_do_not_depend_on_the_unit(name, ideal, observed, factor):
    measure = from_ideal_and_observed(name)
    value = measure(ideal, observed) / ideal.sum()
    assert measure(factor * ideal, factor * observed, relative=True) == pytest.approx(value, **close)


@pytest.mark.parametrize("name", [name for name in COMPARISONS if MEASURES[name].is_distance])
@law
@given(ideal=performance, observed=performance)
def test_distances_are_symmetric_and_not_negative(name, ideal, observed):
    measure = from_ideal_and_observed(name)
    value = measure(ideal, observed)
    assert value >= 0.0
    assert measure(observed, ideal) == pytest.approx(value, **close)


@law
@given(lone=working, lost=fraction, n=sizes)
@pytest.mark.parametrize("name", SIZE_MEASURES)
def test_independent_robots_are_neutral_at_any_pair_of_sizes(name, lone, lost, n):
    small, large = n[0] * lone, n[1] * lone
    value = {
        "spatial_emergence": lambda: metrics.spatial_emergence(small, lost, n[0], large, lost, n[1], lone, lost),
        "time_emergence": lambda: metrics.time_emergence(lost, n[0], lost, n[1]),
        "task_emergence": lambda: metrics.task_emergence(small, n[0], large, n[1]),
        "interference_gain": lambda: metrics.interference_gain(small, 0.9 * lost, n[0], large, 0.9 * lost, n[1]),
        "undisturbed_gain": lambda: metrics.undisturbed_gain(small, 0.9 * lost, n[0], large, 0.9 * lost, n[1]),
        "scalability": lambda: metrics.scalability(small, n[0], large, n[1]),
    }[name]()
    assert value == pytest.approx(MEASURES[name].neutral, rel=1e-9, abs=1e-6)


@law
@given(perf1=performance, perf2=performance, lost1=fraction, lost2=fraction, n=sizes)
def test_task_emergence_is_the_sum_of_its_two_parts(perf1, perf2, lost1, lost2, n):
    calm1, calm2 = 0.9 * lost1, 0.9 * lost2
    parts = [
        part(perf1, calm1, n[0], perf2, calm2, n[1]) for part in (metrics.interference_gain, metrics.undisturbed_gain)
    ]
    assert sum(parts) == pytest.approx(metrics.task_emergence(perf1, n[0], perf2, n[1]), rel=1e-9, abs=1e-5)


@law
@given(perf1=working, perf2=working, n=sizes)
def test_printed_scalability_is_minus_speedup_times_the_corrected(perf1, perf2, n):
    printed = metrics.scalability(perf1, n[0], perf2, n[1], variant="paper", reduce="total")
    corrected = metrics.scalability(perf1, n[0], perf2, n[1])
    speedup = perf2.sum() / perf1.sum()
    assert printed == pytest.approx(-speedup * corrected, rel=1e-6, abs=1e-6 * (1 + speedup))


@law
@given(perf1=working, perf2=working, n=sizes, more=st.floats(1.001, 10.0))
def test_more_performance_of_the_larger_swarm_never_lowers_a_size_measure(perf1, perf2, n, more):
    assert metrics.scalability(perf1, n[0], more * perf2, n[1]) > metrics.scalability(perf1, n[0], perf2, n[1])
    assert metrics.task_emergence(perf1, n[0], more * perf2, n[1]) > metrics.task_emergence(perf1, n[0], perf2, n[1])


curve_pair = st.tuples(st.integers(1, 8), st.integers(1, 8)).flatmap(
    lambda lengths: st.tuples(*(arrays(np.float64, length, elements=st.floats(-10, 10)) for length in lengths))
)


@law
@given(pair=curve_pair)
def test_dtw_is_the_recursion_and_symmetric(pair):
    x, y = pair
    expected = dtw_by_matrix(x, y)
    assert metrics.dtw(x, y) == expected
    assert metrics.dtw(y, x) == pytest.approx(expected, **close)


@law
@given(v=arrays(np.float64, 4, elements=st.floats(0.01, 2)), ideal=arrays(np.float64, 4, elements=st.floats(0.01, 2)))
def test_scalings_are_one_without_deviation_and_reciprocal_to_each_other(v, ideal):
    printed = metrics.environment_scaling(v, ideal, model="paper")
    assert metrics.environment_scaling(v, ideal, model="reciprocal") * printed == pytest.approx(np.ones(4), rel=1e-12)
    for model in ("paper", "linear", "reciprocal"):
        assert metrics.environment_scaling(v, v, model=model).tolist() == [1.0] * 4
    linear = metrics.environment_scaling(v, ideal)
    assert ((linear < 1) == (v > ideal)).all()  # adversity lowers what a reactive swarm should do


@law
@given(lam=rate, mu=rate, n=st.integers(1, 30))
def test_littles_law_ties_lengths_and_times(lam, mu, n):
    assume(lam < 0.999 * mu)
    queue = metrics.queue_statistics(PopulationRates(lambda_d=lam, mu_b=mu), n)
    assert queue.length == pytest.approx(lam * queue.time, rel=1e-6)
    assert queue.time_printed == pytest.approx(queue.time + 1 / mu, rel=1e-12)
    assert queue.truncated_length <= min(n, queue.length) * (1 + 1e-9)


@pytest.mark.parametrize(("n", "m"), [(10, 10), (50, 50), (80, 37)])
def test_agrees_with_an_independent_library(n, m):
    rng = np.random.default_rng(n + m)
    for _ in range(10):
        x, y = rng.random(n), rng.random(m)
        # Its default is the root of summed squares, a different number.
        assert dtw(x, y) == pytest.approx(dtaidistance.dtw.distance(x, y, inner_dist="euclidean"), abs=1e-9)


def test_runs_broadcast():
    rng = np.random.default_rng(3)
    x, y = rng.random((4, 1, 9)), rng.random((5, 6))
    values = dtw(x, y)
    assert values.shape == (4, 5)
    assert values[2, 3] == dtw(x[2, 0], y[3])


def test_a_nan_spoils_its_own_pair_only():
    x = np.zeros((2, 3))
    x[0, 1] = np.nan
    values = dtw(x, [1.0, 1.0])
    assert np.isnan(values[0])
    assert values[1] == 3.0


def test_noise_floor_pairs_different_runs():
    assert noise_floor([[0.0, 0.0], [1.0, 1.0], [4.0, 4.0]]).tolist() == [2.0, 8.0, 6.0]
    assert noise_floor([[0.0, 0.0], [1.0, 1.0], [4.0, 4.0]], maps=[1, 2, 1]).tolist() == [8.0]
    assert noise_floor([[0.0], [1.0]], maps=[1, 2]).tolist() == []
