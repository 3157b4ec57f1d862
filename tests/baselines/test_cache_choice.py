"""Which cache and which isolated object robots go to: utilities by worked numbers, and what is left out."""

import math

import numpy as np
import pytest

from baselines.cache_choice import (
    cache_is_known,
    cache_utility,
    is_isolated,
    isolated_object_utility,
    object_is_near,
    select_cache,
    select_isolated_object,
)
from baselines.cache_memory import NOT_TO_ADD, NOT_TO_TAKE
from baselines.robots import Activity
from baselines.stochm import STOCHMPolicy
from baselines.task_machines import select_goal
from baselines.tasks import DRAW_POINT_X, DRAW_POINT_Y, TASK_DRAWS
from swarm_forage_env.contract.codes import Goal
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


def test_older_memories_count_less():
    robot = robot_at(24.0, 8.0)
    robot.know_cache(1, CACHE, 4)
    robot.memory.caches[0].seen = robot.record.clock - 50_000
    robot.know_cache(2, (105, 8), 4)  # at (21.1, 1.7): 0.077 when seen now
    assert select(robot)
    assert robot.goal == pytest.approx((21.1, 1.7)), "0.1013 has decayed by exp(0.6065 - 1)"


@pytest.mark.parametrize(("x", "y"), [(0.0, 0.0), (1.0 - 1e-9, 0.5), (0.25, 1.0 - 1e-9)])
def test_the_point_is_uniform_in_the_square_shrunk_by_a_cell_per_side(x, y):
    robot = robot_at(24.0, 8.0)
    robot.know_cache(1, CACHE, 4)
    draws = MIDDLE.copy()
    draws[[DRAW_POINT_X, DRAW_POINT_Y]] = x, y
    assert select(robot, draws)
    assert robot.goal == pytest.approx((14.5 + 5.8 * (x - 0.5), 8.1 + 5.8 * (y - 0.5)))


@pytest.mark.parametrize("activity", [Activity.ACQUIRE, Activity.TRANSPORT])
def test_the_cache_that_the_robot_stands_in_is_left_out(activity):
    robot = robot_at(11.5, 8.0, activity)
    robot.know_cache(1, CACHE, 9)
    assert not select(robot)
    robot.seen.pose(11.3, 8.0)
    assert select(robot)


def test_stochx_takes_only_from_caches_of_three_but_adds_to_any():
    robot = robot_at(24.0, 8.0)
    robot.know_cache(1, CACHE, 2)
    assert not select(robot)
    robot.record.activity = Activity.TRANSPORT
    assert select(robot)
    robot = robot_at(24.0, 8.0)
    robot.know_cache(1, CACHE, 3)
    assert select(robot)


def test_stochm_takes_from_any_cache():
    robot = robot_at(24.0, 8.0, policy=STOCHMPolicy())
    robot.know_cache(1, CACHE, 2)
    assert select(robot)


@pytest.mark.parametrize(
    ("purpose", "activity"),
    [(NOT_TO_TAKE, Activity.ACQUIRE), (NOT_TO_ADD, Activity.TRANSPORT)],
    ids=["taking", "adding"],
)
def test_caches_to_be_left_alone_are_left_out_for_one_purpose_only(purpose, activity):
    robot = robot_at(24.0, 8.0, activity)
    robot.know_cache(1, CACHE, 9)
    robot.memory.shunned_caches[purpose, :2] = 5, 1
    assert not select(robot)
    other = Activity.TRANSPORT if activity == Activity.ACQUIRE else Activity.ACQUIRE
    robot.record.activity = other
    assert select(robot)


def test_a_goal_in_a_cache_holds_while_the_cache_is_remembered_with_enough_objects():
    robot = robot_at(24.0, 8.0)
    robot.know_cache(1, CACHE, 3)
    assert select(robot)
    assert cache_is_known(robot.record, robot.constants, robot.memory)
    robot.know_cache(1, CACHE, 2)
    assert not cache_is_known(robot.record, robot.constants, robot.memory)
    robot.record.activity = Activity.TRANSPORT
    assert cache_is_known(robot.record, robot.constants, robot.memory)
    robot.record.n_caches = 0
    assert not cache_is_known(robot.record, robot.constants, robot.memory)


# Isolated objects


def isolated(robot: TaskRobot) -> bool:
    return select_isolated_object(robot.record, robot.senses, robot.constants, robot.memory)


def test_utility_of_an_isolated_object():
    robot = TaskRobot()
    # 3 m from the robot and 4 m from the nest centre at (3.2, 8).
    assert isolated_object_utility(7.2, 8.0, 7.2, 11.0, 0.5, robot.constants) == pytest.approx(math.exp(0.5) / 12)
    assert isolated_object_utility(7.2, 8.0, 7.2, 8.0, 0.5, robot.constants) > 1e5


def test_objects_near_each_other_are_no_candidates():
    robot = robot_at(10.1, 8.1)
    robot.know_object(3, (80, 40))
    robot.know_object(4, (112, 40))  # 6.4 m further: within the proximity distance
    assert not isolated(robot)
    robot.know_object(4, (113, 40))
    assert isolated(robot)
    assert robot.goal == pytest.approx((16.1, 8.1)), "nearer to robot and nest"
    assert robot.record.goal_tolerance_m == 0.8


def test_older_memories_of_isolated_objects_count_less():
    robot = robot_at(18.1, 12.0)
    robot.know_object(3, (100, 70))  # utility 0.052
    robot.know_object(4, (60, 70))  # 0.040
    assert isolated(robot)
    assert robot.goal == pytest.approx((20.1, 14.1))
    robot.memory.objects.seen[0] = robot.record.clock - 50_000
    assert isolated(robot)
    assert robot.goal == pytest.approx((12.1, 14.1)), "0.052 has decayed by exp(0.6065 - 1) to 0.035"


def test_several_objects_are_compared_with_all_others():
    robot = robot_at(10.1, 8.1)
    for row, cell in enumerate([(80, 40), (130, 40), (131, 41), (30, 70), (82, 40)]):
        robot.know_object(row, cell)
    alone = [is_isolated(robot.record, entry, robot.constants, robot.memory) for entry in range(5)]
    assert alone == [False, False, False, True, False]


def test_objects_near_a_cache_are_no_candidates():
    robot = robot_at(10.1, 8.1)
    robot.know_object(3, (110, 40))
    robot.know_cache(1, (79, 40), 5)  # 6.2 m
    assert not isolated(robot)
    robot.record.n_caches = 0
    robot.know_cache(1, (77, 40), 5)  # 6.6 m
    assert isolated(robot)


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


def test_shunned_objects_are_not_selected_as_free_objects():
    robot = TaskRobot()
    robot.record.goal_kind = Goal.OBJECT
    robot.know_object(3, (60, 50))
    robot.memory.shunned[3] = robot.record.shun_round
    assert not select_goal(robot.record, robot.senses, robot.constants, MIDDLE, robot.memory)
    robot.record.shun_round += 1
    assert select_goal(robot.record, robot.senses, robot.constants, MIDDLE, robot.memory)
