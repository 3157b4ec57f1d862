"""Slow twin of the random walk of objects: neighbours as a list of cells."""

import numpy as np

from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_OBJECT, ObjectStatus
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.floor import Box
from swarm_forage_env.world.state import ObjectState

GAPS_AFTER = (5, 40, 43, 45, 47, 50, 52, 55, 57, 60, 62, 65, 67, 70, 72, 75, 77, 81, 86, 91, *range(95, 156, 5))
"""Cell borders with a rounding gap, as published with the study's analysis."""


def free_neighbours(objects: ObjectState, x: int, y: int, area: Box, self_conflict: bool) -> list[tuple[int, int]]:
    """Return the cells around (x, y) that a one-cell step may reach, row by row from the lower left."""
    cells: list[tuple[int, int]] = []
    for to_y in (y - 1, y, y + 1):
        for to_x in (x - 1, x, x + 1):
            inside = area[0] <= to_x < area[2] and area[1] <= to_y < area[3]
            if not inside or objects.floor[to_y, to_x] != CELL_EMPTY:
                continue
            crosses_x = to_x != x and min(x, to_x) in GAPS_AFTER
            crosses_y = to_y != y and min(y, to_y) in GAPS_AFTER
            if not self_conflict or crosses_x or crosses_y:
                cells.append((to_x, to_y))
    return cells


def walk_slowly(objects: ObjectState, area: Box, probability: float, chance: FloatArray, self_conflict: bool) -> int:
    """Move objects one after the other; returns how many moved."""
    moved = 0
    for row in np.flatnonzero(objects.status == ObjectStatus.FREE).tolist():
        x, y = objects.cell[row].tolist()
        choices = free_neighbours(objects, x, y, area, self_conflict)
        if chance[row] < probability and choices:
            to_x, to_y = choices[int(chance[row] / probability * len(choices))]
            objects.floor[y, x] = CELL_EMPTY
            objects.floor[to_y, to_x] = CELL_OBJECT + row
            objects.cell[row] = to_x, to_y
            moved += 1
    return moved
