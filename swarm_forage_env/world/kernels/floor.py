"""What robots sense of the floor and the light above it: ground readings, nest light, line-of-sight window."""

import math

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY, CELL_NEST, CELL_OBJECT
from swarm_forage_env.contract.detection import BEAM_ANGLES_RAD
from swarm_forage_env.contract.layout import (
    CACHE_FIELDS,
    GROUND_SENSORS,
    RING_SENSORS,
    SERIAL_SCALE,
    VISIBLE_CACHES,
    WINDOW_CELLS,
)
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray, ObsArray, Row
from swarm_forage_env.scenarios.floor import CELLS_PER_M
from swarm_forage_env.world.state import CacheState

_GROUND_X = np.array([0.063, 0.063, -0.063, -0.063])
_GROUND_Y = np.array([0.0116, -0.0116, 0.0116, -0.0116])
_GREY_OBJECT = 0.0
_GREY_EMPTY = 1.0
_GREY_NEST = 179.0 / 255.0
_GREY_CACHE = 102.0 / 255.0
_LIGHT_CUTOFF = 2.5
"""Scaled distance beyond which a light is not seen."""
_FIRST_SENSOR_RAD = BEAM_ANGLES_RAD[0]
_SENSOR_STEP_RAD = BEAM_ANGLES_RAD[1] - BEAM_ANGLES_RAD[0]
_LAST_SENSOR = np.uint64(RING_SENSORS - 1)
_HALF_WINDOW = WINDOW_CELLS // 2


@kernel
def grey_of(code: int) -> float:
    """Grey level of a floor code of `contract.codes`: object 0, nest 0.70, cache 0.40, empty 1, also by an obstacle."""
    if code >= CELL_OBJECT:
        return _GREY_OBJECT
    if code == CELL_EMPTY:
        return _GREY_EMPTY
    if code == CELL_NEST:
        return _GREY_NEST
    return _GREY_CACHE if code <= CELL_CACHE else _GREY_EMPTY


@kernel
def ground(
    position: FloatArray, facing: FloatArray, present: BoolArray, floor: IntArray, obs: ObsArray, start: int
) -> None:
    """Write four grey readings per robot into obs[:, start:start + 4]; outside the grid reads empty."""
    ny, nx = floor.shape
    for i in range(position.shape[0]):
        if not present[i]:
            obs[i, start : start + GROUND_SENSORS] = 0.0
            continue
        cos = facing[i, 0]
        sin = facing[i, 1]
        for k in range(GROUND_SENSORS):
            x = position[i, 0] + cos * _GROUND_X[k] - sin * _GROUND_Y[k]
            y = position[i, 1] + sin * _GROUND_X[k] + cos * _GROUND_Y[k]
            cell_x = int(math.floor(x * CELLS_PER_M))
            cell_y = int(math.floor(y * CELLS_PER_M))
            inside = 0 <= cell_x < nx and 0 <= cell_y < ny
            obs[i, start + k] = grey_of(floor[cell_y, cell_x]) if inside else _GREY_EMPTY


@kernel
def light(
    position: FloatArray,
    facing: FloatArray,
    present: BoolArray,
    lights: FloatArray,
    intensity: float,
    carried_object: IntArray,
    of_carriers_only: bool,
    obs: ObsArray,
    start: int,
) -> None:
    """Write the ring of light readings of each robot into the columns of `obs` from `start`.

    Per light of `lights` (L, 3: x, y, height in m): exp(-2 distance / intensity), falling linearly to 0 at
    90 degrees between sensor axis and light; lights add up; clamped to 1. With `of_carriers_only` the rows of robots
    that carry nothing stay zero.
    """
    for i in range(position.shape[0]):
        row = obs[i, start : start + RING_SENSORS]
        row[:] = 0.0
        if not present[i] or (of_carriers_only and carried_object[i] < 0):
            continue
        for lamp in range(lights.shape[0]):
            dx = lights[lamp, 0] - position[i, 0]
            dy = lights[lamp, 1] - position[i, 1]
            height = lights[lamp, 2]
            scaled = math.sqrt(dx * dx + dy * dy + height * height) / intensity
            if scaled > _LIGHT_CUTOFF:
                continue
            base = math.exp(-2.0 * scaled)
            cos = facing[i, 0]
            sin = facing[i, 1]
            bearing = math.atan2(dy * cos - dx * sin, dx * cos + dy * sin)
            # Only the sensors within a quarter turn of the light, counted round the ring: 12, or 13 by rounding. A
            # known number of rounds and an index without a sign spare a tenth of the time.
            first = math.ceil((bearing - 0.5 * math.pi - _FIRST_SENSOR_RAD) / _SENSOR_STEP_RAD)
            away = _FIRST_SENSOR_RAD + first * _SENSOR_STEP_RAD - bearing
            k = np.uint64(first if first >= 0.0 else first + RING_SENSORS)  # less than a turn: no division is needed
            for _ in range(RING_SENSORS // 2 - 1):
                _shine(row, k, base, away)
                away += _SENSOR_STEP_RAD
                k = _next_in_ring(k)
            while away < 0.5 * math.pi:
                _shine(row, k, base, away)
                away += _SENSOR_STEP_RAD
                k = _next_in_ring(k)


@kernel
def _shine(row: Row, k: np.uint64, base: float, away: float) -> None:
    """Add a light to the reading of sensor k, whose axis is `away` from it (rad); `base` is what it reads head-on."""
    row[k] = min(1.0, row[k] + base * (1.0 - abs(away) / (0.5 * math.pi)))


@kernel
def _next_in_ring(k: np.uint64) -> np.uint64:
    return np.uint64(0) if k == _LAST_SENSOR else k + np.uint64(1)


@kernel
def line_of_sight(
    position: FloatArray,
    present: BoolArray,
    floor: IntArray,
    shares: ObsArray,
    caches: CacheState,
    half_side: int,
    half_windows: IntArray,
    obs: ObsArray,
    starts: tuple[int, int, int],
) -> None:
    """Write the robot's cell, the objects of its 5 x 5 window and the caches that meet it.

    `shares` (M + 1,) = what is written for no object, and for each object (row + 1) / M;
    `half_side` = (cache side in squares - 1) / 2; `half_windows` (N,) = squares that a robot sees on either side of its
    own, the others of its window hold nothing;
    `starts` = first columns of los_cell, los_object, los_cache.
    """
    ny, nx = floor.shape
    cell_start, object_start, cache_start = starts
    n_objects = shares.shape[0] - 1
    for i in range(position.shape[0]):
        if not present[i]:
            for k in range(cell_start, cache_start + CACHE_FIELDS * VISIBLE_CACHES):
                obs[i, k] = 0.0
            continue
        cell_x = min(nx - 1, max(0, int(position[i, 0] * CELLS_PER_M)))
        cell_y = min(ny - 1, max(0, int(position[i, 1] * CELLS_PER_M)))
        obs[i, cell_start] = (2 * cell_x + 1) / nx - 1.0
        obs[i, cell_start + 1] = (2 * cell_y + 1) / ny - 1.0
        window = obs[i, object_start:cache_start]
        if _HALF_WINDOW <= cell_x < nx - _HALF_WINDOW and _HALF_WINDOW <= cell_y < ny - _HALF_WINDOW:
            _whole_window(floor, cell_x - _HALF_WINDOW, cell_y - _HALF_WINDOW, shares, window)
        else:
            _cut_window(floor, cell_x - _HALF_WINDOW, cell_y - _HALF_WINDOW, shares, window)
        if half_windows[i] < _HALF_WINDOW:
            _narrow_window(half_windows[i], window)
        for k in range(cache_start, cache_start + CACHE_FIELDS * VISIBLE_CACHES):
            obs[i, k] = 0.0
        if caches.alive.shape[0] > 0:
            reach = half_side + half_windows[i]
            _visible_caches(cell_x, cell_y, position, caches, reach, i, obs, cache_start, (nx, ny, n_objects))


@kernel
def _whole_window(floor: IntArray, x_low: int, y_low: int, shares: ObsArray, window: ObsArray) -> None:
    """Write the objects of a window inside of the floor. Without a branch: where objects lie cannot be foreseen."""
    for y in range(WINDOW_CELLS):
        for x in range(WINDOW_CELLS):
            window[y * WINDOW_CELLS + x] = shares[max(floor[y_low + y, x_low + x], CELL_EMPTY)]


@kernel
def _cut_window(floor: IntArray, x_low: int, y_low: int, shares: ObsArray, window: ObsArray) -> None:
    """Write the objects of a window at the border; cells outside of the floor hold none."""
    ny, nx = floor.shape
    for y in range(WINDOW_CELLS):
        for x in range(WINDOW_CELLS):
            inside = 0 <= x_low + x < nx and 0 <= y_low + y < ny
            window[y * WINDOW_CELLS + x] = shares[max(floor[y_low + y, x_low + x], CELL_EMPTY)] if inside else 0.0


@kernel
def _narrow_window(half: int, window: ObsArray) -> None:
    """Empty the cells of a window that are more than `half` cells from its middle along x or y."""
    for y in range(WINDOW_CELLS):
        for x in range(WINDOW_CELLS):
            if max(abs(x - _HALF_WINDOW), abs(y - _HALF_WINDOW)) > half:
                window[y * WINDOW_CELLS + x] = 0.0


@kernel
def _visible_caches(
    cell_x: int,
    cell_y: int,
    position: FloatArray,
    caches: CacheState,
    reach: int,
    i: int,
    obs: ObsArray,
    start: int,
    sizes: tuple[int, int, int],
) -> None:
    """List up to VISIBLE_CACHES caches with a centre within `reach` cells, nearest centre first, ties by slot."""
    alive, centre = caches.alive, caches.cell
    last_distance = -1.0
    last_slot = -1
    for place in range(VISIBLE_CACHES):
        best = -1
        best_distance = math.inf
        for slot in range(alive.shape[0]):
            if not alive[slot]:
                continue
            if abs(centre[slot, 0] - cell_x) > reach or abs(centre[slot, 1] - cell_y) > reach:
                continue
            dx = (centre[slot, 0] + 0.5) / CELLS_PER_M - position[i, 0]
            dy = (centre[slot, 1] + 0.5) / CELLS_PER_M - position[i, 1]
            distance = dx * dx + dy * dy
            listed = distance < last_distance or (distance == last_distance and slot <= last_slot)
            if not listed and distance < best_distance:
                best = slot
                best_distance = distance
        if best < 0:
            return
        fields = (caches.serial[best], centre[best, 0], centre[best, 1], caches.count[best])
        write_cache(obs, i, start + CACHE_FIELDS * place, fields, sizes)
        last_distance = best_distance
        last_slot = best


@kernel
def write_cache(
    obs: ObsArray, i: int, start: int, fields: tuple[int, int, int, int], sizes: tuple[int, int, int]
) -> None:
    """Write the fields of a cache into four columns of row i: serial x 2^-24, centre x, y as position, count / M.

    `fields` = serial, centre cell x, y, count; `sizes` = cells along x, along y, objects.
    """
    obs[i, start] = fields[0] / SERIAL_SCALE
    obs[i, start + 1] = (2 * fields[1] + 1) / sizes[0] - 1.0
    obs[i, start + 2] = (2 * fields[2] + 1) / sizes[1] - 1.0
    obs[i, start + 3] = fields[3] / sizes[2]
