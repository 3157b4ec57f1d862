"""Slow twin of object placement: lists of cells instead of counters, and the waiting rule word by word."""

from collections.abc import Callable

import numpy as np

from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_NEST, CELL_OBJECT, CELL_OBSTACLE
from swarm_forage_env.contract.types import FloatArray, IntArray
from swarm_forage_env.scenarios.floor import Box
from swarm_forage_env.world.kernels.placement import TRIES, UNLIMITED
from swarm_forage_env.world.state import Source

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
