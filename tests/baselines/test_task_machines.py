"""The machine of every task, state by state, and how tasks end: finished, refused or given up."""

import math

import numpy as np
import pytest

from baselines.robots import Activity, VectorState
from baselines.stochm import STOCHMPolicy
from baselines.stochx import STOCHXPolicy
from swarm_forage_env.contract.codes import Event, Grip, Task
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.task_robot import TaskRobot
from tests.support.task_work import (
    CACHE,
    CACHE_SEEN,
    COLLECTS,
    HARVESTS,
    TO_NEST,
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


@pytest.mark.parametrize("task", [*HARVESTS, *COLLECTS])
def test_a_task_starts_by_acquiring_in_the_same_tick(robot, task):
    assert robot.start(task)[2] == np.float32(Grip.RELEASE)
    assert robot.activity is Activity.ACQUIRE
    assert robot.record.explore_ticks == 1


@pytest.mark.parametrize("task", HARVESTS)
def test_free_objects_are_found_by_ground_sensor_after_ten_seconds(robot, task):
    robot.start(task)
    robot.finish_soon()
    robot.seen.ground("object")
    robot.act(49)
    assert robot.activity is Activity.ACQUIRE
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP


@pytest.mark.parametrize("task", COLLECTS)
def test_caches_are_not_found_by_ground_sensor(robot, task):
    robot.start(task)
    robot.policy._allocation.estimate[:] = 1e9  # never gives up
    robot.seen.ground("cache")
    robot.act(120)
    assert robot.activity is Activity.ACQUIRE


@pytest.mark.parametrize("task", [*HARVESTS, *COLLECTS])
def test_every_task_goes_to_its_source_and_asks_there(robot, task):
    wait_for_pickup(robot, task)


@pytest.mark.parametrize("event", [Event.NOTHING_HERE, Event.VANISHED])
@pytest.mark.parametrize("task", [Task.HARVESTER, Task.COLLECTOR])
def test_a_refused_pickup_is_an_acquisition_again(robot, task, event):
    wait_for_pickup(robot, task)
    robot.seen.window({})
    robot.seen.event(event)
    robot.act()
    assert robot.activity is Activity.ACQUIRE
    assert robot.task is task


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


def test_a_collector_gives_way_when_others_have_emptied_the_cache_too_far(robot):
    wait_for_pickup(robot, Task.COLLECTOR)
    robot.seen.caches((7, CACHE, 3))
    assert robot.act()[2] == Grip.GRASP
    robot.seen.caches((7, CACHE, 2))
    assert robot.act()[2] == np.float32(Grip.RELEASE)
    assert robot.activity is Activity.ACQUIRE


def test_a_target_cache_that_is_gone_is_given_up(robot):
    robot.start(Task.COLLECTOR)
    robot.finish_soon()
    robot.seen.caches(CACHE_SEEN)
    robot.act()
    robot.seen.caches()
    robot.seen.pose(11.5, 8.1)
    robot.act()
    assert robot.policy.n_caches.tolist() == [0]
    assert robot.record.is_searching, "the search for another one begins where it was"
    assert robot.goal == pytest.approx((14.5, 8.1))


def test_a_search_goes_to_the_last_known_cache_and_then_at_random(robot):
    robot.seen.caches(CACHE_SEEN)
    robot.act()
    robot.seen.caches()
    robot.seen.pose(11.5, 8.1)
    robot.start(Task.COLLECTOR)
    robot.finish_soon()
    assert robot.record.is_searching
    assert robot.stage is VectorState.VECTOR
    robot.seen.pose(14.5, 8.1)
    robot.act()
    assert not robot.record.is_searching
    assert robot.stage is VectorState.IDLE
    robot.act(3)
    assert robot.activity is Activity.ACQUIRE
    assert robot.stage is VectorState.IDLE, "a random walk from now on"


def test_a_cache_in_sight_ends_the_search(robot):
    robot.seen.caches(CACHE_SEEN)
    robot.act()
    robot.seen.caches()
    robot.seen.pose(11.5, 8.1)
    robot.start(Task.COLLECTOR)
    robot.finish_soon()
    robot.seen.caches((8, (100, 40), 5))
    robot.act()
    assert not robot.record.is_searching
    assert robot.goal != pytest.approx((14.5, 8.1))
    assert robot.stage is VectorState.VECTOR


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


@pytest.mark.parametrize("task", [*HARVESTS, *COLLECTS])
def test_a_robot_that_has_picked_up_sets_out_for_its_destination_holding(robot, task):
    assert pick_up(robot, task)[2] == Grip.GRASP
    assert robot.activity is (Activity.HOMING if task in TO_NEST else Activity.TRANSPORT)
    assert 3 not in robot.memory.objects.row[: robot.record.n_known]


@pytest.mark.parametrize("task", [*HARVESTS, *COLLECTS])
def test_every_task_asks_to_drop_with_its_own_word(robot, task):
    expected = {Task.STARTER: Grip.SITE, Task.FINISHER: Grip.CREATE_CACHE}.get(task, Grip.DELIVER)
    assert wait_for_drop(robot, task)[2] == np.float32(expected)


@pytest.mark.parametrize("task", [*HARVESTS, *COLLECTS])
@pytest.mark.parametrize("event", [Event.NOTHING_HERE, Event.VANISHED])
def test_a_refused_drop_is_a_transport_again(robot, task, event):
    wait_for_drop(robot, task)
    robot.seen.ground("floor")
    robot.seen.pose(20.5, 15.0)
    robot.seen.caches()
    robot.seen.event(event)
    assert robot.act()[2] == Grip.GRASP
    assert robot.activity is (Activity.HOMING if task in TO_NEST else Activity.TRANSPORT)
    assert robot.task is task


@pytest.mark.parametrize("task", [Task.STARTER, Task.FINISHER])
def test_a_cache_too_near_is_remembered_and_another_place_chosen(robot, task):
    wait_for_drop(robot, task)
    before = robot.goal
    near = (11, (int(before[0] / 0.2), int(before[1] / 0.2)), 4)
    robot.seen.event(Event.CACHE_TOO_NEAR, cache=near)
    robot.act()
    assert robot.activity is Activity.TRANSPORT
    assert list(robot.policy.remembered_caches(0)) == [11]
    if task is Task.STARTER:
        assert np.hypot(robot.goal[0] - before[0], robot.goal[1] - before[1]) > 6.0
    else:
        assert robot.stage is VectorState.IDLE, "no isolated object left"


def test_a_starter_walks_with_its_object_while_no_site_is_allowed(robot):
    wait_for_pickup(robot, Task.STARTER)
    for serial, cell in enumerate([(30, 40), (72, 40), (114, 40), (95, 40), (140, 40)], start=1):
        robot.know_cache(serial, cell, 5)
    robot.seen.caches((6, (50, 40), 5))
    robot.seen.carry(3)
    left, right, grip = robot.act(5)
    assert left + right > 0.8, "at walking speed"
    assert grip == Grip.GRASP
    assert robot.activity is Activity.TRANSPORT
    assert robot.record.explore_ticks == 5
    robot.record.n_caches = 0
    robot.act()
    assert robot.stage is VectorState.VECTOR


def test_a_starter_goes_away_from_a_cache_that_has_refused(robot):
    wait_for_drop(robot, Task.STARTER)
    robot.seen.pose(15.0, 8.1)
    robot.seen.event(Event.CACHE_TOO_NEAR, cache=(11, (118, 40), 4))  # centre 8.7 m away, the world wants 12.8 m
    robot.act()
    assert robot.memory.caches[0].has_refused
    assert math.dist(robot.goal, (23.7, 8.1)) > 12.8 + 0.8
    robot.seen.event(Event.NONE)
    for task in (Task.HARVESTER, Task.STARTER):
        robot.start(task)
    assert not robot.memory.caches[0].has_refused, "until the task ends"


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
    assert list(robot.policy.remembered_caches(0)) == [11]
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


def test_a_finisher_leaves_an_object_near_a_cache_that_has_refused(robot):
    wait_for_drop(robot, Task.FINISHER)
    x, y = robot.goal
    robot.seen.event(Event.CACHE_TOO_NEAR, cache=(11, (int((x + 8.0) / 0.2), int(y / 0.2)), 4))
    robot.act()
    assert robot.activity is Activity.TRANSPORT
    assert robot.stage is VectorState.IDLE, "no isolated object left"
    assert robot.record.explore_ticks == 1


def test_a_finisher_without_a_candidate_walks_with_its_object(robot):
    pick_up(robot, Task.FINISHER)
    robot.act(5)
    assert robot.activity is Activity.TRANSPORT
    assert robot.stage is VectorState.IDLE
    assert robot.record.explore_ticks == 6


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


def test_starting_within_tolerance_is_arrival():
    robot = TaskRobot()
    pick_up(robot, Task.FINISHER)
    robot.know_object(9, (80, 10))
    robot.seen.pose(16.1, 2.7)
    robot.act()
    assert robot.activity is Activity.WAIT_DROP


# How tasks end


@pytest.mark.parametrize("task", [*HARVESTS, *COLLECTS])
def test_a_drop_ends_the_task_and_the_next_one_starts_in_the_same_tick(robot, task):
    wait_for_drop(robot, task)
    lasted = robot.policy._allocation.exec_time[0, task]
    estimate = robot.policy.task_estimates[0, task]
    drop(robot)
    assert robot.policy.task_estimates[0, task] == pytest.approx((estimate + lasted) / 2)
    assert robot.activity is Activity.ACQUIRE
    has_begun = robot.record.explore_ticks == 1 or robot.stage is VectorState.VECTOR
    assert has_begun


def test_giving_up_empty_starts_the_next_task_at_once(robot):
    wait_for_pickup(robot, Task.HARVESTER)
    robot.seen.window({})
    robot.seen.ground("floor")
    assert give_up(robot)[2] == np.float32(Grip.RELEASE)
    assert robot.activity is Activity.ACQUIRE


@pytest.mark.parametrize("task", [*HARVESTS, *COLLECTS])
def test_giving_up_while_carrying_stands_and_releases_until_the_object_is_gone(robot, task):
    pick_up(robot, task)
    for _ in range(2):  # over a cache or in the nest it takes two ticks
        action = give_up(robot) if robot.activity is not Activity.LET_GO else robot.act()
        assert action.tolist() == [0.0, 0.0, np.float32(Grip.RELEASE)]
        assert robot.activity is Activity.LET_GO
    drop(robot)
    assert robot.activity is Activity.ACQUIRE


def test_giving_up_while_waiting_cancels_the_interaction(robot):
    wait_for_drop(robot, Task.STARTER)
    robot.seen.set("interacting", 1.0)
    assert give_up(robot).tolist() == [0.0, 0.0, np.float32(Grip.RELEASE)]


def test_the_abort_draw_is_compared_with_the_abort_probability(robot):
    robot.start(Task.GENERALIST)
    for rounding in (0.0, 1.0):
        chance = robot.policy._chance.row(robot.policy.n_ticks + 1)[0, 4]
        robot.policy._allocation.p_abort[:] = np.nextafter(chance, rounding)
        before = robot.policy._allocation.exec_start[0].max()
        robot.act()
        assert (robot.policy._allocation.exec_start[0].max() > before) == (rounding == 1.0)


# Exception lists


@pytest.mark.parametrize("task", [Task.STARTER, Task.FINISHER])
def test_a_dropped_object_is_left_alone_by_its_dropper_for_one_task(robot, task):
    wait_for_drop(robot, task)
    drop(robot, object_row=3)
    assert robot.memory.shunned[3] == robot.record.shun_round
    give_up(robot)
    assert robot.memory.shunned[3] != robot.record.shun_round


def test_dropped_objects_add_up_over_successive_tasks_that_drop(robot):
    wait_for_drop(robot, Task.STARTER)
    drop(robot, object_row=3)
    robot.policy._allocation.p_abort[:] = 0.0
    robot.record.activity = Activity.WAIT_DROP
    robot.policy._allocation.task[0] = Task.FINISHER
    drop(robot, object_row=4)
    assert [bool(robot.memory.shunned[row] == robot.record.shun_round) for row in (3, 4)] == [True, True]


def test_objects_that_are_let_go_are_not_left_alone(robot):
    pick_up(robot, Task.STARTER)
    give_up(robot)
    drop(robot, object_row=3)
    assert robot.memory.shunned[3] != robot.record.shun_round


# The policies


@pytest.mark.parametrize(("policy_class", "kind"), [(STOCHMPolicy, "static"), (STOCHXPolicy, "dynamic")])
def test_policies_name_the_world_they_are_made_for(policy_class, kind):
    assert policy_class.caches == kind


def test_nobody_has_a_task_before_the_first_tick_and_everybody_after():
    robot = TaskRobot(STOCHMPolicy())
    assert robot.policy.task.dtype == np.int8
    assert robot.policy.task_shares.tolist() == [1.0, 0, 0, 0, 0, 0, 0, 0]
    robot.act()
    assert robot.task in (Task.GENERALIST, Task.HARVESTER, Task.COLLECTOR)
    assert robot.policy.task_shares.sum() == 1.0
    assert robot.policy.task_shares[0] == 0.0


@pytest.mark.parametrize("activity", list(Activity))
def test_inactive_robots_keep_their_state_and_stand(robot, activity):
    robot.start(Task.HARVESTER)
    robot.record.activity = activity
    robots, allocation = robot.policy._robots.copy(), [part.copy() for part in robot.policy._allocation]
    robot.seen.carry(3)
    robot.seen.caches(CACHE_SEEN)
    assert robot.act(5, active=False).tolist() == [0.0, 0.0, Grip.GRASP], "what it carries is held"
    np.testing.assert_array_equal(robot.policy._robots, robots)
    for part, before in zip(robot.policy._allocation, allocation, strict=True):
        np.testing.assert_array_equal(part, before)
    assert robot.policy.n_caches.tolist() == [0]


def test_a_robot_whose_drop_was_completed_in_repair_has_finished(robot):
    wait_for_drop(robot, Task.STARTER)
    estimate = robot.policy.task_estimates[0, Task.STARTER]
    robot.seen.carry(None)
    robot.act(3, active=False)
    robot.act()
    assert robot.policy.task_estimates[0, Task.STARTER] != estimate
    assert robot.activity is Activity.ACQUIRE
