"""Every formula by hand: what it gives, in a table, and what it refuses."""

import math

import numpy as np
import pytest

import metrics
from metrics import CurveError, PopulationError
from metrics import PopulationRates as Rates

INF, NAN = math.inf, math.nan
CROWD = {1: ([1.0], [0.1]), 2: ([1.8], [0.2]), 4: ([3.2], [0.3])}
"""Swarm size -> performance and interference fraction in one interval."""
COLLAPSE = ([8.0], [0.2], 2, [1.6], [0.6], 4)
"""A swarm that delivers a fifth when its size doubles, and whose robots lose three times the time; no walls."""
UNEVEN = ([1, 3], 4, [2, 3], 8)
GROWING = ([1.0, 2.0, 3.0], 1, [3.0, 5.0, 10.0], 2)  # gains 1, 1, 4
IDEAL, LATE, IN_TIME, THROTTLE = [1.0] * 4, [1.0, 1.0, 0.5, 0.5], [1.0, 0.5, 0.5, 1.0], [0.0, 0.5, 0.5, 0.0]
HALF, DEATHS = Rates(lambda_bd=0.001, mu_bd=0.002), Rates(lambda_d=0.0001)
LONG = {"horizon": 50_000, "n": 10}
WEIGHTS, HOW = ("paper", "transient"), ("sum", "mean", "last", "total")
RECORDED = ([8.0, 6.0], [8.0, 5.0], [10.0, 10.0])
"""8 and 5 of 10 robots at work: 8 - 0.8 * 10 = 0 and 6 - 0.5 * 10 = 1."""


DTW = (([0, 2, 0], [0, 1, 1, 0]), ([1, 2, 3, 4, 5], [2, 3, 4]), ([3.0], [1.0]), ([0, 0, 1, 1], [0, 1, 1, 1]),
       ([0.0] * 40, [0.25] * 40))  # fmt: skip


def spatial(n1, n2, one=CROWD[1], **options):
    return metrics.spatial_emergence(*CROWD[n1], n1, *CROWD[n2], n2, *one, **options)


def independent(n1, n2, **options):
    lost = [0.1, 0.1]
    return metrics.spatial_emergence([n1, n1], lost, n1, [n2, n2], lost, n2, [1, 1], lost, **options)


def lossy(**options):
    """Losses of the larger swarm 0.3, 1 and 5."""
    small, _, large, _ = GROWING
    return metrics.spatial_emergence(small, [0.0] * 3, 2, large, [0.1, 0.2, 0.5], 4, small, [0.0] * 3, **options)


def calmer(**options):
    return metrics.time_emergence([0.1, 0.2, 0.3], 2, [0.2, 0.4, 0.3], 4, **options)


def robust(weight, **options):
    return metrics.population_robustness([0.9, 0.9], [1.0, 1.0], HALF, weight=weight, **LONG, **options)


def wave(kind, ticks, frequency=0.25, amplitude=0.4, **options):
    return metrics.waveform(kind, ticks, frequency=frequency, amplitude=amplitude, **options)


EXAMPLES = {
    "robots that interfere": (lambda: metrics.t_lost_fraction([0.0, 1.0, 4.0], 4), [0.0, 0.25, 1.0]),
    "P_lost of one robot": (lambda: metrics.performance_lost(*CROWD[1], 1, *CROWD[1]), [0.1]),
    "P_lost of two": (lambda: metrics.performance_lost(*CROWD[2], 2, *CROWD[1]), [0.16]),
    "P_lost of four": (lambda: metrics.performance_lost(*CROWD[4], 4, *CROWD[1]), [0.56]),
    "P_lost without performance": (lambda: metrics.performance_lost([0.0], [0.5], 2, [1.0], [0.1]), [-0.2]),
    "FL": (lambda: metrics.fractional_loss(*CROWD[2], 2, *CROWD[1]), [0.16 / 1.8]),
    "FL without performance": (lambda: metrics.fractional_loss([0.0], [0.5], 2, [1.0], [0.1]), [-INF]),
    "E_S of independent robots": (lambda: [independent(1, 2), independent(2, 4), independent(4, 32)], [0.0] * 3),
    "E_S as printed counts the walls of a lone robot": (lambda: independent(1, 2, variant="paper"), 0.4),
    "E_S as printed of larger swarms": (lambda: independent(2, 4, variant="paper"), 0.0),
    "E_S of a crowd": (lambda: [spatial(2, 4), spatial(2, 4, variant="paper")], [-0.24, -0.24]),
    "E_S of a crowd and a lone robot": (lambda: [spatial(1, 4), spatial(1, 4, variant="paper")], [-0.56, -0.16]),
    "E_S needs no lone robot": (lambda: spatial(2, 4, (None, None)), -0.24),
    "E_S of a collapse": (lambda: metrics.spatial_emergence(*COLLAPSE, [5.0], [0.0]), 2.24),
    "E_S reduced": (lambda: [lossy(reduce=how) for how in HOW], [-6.3, -2.1, -5.0, -6.3]),
    "E_R of a collapse": (lambda: metrics.time_emergence([0.2], 2, [0.6], 4), -1.6),
    "E_R of a crowd": (lambda: metrics.time_emergence(CROWD[1][1], 1, CROWD[4][1], 4), -0.8),
    "E_R reduced": (lambda: [calmer(), calmer(reduce="last"), calmer(reduce="sum")], [-0.4, 0.0, -1.2]),
    "E_T reduced": (
        lambda: [metrics.task_emergence(*GROWING, reduce=how) for how in HOW],
        [6.0, 2.0, 4.0, 6.0],
    ),
    "E_T relative": (lambda: metrics.task_emergence([9.0, 18.0], 1, [27.0, 45.0], 2, relative=True), 0.25),
    "E_T of nothing": (lambda: metrics.task_emergence([0.0], 1, [0.0], 2, relative=True), NAN),
    "E_T of numbers": (lambda: metrics.task_emergence(1.0, 1, 3.0, 2), 1.0),
    "E_T of a collapse": (lambda: metrics.task_emergence([8.0], 2, [1.6], 4), -14.4),
    "E_I of a collapse": (lambda: metrics.interference_gain(*COLLAPSE), -4.8),  # u1 = 5, u2 = 1
    "E_U of a collapse": (lambda: metrics.undisturbed_gain(*COLLAPSE), -9.6),
    "E_I relative": (lambda: metrics.interference_gain(*COLLAPSE, relative=True), -3.0),
    "E_U relative": (lambda: metrics.undisturbed_gain(*COLLAPSE, relative=True), -6.0),
    "E_I of a whole run": (
        lambda: metrics.interference_gain([[2.0, 6.0]], [[0.4, 0.0]], 2, [[1.6, 0.0]], [[0.2, 1.0]], 4), [-4.8]
    ),
    "E_I of scarce objects": (lambda: metrics.interference_gain([6.0], [0.1], 2, [6.0], [0.1], 4), 0.0),
    "E_U of scarce objects": (lambda: metrics.undisturbed_gain([6.0], [0.1], 2, [6.0], [0.1], 4), -6.0),
    "E_U of crowding alone": (lambda: metrics.undisturbed_gain([18.0], [0.1], 2, [20.0], [0.5], 4), 0.0),
    "E_U never undisturbed": (lambda: metrics.undisturbed_gain([1.0], [1.0], 2, [2.0], [0.5], 4), NAN),
    "C by speedup": (
        lambda: [metrics.scalability([2.0], 3, [2.0 * s], 6) for s in (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)],
        [-INF, -2.0, 0.0, 2 / 3, 1.0, 4 / 3],
    ),
    "C as printed, upside down": (
        lambda: [metrics.scalability([2.0], 3, [2.0 * s], 6, variant="paper") for s in (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)],
        [2.0, 1.0, 0.0, -1.0, -2.0, -4.0],
    ),
    "C of uneven intervals": (
        lambda: [metrics.scalability(*UNEVEN, reduce=how) for how in (None, "sum", "mean", "last")],
        [0.4, 1.0, 0.5, 0.0],
    ),
    "C as printed of uneven intervals": (
        lambda: [metrics.scalability(*UNEVEN, variant="paper", reduce=how) for how in (None, "total")], [-2.0, -0.5]
    ),
    "C without performance": (
        lambda: [metrics.scalability([a], 1, [b], 4) for a, b in ((0.0, 1.0), (0.0, 0.0), (1.0, 0.0))],
        [NAN, NAN, -INF],
    ),
    "C as printed without performance": (
        lambda: [metrics.scalability([a], 1, [b], 4, variant="paper") for a, b in ((0.0, 1.0), (0.0, 0.0), (1.0, 0.0))],
        [-INF, NAN, 4 / 3],
    ),
    "efficiency": (lambda: [metrics.efficiency([4.0, 8.0], 4, reduce=how) for how in ("last", "sum")], [2.0, 3.0]),
    "performance": (lambda: [metrics.raw_performance([4.0, 8.0], reduce=how) for how in ("last", "mean")], [8.0, 6.0]),
    "c_t": (
        lambda: [metrics.environment_scaling(0.5, 0.1, model=how) for how in ("paper", "linear", "reciprocal")],
        [5.0, 0.6, 0.2],
    ),
    "c_t below zero": (lambda: metrics.environment_scaling([1.5, 0.2], 0.1), [-0.4, 0.9]),
    "R of a late swarm": (lambda: metrics.reactivity(IDEAL, LATE, THROTTLE, 0.0), 0.5),
    "R of a perfect swarm": (lambda: metrics.reactivity(IDEAL, IN_TIME, THROTTLE, np.zeros(4)), 0.0),
    "R of an adaptable swarm": (lambda: metrics.reactivity(IDEAL, IDEAL, THROTTLE, 0.0), 1.0),
    "R relative": (lambda: metrics.reactivity(IDEAL, IDEAL, THROTTLE, 0.0, relative=True), 0.25),
    "R as printed rewards a gain from adversity": (
        lambda: metrics.reactivity([1.0, 1.0], [5.0, 5.0], 0.5, 0.1, model="paper"), 0.0
    ),
    "R of the same gain": (lambda: metrics.reactivity([1.0, 1.0], [5.0, 5.0], 0.5, 0.1), 8.8),
    "R of penalties": (lambda: metrics.reactivity([4.0, 4.0], [2.0, 2.0], [2.0, 2.0], 1.0, model="reciprocal"), 0.0),
    "R of several runs": (lambda: metrics.reactivity([IDEAL] * 5, [LATE] * 5, THROTTLE, 0.0), [0.5] * 5),
    "A": (lambda: [metrics.adaptability(IDEAL, some) for some in (LATE, IN_TIME, IDEAL)], [1.0, 1.0, 0.0]),
    "A relative": (lambda: metrics.adaptability(IDEAL, IN_TIME, relative=True), 0.25),
    "A relative to nothing": (lambda: metrics.adaptability([[0.0]] * 2, [[0.0], [1.0]], relative=True), [NAN, INF]),
    "B_sa has no sign": (lambda: [metrics.noise_robustness(IDEAL, [x] * 4) for x in (1.5, 0.5)], [2.0, 2.0]),
    "B_sa relative": (lambda: metrics.noise_robustness(IDEAL, IN_TIME, relative=True), 0.25),
    "signed difference": (lambda: [metrics.mean_signed_difference(IDEAL, [x] * 4) for x in (1.5, 0.5)], [0.5, -0.5]),
    "B_pd": (lambda: [*map(robust, WEIGHTS)], [-0.14, -0.008752086]),
    "B_pd relative": (lambda: robust("paper", relative=True), -0.07),
    "B_pd reduced": (
        lambda: [
            metrics.population_robustness([0.9, 1.0], [1, 1], HALF, weight="paper", reduce=how, **LONG)
            for how in ("mean", "last")
        ],
        [-0.02, 0.03],
    ),
    "T_S": (lambda: [metrics.population_weight(HALF, weight=w, **LONG) for w in WEIGHTS], [0.97, 0.904376043]),
    "T_S of robots that only die": (lambda: metrics.population_weight(DEATHS, horizon=50_000, n=115), 1 - 5 / 230),
    "T_S where nobody leaves": (
        lambda: [metrics.population_weight(Rates(mu_bd=m), weight=w, **LONG) for m in (0, 1) for w in WEIGHTS],
        [1.0] * 4,
    ),
    "T_S beside a disturbed ideal": (
        lambda: [metrics.population_weight(HALF, ideal_rates=HALF, weight=w, **LONG) for w in WEIGHTS],
        [1.0, 1.0],
    ),
    "B_pd'": (
        lambda: [metrics.recorded_population_robustness(*RECORDED, 10.0, reduce=how) for how in HOW[:3]],
        [1.0, 0.5, 1.0],
    ),
    "B_pd' of a dwindling ideal": (lambda: metrics.recorded_population_robustness(*RECORDED, [10.0, 5.0]), -4.0),
    "B_pd' relative": (lambda: metrics.recorded_population_robustness(*RECORDED, 10.0, relative=True), 0.05),
    "constant": (lambda: wave("constant", [0, 1], offset=5.0, phase=1.0), [0.4, 0.4]),
    "sine": (lambda: wave("Sine", [0, 1, 2, 3], offset=0.5), [0.5, 0.9, 0.5, 0.1]),
    "sine, shifted": (lambda: wave("sine", 0, phase=math.pi / 2), 0.4),
    "square, positive at zero": (lambda: wave("square", [0, 1, 2.5, 3], offset=0.4), [0.8, 0.8, 0.0, 0.0]),
    "step down": (lambda: wave("square", [1, 49, 51, 99], 1 / 100, 0.3), [0.3, 0.3, -0.3, -0.3]),
    "step up": (lambda: wave("square", [1, 49, 51, 99], 1 / 100, 0.3, offset=0.3, phase=math.pi), [0, 0, 0.6, 0.6]),
    "sawtooth": (
        lambda: wave("sawtooth", [0.0, 1.0, 1.999, 2.0, 3.0], amplitude=0.5, offset=0.1),
        [0.1, 0.35, 0.59975, -0.4, -0.15],
    ),
    "sawtooth, phase in cycles": (lambda: wave("sawtooth", 0.0, 0.0, 0.5, phase=0.25), 0.25),
    "dtw": (lambda: [metrics.dtw(*pair) for pair in DTW], [2.0, 2.0, 2.0, 0.0, 10.0]),
    "aligned distance": (lambda: metrics.aligned_l1(*DTW[3]), 1.0),
    "improvement where less is better": (
        lambda: metrics.probability_of_improvement([3, 4, 5], [1, 2, 4], higher_is_better=False).value, 1.5 / 9
    ),
    "ideal conditions": (lambda: metrics.environment_distance(np.full(50, 0.1), 0.1), 0.0),
}  # fmt: skip


@pytest.mark.parametrize(("call", "expected"), EXAMPLES.values(), ids=EXAMPLES)
def test_by_hand(call, expected):
    np.testing.assert_allclose(call(), expected, rtol=1e-9, atol=1e-9)


CURVES = {
    "t_lost_fraction": lambda curve: metrics.t_lost_fraction(curve, 4),
    "performance_lost": lambda curve: metrics.performance_lost(curve, [0.1] * 3, 4, [1, 2, 3], [0.1] * 3),
    "spatial_emergence": lambda curve: metrics.spatial_emergence(
        curve, [0.1] * 3, 2, [1, 2, 3], [0.1] * 3, 4, [1, 2, 3], [0.1] * 3
    ),
    "task_emergence": lambda curve: metrics.task_emergence(curve, 1, [1, 2, 3], 2, reduce="last"),
    "interference_gain": lambda curve: metrics.interference_gain(curve, [0.1] * 3, 1, [1, 2, 3], [0.2] * 3, 2),
    "scalability": lambda curve: metrics.scalability(curve, 1, [1, 2, 3], 2),
    "efficiency": lambda curve: metrics.efficiency(curve, 2),
    "raw_performance": metrics.raw_performance,
    "reactivity": lambda curve: metrics.reactivity(curve, [1, 2, 3], 0.5, 0.1),
    "adaptability": lambda curve: metrics.adaptability(curve, [1, 2, 3]),
    "noise_robustness": lambda curve: metrics.noise_robustness(curve, [1, 2, 3]),
    "mean_signed_difference": lambda curve: metrics.mean_signed_difference(curve, [1, 2, 3]),
    "population_robustness": lambda curve: metrics.population_robustness(curve, [1, 2, 3], Rates(), horizon=100),
    "recorded_population_robustness": lambda curve: metrics.recorded_population_robustness(curve, 1, [1, 2, 3], 1),
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


@pytest.mark.parametrize("call", CURVES.values(), ids=CURVES)
def test_every_measure_refuses_what_is_no_curve_and_a_nan_spoils_its_own_run_only(call):
    for curve, message in BAD_CURVES.values():
        with pytest.raises(CurveError, match=message):
            call(curve)
    healthy, broken = np.array([[1.0, 2.0, 3.0], [1.0, 1.0, 1.0]]), np.array([[1.0, NAN, 3.0], [1.0, 1.0, 1.0]])
    expected, value = call(healthy), call(broken)
    assert np.array_equal(np.isnan(value), np.isnan(broken) if value.ndim == 2 else [True, False])
    assert np.array_equal(value[1], expected[1])
    assert call(np.ones((5, 7, 3))).shape[:2] == (5, 7)


SIZES = (
    lambda n: metrics.t_lost_fraction([0.0], n),
    lambda n: metrics.performance_lost([1.0], [0.0], n, [1.0], [0.0]),
    lambda n: metrics.scalability([1.0], n, [1.0], 4),
    lambda n: metrics.efficiency([1.0], n),
    lambda n: metrics.availability(n, 1, 0.5),
    lambda n: metrics.queue_statistics(Rates(), n),
    lambda n: metrics.mean_away(HALF, n, 10.0),
)
PAIRS = (
    lambda a, b: metrics.spatial_emergence([1.0], [0.1], a, [1.0], [0.1], b, None, None),
    lambda a, b: metrics.time_emergence([0.1], a, [0.1], b),
    lambda a, b: metrics.task_emergence([1.0], a, [1.0], b),
    lambda a, b: metrics.undisturbed_gain([1.0], [0.1], a, [1.0], [0.1], b),
    lambda a, b: metrics.scalability([1.0], a, [1.0], b, variant="paper"),
)
REFUSED = [
    *((lambda call=call: call(2.5), CurveError, "whole number") for call in SIZES),
    *((lambda call=call: call(0), CurveError, ">= 1") for call in SIZES),
    *((lambda call=call: call(4, 4), CurveError, "n1 < n2, got n1 = 4 and n2 = 4") for call in PAIRS),
    (lambda: metrics.task_emergence([1.0, 2.0], 1, [1.0] * 3, 2), CurveError, "equally many intervals"),
    (lambda: metrics.reactivity([1.0] * 3, [1.0] * 3, [0.1] * 2, 0.0), CurveError, "one sample per interval"),
    (lambda: metrics.adaptability(np.ones((2, 4)), np.ones((3, 4))), CurveError, "run axes that broadcast"),
    (lambda: metrics.dtw([0.0, -INF], [0.0, 1.0]), CurveError, "infinity"),
    (lambda: metrics.spatial_emergence([1.0], [0.1], 1, [2.0], [0.1], 50, None, None), CurveError, "perf_one"),
    (lambda: metrics.t_lost_fraction([5.0], 4), CurveError, "<= n = 4"),
    (lambda: metrics.performance_lost([1.0], [0.2], 4, [1.0], [1.1]), CurveError, "t_lost_fraction"),
    (lambda: metrics.undisturbed_gain([1.0], [0.1], 2, [1.0], [3.0], 4), CurveError, "fraction of the robots"),
    (lambda: metrics.scalability([1.0], 1, [1.0], 2, reduce="median"), ValueError, "one of '"),
    (lambda: metrics.waveform("triangle", [0]), ValueError, "one of '"),
    (lambda: wave("sine", [0], frequency=-1), ValueError, "finite numbers"),
    (lambda: metrics.environment_scaling([0.0, 0.5], [0.1, 0.0], model="paper"), CurveError, "model='linear'"),
    (lambda: metrics.environment_scaling([0.5, 0.0], 0.1, model="reciprocal"), CurveError, "model='linear'"),
    (lambda: metrics.environment_scaling([0.1] * 2, [0.1] * 3), CurveError, "same intervals"),
    (lambda: metrics.environment_distance(np.ones((2, 3)), 0.1), CurveError, "one signal each"),
    (lambda: metrics.noise_floor([0.0, 1.0]), CurveError, "two runs"),
    (lambda: metrics.population_weight(HALF, horizon=1000), ValueError, "swarm size n"),
    (lambda: metrics.population_weight(HALF, horizon=0, weight="paper"), PopulationError, "horizon"),
    (lambda: metrics.population_weight(DEATHS, horizon=1000, weight="paper"), PopulationError, "transient"),
    (lambda: metrics.recorded_population_robustness([1.0], [5.0], [1.0], [0.0]), CurveError, "n_active_ideal"),
    (lambda: metrics.ratio_for_team(0.0), PopulationError, "more than 0 robots"),
    (lambda: metrics.availability(5, 3, NAN), PopulationError, "lambda / mu"),
    (lambda: metrics.availability(50, 4.5, 1.2), CurveError, "n_min as a whole number"),
    (lambda: Rates(lambda_d=-1.0), PopulationError, "finite rate >= 0"),
    (lambda: metrics.mean_away(HALF, 5, 0.0), PopulationError, "horizon"),
]


@pytest.mark.parametrize(("call", "error", "told"), REFUSED)
def test_what_a_formula_cannot_work_with_is_refused(call, error, told):
    with pytest.raises(error, match=told):
        call()


def test_an_unlucky_run_of_a_proportional_swarm_is_as_robust_as_a_lucky_one():
    active, ideal = np.array([[9.0, 9.0], [6.0, 2.0]]), [[10.0, 10.0]] * 2
    np.testing.assert_allclose(metrics.recorded_population_robustness(active, active, ideal, 10.0), 0.0)
    expected_share = metrics.population_robustness(active, ideal, HALF, **LONG)
    assert expected_share[0] - expected_share[1] == pytest.approx(10.0, abs=1e-9)
