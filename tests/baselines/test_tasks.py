"""Tasks state by state: which cache or object robots go to, how they work, how tasks end, and the authors' quirks."""

import math

import pytest

from baselines.cache_choice import cache_utility, object_is_near
from baselines.cache_memory import NOT_TO_ADD, NOT_TO_TAKE, OBJECTS
from baselines.robots import Activity, VectorState
from swarm_forage_env.contract.codes import Event, Grip, Task
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.task_robot import TaskRobot, caches_of

CACHE = (72, 40)
"""Centre cell of the cache at (14.5, 8.1) m; its square is 11.4 .. 17.6 m by 5.0 .. 11.2 m."""
CACHE_SEEN = (7, CACHE, 12)
NEARER = (36, 40)
"""Centre cell of a cache at (7.3, 8.1) m, nearer to the nest than the other."""


@pytest.fixture
def robot() -> TaskRobot:
    return TaskRobot()


def pick_up(robot: TaskRobot, task: Task) -> None:
    """Start a task and give the robot object 3 where it asks for it."""
    robot.start(task)
    robot.finish_soon()
    in_cache = task is Task.TRANSFERER
    if in_cache:
        robot.seen.caches(CACHE_SEEN)
    else:
        robot.seen.window({(2, 0): 3})
    robot.act()
    robot.seen.pose(*robot.goal)
    robot.seen.window({} if in_cache else {(0, 0): 3})
    robot.seen.ground("cache" if in_cache else "object")
    assert robot.act().tolist() == [0.0, 0.0, Grip.GRASP]
    robot.seen.window({})
    robot.seen.carry(3)
    event = Event.PICKED_FROM_CACHE if in_cache else Event.PICKED_UP
    robot.seen.event(event, object_row=3, cache=CACHE_SEEN if in_cache else None)
    robot.act()
    robot.seen.event(Event.NONE)
    robot.seen.ground("floor")


def wait_for_drop(robot: TaskRobot, task: Task) -> None:
    """Bring a Cache Starter, Finisher or Transferer to where it asks to drop."""
    pick_up(robot, task)
    if task is Task.FINISHER:
        robot.know_object(9, (80, 10))
        robot.act()
        robot.seen.pose(16.1, 2.7)  # the object at (16.1, 2.1) is out of the window, but near
    elif task is Task.TRANSFERER:
        robot.seen.pose(20.5, 8.1)
        robot.seen.caches((8, NEARER, 5))
        robot.act()
        robot.seen.ground("cache")
    if task is not Task.FINISHER:
        robot.seen.pose(*robot.goal)
    assert robot.act()[:2].tolist() == [0.0, 0.0]
    assert robot.activity is Activity.WAIT_DROP


def drop(robot: TaskRobot, event: Event = Event.DROPPED, **about) -> None:
    """Let the drop happen, with another task to follow."""
    robot.seen.carry(None)
    robot.seen.ground("floor")
    robot.seen.event(event, **about)
    robot.act()
    robot.seen.event(Event.NONE)


# Which cache, which object


def test_utility_of_a_cache():
    robot = TaskRobot()
    expected = math.e * 4 / (9.5005 * 11.3004)
    assert expected == pytest.approx(0.1013, abs=5e-5)
    assert cache_utility(14.5, 8.1, 4, 24.0, 8.0, 1.0, robot.constants) == pytest.approx(expected, rel=1e-4)
    # An isolated object 3 m from the robot and 4 m from the nest centre at (3.2, 8), and one under the robot.
    assert cache_utility(7.2, 8.0, 1, 7.2, 11.0, 0.5, robot.constants) == pytest.approx(math.exp(0.5) / 12)
    assert cache_utility(7.2, 8.0, 1, 7.2, 8.0, 0.5, robot.constants) > 1e5


def test_robots_go_to_an_object_however_poor(robot):
    robot.start(Task.GENERALIST)
    robot.finish_soon()
    robot.know_object(3, (17, 41))  # in the nest, 25 m away: utility 0.03
    robot.seen.pose(28.0, 8.0)
    robot.act()
    assert robot.goal == pytest.approx((3.5, 8.3))


def test_creation_needs_an_object_within_eighty_centimetres():
    robot = TaskRobot()
    robot.know_object(3, (50, 50))  # centre (10.1, 10.1)
    for x, is_near in [(10.89, True), (10.91, False)]:
        robot.seen.believed_position(x, 10.1)
        near = object_is_near(robot.record, robot.senses, robot.constants, robot.memory.objects)
        assert near == is_near


def test_a_transfer_goes_to_a_cache_nearer_to_the_nest(robot):
    pick_up(robot, Task.TRANSFERER)
    robot.know_cache(8, (25, 75), 5)  # at (5.1, 15.1) m, 7.4 m from the nest's centre; the other is 11.3 m from it
    robot.seen.pose(20.5, 8.1)
    robot.act()
    assert max(abs(robot.goal[0] - 5.1), abs(robot.goal[1] - 15.1)) < 3.1


def test_a_cache_that_is_there_again_serves_as_well(robot):
    robot.start(Task.TRANSFERER)
    robot.finish_soon()
    robot.seen.caches(CACHE_SEEN)
    robot.act()
    goal = robot.goal
    robot.seen.caches((9, CACHE, 12))
    robot.act(2)
    assert robot.goal == goal


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
