"""What robots sense of the floor and the light above it: ground readings, nest light, line-of-sight window."""

import math

import numpy as np

from swarm_forage_env._internal.compiling import inline_kernel, kernel, part
from swarm_forage_env._internal.prefetching import AHEAD, LARGE, prefetch
from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY, CELL_OBJECT
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
from swarm_forage_env.world.state import CHANGES, CacheState

GROUND_X_M = np.array([0.063, 0.063, -0.063, -0.063])
"""Places of the ground sensors in the robot's frame, ahead of its centre."""
GROUND_Y_M = np.array([0.0116, -0.0116, 0.0116, -0.0116])
"""To its left."""
_GROUND_REACH_M = 0.065
"""No ground sensor is farther from the robot's centre."""
_GREYS = np.array([102.0 / 255.0, 1.0, 179.0 / 255.0, 1.0, 0.0])
"""Grey levels of the codes of `contract.codes` from CELL_CACHE to CELL_OBJECT: cache, obstacle, nest, empty, object."""
_LIGHT_CUTOFF = 2.5
"""Scaled distance beyond which a light is not seen."""
_LIGHT_AXES = BEAM_ANGLES_RAD / (0.5 * math.pi)
"""Directions of the light sensors in quarter turns."""
_FADING = 1.0 / np.array([1.0, 1.0, 2.0, 6.0, 24.0, 120.0, 720.0, 5040.0])
"""Coefficients of the series of exp."""
_ARC_EVEN = np.array(
    [0.6366197702492, 0.1273184146210, 0.0702105755704, 0.0416437300056, 0.0130302611431, 0.0005968716807]
)
_ARC_ODD = np.array([-0.2122063918863, -0.0908738576302, -0.0554741666688, -0.0267941545525, -0.0040710524424])
"""Coefficients of t, t^5, ... and of t^3, t^7, ... in `quarter_turns`, fitted so that the largest error is least."""
_HALF_WINDOW = WINDOW_CELLS // 2


@part
def ground(
    position: FloatArray, facing: FloatArray, present: BoolArray, floor: IntArray, obs: ObsArray, start: int
) -> None:
    """Write four grey readings per robot into obs[:, start:start + 4]; outside the grid reads empty."""
    ny, nx = floor.shape
    n_robots = position.shape[0]
    for i in range(n_robots):
        if n_robots >= LARGE:
            ahead = min(i + AHEAD, n_robots - 1)
            byte = int(position[ahead, 0] * CELLS_PER_M) * floor.itemsize
            prefetch(floor, int((position[ahead, 1] - _GROUND_REACH_M) * CELLS_PER_M), byte)
            prefetch(floor, int((position[ahead, 1] + _GROUND_REACH_M) * CELLS_PER_M), byte)
        if not present[i]:
            obs[i, start : start + GROUND_SENSORS] = 0.0
            continue
        cos = facing[i, 0]
        sin = facing[i, 1]
        for k in range(GROUND_SENSORS):
            x = position[i, 0] + cos * GROUND_X_M[k] - sin * GROUND_Y_M[k]
            y = position[i, 1] + sin * GROUND_X_M[k] + cos * GROUND_Y_M[k]
            cell_x = int(x * CELLS_PER_M)
            cell_y = int(y * CELLS_PER_M)
            inside = x >= 0.0 and y >= 0.0 and cell_x < nx and cell_y < ny
            code = floor[cell_y, cell_x] if inside else CELL_EMPTY
            obs[i, start + k] = _GREYS[min(CELL_OBJECT, max(code, CELL_CACHE)) - CELL_CACHE]


@part
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
    lit: BoolArray,
    kept: bool,
    seen: FloatArray,
) -> None:
    """Write the ring of light readings of each robot into the columns of `obs` from `start`.

    Per light of `lights` (L, 3: x, y, height in m): exp(-2 distance / intensity), falling linearly to 0 at
    90 degrees between sensor axis and light; lights add up; clamped to 1. With `of_carriers_only` the rows of robots
    that carry nothing stay zero. Writes into `lit` (N,) who looks for lights; `kept`: it and `obs` are as the last call
    left them, so the rows of all that did not look are zeros already. `seen` (2, N) is scratch.
    """
    for i in range(position.shape[0]):
        if lit[i] or not kept:
            obs[i, start : start + RING_SENSORS] = 0.0
        lit[i] = present[i] and not (of_carriers_only and carried_object[i] < 0)
    for lamp in range(lights.shape[0]):
        _look_at(position, facing, (lights[lamp, 0], lights[lamp, 1], lights[lamp, 2]), intensity, seen[0], seen[1])
        for i in range(position.shape[0]):
            base = seen[0, i]
            bearing = seen[1, i]
            if lit[i] and base > 0.0:
                row = obs[i, start : start + RING_SENSORS]
                for k in range(RING_SENSORS):  # all of them, without a branch: processors take several at once
                    away = 2.0 - abs(abs(_LIGHT_AXES[k] - bearing) - 2.0)
                    row[k] = min(1.0, row[k] + base * max(0.0, 1.0 - away))


@part
def _look_at(
    position: FloatArray,
    facing: FloatArray,
    lamp: tuple[float, float, float],
    intensity: float,
    base: Row,
    bearing: Row,
) -> None:
    """Write what every robot reads of a lamp head-on, 0 beyond the cutoff, and where it is, in quarter turns.

    Flat arrays have steps that are known when this is compiled, and there is no branch: so processors take several
    robots at once.
    """
    x, y, height = lamp
    farthest = _LIGHT_CUTOFF * intensity
    place, ahead = position.reshape(position.size), facing.reshape(facing.size)
    for i in range(base.shape[0]):
        dx = x - place[2 * i]
        dy = y - place[2 * i + 1]
        cos = ahead[2 * i]
        sin = ahead[2 * i + 1]
        distance = math.sqrt(dx * dx + dy * dy + height * height)
        share = fading(distance / intensity)
        base[i] = share if distance <= farthest else 0.0
        bearing[i] = quarter_turns(dx * cos + dy * sin, dy * cos - dx * sin)


@kernel
def fading(scaled: float) -> float:
    """Return exp(-2 scaled) for distances that are seen, within 1e-9 of it: the 32nd power of a series."""
    x = -0.0625 * scaled
    square = x * x
    low = (1.0 + x) + square * (_FADING[2] + x * _FADING[3])
    high = (_FADING[4] + x * _FADING[5]) + square * (_FADING[6] + x * _FADING[7])
    share = low + square * square * high
    for _ in range(5):
        share *= share
    return share


@kernel
def quarter_turns(x: float, y: float) -> float:
    """Direction of (x, y) in quarter turns from the x axis, counter-clockwise, 0 to 4, within 1e-10; 0 for (0, 0)."""
    along = abs(x)
    across = abs(y)
    slope = min(along, across) / max(along, across, 1e-300)
    square = slope * slope
    step = square * square
    even = 0.0
    odd = 0.0
    for k in range(_ARC_EVEN.shape[0] - 1, -1, -1):
        even = even * step + _ARC_EVEN[k]
    for k in range(_ARC_ODD.shape[0] - 1, -1, -1):
        odd = odd * step + _ARC_ODD[k]
    turn = slope * (even + square * odd)
    turn = 1.0 - turn if across > along else turn
    turn = 2.0 - turn if x < 0.0 else turn
    return 4.0 - turn if y < 0.0 else turn


@part
def note_change(changed: IntArray, x: int, y: int) -> None:
    """Add a square to the list `Requests.changed`."""
    n_changed = changed[-1, 0]
    if n_changed < CHANGES:
        changed[n_changed, 0] = x
        changed[n_changed, 1] = y
    changed[-1, 0] = n_changed + 1


@part
def _is_near_change(changed: IntArray, cell_x: int, cell_y: int) -> bool:
    """Whether a square in the window around a cell has changed."""
    for k in range(changed[-1, 0]):
        if max(abs(changed[k, 0] - cell_x), abs(changed[k, 1] - cell_y)) <= _HALF_WINDOW:
            return True
    return False


@inline_kernel
def line_of_sight(
    position: FloatArray,
    present: BoolArray,
    floor: IntArray,
    changed: IntArray,
    kept: bool,
    shares: ObsArray,
    caches: CacheState,
    half_side: int,
    obs: ObsArray,
    starts: tuple[int, int, int],
) -> None:
    """Write the robot's cell, the objects of its 5 x 5 window and the caches that meet it.

    `changed` = see `Requests`; `kept`: `obs` is as the last call left it, so that only robots that have come to another
    cell, or near a change, or see caches, look again;
    `shares` (M + 1,) = what is written for no object, and for each object (row + 1) / M;
    `half_side` = (cache side in squares - 1) / 2; `starts` = first columns of los_cell, los_object, los_cache.
    """
    ny, nx = floor.shape
    cell_start, object_start, cache_start = starts
    n_objects = shares.shape[0] - 1
    n_slots = caches.alive.shape[0]
    lists_changes = kept and changed[-1, 0] <= CHANGES
    while n_slots > 0 and not caches.alive[n_slots - 1]:  # new caches take the first free slot, so few are in use
        n_slots -= 1
    for i in range(position.shape[0]):
        if not present[i]:
            for k in range(cell_start, cache_start + CACHE_FIELDS * VISIBLE_CACHES):
                obs[i, k] = 0.0
            continue
        cell_x = min(nx - 1, max(0, int(position[i, 0] * CELLS_PER_M)))
        cell_y = min(ny - 1, max(0, int(position[i, 1] * CELLS_PER_M)))
        here_x = np.float32((2 * cell_x + 1) / nx - 1.0)
        here_y = np.float32((2 * cell_y + 1) / ny - 1.0)
        stays = lists_changes and obs[i, cell_start] == here_x and obs[i, cell_start + 1] == here_y
        stays = stays and not _is_near_change(changed, cell_x, cell_y)
        if not stays:
            obs[i, cell_start] = here_x
            obs[i, cell_start + 1] = here_y
            window = obs[i, object_start:cache_start]
            if _HALF_WINDOW <= cell_x < nx - _HALF_WINDOW and _HALF_WINDOW <= cell_y < ny - _HALF_WINDOW:
                _whole_window(floor, cell_x - _HALF_WINDOW, cell_y - _HALF_WINDOW, shares, window)
            else:
                _cut_window(floor, cell_x - _HALF_WINDOW, cell_y - _HALF_WINDOW, shares, window)
        if stays and obs[i, cache_start] == 0.0:  # none in sight; a new one, or the end of one, changes many squares
            continue
        for k in range(cache_start, cache_start + CACHE_FIELDS * VISIBLE_CACHES):
            obs[i, k] = 0.0
        if n_slots > 0:
            reach = half_side + _HALF_WINDOW
            _visible_caches(cell_x, cell_y, position, caches, n_slots, reach, i, obs, cache_start, (nx, ny, n_objects))


@part
def _whole_window(floor: IntArray, x_low: int, y_low: int, shares: ObsArray, window: ObsArray) -> None:
    """Write the objects of a window inside of the floor. Without a branch: where objects lie cannot be foreseen."""
    for y in range(WINDOW_CELLS):
        for x in range(WINDOW_CELLS):
            window[y * WINDOW_CELLS + x] = shares[max(floor[y_low + y, x_low + x], CELL_EMPTY)]


@part
def _cut_window(floor: IntArray, x_low: int, y_low: int, shares: ObsArray, window: ObsArray) -> None:
    """Write the objects of a window at the border; cells outside of the floor hold none."""
    ny, nx = floor.shape
    for y in range(WINDOW_CELLS):
        for x in range(WINDOW_CELLS):
            inside = 0 <= x_low + x < nx and 0 <= y_low + y < ny
            window[y * WINDOW_CELLS + x] = shares[max(floor[y_low + y, x_low + x], CELL_EMPTY)] if inside else 0.0


@part
def _visible_caches(
    cell_x: int,
    cell_y: int,
    position: FloatArray,
    caches: CacheState,
    n_slots: int,
    reach: int,
    i: int,
    obs: ObsArray,
    start: int,
    sizes: tuple[int, int, int],
) -> None:
    """List up to VISIBLE_CACHES caches with a centre within `reach` cells, nearest centre first, ties by slot.

    Slots from `n_slots` on hold none.
    """
    alive, centre = caches.alive, caches.cell
    last_distance = -1.0
    last_slot = -1
    for place in range(VISIBLE_CACHES):
        best = -1
        best_distance = math.inf
        for slot in range(n_slots):
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


@part
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
