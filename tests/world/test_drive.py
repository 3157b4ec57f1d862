"""From actions to wheel speeds: limits, gains, held wheels, refused commands."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.policy import ActionError
from tests.reference.motion import (
    MAX_DIFFERENCE_MPS,
    MAX_SPEED_MPS,
    WHEEL_SCALE_MPS,
    limited_speeds,
    limited_wheels,
    steered_wheels,
)
from tests.support.stage import assert_same_world, lay, put, snapshot, stand, tidy_world

command = st.floats(-2.0, 2.0, width=32)


@pytest.fixture(scope="module")
def lone_robot():
    return tidy_world(n_robots=1)


def drive(env, left, right, *, gain=None, grip=Grip.RELEASE):
    """Wheel speeds of robot 0 after one step with a command."""
    actions = np.zeros((len(env.active), 3), np.float32)
    actions[:, 2] = grip
    actions[0, :2] = left, right
    env.step_batch(actions, wheel_gain=None if gain is None else np.array([gain] * len(env.active)))
    return env.swarm.wheel_speed[0].tolist()


@given(left=command, right=command)
def test_speed_and_difference_are_clipped_separately(lone_robot, left, right):
    put(lone_robot, 0, 16.0, 8.0)
    wheels = drive(lone_robot, left, right)
    assert wheels == pytest.approx(limited_wheels(left, right), abs=1e-9)
    assert abs(wheels[0] + wheels[1]) / 2 <= MAX_SPEED_MPS + 1e-12
    assert abs(wheels[1] - wheels[0]) <= MAX_DIFFERENCE_MPS + 1e-12


@pytest.mark.parametrize(
    ("command", "wheels"),
    [
        ((1.0, 1.0), (0.10, 0.10)),  # a learner's full speed
        ((-1.0, -1.0), (-0.10, -0.10)),
        ((-1.0, 1.0), (-0.10, 0.10)),  # turning on the spot
        ((0.0, 1.0), (0.0, 0.20)),  # both limits just met: the outer wheel keeps its full speed
        ((0.5, 0.5), (0.10, 0.10)),
        ((0.25, 0.5), (0.05, 0.10)),  # inside of both limits
        ((5.0, 5.0), (0.10, 0.10)),  # beyond [-1, 1]
    ],
)
def test_limits_of_learners(lone_robot, command, wheels):
    assert drive(lone_robot, *command) == pytest.approx(wheels, abs=1e-9)


def turn_and_advance(env, wheels):
    """Heading change in degrees and distance covered in metres in one tick with these wheel speeds."""
    put(env, 0, 16.0, 8.0)
    driven = drive(env, wheels[0] / WHEEL_SCALE_MPS, wheels[1] / WHEEL_SCALE_MPS)
    assert driven == pytest.approx(wheels, abs=1e-8)
    swarm = env.swarm
    return math.degrees(swarm.heading[0]), float(np.hypot(*(swarm.position[0] - (16.0, 8.0))))


def test_soft_turn(lone_robot):
    wheels = steered_wheels(9.0, 10.0)
    assert wheels == pytest.approx((0.03, 0.15))
    turn, advance = turn_and_advance(lone_robot, wheels)
    assert turn == pytest.approx(9.82, abs=0.005)
    assert advance == pytest.approx(0.018, rel=0.005)  # the chord of a 9.82 degree arc of 1.8 cm


def test_hard_turn(lone_robot):
    wheels = steered_wheels(9.0, 20.0)
    assert wheels == (-0.10, 0.10)
    turn, advance = turn_and_advance(lone_robot, wheels)
    assert turn == pytest.approx(16.37, abs=0.005)
    assert advance == pytest.approx(0.0, abs=1e-9)


def test_gain_multiplies_after_the_limit(lone_robot):
    assert drive(lone_robot, 1.0, 1.0, gain=(0.5, 0.25)) == pytest.approx((0.05, 0.025))
    assert drive(lone_robot, 0.25, 0.25, gain=(1.2, 0.8)) == pytest.approx((0.06, 0.04))
    assert drive(lone_robot, 1.0, 1.0, gain=(0.0, 0.0)) == [0.0, 0.0]


@pytest.mark.parametrize("gain", [(1.2, 3.0), (30.0, -30.0), (1.0, 1.5), (1e300, 1e300)])
@pytest.mark.parametrize("command", [(-1.0, 1.0), (0.4, 0.5)])
def test_no_gain_makes_a_robot_faster_than_its_motors(lone_robot, command, gain):
    put(lone_robot, 0, 16.0, 8.0)
    left, right = drive(lone_robot, *command, gain=gain)
    wanted = [wheel * factor for wheel, factor in zip(limited_wheels(*command), gain, strict=True)]
    assert (left, right) == pytest.approx(limited_speeds(*wanted), abs=1e-8)
    assert abs(left + right) / 2 <= MAX_SPEED_MPS * (1 + 1e-9)
    assert abs(right - left) <= MAX_DIFFERENCE_MPS * (1 + 1e-9)


@pytest.mark.parametrize(("column", "value"), [(0, np.inf), (1, np.nan), (2, -np.inf)])
def test_a_command_that_is_not_finite_is_refused_and_nothing_moves(column, value):
    env = tidy_world(n_robots=3)
    stand(env, 0, (60, 40))
    lay(env, 0, (60, 40))
    actions = np.full((3, 3), 0.5, np.float32)
    env.step_batch(actions)
    before = snapshot(env)
    actions[1] = 0.25
    actions[2, column] = value
    with pytest.raises(ActionError, match="robot_2"):
        env.step_batch(actions)
    assert_same_world(before, snapshot(env))
    actions[2] = 0.25
    env.step_batch(actions)
    assert env.tick == 2


def test_wheels_are_held_while_interacting():
    env = tidy_world(n_robots=1)
    stand(env, 0, (60, 40))
    lay(env, 0, (60, 40))
    assert drive(env, 0.1, 0.1, grip=Grip.GRASP) == pytest.approx((0.02, 0.02)), "the request itself is free to move"
    assert env.swarm.pending_kind[0] != 0
    where = env.swarm.position[0].copy()
    assert drive(env, 1.0, 0.5, grip=Grip.GRASP) == [0.0, 0.0]
    np.testing.assert_array_equal(env.swarm.position[0], where)
    assert env.swarm.carried_object[0] == 0
    assert drive(env, 1.0, 1.0, grip=Grip.GRASP) == pytest.approx((0.10, 0.10))
