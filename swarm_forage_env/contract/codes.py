"""Numeric codes: gripper commands, events, tasks, floor codes, object states, counters.

Policies use the first three; the rest is for the world.
"""

from enum import IntEnum
from typing import ClassVar


class Grip:
    """Gripper commands. Send the constant; the environment accepts a band of values around it (`GRIP_LOWER_ENDS`)."""

    GRASP: ClassVar[float] = 1.0
    """Empty: pick up what lies under the centre. Carrying: hold."""
    RELEASE: ClassVar[float] = -0.125
    """Carrying: let go at this place, never refused. Empty: nothing."""
    DELIVER: ClassVar[float] = -0.375
    """Carrying: drop only into the nest or a cache."""
    SITE: ClassVar[float] = -0.625
    """Carrying: lay on the floor, unless a cache is near."""
    CREATE_CACHE: ClassVar[float] = -1.0
    """Carrying: as SITE, then a cache is formed if possible."""


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


CELL_EMPTY = -1
"""Floor code of a cell that holds nothing. Codes >= 0 are the row of the free object lying there."""
CELL_NEST = -2
CELL_OBSTACLE = -3
"""Floor code of a cell that an obstacle keeps free of objects."""
CELL_CACHE = -4
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
