"""Cache Transferers: from one cache to another that is nearer to the nest, and what they leave alone meanwhile."""

import math

import pytest

from baselines.robots import VectorState
from swarm_forage_env.contract.codes import Event, Task
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, Quirks
from tests.support.task_robot import TaskRobot
from tests.support.task_work import CACHE_SEEN, NEARER, drop, give_up, pick_up, wait_for_drop, wait_for_pickup


@pytest.fixture
def robot() -> TaskRobot:
    return TaskRobot()


def left_alone(robot: TaskRobot) -> tuple[list[int], list[int]]:
    """Serials of the caches that it does not take from and does not add to."""
    take, add = ([serial for serial in serials.tolist() if serial] for serials in robot.memory.shunned_caches)
    return take, add


def next_is(robot: TaskRobot, task: Task) -> None:
    """Let the next task after a transfer be another one, or the block's root."""
    robot.policy._constants["partition_gamma"] = 1e9 if task is Task.TRANSFERER else 0.0
    robot.policy._constants["tab_gamma"] = 0.0


def test_a_transferer_adds_to_another_cache_than_it_took_from(robot):
    pick_up(robot, Task.TRANSFERER)
    assert left_alone(robot) == ([], [7])
    robot.seen.pose(20.5, 8.1)
    robot.act()
    assert robot.stage is VectorState.IDLE, "the only cache known is the one it came from"


@pytest.mark.parametrize("quirks", [Quirks(), AUTHORS_PROGRAM], ids=["described", "program"])
def test_a_cache_that_is_forgotten_and_seen_again_is_still_left_alone(quirks):
    robot = TaskRobot(quirks=quirks)
    pick_up(robot, Task.TRANSFERER)
    robot.know_cache(8, NEARER, 5)
    robot.record.n_caches = 0
    robot.seen.pose(20.5, 8.1)
    robot.seen.caches(CACHE_SEEN)
    robot.act(3)
    assert list(robot.policy.remembered_caches(0)) == [7]
    assert robot.stage is VectorState.IDLE or robot.record.is_searching, "with one cache it can only give up"
    robot.seen.caches((8, *CACHE_SEEN[1:]))  # another one in the same place
    robot.act(2)
    goes = quirks.transferer_goes_anywhere  # it is as far from the nest as the one before
    assert (robot.record.target == 8) == goes


def test_a_transferer_does_not_take_back_what_it_has_just_added():
    robot = TaskRobot()
    wait_for_drop(robot, Task.TRANSFERER)
    next_is(robot, Task.TRANSFERER)
    drop(robot, Event.JOINED_CACHE, object_row=3, cache=(8, NEARER, 6))
    robot.finish_soon()
    robot.record.n_caches = 0
    robot.seen.pose(20.5, 8.1)
    robot.seen.caches((8, NEARER, 6))
    robot.act(2)
    assert robot.stage is VectorState.IDLE or robot.record.is_searching
    robot.seen.caches((9, NEARER, 6))
    robot.act(2)
    assert robot.record.target == 9


@pytest.mark.parametrize(
    ("cell", "quirks", "goes"),
    [
        (NEARER, Quirks(), True),
        ((120, 40), Quirks(), False),
        ((-1, 0), Quirks(), False),
        ((120, 40), Quirks(transferer_goes_anywhere=True), True),
    ],
)
def test_a_transferer_goes_towards_the_nest(cell, quirks, goes):
    robot = TaskRobot(quirks=quirks)
    pick_up(robot, Task.TRANSFERER)
    robot.seen.pose(20.5, 8.1)
    if cell != (-1, 0):  # else only its own is known
        robot.know_cache(8, cell, 5)
    robot.act()
    assert (robot.stage is VectorState.VECTOR) == goes
    if goes:
        assert robot.record.target == 8


def test_a_transferer_knows_where_it_took_from_even_if_the_cache_is_gone(robot):
    wait_for_pickup(robot, Task.TRANSFERER)
    robot.seen.caches()  # used up in the same tick, and forgotten at once
    robot.seen.carry(3)
    robot.seen.event(Event.PICKED_FROM_CACHE, object_row=3, cache=CACHE_SEEN)
    robot.act()
    assert robot.record.n_caches == 0
    assert robot.record.cargo_from_nest_m == pytest.approx(math.dist((14.5, 8.1), (3.2, 8.0)))


def test_only_transferers_mind_the_way_to_the_nest(robot):
    pick_up(robot, Task.TRANSFERER)
    assert robot.record.cargo_from_nest_m == pytest.approx(math.dist((14.5, 8.1), (3.2, 8.0)))
    robot.seen.carry(None)
    robot.act()
    pick_up(robot, Task.HARVESTER)
    assert robot.record.cargo_from_nest_m == math.inf


@pytest.mark.parametrize("by_identity", [False, True])
def test_quirk_cache_goal_by_identity(by_identity):
    robot = TaskRobot(quirks=Quirks(cache_goal_by_identity=by_identity))
    robot.start(Task.COLLECTOR)
    robot.finish_soon()
    robot.seen.pose(22.0, 8.1)
    robot.seen.caches(CACHE_SEEN)
    robot.act(3)
    goal = robot.goal
    assert robot.record.target == CACHE_SEEN[0]
    robot.seen.caches((CACHE_SEEN[0] + 1, *CACHE_SEEN[1:]))  # used up and created again in the same place
    robot.act()
    assert robot.stage is (VectorState.IDLE if by_identity else VectorState.VECTOR)
    robot.act()
    assert robot.stage is VectorState.VECTOR
    assert (robot.goal == goal) != by_identity, "chosen anew, so another point in it"


@pytest.mark.parametrize("next_task", [Task.TRANSFERER, Task.COLLECTOR])
def test_caches_of_a_transfer_are_left_alone_by_the_next_transfer_only(robot, next_task):
    wait_for_drop(robot, Task.TRANSFERER)
    next_is(robot, next_task)
    drop(robot, Event.JOINED_CACHE, object_row=3, cache=(8, NEARER, 6))
    assert robot.task is next_task
    assert left_alone(robot) == (([8], [7]) if next_task is Task.TRANSFERER else ([], []))


def test_a_transfer_that_moved_nothing_ends_the_shielding_of_caches(robot):
    wait_for_drop(robot, Task.TRANSFERER)
    next_is(robot, Task.TRANSFERER)
    drop(robot, Event.JOINED_CACHE, object_row=3, cache=(8, NEARER, 6))
    assert left_alone(robot) == ([8], [7])
    give_up(robot)
    assert robot.task is Task.TRANSFERER
    assert left_alone(robot) == ([], [])
