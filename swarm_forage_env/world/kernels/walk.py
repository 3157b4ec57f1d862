"""Random walk of free objects on the floor grid. Random numbers are passed in."""

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_OBJECT, ObjectStatus
from swarm_forage_env.contract.types import CodeArray, FloatArray, IntArray
from swarm_forage_env.scenarios.floor import CELL_M

_FREE = int(ObjectStatus.FREE)
_STUDY_CELLS = 640
"""Cells along the largest arena of the study, 128 m."""
OPEN_BORDERS = np.array([i * CELL_M + CELL_M < (i + 1) * CELL_M for i in range(_STUDY_CELLS)])
"""(640,) bool: whether the border after cell i opens a gap when rectangles are compared in floating point.

The end of cell i computed as i 0.2 + 0.2 falls one rounding error short of the start of its neighbour, (i + 1) 0.2,
after the cells 5, 40, 43, 45, 47, 50 ... 91 and 95, 100, 105 ... 155, and nowhere else.
"""


@kernel
def crosses_open_border(x: int, y: int, dx: int, dy: int) -> bool:
    """Return whether a one-cell step crosses, in x or in y, a border that leaves a rounding gap (`OPEN_BORDERS`)."""
    border_x = x if dx > 0 else x - 1
    border_y = y if dy > 0 else y - 1
    open_x = dx != 0 and border_x < _STUDY_CELLS and OPEN_BORDERS[border_x]
    open_y = dy != 0 and border_y < _STUDY_CELLS and OPEN_BORDERS[border_y]
    return open_x or open_y


@kernel
def can_step(
    floor: IntArray, area: tuple[int, int, int, int], x: int, y: int, dx: int, dy: int, self_conflict: bool
) -> bool:
    """Return whether the neighbour cell is free: inside the half-open box `area` and empty.

    With `self_conflict` an object also collides with its own old place, except across an open border.
    """
    to_x = x + dx
    to_y = y + dy
    if to_x < area[0] or to_x >= area[2] or to_y < area[1] or to_y >= area[3]:
        return False
    if floor[to_y, to_x] != CELL_EMPTY:
        return False
    return not self_conflict or crosses_open_border(x, y, dx, dy)


@kernel
def walk(
    floor: IntArray,
    status: CodeArray,
    cell: IntArray,
    chance: FloatArray,
    probability: float,
    area: tuple[int, int, int, int],
    self_conflict: bool,
) -> int:
    """Move free objects one cell, in row order; each sees the moves made before it. Returns the number of moves.

    Every free object takes one step with `probability` (p_rw of the paper's scenario 2), to one of the free cells of
    `area` among the eight neighbours, drawn uniformly; if none is free it stays. The study redraws a step of -1, 0 or 1
    cells per axis until it fits, up to 32 times. That is a uniform choice, too; only the rule of giving up after 32
    draws is left out here. `self_conflict`: quirk `motion_self_conflict`, see `can_step`. One number belongs to each
    object and tick, whatever its status, so that runs which share a seed stay paired.

    `chance` (M,) is used twice: if it is below `probability` the object moves, and then chance / probability, which is
    again uniform in [0, 1), chooses among its free neighbour cells. Writes `floor` (ny, nx) and `cell` (M, 2).
    """
    moves = 0
    for row in range(chance.shape[0]):
        if chance[row] >= probability or status[row] != _FREE:
            continue
        x = cell[row, 0]
        y = cell[row, 1]
        n_open = 0
        for dy in range(-1, 2):
            for dx in range(-1, 2):
                if can_step(floor, area, x, y, dx, dy, self_conflict):
                    n_open += 1
        wanted = int(chance[row] / probability * n_open)
        for step in range(9):
            dx = step % 3 - 1
            dy = step // 3 - 1
            if not can_step(floor, area, x, y, dx, dy, self_conflict):
                continue
            if wanted == 0:
                floor[y, x] = CELL_EMPTY
                floor[y + dy, x + dx] = CELL_OBJECT + row
                cell[row, 0] = x + dx
                cell[row, 1] = y + dy
                moves += 1
                break
            wanted -= 1
    return moves
