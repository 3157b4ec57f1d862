"""Proximity readings: a ring of beams against the discs of other robots, the four walls and boxes on the floor."""

import math
from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.compiling import inline_kernel, kernel, part
from swarm_forage_env._internal.prefetching import AHEAD, LARGE, prefetch
from swarm_forage_env.contract.detection import BEAM_ANGLES_RAD
from swarm_forage_env.contract.layout import RING_SENSORS
from swarm_forage_env.contract.types import BitArray, BoolArray, FloatArray, ObsArray, Row
from swarm_forage_env.world.kernels.bins import bin_of, cell_of, may_be_beside, word_of
from swarm_forage_env.world.kernels.obstacles import is_within
from swarm_forage_env.world.state import Bins

_BEAM_COS = np.cos(BEAM_ANGLES_RAD)
_BEAM_SIN = np.sin(BEAM_ANGLES_RAD)
_CONTACT_M = 0.00989
_READING_NUMERATOR = 0.0100527
_READING_OFFSET_M = 0.000163144
_HALF_RING = ((0, 0), (1, 0), (1, 1), (0, 1), (-1, 1))
"""Steps to a cell itself and to half of its eight neighbours; the other half meets it from its own side."""

Sides: TypeAlias = tuple[float, float, float, float]
"""Lines along x, y, x and y, as distances in m from the centre of a robot."""


@kernel
def proximity_reading(gap_m: float) -> float:
    """Reading for a free distance along a beam: 1 at contact, falling like 1 / distance (foot-bot sensor model)."""
    if gap_m < _CONTACT_M:
        return 1.0
    return _READING_NUMERATOR / (gap_m + _READING_OFFSET_M)


@part
def _beam_to_disc(centre: tuple[float, float], cos: float, sin: float, radius: float) -> float:
    """Free distance of a disc along (cos, sin) to a disc of equal radius, whose centre is so far away along x and y."""
    dx, dy = centre
    along = dx * cos + dy * sin
    if along <= 0.0:
        return math.inf
    across_squared = dx * dx + dy * dy - along * along
    room = radius * radius - across_squared
    if room < 0.0:
        return math.inf
    return along - math.sqrt(room) - radius


@part
def _beam_to_wall(to_low: float, to_high: float, direction: float, radius: float) -> float:
    """Free distance to the wall ahead on one axis; to_low and to_high are centre-to-wall distances."""
    if direction > 1e-12:
        return to_high / direction - radius
    if direction < -1e-12:
        return to_low / -direction - radius
    return math.inf


@part
def _beam_to_walls(gaps: Sides, cos: float, sin: float, radius: float) -> float:
    """Free distance of a disc along (cos, sin); `gaps` = distance of its centre to west, south, east, north wall."""
    west, south, east, north = gaps
    return min(_beam_to_wall(west, east, cos, radius), _beam_to_wall(south, north, sin, radius))


@part
def _beam_to_box(sides: Sides, cos: float, sin: float, radius: float) -> float:
    """Free distance of a disc along (cos, sin) to a box: the beam is in the box while it is in both slabs.

    `sides` = west, south, east, north of the box, seen from the centre. The small number stands for 0 in a direction,
    so that nothing is divided by 0.
    """
    west, south, east, north = sides
    cos = cos if abs(cos) > 1e-12 else 1e-12
    sin = sin if abs(sin) > 1e-12 else 1e-12
    to_west, to_east = west / cos, east / cos
    to_south, to_north = south / sin, north / sin
    enters = max(min(to_west, to_east), min(to_south, to_north))
    leaves = min(max(to_west, to_east), max(to_south, to_north))
    if leaves < max(0.0, enters):
        return math.inf
    return enters - radius


@inline_kernel
def _see(
    free_m: Callable[[Any, float, float, float], float],
    place: Any,
    facing: FloatArray,
    i: int,
    radius: float,
    reach: float,
    row: Row,
) -> None:
    """Raise robot i's readings in `row` to those of a thing; `free_m` tells how far a beam to its `place` is free."""
    cos_h = facing[i, 0]
    sin_h = facing[i, 1]
    for k in range(RING_SENSORS):
        cos = cos_h * _BEAM_COS[k] - sin_h * _BEAM_SIN[k]
        sin = sin_h * _BEAM_COS[k] + cos_h * _BEAM_SIN[k]
        gap = free_m(place, cos, sin, radius)
        if gap <= reach:
            row[k] = max(row[k], proximity_reading(gap))


@part
def _see_what_stands(
    position: FloatArray,
    facing: FloatArray,
    present: BoolArray,
    interior: FloatArray,
    obstacles: FloatArray,
    radius: float,
    reach: float,
    obs: ObsArray,
    start: int,
    near: BoolArray,
    kept: bool,
) -> None:
    """Begin `proximity`: write readings of walls and boxes, and zeros where there are none; see there."""
    wall_sight = radius + reach
    for i in range(position.shape[0]):
        row = obs[i, start : start + RING_SENSORS]
        if near[i] or not kept:
            row[:] = 0.0
        near[i] = False
        if present[i]:
            x = position[i, 0]
            y = position[i, 1]
            gaps = (x - interior[0], y - interior[1], interior[2] - x, interior[3] - y)
            if min(gaps[0], gaps[1], gaps[2], gaps[3]) < wall_sight:
                near[i] = True
                _see(_beam_to_walls, gaps, facing, i, radius, reach, row)
            for b in range(obstacles.shape[0]):
                if is_within(x, y, obstacles, b, wall_sight):
                    near[i] = True
                    sides = (obstacles[b, 0] - x, obstacles[b, 1] - y, obstacles[b, 2] - x, obstacles[b, 3] - y)
                    _see(_beam_to_box, sides, facing, i, radius, reach, row)


@inline_kernel
def proximity(
    position: FloatArray,
    facing: FloatArray,
    present: BoolArray,
    bins: Bins,
    occupied: BitArray,
    interior: FloatArray,
    obstacles: FloatArray,
    radius: float,
    reach: float,
    obs: ObsArray,
    start: int,
    near: BoolArray,
    kept: bool,
) -> None:
    """Write readings into `obs` from column `start`, and into `near` (N,) whether anything is within reach of a beam.

    `bins` = (cell size in m, first_in_bin, next_in_bin) from `bin_robots` with cells of at least
    2 radius + reach; `interior` = x low, y low, x high, y high of the free floor; `obstacles` (B, 4) likewise, of
    boxes on it; `reach` is measured from the body. `kept`: `near` and `obs` are as the last call left them, so the rows
    of all that were not near are zeros already.
    """
    cell_m, first_in_bin, next_in_bin = bins
    n_bins, n_words, n_robots = first_in_bin.shape[0], occupied.shape[0], position.shape[0]
    sight = 2.0 * radius + reach
    sight_squared = sight * sight
    _see_what_stands(position, facing, present, interior, obstacles, radius, reach, obs, start, near, kept)
    for i in range(n_robots):
        if n_robots >= LARGE:
            ahead = min(i + AHEAD, n_robots - 1)
            ahead_x = cell_of(position[ahead, 0], cell_m)
            ahead_y = cell_of(position[ahead, 1], cell_m)
            prefetch(occupied, word_of(ahead_x, ahead_y, n_words), 0)
            prefetch(occupied, word_of(ahead_x, ahead_y + 1, n_words), 0)
        if not present[i]:
            continue
        x = position[i, 0]
        y = position[i, 1]
        cell_x = cell_of(x, cell_m)
        cell_y = cell_of(y, cell_m)
        # Each pair is met once: behind i in its own bin, or in one of the next cells on one side. A pair that hashing
        # shows twice gives the same readings twice.
        # Most robots are alone. All bins are looked at before anything is decided: one branch, which can be foreseen.
        n_cells = 5 if may_be_beside(cell_x, cell_y, occupied) else 1
        found = next_in_bin[i]
        for k in range(1, n_cells):
            step_x, step_y = _HALF_RING[k]
            found = max(found, first_in_bin[bin_of(cell_x + step_x, cell_y + step_y, n_bins)])
        if found < 0:
            continue
        for k in range(n_cells):
            step_x, step_y = _HALF_RING[k]
            j = next_in_bin[i] if k == 0 else first_in_bin[bin_of(cell_x + step_x, cell_y + step_y, n_bins)]
            while j >= 0:
                dx = position[j, 0] - x
                dy = position[j, 1] - y
                if j != i and dx * dx + dy * dy <= sight_squared:
                    near[i] = True
                    near[j] = True
                    _see(_beam_to_disc, (dx, dy), facing, i, radius, reach, obs[i, start : start + RING_SENSORS])
                    _see(_beam_to_disc, (-dx, -dy), facing, int(j), radius, reach, obs[j, start : start + RING_SENSORS])
                j = next_in_bin[j]
