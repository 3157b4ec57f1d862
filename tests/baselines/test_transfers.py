"""Cache Transferers: from one cache to another that is nearer to the nest, and what they leave alone meanwhile."""

import math

import pytest

from baselines.robots import VectorState
from swarm_forage_env.contract.codes import Event, Task
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.task_robot import TaskRobot
from tests.support.task_work import CACHE_SEEN, NEARER, drop, give_up, pick_up, wait_for_drop, wait_for_pickup


@pytest.fixture
def robot() -> TaskRobot:
    return TaskRobot()


def test_a_transferer_adds_to_another_cache_than_it_took_from(robot):
    pick_up(robot, Task.TRANSFERER)
    assert robot.memory.caches[0].no_drop
    robot.seen.pose(20.5, 8.1)
    robot.act()
    assert robot.stage is VectorState.IDLE, "the only cache known is the one it came from"


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
    robot.policy._constants["partition_gamma"] = 1e9 if next_task is Task.TRANSFERER else 0.0
    robot.policy._constants["tab_gamma"] = 0.0
    drop(robot, Event.JOINED_CACHE, object_row=3, cache=(8, NEARER, 6))
    assert robot.task is next_task
    shunned = next_task is Task.TRANSFERER
    marks = {int(cache.serial): (bool(cache.no_pickup), bool(cache.no_drop)) for cache in robot.memory.caches[:2]}
    assert marks == {7: (False, shunned), 8: (shunned, False)}


def test_a_transfer_that_moved_nothing_ends_the_shielding_of_caches(robot):
    wait_for_drop(robot, Task.TRANSFERER)
    robot.policy._constants["partition_gamma"] = 1e9
    robot.policy._constants["tab_gamma"] = 0.0
    drop(robot, Event.JOINED_CACHE, object_row=3, cache=(8, NEARER, 6))
    assert any(cache.no_drop for cache in robot.memory.caches[:2])
    give_up(robot)
    assert robot.task is Task.TRANSFERER
    assert not any(cache.no_pickup or cache.no_drop for cache in robot.memory.caches[:2])
