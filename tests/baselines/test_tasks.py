"""Tasks state by state: which cache or object robots go to, how they work, how tasks end, and the authors' quirks."""

import math

import numpy as np
import pytest

from baselines.cache_choice import cache_utility, object_is_near, select_cache
from baselines.cache_memory import NOT_TO_ADD, NOT_TO_TAKE, OBJECTS
from baselines.robots import Activity, VectorState
from baselines.tasks import DRAW_POINT_X, DRAW_POINT_Y, TASK_DRAWS
from swarm_forage_env.contract.codes import Event, Grip, Task
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.task_robot import TaskRobot, caches_of, estimates_of

CACHE = (72, 40)
"""Centre cell of the cache at (14.5, 8.1) m; its square is 11.4 .. 17.6 m by 5.0 .. 11.2 m."""
CACHE_SEEN = (7, CACHE, 12)
NEARER = (36, 40)
"""Centre cell of a cache at (7.3, 8.1) m, nearer to the nest than the other."""
COLLECTS = [Task.COLLECTOR, Task.TRANSFERER, Task.CACHE_COLLECTOR]
TO_NEST = [Task.GENERALIST, Task.COLLECTOR, Task.CACHE_COLLECTOR]
MIDDLE = np.full(TASK_DRAWS, 0.5)


@pytest.fixture
def robot() -> TaskRobot:
    return TaskRobot()


def wait_for_pickup(robot: TaskRobot, task: Task) -> None:
    """Start a task and bring the robot to where it asks for an object."""
    robot.start(task)
    robot.finish_soon()
    if task in COLLECTS:
        robot.seen.caches(CACHE_SEEN)
        robot.act()
        assert robot.stage is VectorState.VECTOR
        robot.seen.pose(*robot.goal)
        robot.seen.ground("cache")
    else:
        robot.seen.window({(2, 0): 3})
        robot.act()
        robot.seen.pose(*robot.goal)
        robot.seen.window({(0, 0): 3})
        robot.seen.ground("object")
    action = robot.act()
    assert robot.activity is Activity.WAIT_PICKUP
    assert action.tolist() == [0.0, 0.0, Grip.GRASP]


def pick_up(robot: TaskRobot, task: Task) -> np.ndarray:
    """Start a task and give the robot object 3 where it asks for it; returns the action after that."""
    wait_for_pickup(robot, task)
    robot.seen.window({})
    robot.seen.carry(3)
    event = Event.PICKED_FROM_CACHE if task in COLLECTS else Event.PICKED_UP
    robot.seen.event(event, object_row=3, cache=CACHE_SEEN if task in COLLECTS else None)
    action = robot.act()
    robot.seen.event(Event.NONE)
    robot.seen.ground("floor")
    return action


def wait_for_drop(robot: TaskRobot, task: Task) -> np.ndarray:
    """Bring the robot to where it asks to drop; returns the action."""
    pick_up(robot, task)
    if task in TO_NEST:
        robot.seen.ground("nest")
        robot.act()
        robot.seen.caches()
        robot.seen.pose(3.2, 8.0)
    elif task is Task.STARTER:
        robot.seen.pose(*robot.goal)
    elif task is Task.FINISHER:
        robot.know_object(9, (80, 10))
        robot.act()
        robot.seen.pose(16.1, 2.7)  # the object at (16.1, 2.1) is out of the window, but near
    else:
        cell = NEARER if task is Task.TRANSFERER else CACHE
        robot.seen.pose(20.5, 8.1)
        robot.seen.caches((8, cell, 5))
        robot.act()
        robot.seen.pose(*robot.goal)
        robot.seen.ground("cache")
    action = robot.act()
    assert robot.activity is Activity.WAIT_DROP
    assert action[:2].tolist() == [0.0, 0.0]
    return action


def drop(robot: TaskRobot, event: Event = Event.DROPPED, **about) -> None:
    """Let the drop happen, with another task to follow."""
    robot.seen.carry(None)
    robot.seen.ground("floor")
    robot.seen.event(event, **about)
    robot.act()
    robot.seen.event(Event.NONE)


def give_up(robot: TaskRobot) -> np.ndarray:
    robot.policy._allocation.p_abort[:] = 2.0
    action = robot.act()
    robot.finish_soon()
    return action


# Which cache, which object


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


def test_creation_needs_an_object_within_eighty_centimetres():
    robot = TaskRobot()
    robot.know_object(3, (50, 50))  # centre (10.1, 10.1)
    for x, is_near in [(10.89, True), (10.91, False)]:
        robot.seen.believed_position(x, 10.1)
        near = object_is_near(robot.record, robot.senses, robot.constants, robot.memory.objects)
        assert near == is_near


# The authors' quirks


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


@pytest.mark.parametrize("task", [Task.GENERALIST, Task.FINISHER, Task.TRANSFERER])
def test_a_drop_ends_the_task_and_the_next_one_starts_in_the_same_tick(robot, task):
    wait_for_drop(robot, task)
    lasted = robot.policy._allocation.exec_time[0, task]
    estimate = estimates_of(robot.policy, 0)[task]
    drop(robot)
    assert estimates_of(robot.policy, 0)[task] == pytest.approx((estimate + lasted) / 2)
    assert robot.activity is Activity.ACQUIRE
    has_begun = robot.record.explore_ticks == 1 or robot.stage is VectorState.VECTOR
    assert has_begun


@pytest.mark.parametrize("task", [Task.HARVESTER, Task.CACHE_COLLECTOR])
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


def test_dropped_objects_add_up_over_successive_tasks_that_drop(robot):
    wait_for_drop(robot, Task.STARTER)
    drop(robot, object_row=3)
    robot.policy._allocation.p_abort[:] = 0.0
    robot.record.activity = Activity.WAIT_DROP
    robot.policy._allocation.task[0] = Task.FINISHER
    drop(robot, object_row=4)
    assert robot.left_alone[OBJECTS] == [3 + 1, 4 + 1]


@pytest.mark.parametrize("next_task", [Task.TRANSFERER, Task.COLLECTOR])
def test_caches_of_a_transfer_are_left_alone_by_the_next_transfer_only(robot, next_task):
    wait_for_drop(robot, Task.TRANSFERER)
    robot.policy._constants["partition_gamma"] = 1e9 if next_task is Task.TRANSFERER else 0.0
    robot.policy._constants["tab_gamma"] = 0.0
    drop(robot, Event.JOINED_CACHE, object_row=3, cache=(8, NEARER, 6))
    assert robot.task is next_task
    take, add = robot.left_alone[NOT_TO_TAKE], robot.left_alone[NOT_TO_ADD]
    assert (take, add) == (([8], [7]) if next_task is Task.TRANSFERER else ([], []))
