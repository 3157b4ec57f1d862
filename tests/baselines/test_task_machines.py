"""The machine of every task, state by state, and how tasks end: finished, refused or given up."""

import math

import numpy as np
import pytest

from baselines.robots import Activity, VectorState
from swarm_forage_env.contract.codes import Event, Grip, Task
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.memories import caches_of, estimates_of
from tests.support.task_robot import TaskRobot
from tests.support.task_work import (
    CACHE,
    COLLECTS,
    HARVESTS,
    drop,
    give_up,
    pick_up,
    wait_for_drop,
    wait_for_pickup,
)


@pytest.fixture
def robot() -> TaskRobot:
    return TaskRobot()


# Sources


@pytest.mark.parametrize("task", COLLECTS)
def test_quirk_waits_for_cache(task):
    robot = TaskRobot(quirks=Quirks(waits_for_cache=True))
    wait_for_pickup(robot, task)
    for count, grip in ((2, Grip.RELEASE), (2, Grip.RELEASE), (3, Grip.GRASP), (2, Grip.RELEASE)):
        robot.seen.caches((7, CACHE, count))
        assert robot.act().tolist() == [0.0, 0.0, np.float32(grip)]
        assert robot.activity is Activity.WAIT_PICKUP
    robot.seen.caches()
    robot.act()
    assert robot.activity is Activity.ACQUIRE, "nothing to wait for"


@pytest.mark.parametrize("doubled", [False, True])
def test_quirk_explore_double_start_of_a_search(doubled):
    robot = TaskRobot(quirks=Quirks(explore_double_start=doubled))
    robot.start(Task.COLLECTOR)
    robot.act()
    robot.record.explore_ticks = -1
    single = robot.record.wander_deg
    robot.act()
    draws = robot.policy._draws[0]
    steps = [10.0 * draws[2] - 5.0] * doubled + [10.0 * draws[1] - 5.0]
    for step in steps:
        single = np.fmod(single + step, 5.0)
    assert robot.record.wander_deg == pytest.approx(single)


# Destinations


@pytest.mark.parametrize("task", [Task.STARTER, Task.FINISHER])
def test_quirk_refusals_not_remembered(task):
    robot = TaskRobot(quirks=Quirks(refusals_not_remembered=True))
    wait_for_drop(robot, task)
    x, y = robot.goal
    if task is Task.STARTER:
        robot.seen.pose(26.0, 8.1)
        x, y = 14.6, 8.05  # half way
    cache = (11, (int((x + 7.1) / 0.2), int(y / 0.2)), 4)  # the world wants 12.8 m, the robot 6.4 m
    robot.seen.event(Event.CACHE_TOO_NEAR, cache=cache)
    robot.act()
    assert list(caches_of(robot.policy, 0)) == [11]
    assert not robot.memory.caches[0].has_refused
    assert math.dist(robot.goal, (x, y)) < 0.6, "where it will be refused again"
    assert robot.activity is (Activity.TRANSPORT if task is Task.STARTER else Activity.WAIT_DROP)


@pytest.mark.parametrize("stays", [False, True])
@pytest.mark.parametrize("sees_obstacle", [False, True])
def test_quirk_no_walk_at_site(stays, sees_obstacle):
    quirks = Quirks(no_walk_at_site=stays, scattered_sites=True, finisher_tolerance_mismatch=True)
    robot = TaskRobot(quirks=quirks)
    wait_for_pickup(robot, Task.STARTER)
    robot.policy._constants["far_site_share_at_border"] = 0.0
    robot.policy._constants["site_scatter_at_border_m"] = 1e-6  # all choices in one place, 6.4 m from the nest
    robot.seen.pose(9.2, 8.0, 1.0)
    if sees_obstacle:
        robot.seen.obstacle(0.0)
    robot.seen.window({})
    robot.seen.carry(3)
    seen = []
    for _ in range(4):
        robot.act()
        seen.append((robot.stage, robot.record.explore_ticks, robot.record.wander_deg))
    assert math.dist(robot.goal, (9.6, 8.0)) < 0.01
    alone = [(VectorState.IDLE, -1, seen[0][2])] * 4
    assert (seen == alone) == stays, "else it avoids or wanders"
    assert robot.activity is Activity.TRANSPORT
    robot.policy._constants["far_site_share_at_border"] = 1.0
    robot.seen.obstacle(None)
    robot.act(12)
    if stays:
        assert robot.stage is VectorState.VECTOR, "a choice farther away"
        robot.seen.pose(*robot.goal)
        robot.act()
        assert robot.activity is Activity.WAIT_DROP


@pytest.mark.parametrize("mismatch", [False, True])
def test_quirk_finisher_tolerance_mismatch(mismatch):
    robot = TaskRobot(quirks=Quirks(finisher_tolerance_mismatch=mismatch))
    pick_up(robot, Task.FINISHER)
    robot.know_object(9, (80, 10))  # at (16.1, 2.1)
    robot.seen.pose(20.5, 8.1)
    robot.act()
    assert robot.stage is VectorState.VECTOR
    robot.seen.pose(16.1, 6.7)  # 4.6 m away
    robot.act()
    # Arrived at 4.8 m, but not within 0.8 m: the goal is reset.
    assert robot.stage is (VectorState.IDLE if mismatch else VectorState.VECTOR)
    robot.seen.pose(16.1, 2.7)
    robot.act(2)
    # Selected again within tolerance, which never counts as arriving.
    assert robot.activity is (Activity.TRANSPORT if mismatch else Activity.WAIT_DROP)


# How tasks end


@pytest.mark.parametrize("task", [*HARVESTS, *COLLECTS])
def test_a_drop_ends_the_task_and_the_next_one_starts_in_the_same_tick(robot, task):
    wait_for_drop(robot, task)
    lasted = robot.policy._allocation.exec_time[0, task]
    estimate = estimates_of(robot.policy, 0)[task]
    drop(robot)
    assert estimates_of(robot.policy, 0)[task] == pytest.approx((estimate + lasted) / 2)
    assert robot.activity is Activity.ACQUIRE
    has_begun = robot.record.explore_ticks == 1 or robot.stage is VectorState.VECTOR
    assert has_begun


@pytest.mark.parametrize("task", [*HARVESTS, *COLLECTS])
def test_giving_up_while_carrying_stands_and_releases_until_the_object_is_gone(robot, task):
    pick_up(robot, task)
    for _ in range(2):  # over a cache or in the nest it takes two ticks
        action = give_up(robot) if robot.activity is not Activity.LET_GO else robot.act()
        assert action.tolist() == [0.0, 0.0, np.float32(Grip.RELEASE)]
        assert robot.activity is Activity.LET_GO
    drop(robot)
    assert robot.activity is Activity.ACQUIRE


def test_the_abort_draw_is_compared_with_the_abort_probability(robot):
    robot.start(Task.GENERALIST)
    for rounding in (0.0, 1.0):
        chance = robot.policy._chance.row(robot.policy.n_ticks + 1)[0, 4]
        robot.policy._allocation.p_abort[:] = np.nextafter(chance, rounding)
        before = robot.policy._allocation.exec_start[0].max()
        robot.act()
        assert (robot.policy._allocation.exec_start[0].max() > before) == (rounding == 1.0)


# Exception lists


def test_dropped_objects_add_up_over_successive_tasks_that_drop(robot):
    wait_for_drop(robot, Task.STARTER)
    drop(robot, object_row=3)
    robot.policy._allocation.p_abort[:] = 0.0
    robot.record.activity = Activity.WAIT_DROP
    robot.policy._allocation.task[0] = Task.FINISHER
    drop(robot, object_row=4)
    assert [bool(robot.memory.shunned[row] == robot.record.shun_round) for row in (3, 4)] == [True, True]


# The policies
