"""Throttle: what it does to wheels, which robots are throttled and when, and what it records."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.floor import WHEEL_SCALE_MPS
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.throttle import Throttle, ThrottleConfig, sine_throttles, square_throttles
from swarm_forage_env.wrappers.waveform import Waveform
from tests.reference.adversity import throttle_gain
from tests.reference.motion import steered_wheels
from tests.support.fake_arena import FakeArena
from tests.support.stage import begin, lay, load, put, stand, tidy_world


def constant(amplitude: float, *, carriers: bool = False) -> ThrottleConfig:
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


def wheels_after(env: ForageEnv, config: ThrottleConfig, wheels_mps) -> list[float]:
    """Wheel speeds in cm/s of robot 0 after one throttled step with these commanded speeds in m/s."""
    stack = Throttle(env, config)
    begin(stack)
    put(env, 0, 16.0, 8.0)
    actions = np.zeros((len(env.active), 3), np.float32)
    actions[:, 2] = Grip.RELEASE
    actions[0, :2] = np.array(wheels_mps) / WHEEL_SCALE_MPS
    stack.step_batch(actions)
    return (env.swarm.wheel_speed[0] * 100).tolist()


@pytest.fixture(scope="module")
def lone_robot():
    return tidy_world(n_robots=1)


@pytest.mark.parametrize(
    ("strength", "force_cms", "expected_cms"),
    [(0.8, 8.0, 1.6), (0.3, 17.0, 7.0), (0.0, 17.0, 10.0), (1.0, 8.0, 0.0)],
)
def test_driving_straight(lone_robot, strength, force_cms, expected_cms):
    wheels = wheels_after(lone_robot, constant(strength), steered_wheels(force_cms, 0.0))
    assert wheels == pytest.approx([expected_cms] * 2, abs=1e-6)
    moved = np.hypot(*(lone_robot.swarm.position[0] - (16.0, 8.0)))
    assert moved == pytest.approx(expected_cms / 100 * 0.2, abs=1e-8)


@given(
    left=st.floats(-2.0, 2.0, width=32),
    right=st.floats(-2.0, 2.0, width=32),
    strength=st.floats(0.0, 1.0),
)
def test_equals_the_slow_twin(left, right, strength):
    gain = gain_of(constant(strength), [(left, right)])
    expected = throttle_gain((left, right), strength)
    if strength == 0.0:
        assert gain is None
    else:
        assert gain[0] == pytest.approx([expected, expected], abs=1e-12)


def test_whoever_carries_at_the_start_of_a_step_is_throttled_in_it():
    env = tidy_world(n_robots=2)
    stack = Throttle(env, constant(0.5, carriers=True))
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


def ramp(n_ticks: int) -> ThrottleConfig:
    """V(t) = t / 100 up to `n_ticks`."""
    times = (0.0, n_ticks * 0.2)
    return ThrottleConfig(waveform=Waveform(kind="table", times_s=times, values=(0.0, n_ticks / 100)))


def test_last_value_and_mean_are_recorded_per_interval():
    config = ThrottleConfig(waveform=ramp(50).waveform, carriers=True)
    recorder = RunRecorder(config.wrap(FakeArena()))
    for seed in (0, 1):  # a second run starts afresh
        recorder.reset_batch(seed)
        while not recorder.complete:
            recorder.step_batch(np.zeros((4, 3), np.float32))
        recorded = recorder.contributed()
        assert recorded["throttle"].tolist() == pytest.approx([0.05, 0.10, 0.15])
        assert recorded["throttle_mean"].tolist() == pytest.approx([0.03, 0.08, 0.13])
        assert recorder.columns()["adversity"].tolist() == recorded["throttle_mean"].tolist()


def test_the_waveform_itself_is_recorded_where_it_is_negative():
    waveform = Waveform(kind="square", amplitude=0.5, period_s=2.0)
    recorder = RunRecorder(ThrottleConfig(waveform=waveform).wrap(FakeArena()))
    recorder.reset_batch(0)
    while not recorder.complete:
        recorder.step_batch(np.zeros((4, 3), np.float32))
    assert recorder.contributed()["throttle"].tolist() == [0.5, -0.5, 0.5]


# Configuration


def test_levels_of_the_study():
    square, sine = square_throttles(), sine_throttles()
    assert len(square) == 7
    assert len(sine) == 8
    assert all(config.carriers for config in square)
    assert not any(config.carriers for config in sine)
    assert [config.waveform.amplitude for config in square] == [0.10, 0.15, 0.20, 0.25, 0.30, 0.35, 0.40]
    assert [config.waveform.amplitude for config in sine] == [0.10, 0.15, 0.20, 0.25, 0.30, 0.35, 0.40, 0.45]
    for configs, kind, period_s, highest in ((square, "square", 5_000.0, 0.80), (sine, "sine", 10_000.0, 0.90)):
        assert configs[0].waveform == Waveform(kind="constant", amplitude=0.10)
        for config in configs[1:]:
            assert (config.waveform.kind, config.waveform.period_s) == (kind, period_s)
            assert config.waveform.offset == config.waveform.amplitude
        assert configs[-1].waveform.ends[1] == pytest.approx(highest)
