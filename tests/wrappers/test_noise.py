"""Sensor and actuator noise: sizes, clamps, what stays exact, and what the study's noise does to decisions."""

import numpy as np
import pytest
from scipy import special

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.detection import sees_cache, sees_nest, sees_object, sees_obstacle
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import Quirks
from swarm_forage_env.world.kernels.disturbances import draw_bits, new_lanes, room_for_draws
from swarm_forage_env.wrappers.noise import (
    NOISE_GROUPS,
    ActuatorNoise,
    ActuatorNoiseConfig,
    SensorNoise,
    SensorNoiseConfig,
    noise_levels,
)
from swarm_forage_env.wrappers.waveform import Waveform
from tests.reference.adversity import SENSORS, noise_bits, noisy_row, normal_of, normal_of_bits
from tests.reference.sensing import interferes
from tests.support.fake_arena import FakeArena
from tests.support.stage import tidy_world

ROBOTS = 100


@pytest.fixture(scope="module")
def world() -> ForageEnv:
    env = ForageEnv(scenario("warehouse_medium", n_robots=ROBOTS, n_objects=100))
    env.reset_batch(0)
    return env


def noisy(world: ForageEnv, obs: np.ndarray, times: int, **fields) -> np.ndarray:
    """Noise added to copies of the same observations, (times, N, D)."""
    stack = SensorNoise(world, SensorNoiseConfig(**fields))
    stack.on_reset(1)
    return np.stack([stack.observe(obs.copy()) for _ in range(times)])


# Sizes and clamps


@pytest.mark.parametrize(
    ("fields", "sigmas"),
    [
        ({"sigma": 0.2}, dict.fromkeys(SENSORS, 0.2)),
        ({"sigma": 2.0}, dict.fromkeys(SENSORS, 2.0)),
        (
            {"sigma": 0.02, "groups": ("proximity", "ground"), "sigmas": {"ground": 0.1, "light": 0.04}},
            {"proximity": 0.02, "light": 0.04, "ground": 0.1},
        ),
    ],
    ids=["all sensors", "to the ends of their ranges", "some sensors"],
)
def test_equals_the_slow_twin(world, fields, sigmas):
    rng = np.random.default_rng(2)
    obs = rng.uniform(-1, 1, (ROBOTS, world.layout.size)).astype(np.float32)
    obs[:, :52] = np.abs(obs[:, :52])
    heading = rng.uniform(-np.pi, np.pi, ROBOTS)
    obs[:, world.layout["heading"]] = np.column_stack((np.cos(heading), np.sin(heading)))
    seen = noisy(world, obs, 1, **fields)[0]
    bits = next(noise_bits(1, Stream.SENSOR_NOISE, ROBOTS, sum(SENSORS[group] for group in sigmas)))
    for robot, draws in enumerate(normal_of_bits(bits).tolist()):
        expected = noisy_row(obs[robot].tolist(), draws, sigmas, (48.0, 48.0))
        np.testing.assert_allclose(seen[robot], expected, rtol=0, atol=2e-6)


def test_rows_of_absent_robots_stay_zero():
    env = tidy_world(n_robots=4)
    stack = SensorNoise(env, SensorNoiseConfig(sigma=1.0))
    stack.reset_batch(0)
    present = np.array([True, False, True, False])
    env.set_population(active=np.array([True, False, False, False]), present=present)
    obs, *_ = stack.step_batch(np.zeros((4, 3), np.float32))
    assert not obs[~present].any()
    assert obs[present][:, env.layout["proximity"]].any(axis=1).all(), "robots in repair sense, with noise"


@pytest.mark.parametrize("sigma", [0.0, Waveform(kind="constant", amplitude=-1.0)])
def test_without_noise_observations_are_bitwise_the_same(world, sigma):
    obs = world.reset_batch(5)
    np.testing.assert_array_equal(noisy(world, obs.copy(), 3, sigma=sigma)[2], obs)


# The study


STUDY_TABLE = [
    # sigma, false obstacle per tick, all four sensors show the object, three of four show the nest or a cache
    (0.0043, 0.168, 1.00, 1.00),
    (0.043, 0.57, 0.60, 1.00),
    (0.100, 0.90, 0.23, 0.62),
]


@pytest.mark.parametrize(("sigma", "obstacle", "object_seen", "area_seen"), STUDY_TABLE)
def test_decisions_under_the_noise_of_the_study(world, sigma, obstacle, object_seen, area_seen):
    samples = 60
    for decision, group, value, expected in (
        (lambda ring: sees_obstacle(ring, True), "proximity", 0.0, obstacle),
        (sees_object, "ground", 0.0, object_seen),
        (sees_nest, "ground", 179 / 255, area_seen),
        (sees_cache, "ground", 102 / 255, area_seen),
    ):
        obs = np.zeros((ROBOTS, world.layout.size), np.float32)
        obs[:, world.layout[group]] = value
        seen = noisy(world, obs, samples, sigma=sigma)[:, :, world.layout[group]].reshape(samples * ROBOTS, -1)
        error = np.sqrt(expected * (1 - expected) / len(seen))
        share = np.mean([decision(row) for row in seen])
        assert share == pytest.approx(expected, abs=0.0051 + 4 * error), "to the last place that is printed"


def test_levels_of_the_study():
    warehouses, rescue = noise_levels(), noise_levels(0.10)
    sigmas = [sensors.sigma for sensors, _ in warehouses]
    assert sigmas == pytest.approx([0.0, 0.0043, 0.0086, 0.0129, 0.0171, 0.0214, 0.0257, 0.03], abs=5e-5)
    assert [wheels.sigma for _, wheels in warehouses] == sigmas
    assert {sensors.groups for sensors, _ in warehouses} == {NOISE_GROUPS}
    assert rescue[-1][0].sigma == 0.10


@pytest.mark.parametrize("exact", [False, True])
def test_quirk_pose_sensors_exact(exact):
    env = ForageEnv(scenario("warehouse_small", n_robots=5, quirks=Quirks(pose_sensors_exact=exact)))
    true = env.reset_batch(0).copy()
    stack = SensorNoise(env, SensorNoiseConfig(sigma=0.1))
    seen = stack.reset_batch(0)
    changed = {name: bool((seen[:, env.layout[name]] != true[:, env.layout[name]]).any()) for name in NOISE_GROUPS}
    assert changed == {name: not exact or name not in ("position", "heading") for name in NOISE_GROUPS}


# Draws


def test_normal_draws_have_the_normal_distribution_function():
    steps = np.concatenate((np.arange(0, 2**24, 4099), np.arange(20_000), 2**24 - 1 - np.arange(20_000)))
    normal = normal_of(steps * 2.0**-24)
    assert np.abs(special.ndtr(normal.astype(np.float64)) - (steps + 0.5) * 2.0**-24).max() < 2e-5
    assert np.abs(normal).max() == pytest.approx(5.42, abs=0.005)
    np.testing.assert_allclose(normal_of((2**24 - 1 - steps) * 2.0**-24), -normal, atol=1e-6)
    rising = np.argsort(steps, kind="stable")
    assert np.all(np.diff(normal[rising]) >= 0.0)


@pytest.mark.parametrize("n_draws", [0, 64, 64 * 5])
def test_random_bits_are_those_of_the_twin(n_draws):
    lanes, room = new_lanes(stream_rng(7, Stream.SENSOR_NOISE)), room_for_draws(n_draws)
    twin = noise_bits(7, Stream.SENSOR_NOISE, 1, n_draws)
    for _ in range(4):
        draw_bits(lanes, room)
        np.testing.assert_array_equal(room, next(twin)[0])


# Actuators


def actuator_gains(n_steps: int, *, wheel_gain=None, seed: int = 0, **fields) -> np.ndarray:
    """Gains (steps, N, 2) that reach the world."""
    env = FakeArena(scenario("warehouse_medium", n_robots=ROBOTS, n_objects=50))
    stack = ActuatorNoiseConfig(**fields).wrap(env)
    stack.reset_batch(seed)
    gains = []
    for _ in range(n_steps):
        stack.step_batch(np.zeros((ROBOTS, 3), np.float32), wheel_gain=wheel_gain)
        gains.append(np.array(env.calls[-1]["wheel_gain"]))
    return np.stack(gains)


def test_gains_are_those_of_the_twin_and_from_outside_multiplied_and_left_alone():
    outer = np.full((ROBOTS, 2), 0.5)
    outer[0] = 0.0, 2.0
    alone, both = actuator_gains(3, sigma=0.1), actuator_gains(3, sigma=0.1, wheel_gain=outer)
    draws = normal_of_bits(next(noise_bits(0, Stream.ACTUATOR_NOISE, ROBOTS, 2)))
    np.testing.assert_allclose(alone[0], 1.0 + 0.1 * draws, rtol=1e-6)
    np.testing.assert_allclose(both, outer * alone)
    assert outer[1:].tolist() == [[0.5, 0.5]] * (ROBOTS - 1)


def test_wheel_noise_acts_after_the_limit_and_only_on_wheels_that_turn():
    env = tidy_world(n_robots=3)
    stack = ActuatorNoise(env, ActuatorNoiseConfig(sigma=0.5))
    stack.reset_batch(0)
    actions = np.array([[1.0, 1.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.3, 0.0]], np.float32)
    speeds = np.stack([stack.step_batch(actions) and env.swarm.wheel_speed.copy() for _ in range(20)])
    assert np.abs(speeds.sum(axis=2)).max() / 2 == pytest.approx(0.10), "limited again"
    assert np.abs(np.diff(speeds, axis=2)).max() <= 0.20 + 1e-9
    assert speeds[:, 0].std() > 0.02
    assert not speeds[:, 1].any()
    assert not speeds[:, 2, 0].any()
    assert speeds[:, 2, 1].std() > 0.01


# Belief


def test_the_believed_share_of_interference_counts_false_obstacles():
    env = ForageEnv(scenario("warehouse_small", n_robots=40, n_objects=5, start_margin_m=6.5, interval_s=2.0))
    stack = SensorNoise(env, SensorNoiseConfig(sigma=0.03, groups=("proximity",)))
    stack.reset_batch(0)
    believed, true = [], []
    for _ in range(10):
        obs, *_ = stack.step_batch(np.zeros((40, 3), np.float32))
        rings = obs[:, env.layout["proximity"]]
        believed.append(np.mean([sees_obstacle(ring, False) for ring in rings]))
        true.append(np.mean([interferes(env, robot) for robot in range(40)]))
    assert stack.interval_columns() == {"believed_interference_fraction": pytest.approx(np.mean(believed))}
    assert np.mean(believed) > np.mean(true) + 0.1
    # The next interval starts anew, and robots in repair do not count.
    env.set_population(active=np.arange(40) < 10, present=np.ones(40, bool))
    obs, *_ = stack.step_batch(np.zeros((40, 3), np.float32))
    expected = np.mean([sees_obstacle(ring, False) for ring in obs[:10, env.layout["proximity"]]])
    assert stack.interval_columns()["believed_interference_fraction"] == pytest.approx(expected)
