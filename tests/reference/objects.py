"""Slow twins of placed and walking objects: lists of cells instead of counters, the waiting rule word by word."""

from collections.abc import Callable

import numpy as np

from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_NEST, CELL_OBJECT, CELL_OBSTACLE, ObjectStatus
from swarm_forage_env.contract.types import FloatArray, IntArray
from swarm_forage_env.scenarios.floor import Box
from swarm_forage_env.world.kernels.placement import TRIES, UNLIMITED
from swarm_forage_env.world.state import ObjectState, Source

Cell = tuple[int, int]


def cells_of(box: Box) -> list[Cell]:
    """Return the cells of a half-open box, row by row from the lower left."""
    return [(x, y) for y in range(box[1], box[3]) for x in range(box[0], box[2])]


def region_order(source: Source, draws: FloatArray) -> list[int]:
    """Return all regions in the order in which they are tried."""
    order: list[int] = []
    n_groups = len(source.group_start) - 1
    for i in range(n_groups):
        group = (int(draws[0] * n_groups) + i) % n_groups
        members = list(range(source.group_start[group], source.group_start[group + 1]))
        first = int(draws[1] * len(members))
        order += members[first:] + members[:first]
    return order


def choose_cell(floor: IntArray, source: Source, area: Box, draws: FloatArray) -> Cell | None:
    """Return a free cell of the first region that has room, or None."""
    for region in region_order(source, draws):
        x_low, y_low, x_high, y_high = (int(edge) for edge in source.regions[region])
        box = (max(x_low, area[0]), max(y_low, area[1]), min(x_high, area[2]), min(y_high, area[3]))
        cells = cells_of(box)
        free = [(x, y) for x, y in cells if floor[y, x] == CELL_EMPTY]
        occupied = sum(1 for x, y in cells if floor[y, x] >= CELL_OBJECT)
        capacity = source.capacity[region]
        if not free or (capacity != UNLIMITED and occupied >= capacity):
            continue
        for k in range(TRIES):
            guess = (
                box[0] + int(draws[3 + 2 * k] * (box[2] - box[0])),
                box[1] + int(draws[4 + 2 * k] * (box[3] - box[1])),
            )
            if guess in free:
                return guess
        return free[int(draws[2] * len(free))]
    return None


def scatter_slowly(rows: IntArray, floor: IntArray, source: Source, area: Box, draws: FloatArray) -> dict[int, Cell]:
    """Lay objects on the floor one by one until one finds no place; returns where each came to lie."""
    placed: dict[int, Cell] = {}
    for row, row_draws in zip(rows.tolist(), draws, strict=True):
        cell = choose_cell(floor, source, area, row_draws)
        if cell is None:
            break
        floor[cell[1], cell[0]] = CELL_OBJECT + row
        placed[row] = cell
    return placed


def waiting_by_the_word(rows: list[int], waiting: list[int], place: Callable[[int], bool]) -> list[int]:
    """Return who waits afterwards: each new object is tried, then every waiting one once, longest wait first."""
    for row in rows:
        newcomers = [] if place(row) else [row]
        waiting = [other for other in waiting if not place(other)] + newcomers
    return waiting


def random_source(rng: np.random.Generator) -> tuple[Source, Box, IntArray]:
    """Return a source of six disjoint regions with capacities 2, 5, 5, 9, 9, 9, an area and a littered floor."""
    corners = [(1 + 7 * (k % 3), 1 + 7 * (k // 3)) for k in rng.permutation(6)]
    extents = rng.integers(2, 7, (6, 2))
    regions = np.array([(x, y, x + w, y + h) for (x, y), (w, h) in zip(corners, extents, strict=True)], np.int32)
    source = Source(regions, np.array([2, 5, 5, 9, 9, 9], np.int32), np.array([0, 1, 3, 6], np.int32))
    floor = np.full((16, 24), CELL_EMPTY, np.int32)
    floor[rng.random(floor.shape) < 0.2] = CELL_NEST
    floor[rng.random(floor.shape) < 0.2] = CELL_OBSTACLE
    return source, (2, 2, 22, 13), floor


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
