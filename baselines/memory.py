"""Object memory: what each robot remembers of the objects it has seen, with a decaying pheromone.

The rule, for one robot and tick, W being its 5 x 5 window of cells:

1. A remembered object whose cell lies in W, but which is not seen in W, is forgotten.
2. Every object seen is remembered at its cell with pheromone density 1; another object remembered there is forgotten.
3. Every density decays by the factor 1 - rho.

The third step has a closed form: an object last seen a ticks ago has density (1 - rho)^(a + 1), so only the tick
of last sight is stored. The first two need a look through the memory only when the window has changed;
otherwise the objects in view are just stamped with the time. Source: object memory of the paper's cognitive
controllers; there is no limit on its size and no forgetting by age.

Compiled code cannot make arrays. So before it runs there is room for whatever robots may see in that time: `with_room`.
"""

import math
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.layout import WINDOW_CELLS
from swarm_forage_env.contract.policy import Memories
from swarm_forage_env.contract.types import CodeArray, IntArray, ObsArray, Row

_WINDOW = WINDOW_CELLS * WINDOW_CELLS
_REACH = WINDOW_CELLS // 2
_MOST_LISTS = 1024
"""A list is searched from its head: with so many lists per robot, and few objects known, at once."""

_FIELDS: list[tuple[str, type]] = [
    ("row", np.int32),  # of the object
    ("cell_x", np.int32),  # cell at which it was last seen
    ("cell_y", np.int32),
    ("seen", np.int32),  # tick of the robot's own clock at which it was last seen
    ("next", np.int32),  # entry + 1 of the next object in the same list, or 0
]
KNOWN = np.dtype((np.record, np.dtype(_FIELDS, align=True)))
"""One remembered object."""


class ObjectMemory(NamedTuple):
    """Memories of all robots."""

    known: np.ndarray
    """(N, K) records of `KNOWN`; row i holds a compact array of `n_known[i]` objects, in no particular order."""
    head: IntArray
    """(N, lists) by the last bits of an object's row: entry + 1 of the first such object, or 0."""
    window: ObsArray
    """(N, 27) readings of the window seen last, then those of the cell in its centre; not a number before the first."""
    shown: CodeArray
    """(N, 25) the robot's `n_shown` cells of that window which show an object."""


class OneMemory(NamedTuple):
    """`ObjectMemory` of one robot: the same arrays without their first axis."""

    known: Row
    head: Row
    window: Row
    shown: Row


def new_memory(n_robots: int, n_objects: int) -> ObjectMemory:
    """Return empty memories of `n_robots` robots for some of `n_objects` objects, without room; see `with_room`."""
    n_lists = min(_MOST_LISTS, 1 << (n_objects - 1).bit_length())
    return ObjectMemory(
        known=np.zeros((n_robots, 0), KNOWN),
        head=np.zeros((n_robots, n_lists), np.int32),
        window=np.full((n_robots, _WINDOW + 2), np.nan, np.float32),
        shown=np.zeros((n_robots, _WINDOW), np.int8),
    )


def with_room(array: np.ndarray, used: IntArray, more: int, at_most: int = 2**31) -> np.ndarray:
    """Return lists (..., K), of which the first `used` (...) places are in use, with room for `more`.

    That is the array itself, or a copy that is half as long again at least, `at_most` at most: that is always enough.
    """
    length, most_used = array.shape[-1], int(used.max(initial=0))
    needed = min(most_used + more, at_most)
    if needed <= length:
        return array
    longer = np.zeros((*array.shape[:-1], min(max(needed, length * 3 // 2), at_most)), array.dtype)
    longer[..., :most_used] = array[..., :most_used]
    return longer


def object_memory_with_room(memory: ObjectMemory, robots: np.ndarray, n_ticks: int, n_objects: int) -> ObjectMemory:
    """Return memories with room for the objects that robots may see in so many ticks."""
    known = with_room(memory.known, robots["n_known"], n_ticks * _WINDOW, n_objects)
    return memory if known is memory.known else memory._replace(known=known)


@part
def memory_of(memory: ObjectMemory, robot_index: int) -> OneMemory:
    """Return views of one robot's memory."""
    return OneMemory(
        memory.known[robot_index], memory.head[robot_index], memory.window[robot_index], memory.shown[robot_index]
    )


@part
def object_row_of(reading: float, c: np.record) -> int:
    """Object row that a reading (row + 1) / M stands for; -1 = none."""
    return int(reading * c.n_objects + 0.5) - 1


@part
def find_object(memory: OneMemory, object_row: int) -> int:
    """Entry of a remembered object, or -1."""
    entry = memory.head[object_row & (memory.head.shape[0] - 1)] - 1
    while entry >= 0 and memory.known[entry].row != object_row:
        entry = memory.known[entry].next - 1
    return entry


@kernel
def remember(robot: np.record, memory: OneMemory, object_row: int, cell_x: int, cell_y: int) -> None:
    """Store an object as seen now at a cell, whether known before or not."""
    entry = find_object(memory, object_row)
    if entry < 0:
        entry = robot.n_known
        robot.n_known += 1
        place = object_row & (memory.head.shape[0] - 1)
        memory.known[entry].row = object_row
        memory.known[entry].next = memory.head[place]
        memory.head[place] = entry + 1
    known = memory.known[entry]
    known.cell_x = cell_x
    known.cell_y = cell_y
    known.seen = robot.clock


@part
def forget(robot: np.record, memory: OneMemory, object_row: int) -> None:
    """Remove an object; nothing happens if it is not remembered. The last entry takes its place."""
    entry = find_object(memory, object_row)
    if entry < 0:
        return
    _lead(memory, entry, memory.known[entry].next)
    last = robot.n_known - 1
    if entry != last:
        _lead(memory, last, entry + 1)
        memory.known[entry] = memory.known[last]
    robot.n_known = last


@part
def _lead(memory: OneMemory, entry: int, to: int) -> None:
    """Let what leads to an entry of a list lead to another one, given as entry + 1, or to none, 0."""
    place = memory.known[entry].row & (memory.head.shape[0] - 1)
    before = memory.head[place] - 1
    if before == entry:
        memory.head[place] = to
        return
    while memory.known[before].next - 1 != entry:
        before = memory.known[before].next - 1
    memory.known[before].next = to


@part
def _sees_the_same(row: Row, c: np.record, memory: OneMemory) -> bool:
    """Whether the robot's cell and the window are those seen last."""
    window = row[c.los_object : c.los_object + _WINDOW].view(np.uint32)
    before = memory.window.view(np.uint32)
    changes = np.uint32(0)
    for k in range(_WINDOW):
        changes |= window[k] ^ before[k]
    same_x = row[c.los_cell] == memory.window[_WINDOW]
    same_y = row[c.los_cell + 1] == memory.window[_WINDOW + 1]
    return changes == 0 and same_x and same_y


@part
def look_around(robot: np.record, row: Row, c: np.record, memory: OneMemory) -> None:
    """One tick of the memory rule above, from the window in observation `row`. Advances the robot's clock."""
    robot.clock += 1
    if not _sees_the_same(row, c, memory):
        n_shown = 0
        for k in range(_WINDOW):
            memory.window[k] = row[c.los_object + k]
            if memory.window[k] > 0.0:
                memory.shown[n_shown] = k
                n_shown += 1
        robot.n_shown = n_shown
        memory.window[_WINDOW] = row[c.los_cell]
        memory.window[_WINDOW + 1] = row[c.los_cell + 1]
        robot.window_x = int((float(row[c.los_cell]) + 1.0) * c.half_width_m / c.cell_m) - _REACH
        robot.window_y = int((float(row[c.los_cell + 1]) + 1.0) * c.half_height_m / c.cell_m) - _REACH
        _forget_what_is_gone(robot, c, memory)
    for entry in range(robot.n_shown):
        k = memory.shown[entry]
        object_row = object_row_of(memory.window[k], c)
        remember(robot, memory, object_row, robot.window_x + k % WINDOW_CELLS, robot.window_y + k // WINDOW_CELLS)


@part
def _forget_what_is_gone(robot: np.record, c: np.record, memory: OneMemory) -> None:
    """Forget objects whose remembered cell is in the window, but does not show them.

    One that shows elsewhere in the window comes back at once with its new cell.
    """
    for entry in range(robot.n_known - 1, -1, -1):  # backwards: forgetting moves the last entry here
        known = memory.known[entry]
        x = known.cell_x - robot.window_x
        y = known.cell_y - robot.window_y
        if abs(x - _REACH) <= _REACH and abs(y - _REACH) <= _REACH:
            shown = object_row_of(memory.window[y * WINDOW_CELLS + x], c)
            if shown != known.row:
                forget(robot, memory, known.row)


@kernel
def density(age_ticks: int, log_keep: float) -> float:
    """Pheromone density of what was last seen `age_ticks` ago: (1 - rho)^(age + 1), log_keep = log(1 - rho)."""
    return math.exp(log_keep * (age_ticks + 1))


def listed(lists: np.ndarray, used: IntArray) -> tuple[IntArray, np.ndarray]:
    """Return robot and record of everything in the first `used[i]` places of rows of `lists` (N, K)."""
    robot = np.repeat(np.arange(len(used), dtype=np.int32), used)
    place = np.arange(len(robot)) - np.repeat(np.cumsum(used) - used, used)
    return robot, lists[robot, place]


def object_memories(memory: ObjectMemory, robots: np.ndarray) -> Memories:
    """Return where all robots remember objects."""
    robot, known = listed(memory.known, robots["n_known"])
    return Memories.of_cells(robot, np.column_stack((known["cell_x"], known["cell_y"])))
