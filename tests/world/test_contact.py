"""Touching robots: a pressing pair keeps its common speed; turned, mirrored or swapped it behaves the same."""

import math

import numpy as np
import pytest

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.kernels.contact import press
from swarm_forage_env.world.kernels.tick import look
from swarm_forage_env.world.motion import TOUCH_SLACK_M
from tests.reference.motion import pressed_velocities
from tests.support.engines import DIAMETER_M, RADIUS_M, heap, in_each_engine
from tests.support.stage import put, tidy_world

MIDDLE = np.array([16.0, 8.0])
FULL = 0.5
"""Wheel command of the highest centre speed, 0.10 m/s."""


def world(*poses: tuple[float, float, float], n_objects: int = 1) -> ForageEnv:
    """Robots at (x, y, heading) from the middle of the small warehouse."""
    env = tidy_world(n_robots=len(poses), n_objects=n_objects)
    for robot, (x, y, heading) in enumerate(poses):
        put(env, robot, MIDDLE[0] + x, MIDDLE[1] + y, heading)
    env.arena.observe()
    return env


def drive(env: ForageEnv, *commands: tuple[float, float], ticks: int = 1) -> np.ndarray:
    """Drive with these wheel commands; returns the velocities of the last tick, (N, 2) in m/s."""
    actions = np.column_stack((commands, np.ones(len(commands)))).astype(np.float32)
    before = env.swarm.position.copy()
    for _ in range(ticks):
        before = env.swarm.position.copy()
        env.step_batch(actions)
    return (env.swarm.position - before) / env.scenario.dt_s


# The rule


@in_each_engine
def test_a_pair_that_meets_keeps_the_mean_speed_of_its_commands():
    env = world((-0.10, 0.0, 0.0), (0.10, 0.0, math.pi))
    drive(env, (FULL, FULL), (0.3, 0.3), ticks=3)
    for _ in range(20):
        np.testing.assert_allclose(drive(env, (FULL, FULL), (0.3, 0.3)), [(0.02, 0.0), (0.02, 0.0)], atol=1e-6)
    np.testing.assert_allclose(
        env.swarm.wheel_speed, [(0.10, 0.10), (0.06, 0.06)], atol=1e-8, err_msg="wheels turn as commanded"
    )


def test_the_common_speed_is_kept_when_commands_change_and_clipped_to_them():
    env = world((-0.10, 0.0, 0.0), (0.10, 0.0, math.pi))
    drive(env, (FULL, FULL), (0.3, 0.3), ticks=3)
    assert drive(env, (0.2, 0.2), (0.45, 0.45))[0, 0] == pytest.approx(0.02, abs=1e-6), "the weaker one goes on shoving"
    assert drive(env, (0.05, 0.05), (0.45, 0.45))[0, 0] == pytest.approx(0.01, abs=1e-6), "no faster than it wants"
    assert drive(env, (FULL, FULL), (0.45, 0.45))[0, 0] == pytest.approx(0.01, abs=1e-6)
    assert drive(env, (FULL, FULL), (-0.2, -0.2))[0, 0] == pytest.approx(0.04, abs=1e-6), "dragged along by who flees"


def test_across_the_line_between_them_robots_move_as_commanded():
    env = world((0.0, 0.0, 0.5), (DIAMETER_M, 0.0, math.pi))
    velocity = drive(env, (FULL, FULL), (0.2, 0.2))
    assert velocity[0, 1] == pytest.approx(0.10 * math.sin(0.5), abs=1e-3)
    assert velocity[1, 1] == pytest.approx(0.0, abs=1e-3)
    assert env.swarm.heading == pytest.approx([0.5, math.pi], abs=1e-9)


def seek(env: ForageEnv, ticks: int) -> list[float]:
    """Two robots seek the middle as in the specification; returns the pair's speed in every tick in touch."""
    speeds = []
    for _ in range(ticks):
        distance = np.hypot(*(MIDDLE - env.swarm.position).T)
        if distance.min() < 0.02:
            return speeds
        wheel = np.where(distance > 0.2, 0.08, 0.4 * distance) / 0.20
        before = env.swarm.position.copy()
        touching = math.dist(*before) <= DIAMETER_M + TOUCH_SLACK_M
        drive(env, *zip(wheel, wheel, strict=True))
        if touching:
            speeds.append((env.swarm.position - before)[0, 0] / env.scenario.dt_s)
    raise AssertionError("nobody arrived")


@pytest.mark.parametrize(("rows", "mirrored"), [((0, 1), False), ((1, 0), True)])
def test_of_two_robots_at_one_target_one_gets_there(rows, mirrored):
    sign = -1.0 if mirrored else 1.0
    poses = [(-0.30 * sign, 0.0, math.pi * mirrored), (0.36 * sign, 0.0, math.pi * (not mirrored))]
    env = world(*(poses[row] for row in rows))
    speeds = seek(env, 300)
    assert len(speeds) > 20
    assert np.all(np.sign(speeds) == -sign), "the one from farther away was faster"
    assert abs(env.swarm.position[rows[1], 0] - MIDDLE[0]) < 0.02


# Several robots


def test_a_robot_between_two_is_moved_by_the_mean_of_both():
    env = world((-DIAMETER_M, 0.0, 0.0), (0.0, 0.0, 1.0), (DIAMETER_M, 0.0, math.pi))
    velocity = drive(env, (FULL, FULL), (0.0, 0.0), (FULL, FULL), ticks=10)
    np.testing.assert_allclose(velocity, 0.0, atol=1e-6)
    env = world((-DIAMETER_M, 0.0, 0.0), (0.0, 0.0, 1.0), (DIAMETER_M, 0.0, math.pi))
    drift = drive(env, (FULL, FULL), (0.0, 0.0), (0.25, 0.25), ticks=10)
    assert 0.0 < drift[1, 0] < 0.05, "towards the weaker one"


class Pressing:
    """The kernel of contact and its memory, on robots that stand at `places`."""

    def __init__(self, places: np.ndarray, present: np.ndarray) -> None:
        """Stand the robots there."""
        env = ForageEnv(with_overrides(scenario("warehouse_small"), n_robots=len(places)))
        env.reset_batch(0)
        self._arrays = env.arena._arrays
        self._memory = self._arrays.motion.touching
        self.position = env.swarm.position
        self.position[:], env.swarm.present[:] = places, present

    def velocities(self, command: np.ndarray) -> np.ndarray:
        """Velocities (N, 3) after contact for commanded ones (N, 3)."""
        sensors, motion = self._arrays.sensors, self._arrays.motion
        look(self._arrays)
        motion.twist[:-1] = command
        touching = sensors.near, sensors.bins, motion.touch_m
        present = self._arrays.state.swarm.present
        press(self.position, present, *touching, *self._memory, motion.command, motion.twist)
        self._memory = self._memory[1], self._memory[0]
        return motion.twist[:-1].copy()


@pytest.mark.parametrize("seed", range(3))
def test_contact_is_its_slow_twin(seed):
    rng = np.random.default_rng(seed)
    n_robots = 30
    places = heap(rng, n_robots)
    places += MIDDLE
    present = rng.random(n_robots) < 0.9
    contact = Pressing(places, present)
    memory: dict[tuple[int, int], float] = {}
    command = rng.uniform(-0.1, 0.1, (n_robots, 3))
    n_pressing = 0
    for _ in range(8):
        changed = rng.random(n_robots) < 0.3
        command[changed] = rng.uniform(-0.1, 0.1, (n_robots, 3))[changed]
        velocity = contact.velocities(command)
        expected, memory = pressed_velocities(
            [tuple(place) for place in contact.position.tolist()],
            [(x, y) for x, y, _ in command.tolist()],
            present.tolist(),
            DIAMETER_M + TOUCH_SLACK_M,
            memory,
        )
        np.testing.assert_allclose(velocity[:, :2], expected, atol=1e-12)
        np.testing.assert_array_equal(velocity[:, 2], command[:, 2])
        n_pressing += len(memory)
        contact.position += rng.normal(0.0, 1e-4, (n_robots, 2))
    assert n_pressing > 50


# Walls, and robots that do not drive


@in_each_engine
def test_a_robot_at_a_wall_is_held_there_by_one_that_shoves():
    x_high = scenario("warehouse_small").arena.interior_m[2] - MIDDLE[0]
    env = world((x_high - RADIUS_M, 0.0, 0.0), (x_high - 3 * RADIUS_M, 0.0, 0.0))
    drive(env, (0.0, 0.0), (FULL, FULL), ticks=50)
    assert env.swarm.position[0, 0] == pytest.approx(MIDDLE[0] + x_high - RADIUS_M, abs=1e-4)
    assert math.dist(*env.swarm.position) > 0.97 * DIAMETER_M
    drive(env, (-FULL, -FULL), (FULL, FULL), ticks=20)
    assert math.dist(*env.swarm.position) > 0.97 * DIAMETER_M
    away = drive(env, (0.0, 0.0), (-FULL, -FULL), ticks=5)
    assert away[1, 0] == pytest.approx(-0.10, abs=1e-6)


def test_a_reset_forgets_who_pressed():
    env = world((-0.10, 0.0, 0.0), (0.10, 0.0, math.pi))
    drive(env, (FULL, FULL), (0.3, 0.3), ticks=3)
    env.reset_batch(1)
    for robot, (x, heading) in enumerate(((-DIAMETER_M / 2, 0.0), (DIAMETER_M / 2, math.pi))):
        put(env, robot, MIDDLE[0] + x, MIDDLE[1], heading)
    env.arena.observe()
    assert drive(env, (0.3, 0.3), (FULL, FULL))[0, 0] == pytest.approx(-0.02, abs=1e-6)
