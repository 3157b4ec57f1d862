"""Numeric codes: gripper commands, events, tasks and their graph, floor codes, object states, counters.

Policies use the first three; the rest is for the world. The paper's tasks:

    Generalist            free object    -> nest
      Harvester           free object    -> existing cache
        Cache Starter     free object    -> a site half way to the nest
        Cache Finisher    free object    -> an isolated object, where it creates a cache
      Collector           existing cache -> nest
        Cache Transferer  existing cache -> another existing cache
        Cache Collector   existing cache -> nest

A task with two subtasks is the root of a task allocation block (TAB): doing both once does the root's work once.
"""

from enum import IntEnum
from typing import NamedTuple

import numpy as np


class GripperCommands(NamedTuple):
    """Gripper commands, `Grip.GRASP`. The environment takes a band of values around each (`GRIP_LOWER_ENDS`)."""

    GRASP: float = 1.0
    """Empty: pick up what lies under the centre. Carrying: hold."""
    RELEASE: float = -0.125
    """Carrying: let go at this place, never refused. Empty: nothing."""
    DELIVER: float = -0.375
    """Carrying: drop only into the nest or a cache."""
    SITE: float = -0.625
    """Carrying: lay on the floor, unless a cache is near."""
    CREATE_CACHE: float = -1.0
    """Carrying: as SITE, then a cache is formed if possible."""


Grip = GripperCommands()
"""Gripper commands; a tuple of numbers, because compiled code can name those of one."""
GRIP_LOWER_ENDS = (0.0, -0.25, -0.5, -0.75)
"""Commands above these are GRASP, RELEASE, DELIVER and SITE; those that are not above the last are CREATE_CACHE."""


class Event(IntEnum):
    """What happened to a robot in the last step; at most one each."""

    NONE = 0
    PICKED_UP = 1
    PICKED_FROM_CACHE = 2
    DELIVERED = 3
    DROPPED = 4
    DROPPED_ELSEWHERE = 5
    JOINED_CACHE = 6
    NOTHING_HERE = 7
    VANISHED = 8
    CACHE_TOO_NEAR = 9


class Task(IntEnum):
    """Task codes that a policy may expose in `task`, an (N,) int8 array."""

    NONE = 0
    GENERALIST = 1
    HARVESTER = 2
    COLLECTOR = 3
    STARTER = 4
    FINISHER = 5
    TRANSFERER = 6
    CACHE_COLLECTOR = 7


class Goal(IntEnum):
    """What a robot takes an object from, or brings it to."""

    NONE = 0
    OBJECT = 1
    """A free object, by ground sensor or memory."""
    CACHE = 2
    """An existing cache."""
    NEST = 3
    SITE = 4
    """A place for a new cache."""
    ISOLATED_OBJECT = 5
    """A free object far from all others and from caches: the start of a new cache."""


class Tab(IntEnum):
    """Task allocation blocks, by root."""

    GENERALIST = 0
    HARVESTER = 1
    COLLECTOR = 2


_ENDS = {
    Task.NONE: (Goal.NONE, Goal.NONE),
    Task.GENERALIST: (Goal.OBJECT, Goal.NEST),
    Task.HARVESTER: (Goal.OBJECT, Goal.CACHE),
    Task.COLLECTOR: (Goal.CACHE, Goal.NEST),
    Task.STARTER: (Goal.OBJECT, Goal.SITE),
    Task.FINISHER: (Goal.OBJECT, Goal.ISOLATED_OBJECT),
    Task.TRANSFERER: (Goal.CACHE, Goal.CACHE),
    Task.CACHE_COLLECTOR: (Goal.CACHE, Goal.NEST),
}
SOURCE = np.array([_ENDS[task][0] for task in Task], np.int8)
"""(8,) `Goal` code of where a task takes its object from."""
DESTINATION = np.array([_ENDS[task][1] for task in Task], np.int8)
"""(8,) `Goal` code of where a task brings it."""
TAB_ROOT = np.array([Task.GENERALIST, Task.HARVESTER, Task.COLLECTOR], np.int8)
"""(3,) task code of each block's root."""
TAB_CHILDREN = np.array(
    [(Task.HARVESTER, Task.COLLECTOR), (Task.STARTER, Task.FINISHER), (Task.TRANSFERER, Task.CACHE_COLLECTOR)], np.int8
)
"""(3, 2) task codes of each block's subtasks."""

CELL_EMPTY = 0
"""Floor code of a cell that holds nothing. It is 0 because memory of zeros costs nothing until it is written: a huge
floor takes only what lies on it."""
CELL_OBJECT = 1
"""Floor code of a cell where object 0 lies; row k lies as CELL_OBJECT + k."""
CELL_NEST = -1
CELL_OBSTACLE = -2
"""Floor code of a cell that an obstacle keeps free of objects."""
CELL_CACHE = -3
"""Floor code of cache slot 0; slot k paints its cells with CELL_CACHE - k."""


class ObjectStatus(IntEnum):
    """Where an object is; at any time exactly one of these."""

    FREE = 0
    CARRIED = 1
    CACHED = 2
    WAITING = 3
    """There was no free cell; it is placed again as soon as there is one and objects are placed."""


class Counter(IntEnum):
    """Cumulative counts since reset, indices into `StepEvents.counters`; intervals are differences."""

    COLLECTED = 0
    """Objects delivered to the nest."""
    FREE_PICKUPS = 1
    """Objects picked up from the floor."""
    FIRST_PICKED = 2
    """Pick-ups of an object that no robot had carried since it was placed."""
    CACHE_PICKUPS = 3
    CACHE_DROPS = 4
    FLOOR_DROPS = 5
    """Objects laid on the floor by robots."""
    DISPLACED_DROPS = 6
    """Drops without a free cell: the object was re-placed elsewhere."""
    OBJECTS_MOVED = 7
    """Random-walk steps taken by objects."""
    CACHES_CREATED = 8
    CACHES_DEPLETED = 9
    INTERFERING = 10
    """Robot-ticks in interference."""
    ACTIVE = 11
    """Robot-ticks of active robots."""
    PRESENT = 12
    """Robot-ticks of robots that are born and alive."""
    CACHES_ALIVE = 13
    """Cache-ticks."""
    OBJECTS_CACHED = 14
    """Object-ticks inside caches."""
    CARRYING = 15
    """Robot-ticks of active robots that carry an object, counted before the grippers of the tick move."""
    AVOIDANCES = 16
    """Robots that came into interference and were not in it, or not active, a tick before."""
    SEARCHING = 17
    """Robot-ticks of active robots out of interference that carry nothing and ask for nothing; counted as CARRYING."""
    HOMING = 18
    """The same of robots that carry an object."""
    HANDLING = 19
    """The same of robots in a pick-up from the floor, or in a drop that no cache takes."""
    AT_CACHES = 20
    """The same of robots in a pick-up from a cache, or in a drop into one."""
    INTERFERING_NEAR_CACHES = 21
    """Robot-ticks in interference within `scenarios.floor.NEAR_CACHE_M` of the centre of a cache."""
