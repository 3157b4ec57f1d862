"""Cache memory: which caches each robot has seen, where, with how many objects; and which ones it must leave alone.

The rule, for one robot and tick, W being its 5 x 5 window of cells:

1. A remembered cache whose square meets W, but which is not seen, is forgotten. The place of the last one forgotten
   stays known, as the place where a search for caches begins.
2. Every cache seen is remembered at its centre cell with its number of objects and pheromone density 1; remembered
   objects on its square are forgotten.
3. Every density decays as those of objects do (see `memory`).

Source: cache memory of the paper's task-allocating controllers.
"""

from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.layout import CACHE_FIELDS, SERIAL_SCALE, VISIBLE_CACHES, WINDOW_CELLS
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import IntArray, Row

from .memory import (
    ObjectMemory,
    OneMemory,
    forget,
    memory_of,
    new_memory,
    object_memory_with_room,
    object_row_of,
    with_room,
)

_FIELDS: list[tuple[str, type]] = [
    ("cell_x", np.int32),  # centre cell
    ("cell_y", np.int32),
    ("serial", np.int32),  # identity
    ("count", np.int32),  # objects when last seen
    ("seen", np.int32),  # tick of the robot's own clock at which it was last seen
    ("has_refused", np.bool_),  # it is known that the world refuses to start another cache near it
]
CACHE = np.dtype((np.record, np.dtype(_FIELDS, align=True)))
"""One remembered cache."""


class TaskMemory(NamedTuple):
    """Memories of all robots."""

    objects: ObjectMemory
    caches: np.ndarray
    """(N, K) records of `CACHE`; row i holds a compact list of `n_caches[i]` caches, in no particular order."""
    shunned: IntArray
    """(N, 3, K) what is left alone, by `OBJECTS`, `NOT_TO_TAKE` and `NOT_TO_ADD`: rows + 1, serials, serials."""
    n_shunned: IntArray
    """(N, 3) how many."""


class OneTaskMemory(NamedTuple):
    """`TaskMemory` of one robot."""

    objects: OneMemory
    caches: Row
    shunned: np.ndarray
    n_shunned: Row


OBJECTS = 0
"""Place in `TaskMemory.shunned` of objects."""
NOT_TO_TAKE = 1
"""The same of caches that a robot takes nothing from."""
NOT_TO_ADD = 2
"""The same for those that it adds nothing to."""


def new_task_memory(spec: SwarmSpec) -> TaskMemory:
    """Return empty memories, without room; see `task_memory_with_room`."""
    return TaskMemory(
        objects=new_memory(spec.n_robots, spec.n_objects),
        caches=np.zeros((spec.n_robots, 0), CACHE),
        shunned=np.zeros((spec.n_robots, 3, 0), np.int32),
        n_shunned=np.zeros((spec.n_robots, 3), np.int32),
    )


def task_memory_with_room(memory: TaskMemory, robots: np.ndarray, n_ticks: int, spec: SwarmSpec) -> TaskMemory:
    """Return memories with room for what robots may see and shun in so many ticks.

    Twice as many caches can be remembered as fit into the arena side by side.
    """
    width_m, height_m = spec.arena_size_m
    n_side_by_side = int(width_m / spec.cache_side_m + 1e-9) * int(height_m / spec.cache_side_m + 1e-9)
    objects = object_memory_with_room(memory.objects, robots, n_ticks, spec.n_objects)
    seen = n_ticks * (VISIBLE_CACHES + 1)  # and one in an event
    caches = with_room(memory.caches, robots["n_caches"], seen, 2 * n_side_by_side)
    shunned = with_room(memory.shunned, memory.n_shunned, n_ticks)
    if objects is memory.objects and caches is memory.caches and shunned is memory.shunned:
        return memory
    return TaskMemory(objects, caches, shunned, memory.n_shunned)


@part
def task_memory_of(memory: TaskMemory, robot_index: int) -> OneTaskMemory:
    """Return views of one robot's memory."""
    return OneTaskMemory(
        memory_of(memory.objects, robot_index),
        memory.caches[robot_index],
        memory.shunned[robot_index],
        memory.n_shunned[robot_index],
    )


@part
def cell_of(share: float, half_extent_m: float, c: np.record) -> int:
    """Cell along one axis of a coordinate in observation units."""
    return int((share + 1.0) * half_extent_m / c.cell_m)


@part
def find_cache(robot: np.record, caches: Row, cell_x: int, cell_y: int) -> int:
    """List entry of the cache remembered at a centre cell, or -1."""
    for entry in range(robot.n_caches):
        if caches[entry].cell_x == cell_x and caches[entry].cell_y == cell_y:
            return entry
    return -1


@part
def covers(cache: np.record, x: float, y: float, c: np.record) -> bool:
    """Whether a point (m) lies in a remembered cache's square."""
    dx = abs((cache.cell_x + 0.5) * c.cell_m - x)
    dy = abs((cache.cell_y + 0.5) * c.cell_m - y)
    return max(dx, dy) <= 0.5 * c.cache_side_m


@kernel
def remember_cache(robot: np.record, memory: OneTaskMemory, fields: Row, c: np.record) -> None:
    """Store a cache as seen now.

    Args:
        robot: Record of the robot.
        memory: Edited.
        fields: Serial, centre x, y and count as observations give them; serial 0 = no cache, nothing happens.
        c: Constants of the run.
    """
    serial = int(fields[0] * SERIAL_SCALE + 0.5)
    if serial == 0:
        return
    cell_x = cell_of(fields[1], c.half_width_m, c)
    cell_y = cell_of(fields[2], c.half_height_m, c)
    caches = memory.caches
    entry = find_cache(robot, caches, cell_x, cell_y)
    if entry < 0:
        entry = _new_entry(robot, caches)
    elif c.last_cache_at_every_sight and robot.n_caches == 1:  # quirk: not only when it is forgotten
        _keep_last_place(robot, caches[entry], c)
    cache = caches[entry]
    if cache.serial != serial:
        cache.serial = serial
        cache.cell_x = cell_x
        cache.cell_y = cell_y
        cache.has_refused = False
        _forget_objects_under(robot, memory.objects, cache, c)
    cache.count = int(fields[3] * c.n_objects + 0.5)
    cache.seen = robot.clock


@part
def _new_entry(robot: np.record, caches: Row) -> int:
    """A list entry for a new cache; if the list is full, the entry of the cache that was last seen longest ago."""
    if robot.n_caches < caches.shape[0]:
        entry = robot.n_caches
        robot.n_caches += 1
    else:
        entry = 0
        for other in range(caches.shape[0]):
            if caches[other].seen < caches[entry].seen:
                entry = other
    caches[entry].serial = 0
    return entry


@part
def _forget_objects_under(robot: np.record, objects: OneMemory, cache: np.record, c: np.record) -> None:
    """Forget objects on the square of a cache: they are inside it now."""
    half = c.cell_m / 2.0
    for entry in range(robot.n_known - 1, -1, -1):  # backwards: forgetting moves the last entry here
        known = objects.known[entry]
        if covers(cache, known.cell_x * c.cell_m + half, known.cell_y * c.cell_m + half, c):
            forget(robot, objects, known.row)


@part
def _keep_last_place(robot: np.record, cache: np.record, c: np.record) -> None:
    """Remember a cache's centre as the place where a search for caches begins."""
    robot.last_cache_x_m = (cache.cell_x + 0.5) * c.cell_m
    robot.last_cache_y_m = (cache.cell_y + 0.5) * c.cell_m
    robot.knows_last_cache = True


@part
def forget_cache(robot: np.record, caches: Row, entry: int, c: np.record) -> None:
    """Remove a cache; the last list entry takes its place. If none is left, its position stays known."""
    last = robot.n_caches - 1
    if last == 0:
        _keep_last_place(robot, caches[entry], c)
    caches[entry] = caches[last]
    robot.n_caches = last


@part
def _should_be_visible(robot: np.record, cache: np.record, c: np.record) -> bool:
    """Whether a remembered cache's square meets the window."""
    left = robot.window_x
    bottom = robot.window_y
    if c.cache_forget_unit_mismatch:  # quirk: metres are compared with cells, and one axis suffices
        half = 0.5 * c.cache_side_m
        x = (cache.cell_x + 0.5) * c.cell_m
        y = (cache.cell_y + 0.5) * c.cell_m
        in_x = left < x + half and x - half < left + WINDOW_CELLS
        in_y = bottom < y + half and y - half < bottom + WINDOW_CELLS
        return in_x or in_y
    reach = c.cache_half_cells
    in_x = cache.cell_x - reach < left + WINDOW_CELLS and left <= cache.cell_x + reach
    in_y = cache.cell_y - reach < bottom + WINDOW_CELLS and bottom <= cache.cell_y + reach
    return in_x and in_y


@part
def look_for_caches(robot: np.record, row: Row, c: np.record, memory: OneTaskMemory) -> None:
    """One tick of the memory rule above, after `memory.look_around`."""
    visible = row[c.los_cache : c.los_cache + VISIBLE_CACHES * CACHE_FIELDS]
    for entry in range(robot.n_caches - 1, -1, -1):  # backwards: forgetting moves the last entry here
        cache = memory.caches[entry]
        if _should_be_visible(robot, cache, c) and not _is_visible(cache, visible, c):
            forget_cache(robot, memory.caches, entry, c)
    for place in range(VISIBLE_CACHES):
        if visible[place * CACHE_FIELDS] <= 0.0:
            break
        remember_cache(robot, memory, visible[place * CACHE_FIELDS :], c)


@part
def _is_visible(cache: np.record, visible: Row, c: np.record) -> bool:
    """Whether a remembered cache is among the visible ones, by its centre cell."""
    for place in range(VISIBLE_CACHES):
        fields = visible[place * CACHE_FIELDS :]
        if fields[0] <= 0.0:
            return False
        same_x = cell_of(fields[1], c.half_width_m, c) == cache.cell_x
        if same_x and cell_of(fields[2], c.half_height_m, c) == cache.cell_y:
            return True
    return False


@part
def is_shunned(memory: OneTaskMemory, kind: int, name: int) -> bool:
    """Whether an object (its row + 1) or a cache (its serial) is among those to be left alone."""
    return name in memory.shunned[kind, : memory.n_shunned[kind]]


@part
def shun(robot: np.record, memory: OneTaskMemory, kind: int, name: int) -> None:
    """Leave an object or a cache alone, also when it is forgotten meanwhile and seen again; nothing happens for 0.

    `TaskMemory.n_shunned` says for how long: until it is set to 0.
    """
    if name == 0:
        return
    if kind == OBJECTS:
        robot.shunned_in_task = True
    else:
        robot.shunned_cache_in_task = True
    if not is_shunned(memory, kind, name):
        memory.shunned[kind, memory.n_shunned[kind]] = name
        memory.n_shunned[kind] += 1


@part
def forgive_refusals(robot: np.record, caches: Row) -> None:
    """Forget which caches have refused."""
    for entry in range(robot.n_caches):
        caches[entry].has_refused = False


@part
def keep_away_m(cache: np.record, c: np.record) -> float:
    """How far from a remembered cache's centre a new one may be started.

    Robots plan with a shorter distance than the world allows. One that was refused keeps the world's distance for the
    rest of its task: with the old one it would choose the same place again and stand there. Our choice: the authors'
    program knows only the shorter one (quirk `refusals_not_remembered`).
    """
    return c.refusal_m if cache.has_refused else c.proximity_m


@part
def event_cache_entry(robot: np.record, row: Row, c: np.record, caches: Row) -> int:
    """List entry of the cache that this step's event names; -1 if there is none or it is not remembered."""
    if row[c.event_cache] <= 0.0:
        return -1
    return find_cache(
        robot,
        caches,
        cell_of(row[c.event_cache + 1], c.half_width_m, c),
        cell_of(row[c.event_cache + 2], c.half_height_m, c),
    )


@part
def event_cache_serial(row: Row, c: np.record) -> int:
    """Serial of the cache that this step's event names, or 0."""
    return int(row[c.event_cache] * SERIAL_SCALE + 0.5)


@part
def event_object_row(row: Row, c: np.record) -> int:
    """Object row that this step's event names, or -1."""
    return object_row_of(row[c.event_object], c)
