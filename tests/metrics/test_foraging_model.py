"""The mean-field model: closed forms in its limits, robots that are not lost, and rates that are found again."""

from dataclasses import asdict

import numpy as np
import pytest

from metrics import CurveError, ForagingRates, SizeLaw, estimate_rates, mean_field, steady_state

RATES = ForagingRates(finding=2e-5, homing_s=250.0, encounters=4e-4, walls=0.01, avoidance_s=2.0, n_objects=200.0)
PLENTY = ForagingRates(finding=1e-9, homing_s=250.0, encounters=0.0, n_objects=1e6)
"""Each searching robot finds 0.001 objects per s, however many are carried; nobody is in the way."""
FIELDS = ("searching", "carrying", "avoiding_searching", "avoiding_carrying")


def test_without_interference_deliveries_are_linear_in_the_swarm_size():
    # One robot: 1000 s of search and 250 s home per object.
    for n in (1, 10, 200):
        assert steady_state(PLENTY, n).deliveries_per_s == pytest.approx(n / 1250.0, rel=1e-3)
        assert steady_state(PLENTY, n).interference == 0.0


def test_without_interference_the_transient_is_that_of_two_states():
    found = mean_field(PLENTY, 10, 2000.0)
    rate = 0.001 + 1.0 / 250.0
    expected = 10 * 0.001 / rate * (1.0 - np.exp(-rate * found.time_s))
    np.testing.assert_allclose(found.carrying, expected, rtol=1e-4)
    gained = 10 * 0.001 / rate / 250.0 * (2000.0 - (1.0 - np.exp(-rate * 2000.0)) / rate)
    assert found.delivered[-1] == pytest.approx(gained, rel=1e-4)


@pytest.mark.parametrize("n", [1, 20, 150])
def test_no_robot_is_lost_and_the_curve_ends_in_the_steady_state(n):
    found = mean_field(RATES, n, 20_000.0)
    np.testing.assert_allclose(sum(getattr(found, name) for name in FIELDS), n, rtol=1e-7)
    end = steady_state(RATES, n)
    assert end.searching + end.carrying + end.avoiding == pytest.approx(n)
    assert (found.searching[-1], found.carrying[-1]) == pytest.approx((end.searching, end.carrying), rel=1e-5)
    assert found.interference[-1] == pytest.approx(end.interference, rel=1e-6)
    rate = np.diff(found.delivered)[-1] / np.diff(found.time_s)[-1]
    assert rate == pytest.approx(end.deliveries_per_s, rel=1e-5)
    assert found.interference[0] == found.delivered[0] == 0.0


def test_interference_by_hand():
    # Encounters 0.01 + 0.0004 * 25 = 0.02 per s, of 2 s each: 0.04 s lost per s of work.
    assert steady_state(RATES, 26).interference == pytest.approx(0.04 / 1.04)


def test_while_objects_are_plenty_the_model_is_the_law_of_contention():
    rates = ForagingRates(**asdict(PLENTY) | {"encounters": 0.01, "walls": 0.05, "avoidance_s": 2.0})
    law = SizeLaw(name="contention", a=1.0 / 1250.0 / 1.1, contention=0.02 / 1.1)
    for n in (1, 7, 40):
        assert steady_state(rates, n).deliveries_per_s == pytest.approx(float(law.performance(n)), rel=1e-3)


def test_objects_run_out():
    few = ForagingRates(finding=1.0, homing_s=100.0, encounters=0.0, n_objects=5.0)
    assert steady_state(few, 50).deliveries_per_s == pytest.approx(5.0 / 100.0, rel=1e-3)  # all are carried, always


def drawn_columns(rates, n, *, n_runs, horizon_s, interval_s, tick_s=0.2, seed=1):
    """Columns of random runs in which every robot follows the rates, tick by tick."""
    rng = np.random.default_rng(seed)
    carries, avoids = np.zeros((2, n_runs, n), dtype=bool)
    per_interval = round(interval_s / tick_s)
    shape = (n_runs, round(horizon_s / interval_s))
    columns = {name: np.zeros(shape) for name in ("pickups", "deliveries", "n_carrying", "interference")}
    for tick in range(shape[1] * per_interval):
        at = tick // per_interval
        free = rates.n_objects - carries.sum(axis=1, keepdims=True)
        draw, other = rng.random((2, n_runs, n))
        finds = ~carries & ~avoids & (draw < rates.finding * free * tick_s)
        delivers = carries & ~avoids & (draw < tick_s / rates.homing_s)
        meets = ~avoids & (other < rates.encounter_rate(n) * tick_s)
        avoids = np.where(avoids, other >= tick_s / rates.avoidance_s, meets)
        carries = (carries | finds) & ~delivers
        columns["pickups"][:, at] += finds.sum(axis=1)
        columns["deliveries"][:, at] += delivers.sum(axis=1)
        columns["n_carrying"][:, at] += carries.sum(axis=1) / per_interval
        columns["interference"][:, at] += avoids.mean(axis=1) / per_interval
    return columns


def test_rates_are_found_again_and_predict_larger_swarms():
    """Robots that follow the model: rates of four of them, and what thirty do."""
    truth = ForagingRates(finding=1e-4, homing_s=60.0, encounters=0.01, walls=0.02, avoidance_s=2.0, n_objects=60.0)
    lone = drawn_columns(truth, 1, n_runs=200, horizon_s=400.0, interval_s=100.0)
    small = drawn_columns(truth, 4, n_runs=200, horizon_s=400.0, interval_s=100.0)
    found = estimate_rates(
        4, **small, interval_s=100.0, n_objects=60.0, lone_interference=lone["interference"], avoidance_s=2.0
    )
    assert found.finding == pytest.approx(truth.finding, rel=0.05)
    assert found.homing_s == pytest.approx(truth.homing_s, rel=0.05)
    assert found.encounters == pytest.approx(truth.encounters, rel=0.15)
    assert found.walls == pytest.approx(truth.walls, rel=0.1)
    large = drawn_columns(truth, 30, n_runs=100, horizon_s=400.0, interval_s=100.0)
    predicted = mean_field(found, 30, 400.0)
    # Of 200 runs each, the rates are some 4 % off, and the mean of 100 large runs 2 %.
    assert predicted.delivered[-1] == pytest.approx(large["deliveries"].sum(axis=1).mean(), rel=0.1)
    assert predicted.interference[-1] == pytest.approx(large["interference"][:, 1:].mean(), rel=0.1)


def test_without_lone_robots_there_are_no_walls():
    columns = {"pickups": [[2.0]], "deliveries": [[1.0]], "n_carrying": [[1.0]], "interference": [[0.2]]}
    found = estimate_rates(3, **columns, interval_s=100.0, n_objects=10.0)
    # 2 searching robots for 80 s with 9 free objects find 2; 1 carrying for 80 s delivers 1; odds 0.25 of two others.
    assert found.finding == pytest.approx(2.0 / (2 * 80 * 9))
    assert (found.homing_s, found.encounters, found.walls) == pytest.approx((80.0, 0.125, 0.0))
    lone = estimate_rates(1, **columns | {"n_carrying": [[0.5]]}, interval_s=100.0, n_objects=10.0)
    assert lone.encounters == 0.0
    quieter = estimate_rates(3, **columns, interval_s=100.0, n_objects=10.0, lone_interference=0.5)
    assert (quieter.encounters, quieter.walls) == (0.0, 1.0)


GOOD = {"pickups": [[1.0, 1.0]], "deliveries": [[1.0, 0.0]], "n_carrying": [[1.0, 1.0]], "interference": [[0.1, 0.1]]}


@pytest.mark.parametrize(
    ("changed", "message"),
    [
        ({"pickups": [[1.0]]}, "equally many intervals"),
        ({"pickups": [[1.0, 1.0]] * 2}, "columns of the same runs"),
        ({"pickups": [[1.0, np.nan]]}, "columns of the same runs"),
        ({"n_carrying": [[1.0, 5.0]]}, "at most 4 robots that carry"),
        ({"n_carrying": [[4.0, 4.0]]}, "search at times"),
        ({"deliveries": [[0.0, 0.0]]}, "pick-ups and deliveries"),
        ({"interference": [[1.0, 1.0]]}, "not always avoiding"),
        ({"interference": [[1.0, 1.5]]}, "fraction of the robots"),
        ({"interval_s": 0.0}, "interval and an avoidance"),
    ],
)
def test_columns_that_tell_no_rates_are_refused(changed, message):
    with pytest.raises(CurveError, match=message):
        estimate_rates(4, **{**GOOD, "interval_s": 100.0, "n_objects": 10.0, **changed})


@pytest.mark.parametrize(("name", "value"), [("finding", -1.0), ("homing_s", 0.0), ("n_objects", np.inf)])
def test_rates_that_mean_nothing_are_refused(name, value):
    with pytest.raises(CurveError, match=name):
        ForagingRates(**asdict(RATES) | {name: value})


def test_a_run_without_length_is_refused():
    with pytest.raises(CurveError, match="horizon"):
        mean_field(RATES, 4, 0.0)
    with pytest.raises(CurveError, match="n_robots"):
        steady_state(RATES, 0)
