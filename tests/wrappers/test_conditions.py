"""Waveforms, and the conditions that follow them: throttle and cost of handling."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import metrics
from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.wrappers.handling import HandlingCost, HandlingCostConfig
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.throttle import (
    IDEAL_THROTTLE,
    Throttle,
    ThrottleConfig,
    sine_throttles,
    square_throttles,
)
from swarm_forage_env.wrappers.waveform import Waveform
from tests.reference.adversity import throttle_gain
from tests.support.fake_arena import FakeArena
from tests.support.foraging import quick_world
from tests.support.stage import OPEN_CELL, begin, lay, load, put, stand, tidy_world

DT_S = 0.2
SAMPLES = range(1_000, 50_001, 1_000)
"""Ticks at the ends of the study's recording intervals."""


def sampled(waveform: Waveform, ticks=SAMPLES) -> list[float]:
    signal = waveform.signal(DT_S)
    return [signal(tick) for tick in ticks]


# The study


@pytest.mark.parametrize(
    ("throttles", "distances"),
    [
        (square_throttles(), [7.4, 9.8, 12.2, 14.6, 17.0, 19.4]),
        (sine_throttles(), [5.04, 7.18, 9.44, 11.76, 14.13, 16.52, 18.92]),
    ],
    ids=["square", "sine"],
)
def test_distances_from_ideal_conditions_are_those_of_the_study(throttles, distances):
    ideal, *levels = throttles
    assert set(sampled(ideal.waveform)) == {IDEAL_THROTTLE}
    measured = [sum(abs(value - IDEAL_THROTTLE) for value in sampled(level.waveform)) for level in levels]
    assert measured == pytest.approx(distances, abs=0.0051)


# Formulas


def test_values_at_chosen_ticks():
    period_s = 100 * DT_S
    sine = Waveform(kind="sine", amplitude=0.3, offset=0.5, period_s=period_s)
    assert sampled(sine, [0, 25, 75]) == pytest.approx([0.5, 0.8, 0.2])
    square = Waveform(kind="square", amplitude=0.3, offset=0.5, period_s=period_s)
    assert sampled(square, [0, 1, 49, 51, 99, 101]) == [0.8, 0.8, 0.8, 0.2, 0.2, 0.8]
    sawtooth = Waveform(kind="sawtooth", amplitude=0.3, offset=0.5, period_s=period_s)
    assert sampled(sawtooth, [0, 25, 49, 50, 75, 100]) == pytest.approx([0.5, 0.65, 0.794, 0.2, 0.35, 0.5])
    constant = Waveform(kind="constant", amplitude=0.3)
    assert sampled(constant, [0, 1, 10**6]) == [0.3, 0.3, 0.3]
    down = Waveform(kind="step", amplitude=-0.4, offset=0.4, start_s=10.0)
    assert sampled(down, [1, 49, 50, 51]) == [0.4, 0.4, 0.0, 0.0]
    table = Waveform(kind="table", times_s=(2.0, 4.0, 4.2), values=(0.0, 1.0, 0.5))
    assert sampled(table, [0, 10, 15, 20, 21, 99]) == pytest.approx([0.0, 0.0, 0.5, 1.0, 0.5, 0.5])


@pytest.mark.parametrize("start_s", [0.6, 3 * DT_S])  # 3 * 0.2 / 0.2 is more than 3
def test_a_step_happens_at_the_tick_of_its_time(start_s):
    signal = Waveform(kind="step", amplitude=1.0, start_s=start_s).signal(DT_S)
    tick = round(start_s / DT_S)
    assert [signal(tick - 1), signal(tick)] == [0.0, 1.0]


@given(
    kind=st.sampled_from(["constant", "sine", "square", "sawtooth"]),
    amplitude=st.floats(-1, 1),
    offset=st.floats(-1, 1),
    period=st.floats(2.0, 1e5),
    phase=st.floats(-7, 7),
    tick=st.integers(0, 50_000),
)
def test_the_measures_know_the_same_waveforms(kind, amplitude, offset, period, phase, tick):
    shape = {} if kind == "constant" else {"offset": offset, "period_s": period * DT_S, "phase": phase}
    mine = Waveform(kind=kind, amplitude=amplitude, **shape).signal(DT_S)(tick)
    theirs = metrics.waveform(
        kind, tick, frequency=1.0 / period, amplitude=amplitude, offset=offset, phase=shape.get("phase", 0.0)
    )
    cycles = tick / period + (phase / math.tau if kind != "sawtooth" else 0.5)
    jumps_here = kind in ("square", "sawtooth") and abs(cycles * 2 - round(cycles * 2)) < 1e-6
    if not jumps_here:
        assert mine == pytest.approx(float(theirs), abs=1e-8)


EXAMPLES = {
    "constant": Waveform(kind="constant", amplitude=-0.2),
    "sine": Waveform(kind="sine", amplitude=-0.2, offset=0.1, period_s=7.0, phase=0.3),
    "square": Waveform(kind="square", amplitude=0.2, offset=0.1, period_s=7.0),
    "sawtooth": Waveform(kind="sawtooth", amplitude=-0.2, offset=0.1, period_s=7.0, phase=0.2),
    "step": Waveform(kind="step", amplitude=0.3, offset=0.1, start_s=3.0),
    "table": Waveform(kind="table", times_s=(0.0, 1.0, 9.0), values=(0.1, 0.7, -0.3)),
}


@pytest.mark.parametrize("kind", EXAMPLES)
def test_the_ends_are_the_nearest_bounds(kind):
    waveform = EXAMPLES[kind]
    values = sampled(waveform, range(1, 7 * 35 + 1))
    low, high = waveform.ends
    assert low - 1e-12 <= min(values) < low + 0.02
    assert high - 0.02 < max(values) <= high + 1e-12


# Plain values


def test_a_waveform_may_be_named_with_its_fields_beside_it():
    flat = {"waveform": "square", "amplitude": 0.2, "period_s": 5_000, "carriers": True}
    nested = {"waveform": {"kind": "square", "amplitude": 0.2, "period_s": 5_000}, "carriers": True}
    expected = ThrottleConfig(waveform=Waveform(kind="square", amplitude=0.2, period_s=5_000), carriers=True)
    assert ThrottleConfig.from_mapping(flat) == ThrottleConfig.from_mapping(nested) == expected
    assert flat["waveform"] == "square", "the given mapping is left alone"


# Throttle: what it does to wheels, which robots are throttled and when


def throttled(amplitude: float, *, carriers: bool = False) -> ThrottleConfig:
    return ThrottleConfig(waveform=Waveform(kind="constant", amplitude=amplitude), carriers=carriers)


def gain_of(config: ThrottleConfig, commands, *, carrying=(), wheel_gain=None) -> np.ndarray | None:
    """The gain (N, 2) that the throttle hands inwards for wheel commands of four robots."""
    world = FakeArena()
    stack = config.wrap(world)
    stack.reset_batch(0)
    world.swarm.carried_object[list(carrying)] = 0
    actions = np.zeros((4, 3), np.float32)
    actions[: len(commands), :2] = commands
    world.swarm.active[:] = np.isfinite(actions).all(axis=1)
    stack.step_batch(actions, wheel_gain=wheel_gain)
    return world.calls[-1]["wheel_gain"]


@given(
    left=st.floats(-2.0, 2.0, width=32),
    right=st.floats(-2.0, 2.0, width=32),
    strength=st.floats(0.0, 1.0),
)
def test_equals_the_slow_twin(left, right, strength):
    gain = gain_of(throttled(strength), [(left, right)])
    expected = throttle_gain((left, right), strength)
    if strength == 0.0:
        assert gain is None
    else:
        assert gain[0] == pytest.approx([expected, expected], abs=1e-12)


def test_whoever_carries_at_the_start_of_a_step_is_throttled_in_it():
    env = tidy_world(n_robots=2)
    stack = Throttle(env, throttled(0.5, carriers=True))
    begin(stack)
    actions = np.array([[0.4, 0.4, Grip.GRASP]] * 2, np.float32)
    stand(env, 0, (60, 40))
    lay(env, 0, (60, 40))
    put(env, 1, 20.0, 4.0)
    load(env, 1, 1)
    speeds = []
    for _ in range(3):
        stack.step_batch(actions)
        speeds.append((env.swarm.wheel_speed[:, 0] * 100).round(6).tolist())
    # Robot 0 asks, waits with its wheels held and gets its object in the second step, and is slow from the third on.
    assert speeds == [[8.0, 4.0], [0.0, 4.0], [4.0, 4.0]]
    assert env.swarm.carried_object.tolist() == [0, 1]


# Time


@pytest.mark.parametrize(
    ("config_class", "column", "unit"), [(ThrottleConfig, "throttle", 0.01), (HandlingCostConfig, "handling_cost", 1.0)]
)
def test_last_value_and_mean_are_recorded_per_interval(config_class, column, unit):
    """V(t) = t units for the 15 ticks of a run, in three intervals of five; a second run starts afresh."""
    ramp = Waveform(kind="table", times_s=(0.0, 3.0), values=(0.0, 15 * unit))
    recorder = RunRecorder(config_class(waveform=ramp).wrap(tidy_world(n_robots=1, horizon_s=3.0, interval_s=1.0)))
    for seed in (0, 1):
        recorder.reset_batch(seed)
        while not recorder.complete:
            recorder.step_batch(np.zeros((1, 3), np.float32))
        recorded = recorder.columns()
        assert recorded[column].tolist() == pytest.approx([5 * unit, 10 * unit, 15 * unit])
        assert recorded[f"{column}_mean"].tolist() == pytest.approx([3 * unit, 8 * unit, 13 * unit])
        assert recorded["adversity"].tolist() == recorded[f"{column}_mean"].tolist()


def test_the_waveform_itself_is_recorded_where_it_is_negative():
    waveform = Waveform(kind="square", amplitude=0.5, period_s=2.0)
    recorder = RunRecorder(ThrottleConfig(waveform=waveform).wrap(FakeArena()))
    recorder.reset_batch(0)
    while not recorder.complete:
        recorder.step_batch(np.zeros((4, 3), np.float32))
    assert recorder.columns()["throttle"].tolist() == [0.5, -0.5, 0.5]


# Cost of handling: how long pick-ups and drops take


def costing(ticks: float) -> HandlingCostConfig:
    return HandlingCostConfig(waveform=Waveform(kind="constant", amplitude=ticks))


@pytest.mark.parametrize(("value", "ticks"), [(-3.0, 1), (1.99, 1), (2.0, 2), (5.7, 5)])
def test_the_integer_part_counts_and_at_least_one_tick(value, ticks):
    env = tidy_world(n_robots=1)
    stack = HandlingCost(env, costing(value))
    begin(stack)
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    while env.events.code[0] != Event.PICKED_UP:
        stack.step_batch(np.array([[0.0, 0.0, Grip.GRASP]], np.float32))
        assert env.arena._requests.handling_ticks.tolist() == [ticks, ticks]
    assert env.tick - 1 == ticks


def test_a_world_with_slow_handling_equals_the_wrapper_that_makes_it_slow():
    world = quick_world("warehouse_small", n_robots=20, horizon_s=60.0, interval_s=60.0)
    slow = with_overrides(world, pickup_ticks=7, drop_ticks=7)
    fields = run_one(plan_run(slow, "crw", seed=2))
    wrapped = run_one(plan_run(world, "crw", wrappers=(costing(7.4),), seed=2))
    assert fields["free_pickups"].sum() > 0
    for name in ("collected", "free_pickups", "interference_ticks"):
        assert fields[name].tolist() == wrapped[name].tolist()
