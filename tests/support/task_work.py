"""How a robot that allocates tasks is brought through them: pick up, wait for the drop, drop, give up."""

import numpy as np

from baselines.robots import Activity, VectorState
from swarm_forage_env.contract.codes import Event, Grip, Task
from tests.support.task_robot import TaskRobot

CACHE = (72, 40)
"""Centre cell of the cache at (14.5, 8.1) m; its square is 11.4 .. 17.6 m by 5.0 .. 11.2 m."""
CACHE_SEEN = (7, CACHE, 12)
HARVESTS = [Task.GENERALIST, Task.HARVESTER, Task.STARTER, Task.FINISHER]
NEARER = (36, 40)
"""Centre cell of a cache at (7.3, 8.1) m, nearer to the nest than the other."""
COLLECTS = [Task.COLLECTOR, Task.TRANSFERER, Task.CACHE_COLLECTOR]
TO_NEST = [Task.GENERALIST, Task.COLLECTOR, Task.CACHE_COLLECTOR]


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
