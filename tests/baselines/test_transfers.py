"""Cache Transferers: from one cache to another that is nearer to the nest, and what they leave alone meanwhile."""

import pytest

from baselines.robots import VectorState
from swarm_forage_env.contract.codes import Event, Task
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.task_robot import TaskRobot
from tests.support.task_work import CACHE_SEEN, NEARER, drop, wait_for_drop


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
