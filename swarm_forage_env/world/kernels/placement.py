"""Drawing free cells for objects: which region, which cell. Random numbers are passed in.

Floor codes are those of `contract.codes`.
"""

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_OBJECT, ObjectStatus
from swarm_forage_env.contract.types import FloatArray, IntArray
from swarm_forage_env.world.kernels.floor import note_change
from swarm_forage_env.world.state import ObjectState, PlacementDraws, Requests, Source

UNLIMITED = int(np.iinfo(np.int32).max)
"""Capacity of a region that takes as many objects as it has free cells."""
TRIES = 16
"""Random cells tried before the free cells of a region are listed; either way the choice is exactly uniform."""
DRAWS = 3 + 2 * TRIES
"""Uniform numbers per object: group, region, listed cell, then x and y of each try."""
_FREE, _WAITING = int(ObjectStatus.FREE), int(ObjectStatus.WAITING)


@kernel
def count_objects(floor: IntArray, x_low: int, y_low: int, x_high: int, y_high: int) -> int:
    """Return how many objects lie in the half-open box."""
    count = 0
    for y in range(y_low, y_high):
        for x in range(x_low, x_high):
            if floor[y, x] >= CELL_OBJECT:
                count += 1
    return count


@part
def draw_free_cell(
    floor: IntArray, x_low: int, y_low: int, x_high: int, y_high: int, draws: FloatArray
) -> tuple[int, int]:
    """Return a uniform choice (x, y) among the empty cells of the half-open box, or (-1, -1) if there is none.

    Whether a cell is found does not depend on `draws`, so a caller may use the same row of (DRAWS,) uniforms for
    the next box after a failure without biasing anything.
    """
    width = x_high - x_low
    height = y_high - y_low
    if width <= 0 or height <= 0:
        return -1, -1
    for k in range(TRIES):
        x = x_low + int(draws[3 + 2 * k] * width)
        y = y_low + int(draws[4 + 2 * k] * height)
        if floor[y, x] == CELL_EMPTY:
            return x, y
    free = 0
    for y in range(y_low, y_high):
        for x in range(x_low, x_high):
            if floor[y, x] == CELL_EMPTY:
                free += 1
    wanted = int(draws[2] * free)
    for y in range(y_low, y_high):
        for x in range(x_low, x_high):
            if floor[y, x] == CELL_EMPTY:
                if wanted == 0:
                    return x, y
                wanted -= 1
    return -1, -1


@part
def draw_source_cell(
    floor: IntArray,
    regions: IntArray,
    capacity: IntArray,
    group_start: IntArray,
    area: tuple[int, int, int, int],
    draws: FloatArray,
) -> tuple[int, int]:
    """Return a free cell (x, y) of a source, or (-1, -1): a random group, then a random region of it.

    Groups, and regions within a group, are tried in cyclic order from the random one. Regions that hold as many objects
    as their capacity, or have no free cell inside `area`, are skipped.
    """
    n_groups = group_start.shape[0] - 1
    first_group = int(draws[0] * n_groups)
    for i in range(n_groups):
        group = (first_group + i) % n_groups
        start = group_start[group]
        size = group_start[group + 1] - start
        first_region = int(draws[1] * size)
        for j in range(size):
            region = start + (first_region + j) % size
            x_low = int(max(regions[region, 0], area[0]))
            y_low = int(max(regions[region, 1], area[1]))
            x_high = int(min(regions[region, 2], area[2]))
            y_high = int(min(regions[region, 3], area[3]))
            limit = capacity[region]
            if limit != UNLIMITED and count_objects(floor, x_low, y_low, x_high, y_high) >= limit:
                continue
            x, y = draw_free_cell(floor, x_low, y_low, x_high, y_high, draws)
            if x >= 0:
                return x, y
    return -1, -1


@kernel
def scatter(
    rows: IntArray,
    floor: IntArray,
    cell: IntArray,
    regions: IntArray,
    capacity: IntArray,
    group_start: IntArray,
    area: tuple[int, int, int, int],
    draws: FloatArray,
) -> int:
    """Lay the objects `rows` on the floor one by one until one finds no place; returns how many lie.

    After a failure the later rows are not tried, because there is no room for them either. Writes `floor` (ny, nx) and
    `cell` (M, 2); `draws` is (len(rows), DRAWS).
    """
    for i in range(rows.shape[0]):
        x, y = draw_source_cell(floor, regions, capacity, group_start, area, draws[i])
        if x < 0:
            return i
        floor[y, x] = CELL_OBJECT + rows[i]
        cell[rows[i], 0] = x
        cell[rows[i], 1] = y
    return rows.shape[0]


@kernel
def place_displaced(
    requests: Requests, objects: ObjectState, source: Source, area: tuple[int, int, int, int], draws: PlacementDraws
) -> None:
    """Place displaced objects and empty their list: `world.placement.place_objects` where no object waits.

    Where one does, or there are not enough draws, nothing happens.
    """
    displaced = requests.displaced
    n_rows = displaced[-1]
    first = draws.n_used[0]
    if n_rows == 0 or objects.waiting[-1] > 0 or first + n_rows > draws.rows.shape[0]:
        return
    rows = displaced[:n_rows]
    n_placed = scatter(
        rows,
        objects.floor,
        objects.cell,
        source.regions,
        source.capacity,
        source.group_start,
        area,
        draws.rows[first : first + n_rows],
    )
    for k in range(n_rows):
        objects.cache_slot[rows[k]] = -1
        if k < n_placed:
            objects.status[rows[k]] = _FREE
            objects.carriers[rows[k]] = 0
            note_change(requests.changed, objects.cell[rows[k], 0], objects.cell[rows[k], 1])
        else:
            objects.status[rows[k]] = _WAITING
            objects.cell[rows[k], :] = -1
            objects.waiting[k - n_placed] = rows[k]
    objects.waiting[-1] = n_rows - n_placed
    draws.n_used[0] += n_rows
    displaced[-1] = 0
