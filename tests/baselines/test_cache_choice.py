"""Which cache and which isolated object robots go to: utilities by worked numbers, and what is left out."""

import math

import numpy as np
import pytest

from baselines.cache_choice import (
    cache_utility,
    object_is_near,
    select_cache,
    select_isolated_object,
)
from baselines.robots import Activity
from baselines.tasks import DRAW_POINT_X, DRAW_POINT_Y, TASK_DRAWS
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.task_robot import TaskRobot

MIDDLE = np.full(TASK_DRAWS, 0.5)
CACHE = (72, 40)
"""Centre cell of the cache at (14.5, 8.1) m."""


def robot_at(x: float, y: float, activity: Activity = Activity.ACQUIRE, policy=None, **changes) -> TaskRobot:
    robot = TaskRobot(policy, **changes)
    robot.seen.pose(x, y)
    robot.record.activity = activity
    return robot


def select(robot: TaskRobot, draws: np.ndarray = MIDDLE) -> bool:
    return select_cache(robot.record, robot.senses, robot.constants, draws, robot.memory)


def test_utility_of_a_cache():
    robot = TaskRobot()
    expected = math.e * 4 / (9.5005 * 11.3004)
    assert expected == pytest.approx(0.1013, abs=5e-5)
    assert cache_utility(14.5, 8.1, 4, 24.0, 8.0, 1.0, robot.constants) == pytest.approx(expected, rel=1e-4)
    # An isolated object 3 m from the robot and 4 m from the nest centre at (3.2, 8), and one under the robot.
    assert cache_utility(7.2, 8.0, 1, 7.2, 11.0, 0.5, robot.constants) == pytest.approx(math.exp(0.5) / 12)
    assert cache_utility(7.2, 8.0, 1, 7.2, 8.0, 0.5, robot.constants) > 1e5


def test_the_cache_of_highest_utility_is_chosen():
    robot = robot_at(24.0, 8.0)
    robot.know_cache(1, CACHE, 4)  # utility 0.1013
    robot.know_cache(2, (105, 20), 4)  # at (21.1, 4.1): 0.122, nearer to the robot
    assert select(robot)
    assert robot.goal == pytest.approx((21.1, 4.1))
    robot.know_cache(1, CACHE, 5)  # 0.1266
    assert select(robot)
    assert robot.goal == pytest.approx((14.5, 8.1))
    assert robot.record.goal_tolerance_m == 0.02


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (1.0 - 1e-9, 0.5), (0.25, 1.0 - 1e-9)])
def test_the_point_is_uniform_in_the_square_shrunk_by_a_cell_per_side(x, y):
    robot = robot_at(24.0, 8.0)
    robot.know_cache(1, CACHE, 4)
    draws = MIDDLE.copy()
    draws[[DRAW_POINT_X, DRAW_POINT_Y]] = x, y
    assert select(robot, draws)
    assert robot.goal == pytest.approx((14.5 + 5.8 * (x - 0.5), 8.1 + 5.8 * (y - 0.5)))


# Isolated objects


def isolated(robot: TaskRobot) -> bool:
    return select_isolated_object(robot.record, robot.senses, robot.constants, robot.memory)


@pytest.mark.parametrize(("mismatch", "tolerance"), [(False, 0.8), (True, 4.8)])
def test_quirk_finisher_tolerance_mismatch_arrives_far_away(mismatch, tolerance):
    robot = robot_at(10.1, 8.1, quirks=Quirks(finisher_tolerance_mismatch=mismatch))
    robot.know_object(3, (110, 40))
    assert isolated(robot)
    assert robot.record.goal_tolerance_m == pytest.approx(tolerance)


def test_creation_needs_an_object_within_eighty_centimetres():
    robot = TaskRobot()
    robot.know_object(3, (50, 50))  # centre (10.1, 10.1)
    for x, is_near in [(10.89, True), (10.91, False)]:
        robot.seen.believed_position(x, 10.1)
        near = object_is_near(robot.record, robot.senses, robot.constants, robot.memory.objects)
        assert near == is_near
