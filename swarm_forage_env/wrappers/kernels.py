"""Compiled functions of the wrappers: normal numbers, noise on observations and messages, gains of wheels.

Standard normal numbers come from uniform ones by the tabulated inverse of the distribution function. Noise needs
thousands of them in every tick; numpy's own normal draws take three times as long. float32 uniform draws are the
multiples of 2^-24, and each stands for one value: interpolated between 4,096 equally likely cells, or looked up one by
one in the outermost two. The distribution function is met to 2e-5 everywhere; no value is beyond 5.42.
"""

import math

import numpy as np
from scipy.special import ndtri

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.detection import sees_obstacle
from swarm_forage_env.contract.layout import NEIGHBOUR_FIELDS, RING_SENSORS
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.world.kernels.drive import limit_command
from swarm_forage_env.world.kernels.kinds import blank

_CELLS = 4096
_EDGES = np.zeros(_CELLS + 1, np.float32)
_EDGES[1:-1] = ndtri(np.arange(1, _CELLS) / _CELLS)
"""Edges of the cells; the outermost are infinite and never used."""
_TAIL = ndtri((np.arange(_CELLS) + 0.5) / _CELLS**2).astype(np.float32)
"""Values of the lowest cell."""

_N_CELLS = np.float32(_CELLS)
_HALF_STEP = np.float32(0.5 / _CELLS)
_FIRST_EDGE, _LAST_EDGE = np.float32(1.0), np.float32(_CELLS - 1)
NOT_NOISY = -1
"""In place of a column of draws: the heading is exact."""


@kernel
def to_normal(draws: ObsArray) -> None:
    """Turn uniform draws (N, C), multiples of 2^-24 in [0, 1), into standard normal ones, in place."""
    for i in range(draws.shape[0]):
        _row_to_normal(draws[i])


@kernel
def _row_to_normal(draws: ObsArray) -> None:
    has_outermost = False
    for k in range(draws.shape[0]):
        place = draws[k] * _N_CELLS
        has_outermost |= (place < _FIRST_EDGE) | (place >= _LAST_EDGE)
    if has_outermost:
        for k in range(draws.shape[0]):
            draws[k] = _normal(draws[k])
    else:  # without branches the processor works on many at a time
        for k in range(draws.shape[0]):
            place = draws[k] * _N_CELLS
            cell = np.uint32(place)
            draws[k] = _between_edges(cell, place - np.float32(cell))


@kernel
def _normal(draw: np.float32) -> np.float32:
    place = draw * _N_CELLS
    cell = np.uint32(place)
    within = place - np.float32(cell)
    if place < _FIRST_EDGE:
        return _TAIL[np.uint32(within * _N_CELLS)]
    if place >= _LAST_EDGE:
        return -_TAIL[np.uint32(_CELLS - 1) - np.uint32(within * _N_CELLS)]
    return _between_edges(cell, within)


@kernel
def _between_edges(cell: np.uint32, within: np.float32) -> np.float32:
    return _EDGES[cell] + (_EDGES[cell + np.uint32(1)] - _EDGES[cell]) * (within + _HALF_STEP)


@kernel
def disturb(
    obs: ObsArray,
    present: BoolArray,
    active: BoolArray,
    draws: ObsArray,
    is_uniform: bool,
    factors: ObsArray,
    spans: IntArray,
    lows: ObsArray,
    heading: tuple[int, int],
    blanks: IntArray,
    proximity: int,
    behind_counts: bool,
) -> float:
    """Add noise to the rows of present robots, and return the share of active robots that then see an obstacle.

    Args:
        obs: (N, D), edited.
        present: (N,) robots with a body; other rows stay as they are.
        active: (N,) robots at work.
        draws: (N, C) float32 uniform in [0, 1), one per robot and noisy column; edited.
        is_uniform: Whether noise is uniform; else draws are made normal first.
        factors: (C,) float32, observation units per unit of draw.
        spans: (S, 3) runs of neighbouring columns: first in obs, first in draws, length.
        lows: (S,) float32, lower clamp of each run.
        heading: First column of the heading in obs, and its column in draws, or `NOT_NOISY`.
        blanks: (B, 4) what stays zero, as `world.kernels.kinds.blank` takes it: a sensor that is lacking has no noise.
        proximity: First column of the proximity readings.
        behind_counts: Quirk `obstacle_behind_counts`.

    Returns:
        The share, 0 if no robot is active.
    """
    if not is_uniform:
        to_normal(draws)
    centre = 0.5 if is_uniform else 0.0
    n_active = 0
    n_seeing = 0
    for i in range(obs.shape[0]):
        if present[i]:
            _perturb_readings(obs[i], draws[i], centre, factors, spans, lows)
            if heading[1] != NOT_NOISY:
                _turn_heading(obs[i], heading[0], (float(draws[i, heading[1]]) - centre) * float(factors[heading[1]]))
    blank(obs, blanks)
    for i in range(obs.shape[0]):
        if active[i]:
            n_active += 1
            n_seeing += sees_obstacle(obs[i, proximity : proximity + RING_SENSORS], behind_counts)
    return n_seeing / n_active if n_active > 0 else 0.0


@kernel
def _perturb_readings(
    obs: ObsArray, draws: ObsArray, centre: float, factors: ObsArray, spans: IntArray, lows: ObsArray
) -> None:
    """Add (draw - centre) * factor to columns of one row and clamp them to [low, 1]; arguments as in `disturb`."""
    one = lows.dtype.type(1.0)
    shift = lows.dtype.type(centre)
    for span in range(spans.shape[0]):
        low = lows[span]
        size = spans[span, 2]
        row = obs[spans[span, 0] : spans[span, 0] + size]
        draw = draws[spans[span, 1] : spans[span, 1] + size]
        factor = factors[spans[span, 1] : spans[span, 1] + size]
        for k in range(size):
            row[k] = min(one, max(low, row[k] + (draw[k] - shift) * factor[k]))


@kernel
def _turn_heading(obs: ObsArray, start: int, angle: float) -> None:
    """Turn the heading (cos, sin), two columns of one row from `start`, by an angle in rad."""
    cos = math.cos(angle)
    sin = math.sin(angle)
    x = float(obs[start])
    y = float(obs[start + 1])
    # Rounding to float32 can leave the unit circle by one unit in the last place.
    obs[start] = min(1.0, max(-1.0, x * cos - y * sin))
    obs[start + 1] = min(1.0, max(-1.0, x * sin + y * cos))


@kernel
def shift_neighbours(
    obs: ObsArray, draws: ObsArray, centre: float, factors: ObsArray, start: int, first: int, n_seen: int
) -> None:
    """Add (draw - centre) * factor to forward and left of neighbours that are there, and clamp them to [-1, 1].

    Args:
        obs: (N, D), edited.
        draws: (N, C) float32, two per robot and neighbour.
        centre: Mean of the draws.
        factors: (C,) float32.
        start: First column of the neighbours in `obs`.
        first: Their first column in `draws` and `factors`.
        n_seen: Neighbours that an observation has room for.
    """
    one = draws.dtype.type(1.0)
    shift = draws.dtype.type(centre)
    for i in range(obs.shape[0]):
        for k in range(n_seen):
            at = start + NEIGHBOUR_FIELDS * k
            if obs[i, at + NEIGHBOUR_FIELDS - 1] > 0.0:
                for axis in range(2):
                    column = first + 2 * k + axis
                    noise = (draws[i, column] - shift) * factors[column]
                    obs[i, at + axis] = min(one, max(-one, obs[i, at + axis] + noise))


@kernel
def garble(obs: ObsArray, draws: ObsArray, lost: FloatArray, start: int, factor: float, loss: float, size: int) -> None:
    """Disturb what was heard: some robots hear nothing, the others get draw * factor added, clamped to [-1, 1].

    Args:
        obs: (N, D), edited.
        draws: (N, m) float32, standard normal.
        lost: (N,) uniform in [0, 1).
        start: First column of the messages in `obs`.
        factor: Standard deviation of the noise.
        loss: Probability that a robot hears nothing.
        size: m, numbers of a message; the column after them is 1 where anything was heard.
    """
    one = draws.dtype.type(1.0)
    scale = draws.dtype.type(factor)
    for i in range(obs.shape[0]):
        if obs[i, start + size] == 0.0:
            continue
        if lost[i] < loss:
            obs[i, start : start + size + 1] = 0.0
            continue
        for k in range(size):
            obs[i, start + k] = min(one, max(-one, obs[i, start + k] + draws[i, k] * scale))


@kernel
def throttle(
    actions: ActionArray,
    strength: float,
    only_carriers: bool,
    carried_object: IntArray,
    limits: FloatArray,
    outer_gain: FloatArray,
    wheel_gain: FloatArray,
) -> None:
    """Write the gains `outer_gain` of both wheels, times 1 - strength |l + r| / (|l| + |r|), into `wheel_gain`; (N, 2).

    l and r are the limited commands in m/s. The factor is 1 - strength with both wheels forward and 1 on the spot, and
    continuous in between. Gains of robots with standing wheels stay; with `only_carriers`, those of robots without an
    object stay, too. `limits` as in `world.kernels.drive.drive`.
    """
    scale, max_speed, max_difference = limits[0], limits[1], limits[2]
    for i in range(carried_object.shape[0]):
        wheel_gain[i, 0] = outer_gain[i, 0]
        wheel_gain[i, 1] = outer_gain[i, 1]
        if only_carriers and carried_object[i] < 0:
            continue
        left, right = limit_command(float(actions[i, 0]), float(actions[i, 1]), scale, max_speed, max_difference)
        total = abs(left) + abs(right)
        if total > 0.0:
            factor = 1.0 - strength * (abs(left + right) / total)
            wheel_gain[i, 0] *= factor
            wheel_gain[i, 1] *= factor


@kernel
def noisy_gain(
    draws: ObsArray, is_uniform: bool, factor: float, outer_gain: FloatArray, wheel_gain: FloatArray
) -> None:
    """Write outer_gain * (1 + noise * factor) into `wheel_gain`; all (N, 2). The first two as in `disturb`."""
    if not is_uniform:
        to_normal(draws)
    centre = 0.5 if is_uniform else 0.0
    for i in range(draws.shape[0]):
        for wheel in range(2):
            wheel_gain[i, wheel] = outer_gain[i, wheel] * (1.0 + (float(draws[i, wheel]) - centre) * factor)
