"""Object memory: what each robot remembers of the objects it has seen, with a decaying pheromone.

The rule, for one robot and tick, W being its 5 x 5 window of cells:

1. A remembered object whose cell lies in W, but which is not seen in W, is forgotten.
2. Every object seen is remembered at its cell with pheromone density 1; another object remembered there is forgotten.
3. Every density decays by the factor 1 - rho.

The third step has a closed form: an object last seen a ticks ago has density (1 - rho)^(a + 1), so only the tick
of last sight is stored. The first two need a look through the memory only when the window has changed;
otherwise the objects in view are just stamped with the time. Source: object memory of the paper's cognitive
controllers; there is no limit on its size and no forgetting by age.
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


class ObjectMemory(NamedTuple):
    """Memories of all robots. Row i holds a compact list of `n_known[i]` objects, in no particular order."""

    row: IntArray
    """(N, M) object row of each list entry."""
    cell_x: IntArray
    """(N, M) cell at which it was last seen."""
    cell_y: IntArray
    """(N, M)."""
    seen: IntArray
    """(N, M) tick of the robot's own clock at which it was last seen."""
    entry: IntArray
    """(N, M) by object row: its list entry + 1, or 0 when it is not remembered."""
    window: ObsArray
    """(N, 27) readings of the window seen last, then those of the cell in its centre; not a number before the first."""
    shown: CodeArray
    """(N, 25) the robot's `n_shown` cells of that window which show an object."""


class OneMemory(NamedTuple):
    """`ObjectMemory` of one robot: the same arrays without their first axis."""

    row: Row
    cell_x: Row
    cell_y: Row
    seen: Row
    entry: Row
    window: Row
    shown: Row


def new_memory(n_robots: int, n_objects: int) -> ObjectMemory:
    """Return empty memories of `n_robots` robots for `n_objects` objects.

    They reserve 20 bytes per robot and object. Zeroed pages are only touched as objects become known, so that a run
    may well need less.
    """
    shape = (n_robots, n_objects)
    return ObjectMemory(
        row=np.zeros(shape, np.int32),
        cell_x=np.zeros(shape, np.int32),
        cell_y=np.zeros(shape, np.int32),
        seen=np.zeros(shape, np.int32),
        entry=np.zeros(shape, np.int32),
        window=np.full((n_robots, _WINDOW + 2), np.nan, np.float32),
        shown=np.zeros((n_robots, _WINDOW), np.int8),
    )


@part
def memory_of(memory: ObjectMemory, robot_index: int) -> OneMemory:
    """Return views of one robot's memory."""
    return OneMemory(
        memory.row[robot_index],
        memory.cell_x[robot_index],
        memory.cell_y[robot_index],
        memory.seen[robot_index],
        memory.entry[robot_index],
        memory.window[robot_index],
        memory.shown[robot_index],
    )


@part
def object_row_of(reading: float, c: np.record) -> int:
    """Object row that a reading (row + 1) / M stands for; -1 = none."""
    return int(reading * c.n_objects + 0.5) - 1


@kernel
def remember(robot: np.record, memory: OneMemory, object_row: int, cell_x: int, cell_y: int) -> None:
    """Store an object as seen now at a cell, whether known before or not."""
    entry = memory.entry[object_row] - 1
    if entry < 0:
        entry = robot.n_known
        robot.n_known += 1
        memory.entry[object_row] = entry + 1
        memory.row[entry] = object_row
    memory.cell_x[entry] = cell_x
    memory.cell_y[entry] = cell_y
    memory.seen[entry] = robot.clock


@part
def forget(robot: np.record, memory: OneMemory, object_row: int) -> None:
    """Remove an object; nothing happens if it is not remembered. The last list entry takes its place."""
    entry = memory.entry[object_row] - 1
    if entry < 0:
        return
    last = robot.n_known - 1
    memory.row[entry] = memory.row[last]
    memory.cell_x[entry] = memory.cell_x[last]
    memory.cell_y[entry] = memory.cell_y[last]
    memory.seen[entry] = memory.seen[last]
    memory.entry[memory.row[entry]] = entry + 1
    memory.entry[object_row] = 0
    robot.n_known = last


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
        x = memory.cell_x[entry] - robot.window_x
        y = memory.cell_y[entry] - robot.window_y
        if abs(x - _REACH) <= _REACH and abs(y - _REACH) <= _REACH:
            shown = object_row_of(memory.window[y * WINDOW_CELLS + x], c)
            if shown != memory.row[entry]:
                forget(robot, memory, memory.row[entry])


@kernel
def density(age_ticks: int, log_keep: float) -> float:
    """Pheromone density of what was last seen `age_ticks` ago: (1 - rho)^(age + 1), log_keep = log(1 - rho)."""
    return math.exp(log_keep * (age_ticks + 1))


def object_memories(memory: ObjectMemory, robots: np.ndarray) -> Memories:
    """Return where all robots remember objects."""
    robot, entry = np.nonzero(np.arange(memory.row.shape[1]) < robots["n_known"][:, None])
    cells = np.column_stack((memory.cell_x[robot, entry], memory.cell_y[robot, entry]))
    return Memories.of_cells(robot.astype(np.int32), cells)
