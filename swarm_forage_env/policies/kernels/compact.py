"""The compact view of learners: sums, decisions and directions instead of single readings."""

import math

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.detection import is_obstacle_vector, ring_sum, sees_cache, sees_nest
from swarm_forage_env.contract.layout import GROUND_SENSORS, RING_SENSORS, WINDOW_CELLS
from swarm_forage_env.contract.types import ObsArray
from swarm_forage_env.scenarios.floor import CELLS_PER_M

COMPACT_COLUMNS = 23
VIEW_REACH_M = 1.0
"""Distance at which a direction gets length 1: the side of the line-of-sight window."""
_TIE_M2 = 1e-6
"""Squared distances that differ by less count as equal, so that rounding does not decide."""
_HALF_WINDOW = WINDOW_CELLS // 2
_WINDOW = WINDOW_CELLS * WINDOW_CELLS
_OWN_CELL = _WINDOW // 2


@kernel
def is_over_object(row: ObsArray, object_start: int) -> bool:
    """Return whether a free object lies in the robot's own cell, the centre of its line-of-sight window."""
    return row[object_start + _OWN_CELL] > 0.0


@kernel
def nearest_object(row: ObsArray, starts: tuple[int, int, int], half_x: float, half_y: float) -> tuple[float, float]:
    """Vector in m, along the axes of the arena, to the nearest object in view; (inf, inf) when there is none.

    Ties go to the first in the order of the window. `starts` = first columns of position, los_cell, los_object;
    `half_x`, `half_y` = half the arena, m.
    """
    position, own_cell, window = starts
    # The sensed position, which noise may disturb, kept inside the robot's cell, which is exact.
    reach = 0.5 / CELLS_PER_M
    off_x = min(reach, max(-reach, (row[position] - row[own_cell]) * half_x))
    off_y = min(reach, max(-reach, (row[position + 1] - row[own_cell + 1]) * half_y))
    best_x = math.inf
    best_y = math.inf
    best = math.inf
    for k in range(_WINDOW):
        if row[window + k] > 0.0:
            x = (k % WINDOW_CELLS - _HALF_WINDOW) / CELLS_PER_M - off_x
            y = (k // WINDOW_CELLS - _HALF_WINDOW) / CELLS_PER_M - off_y
            if x * x + y * y < best - _TIE_M2:
                best = x * x + y * y
                best_x = x
                best_y = y
    return best_x, best_y


@kernel
def nearest_cache(row: ObsArray, starts: tuple[int, int], half_x: float, half_y: float) -> tuple[float, float]:
    """Vector in m, along the axes of the arena, to the centre of the nearest visible cache; (inf, inf) without one.

    `starts` = first columns of position, los_cache.
    """
    position, caches = starts
    if row[caches] == 0.0:
        return math.inf, math.inf
    return (row[caches + 1] - row[position]) * half_x, (row[caches + 2] - row[position + 1]) * half_y


@kernel
def write_direction(out: ObsArray, at: int, x: float, y: float, cos: float, sin: float) -> None:
    """Write a vector into three columns: forward and left over VIEW_REACH_M, cut to length 1; whether there is one."""
    if x == math.inf:
        out[at] = 0.0
        out[at + 1] = 0.0
        out[at + 2] = 0.0
        return
    share = 1.0 / max(VIEW_REACH_M, math.sqrt(x * x + y * y))
    out[at] = (x * cos + y * sin) * share
    out[at + 1] = (y * cos - x * sin) * share
    out[at + 2] = 1.0


@kernel
def compact_view(
    obs: ObsArray, starts: tuple[int, ...], half_x: float, half_y: float, behind_counts: bool, out: ObsArray
) -> None:
    """Write the compact view (N, COMPACT_COLUMNS) of observations (N, D); rows of zeros stay zeros.

    `starts` = first columns of proximity, light, ground, wheel_speed, position, heading, carrying, interacting,
    active, los_cell, los_object, los_cache; `half_x`, `half_y` = half the arena, m; `behind_counts` = quirk
    `obstacle_behind_counts`.
    """
    for i in range(obs.shape[0]):
        row = obs[i]
        view = out[i]
        heading = starts[5]
        cos = row[heading]
        sin = row[heading + 1]
        if cos == 0.0 and sin == 0.0:  # not in the world
            view[:] = 0.0
            continue
        x, y = ring_sum(row[starts[0] : starts[0] + RING_SENSORS])
        share = 1.0 / max(1.0, math.sqrt(x * x + y * y))
        view[0] = x * share
        view[1] = y * share
        view[2] = 1.0 if is_obstacle_vector(x, y, behind_counts) else 0.0
        x, y = ring_sum(row[starts[1] : starts[1] + RING_SENSORS])
        length = math.sqrt(x * x + y * y)
        share = 1.0 / length if length > 0.0 else 0.0
        view[3] = x * share
        view[4] = y * share
        ground = row[starts[2] : starts[2] + GROUND_SENSORS]
        view[5] = 1.0 if is_over_object(row, starts[10]) else 0.0
        view[6] = 1.0 if sees_nest(ground) else 0.0
        view[7] = 1.0 if sees_cache(ground) else 0.0
        for k in range(6):  # wheel_speed, position, heading
            view[8 + k] = row[starts[3 + k // 2] + k % 2]
        for k in range(3):  # carrying, interacting, active
            view[14 + k] = row[starts[6 + k]]
        x, y = nearest_object(row, (starts[4], starts[9], starts[10]), half_x, half_y)
        write_direction(view, 17, x, y, cos, sin)
        x, y = nearest_cache(row, (starts[4], starts[11]), half_x, half_y)
        write_direction(view, 20, x, y, cos, sin)
