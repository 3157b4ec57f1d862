"""One clear error for every curve, size or option that a measure cannot work with."""

import numpy as np
import pytest

import metrics
from metrics import CurveError

ONE_RUN = [1.0, 2.0, 3.0]
CALLS = {
    "t_lost_fraction": lambda curve: metrics.t_lost_fraction(curve, 4),
    "performance_lost": lambda curve: metrics.performance_lost(curve, [0.1] * 3, 4, ONE_RUN, [0.1] * 3),
    "performance_lost reference": lambda curve: metrics.performance_lost(ONE_RUN, [0.1] * 3, 4, curve, [0.1] * 3),
    "spatial_emergence": lambda curve: metrics.spatial_emergence(
        curve, [0.1] * 3, 2, ONE_RUN, [0.1] * 3, 4, ONE_RUN, [0.1] * 3
    ),
    "task_emergence": lambda curve: metrics.task_emergence(curve, 1, ONE_RUN, 2),
    "scalability": lambda curve: metrics.scalability(curve, 1, ONE_RUN, 2),
    "efficiency": lambda curve: metrics.efficiency(curve, 2),
    "raw_performance": metrics.raw_performance,
    "reactivity": lambda curve: metrics.reactivity(curve, ONE_RUN, 0.5, 0.1),
    "adaptability": lambda curve: metrics.adaptability(curve, ONE_RUN),
    "noise_robustness": lambda curve: metrics.noise_robustness(curve, ONE_RUN),
    "mean_signed_difference": lambda curve: metrics.mean_signed_difference(curve, ONE_RUN),
    "population_robustness": lambda curve: metrics.population_robustness(
        curve, ONE_RUN, metrics.PopulationRates(), horizon=100
    ),
}
BAD_CURVES = {
    "missing": (None, "got None"),
    "empty": ([], "at least one run and one interval"),
    "no runs": (np.zeros((0, 3)), "at least one run and one interval"),
    "negative": ([1.0, -1.0, 1.0], ">= 0"),
    "infinite": ([1.0, np.inf, 1.0], "infinity"),
    "not numeric": (["a", "b", "c"], "as numbers"),
    "ragged": ([[1.0, 2.0, 3.0], [1.0]], "as numbers"),
}


@pytest.mark.parametrize("call", CALLS.values(), ids=CALLS)
def test_every_measure_refuses_what_is_no_performance_curve(call):
    for curve, message in BAD_CURVES.values():
        with pytest.raises(CurveError, match=message):
            call(curve)


@pytest.mark.parametrize(
    "name", [name for name in CALLS if name not in ("t_lost_fraction", "efficiency", "raw_performance")]
)
def test_curves_of_different_length_are_refused(name):
    with pytest.raises(CurveError, match=r"equally many intervals|one sample per interval"):
        CALLS[name]([1.0, 2.0])


def test_run_axes_that_do_not_broadcast_are_refused():
    with pytest.raises(CurveError, match="run axes that broadcast"):
        metrics.adaptability(np.ones((2, 4)), np.ones((3, 4)))
    with pytest.raises(CurveError, match="run axes that broadcast"):
        metrics.dtw(np.ones((2, 4)), np.ones((3, 5)))


@pytest.mark.parametrize("name", CALLS)
def test_a_nan_spoils_its_own_run_only(name):
    healthy = np.array([[1.0, 2.0, 3.0], [1.0, 1.0, 1.0]])
    broken = healthy.copy()
    broken[0, 1] = np.nan
    expected, value = CALLS[name](healthy), CALLS[name](broken)
    if value.ndim == 1:
        assert np.isnan(value[0])
    else:  # one value per interval
        assert np.array_equal(np.isnan(value), np.isnan(broken))
    assert np.array_equal(value[1], expected[1])


def test_infinite_curves_of_any_sign_are_refused_by_the_distance():
    with pytest.raises(CurveError, match="infinity"):
        metrics.dtw([0.0, -np.inf], [0.0, 1.0])
    assert metrics.dtw([-1.0], [1.0]) == 2.0


@pytest.mark.parametrize(("size", "message"), [(0, ">= 1"), (-3, ">= 1"), (2.5, "whole number"), ("2", "whole number")])
def test_sizes_are_whole_positive_numbers_of_robots(size, message):
    for call in (
        lambda: metrics.t_lost_fraction([0.0], size),
        lambda: metrics.performance_lost([1.0], [0.0], size, [1.0], [0.0]),
        lambda: metrics.scalability([1.0], size, [1.0], 4),
        lambda: metrics.efficiency([1.0], size),
        lambda: metrics.availability(size, 1, 0.5),
        lambda: metrics.queue_statistics(metrics.PopulationRates(), size),
    ):
        with pytest.raises(CurveError, match=message):
            call()


@pytest.mark.parametrize(("n1", "n2"), [(4, 4), (8, 4)])
def test_sizes_in_the_wrong_order_are_refused(n1, n2):
    curve, lost = [1.0], [0.1]
    for variant in ("paper", "corrected"):
        with pytest.raises(CurveError, match="n1 < n2"):
            metrics.spatial_emergence(curve, lost, n1, curve, lost, n2, curve, lost, variant=variant)
    with pytest.raises(CurveError, match="n1 < n2"):
        metrics.task_emergence(curve, n1, curve, n2)
    with pytest.raises(CurveError, match="n1 < n2"):
        metrics.scalability(curve, n1, curve, n2)


def test_more_interfering_robots_than_robots_are_refused():
    with pytest.raises(CurveError, match="<= n = 4"):
        metrics.t_lost_fraction([5.0], 4)
    with pytest.raises(CurveError, match="t_lost_fraction"):
        metrics.performance_lost([1.0], [1.2], 4, [1.0], [0.1])
    with pytest.raises(CurveError, match="t_lost_fraction"):
        metrics.performance_lost([1.0], [0.2], 4, [1.0], [1.1])


@pytest.mark.parametrize(
    "call",
    [
        lambda: metrics.spatial_emergence([1.0], [0.1], 2, [1.0], [0.1], 4, [1.0], [0.1], variant="printed"),
        lambda: metrics.scalability([1.0], 1, [1.0], 2, variant="printed"),
        lambda: metrics.scalability([1.0], 1, [1.0], 2, reduce="median"),
        lambda: metrics.task_emergence([1.0], 1, [1.0], 2, reduce="median"),
        lambda: metrics.waveform("triangle", [0]),
        lambda: metrics.environment_scaling(0.5, 0.1, model="printed"),
        lambda: metrics.population_weight(metrics.PopulationRates(), horizon=10, weight="equilibrium"),
        lambda: metrics.aggregate([1.0], method="two_sigma"),
        lambda: metrics.bootstrap_measure(metrics.raw_performance, [[1.0]], order="per_curve"),
    ],
)
def test_unknown_options_are_refused_with_the_known_ones(call):
    with pytest.raises(ValueError, match="one of '"):
        call()


def test_a_number_is_a_curve_of_one_interval():
    assert metrics.task_emergence(1.0, 1, 3.0, 2) == 1.0
    assert metrics.adaptability(1.0, 3.0) == 2.0


def test_shapes_reduce_the_last_axis_only():
    runs = np.ones((5, 7, 3))
    assert metrics.scalability(runs, 1, runs, 2).shape == (5, 7)
    assert metrics.adaptability(runs, ONE_RUN).shape == (5, 7)
    assert metrics.reactivity(runs, runs, ONE_RUN, 0.0).shape == (5, 7)
    assert np.shape(metrics.adaptability(ONE_RUN, ONE_RUN)) == ()
