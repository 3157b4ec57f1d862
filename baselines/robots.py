"""A robot of the scripted controllers: its inner state, its draws, and what it makes of its observation.

Conventions of all functions that handle one robot: `robot` is one record of `ROBOT_FIELDS`, edited in place; `row` its
observation; `c` the record of `parameters.kernel_constants`; `draws` its uniform draws of this tick, one column per
use, so that no decision shifts the randomness of another.
"""

import math
from collections.abc import Sequence
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env._internal.prefetching import AHEAD, LARGE, LINE, prefetch
from swarm_forage_env.contract.detection import is_obstacle_vector, ring_is_empty, ring_sum, sees_nest
from swarm_forage_env.contract.layout import EVENT_SCALE, GROUND_SENSORS, RING_SENSORS
from swarm_forage_env.contract.types import CodeArray, ObsArray, Row


class Activity(IntEnum):
    """What a robot is busy with."""

    ACQUIRE = 0
    """Looking for an object, or on the way to one."""
    WAIT_PICKUP = 1
    """Standing on an object, asking for it."""
    HOMING = 2
    """Carrying, outside the nest, towards the light."""
    HOMING_IN_NEST = 3
    """Carrying, inside the nest, looking for a place to drop."""
    WAIT_DROP = 4
    """Standing at the destination, asking to drop."""
    LEAVE_NEST = 5
    """Empty, wandering until the nest is left."""
    TRANSPORT = 6
    """Carrying, looking for a destination other than the nest, or on the way to it."""
    FINISHED = 7
    """Just dropped: the task is done."""
    LET_GO = 8
    """Giving up while carrying: standing, releasing the object here."""


EXPLORING = 9
"""Code behind those of `Activity`: ACQUIRE without a point to go to."""
EXPLORING_LOADED = 10
"""The same of TRANSPORT."""
ACTIVITY_WORDS = (
    "going to a goal",
    "picking up",
    "going home",
    "in the nest, looking for a place",
    "dropping",
    "leaving the nest",
    "carrying to a goal",
    "task done",
    "letting go",
    "exploring",
    "exploring with cargo",
)
"""What the codes of `Activity`, and the two behind them, mean to people."""


READS = ("proximity", "light if carrying", "ground", "wheel_speed", "position", "heading", "carrying", "event")
"""Observation slices that a robot looks at which goes to points."""


class VectorState(IntEnum):
    """Stages of going to a point."""

    IDLE = 0
    VECTOR = 1
    AVOIDANCE = 2
    RECOVERY = 3


ACQUIRE = int(Activity.ACQUIRE)
WAIT_PICKUP = int(Activity.WAIT_PICKUP)
HOMING = int(Activity.HOMING)
HOMING_IN_NEST = int(Activity.HOMING_IN_NEST)
WAIT_DROP = int(Activity.WAIT_DROP)
LEAVE_NEST = int(Activity.LEAVE_NEST)
TRANSPORT = int(Activity.TRANSPORT)
FINISHED = int(Activity.FINISHED)
LET_GO = int(Activity.LET_GO)
VECTOR_IDLE = int(VectorState.IDLE)
VECTOR = int(VectorState.VECTOR)
VECTOR_AVOIDANCE = int(VectorState.AVOIDANCE)
VECTOR_RECOVERY = int(VectorState.RECOVERY)

NOT_EXPLORING = -1

DRAW_DEPTH = 0
"""Draw column: drop distance from the nest centre."""
DRAW_WANDER = 1
"""Draw column: wandering while exploring, in the nest, leaving it."""
DRAW_RESTART = 2
"""Draw column: the second wander of an exploration's first tick (quirk `explore_double_start`)."""
DRAW_VECTOR = 3
"""Draw column: wandering to break free on the way to a point."""
DRAWS = 4

ROBOT_FIELDS: list[tuple[str, type]] = [
    ("wander_deg", np.float64),  # wander angle
    ("rest_x_m", np.float64),  # where a homing robot was when it last came further, in a world with obstacles
    ("rest_y_m", np.float64),
    ("drop_depth_m", np.float64),  # deliver at most this far from the nest centre
    ("goal_x_m", np.float64),
    ("goal_y_m", np.float64),
    ("goal_tolerance_m", np.float64),
    ("target", np.int32),  # identity of the goal: row of an object, or serial of a cache
    ("explore_ticks", np.int32),  # since exploration started, or NOT_EXPLORING
    ("recovery_ticks", np.int32),  # driven straight on after avoiding
    ("turn_ticks", np.int32),  # in a row, up to now, in which it was told to turn on the spot or to stand
    ("rest_ticks", np.int32),  # since then
    ("detour_ticks", np.int32),  # left of a detour: positive to the left, negative to the right
    ("clock", np.int32),  # ticks lived through while active
    ("n_known", np.int32),  # remembered objects
    ("window_x", np.int32),  # lower left cell of the window seen last
    ("window_y", np.int32),
    ("n_shown", np.int8),  # objects in the window seen last
    ("activity", np.int8),
    ("vector_state", np.int8),
    ("is_slowing", np.bool_),  # within the slowing radius at the last arrival force
    ("is_searching", np.bool_),  # the point it goes to is where a search begins, not a goal
]
"""Inner state of one robot; a controller may add fields of its own."""

NO_WINDOW = -(2**30)


def new_robots(n_robots: int, more_fields: Sequence[tuple[str, type]] = ()) -> np.ndarray:
    """Return (n_robots,) records of `ROBOT_FIELDS` and `more_fields` that start to acquire and have seen nothing."""
    # With the common fields first, numba would treat a longer record as a subtype of the shorter one, and warn.
    fields = np.dtype([*more_fields, *ROBOT_FIELDS], align=True)
    # np.record makes fields readable as attributes also in uncompiled kernels; compiled kernels need no help.
    robots = np.zeros(n_robots, np.dtype((np.record, fields)))
    robots["explore_ticks"] = NOT_EXPLORING
    robots["target"] = -1
    robots["window_x"] = NO_WINDOW
    robots["window_y"] = NO_WINDOW
    return robots


def activity_codes(robots: np.ndarray) -> CodeArray:
    """Return what every robot is up to, (N,) indices into `ACTIVITY_WORDS`."""
    codes = robots["activity"].copy()
    without_goal = robots["vector_state"] == VectorState.IDLE
    codes[without_goal & (robots["activity"] == Activity.ACQUIRE)] = EXPLORING
    codes[without_goal & (robots["activity"] == Activity.TRANSPORT)] = EXPLORING_LOADED
    return codes


@part
def fetch_ahead(obs: ObsArray, robots: np.ndarray, i: int, c: np.record) -> None:
    """Ask the memory for a robot that is some rows further on, in a swarm that no cache of a processor holds."""
    if obs.shape[0] < LARGE:
        return
    for byte in range(0, RING_SENSORS * obs.itemsize, LINE):
        prefetch(obs, i + AHEAD, c.proximity * obs.itemsize + byte)
    prefetch(obs, i + AHEAD, c.position * obs.itemsize)
    prefetch(obs, i + AHEAD, c.event * obs.itemsize)
    for byte in range(0, robots.itemsize, LINE):
        prefetch(robots, i + AHEAD, byte)


class Senses(NamedTuple):
    """What a robot makes of its observation in every tick."""

    obstacle: bool
    obstacle_x: float
    """Summed proximity vector, body frame, forward."""
    obstacle_y: float
    carrying: bool
    event: int
    """Code of `Event`."""
    x: float
    """Believed position, m."""
    y: float


@kernel
def sense(row: Row, c: np.record) -> Senses:
    """Read one observation row."""
    obstacle = False
    obstacle_x = 0.0
    obstacle_y = 0.0
    proximity = row[c.proximity : c.proximity + RING_SENSORS]
    if not ring_is_empty(proximity):
        obstacle_x, obstacle_y = ring_sum(proximity)
        obstacle = is_obstacle_vector(obstacle_x, obstacle_y, c.obstacle_behind_counts != 0)
    return Senses(
        obstacle,
        obstacle_x,
        obstacle_y,
        row[c.carrying] > 0.5,
        int(row[c.event] * EVENT_SCALE + 0.5),
        (float(row[c.position]) + 1.0) * c.half_width_m,
        (float(row[c.position + 1]) + 1.0) * c.half_height_m,
    )


@part
def nearest_nest(x: float, y: float, c: np.record) -> tuple[float, float]:
    """Centre of the nest whose centre is nearest to a point, all in m. Our choice where there are several nests."""
    nests = c.nests_m
    nearest, least = 0, math.inf
    for k in range(nests.shape[0]):
        dx, dy = x - nests[k, 0], y - nests[k, 1]
        if dx * dx + dy * dy < least:
            nearest, least = k, dx * dx + dy * dy
    return nests[nearest, 0], nests[nearest, 1]


@part
def in_nest(row: Row, c: np.record) -> bool:
    """Whether the ground sensors see the nest."""
    return sees_nest(row[c.ground : c.ground + GROUND_SENSORS])
