"""What wrappers do to robots in each tick: throttle, noise on wheels, and on observations.

Noise needs thousands of random numbers in every tick, so it has a generator of its own: xoshiro128+ (Blackman and
Vigna, 2021), `LANES` of them side by side, because a processor works on many at a time. numpy takes four times as long.

Standard normal numbers come from random bits by the tabulated inverse of the distribution function. The upper 24 of 32
bits count, and each of their values stands for one number: interpolated between 4,096 equally likely cells, or looked
up one by one in the outermost two. The distribution function is met to 2e-5 everywhere; no value is beyond 5.42.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ndtri

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.detection import sees_obstacle
from swarm_forage_env.contract.layout import RING_SENSORS
from swarm_forage_env.contract.types import ActionArray, BitArray, BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.world.kernels.drive import limit_command, sinc_and_cosine

_CELLS = 4096
_EDGES = np.zeros(_CELLS + 1, np.float32)
_EDGES[1:-1] = ndtri(np.arange(1, _CELLS) / _CELLS)
"""Edges of the cells; the outermost are infinite and never used."""
_TAIL = ndtri((np.arange(_CELLS) + 0.5) / _CELLS**2).astype(np.float32)
"""Values of the lowest cell."""

_OF_CELL, _WITHIN = np.uint32(20), np.uint32(8)
"""Of 32 bits the upper 12 say which cell, and the next 12 where in it."""
_LAST, _ONE = np.uint32(_CELLS - 1), np.uint32(1)
_STEP, _HALF_STEP = np.float32(1.0 / _CELLS), np.float32(0.5 / _CELLS)
LANES = 64
"""Generators side by side: number k comes from the one of k modulo this."""
_ALL_BITS = np.uint64(2**32 - 1)
_SHIFT, _LEFT, _RIGHT = np.uint32(9), np.uint32(11), np.uint32(21)
NOT_NOISY = -1
"""In place of a column of draws: the heading is exact."""


class Noise(NamedTuple):
    """Which columns of an observation are noisy, and how."""

    spans: IntArray
    """(S, 4) runs of neighbouring columns: first in obs, first in draws, length, 1 = only carriers read them."""
    lows: ObsArray
    """(C,) float32, lower clamp of each column of draws."""
    heading: tuple[int, int]
    """First column of the heading in obs, and its column in draws, or `NOT_NOISY`."""


def new_lanes(rng: np.random.Generator) -> BitArray:
    """Return the state (4, LANES) of a generator for `draw_bits`."""
    return rng.integers(2**32, size=(4, LANES), dtype=np.uint32)


def room_for_draws(n_draws: int) -> BitArray:
    """Return room for at least so many random numbers, as `draw_bits` fills it."""
    return np.zeros(-(-n_draws // LANES) * LANES, np.uint32)


def no_noise() -> Noise:
    """Return noise on nothing."""
    return Noise(np.zeros((0, 4), np.int32), np.zeros(0, np.float32), (0, NOT_NOISY))


class Disturbances(NamedTuple):
    """What wrappers do in some ticks that follow each other; as it is made here, nothing.

    `tick.run` takes it.
    """

    throttles: FloatArray = np.zeros(0)
    """(ticks,) strength in each; (0,) without."""
    only_carriers: bool = False
    """Whether only robots that carry are throttled."""
    wheel_lanes: BitArray = np.zeros((0, LANES), np.uint32)
    """(4, LANES) generator of noise on wheels, see `draw_bits`; (0, LANES) without."""
    wheel_draws: BitArray = np.zeros(0, np.uint32)
    """(2 N or more,) scratch for its numbers."""
    wheel_factors: FloatArray = np.zeros(0)
    """(ticks,) see `noisy_gain`."""
    gain: FloatArray = np.zeros((0, 2))
    """(N, 2) scratch for the gain of wheels; (0, 2) where nothing changes it."""
    lanes: BitArray = np.zeros((0, LANES), np.uint32)
    """(4, LANES) generator of noise on observations; (0, LANES) without."""
    draws: BitArray = np.zeros(0, np.uint32)
    """(N C or more,) scratch for its numbers."""
    factors: ObsArray = np.zeros((1, 0), np.float32)
    """(ticks, C), or (1, C) where they are always the same; see `disturb`."""
    noise: Noise = no_noise()
    believing: FloatArray = np.zeros(2)
    """Sum over ticks of the share of active robots that see an obstacle under noise, and how many ticks."""


@kernel
def draw_bits(lanes: BitArray, draws: BitArray) -> None:
    """Fill `draws` with 32 random bits each, of which the upper 24 are good.

    Args:
        lanes: (4, LANES), changed.
        draws: (n,), n a multiple of `LANES`.
    """
    state_0, state_1, state_2, state_3 = lanes[0], lanes[1], lanes[2], lanes[3]
    for first in range(0, draws.shape[0], LANES):
        block = draws[first : first + LANES]
        for lane in range(LANES):  # a known number: the processor works on many at a time
            a, b, c, d = state_0[lane], state_1[lane], state_2[lane], state_3[lane]
            block[lane] = np.uint32((np.uint64(a) + np.uint64(d)) & _ALL_BITS)
            c = np.uint32(c ^ a)
            d = np.uint32(d ^ b)
            state_0[lane] = np.uint32(a ^ d)
            state_1[lane] = np.uint32(b ^ c)
            state_2[lane] = np.uint32(c ^ np.uint32(b << _SHIFT))
            state_3[lane] = np.uint32((d << _LEFT) | (d >> _RIGHT))


@kernel
def standard(bits: np.uint32) -> np.float32:
    """Return a random number of the normal distribution with mean 0 and standard deviation 1."""
    cell = np.uint32(bits >> _OF_CELL)
    place = np.uint32((bits >> _WITHIN) & _LAST)
    if cell == 0:
        return _TAIL[place]
    if cell == _LAST:
        return -_TAIL[_LAST - place]
    return _between_edges(bits)


@part
def _between_edges(bits: np.uint32) -> np.float32:
    cell = np.uint32(bits >> _OF_CELL)
    within = np.float32(np.int32((bits >> _WITHIN) & _LAST)) * _STEP
    return _EDGES[cell] + (_EDGES[cell + _ONE] - _EDGES[cell]) * (within + _HALF_STEP)


@kernel
def disturb(
    obs: ObsArray,
    present: BoolArray,
    active: BoolArray,
    carried_object: IntArray,
    draws: BitArray,
    factors: ObsArray,
    noise: Noise,
    proximity: int,
    behind_counts: bool,
) -> float:
    """Add noise to the rows of present robots, and return the share of active robots that then see an obstacle.

    Args:
        obs: (N, D), edited.
        present: (N,) robots with a body; other rows stay as they are.
        active: (N,) robots at work.
        carried_object: (N,) row of the object that a robot carries, -1 for none.
        draws: (N C or more,) random bits, one number per robot and noisy column, robot by robot.
        factors: (C,) float32, observation units per unit of `standard`.
        noise: Which columns.
        proximity: First column of the proximity readings.
        behind_counts: Quirk `obstacle_behind_counts`.

    Returns:
        The share, 0 if no robot is active.
    """
    start, turned = noise.heading
    n_columns = factors.shape[0]
    n_active = 0
    n_seeing = 0
    for i in range(obs.shape[0]):
        if present[i]:
            own = draws[i * n_columns : (i + 1) * n_columns]
            for k in range(noise.spans.shape[0]):
                span = noise.spans[k]
                if span[3] == 0 or carried_object[i] >= 0:
                    row = obs[i, span[0] : span[0] + span[2]]
                    first, end = span[1], span[1] + span[2]
                    _add_noise(row, own[first:end], factors[first:end], noise.lows[first:end])
            if turned != NOT_NOISY:
                angle = np.float64(standard(own[turned])) * np.float64(factors[turned])
                _turn_heading(obs[i], start, angle)
        if active[i]:
            n_active += 1
            n_seeing += sees_obstacle(obs[i, proximity : proximity + RING_SENSORS], behind_counts)
    return n_seeing / n_active if n_active > 0 else 0.0


@part
def _add_noise(row: ObsArray, bits: BitArray, factors: ObsArray, lows: ObsArray) -> None:
    """Add random numbers times their factors to the columns of one run and clamp them to [low, 1]."""
    one, least, most = np.float32(1.0), bits[0], bits[0]
    for k in range(bits.shape[0]):
        least, most = min(least, bits[k]), max(most, bits[k])
    if least >> _OF_CELL == 0 or most >> _OF_CELL == _LAST:
        for k in range(bits.shape[0]):
            row[k] = min(one, max(lows[k], row[k] + standard(bits[k]) * factors[k]))
    else:  # without branches the processor works on many at a time
        for k in range(bits.shape[0]):
            row[k] = min(one, max(lows[k], row[k] + _between_edges(bits[k]) * factors[k]))


@part
def _turn_heading(obs: ObsArray, start: int, angle: float) -> None:
    """Turn the heading (cos, sin), two columns of one row from `start`, by an angle in rad."""
    sinc, cos = sinc_and_cosine(angle)
    sin = sinc * angle
    x = float(obs[start])
    y = float(obs[start + 1])
    # Rounding to float32 can leave the unit circle by one unit in the last place.
    obs[start] = min(1.0, max(-1.0, x * cos - y * sin))
    obs[start + 1] = min(1.0, max(-1.0, x * sin + y * cos))


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
def noisy_gain(draws: BitArray, factor: float, outer_gain: FloatArray, wheel_gain: FloatArray) -> None:
    """Write outer_gain * (1 + noise * factor) into `wheel_gain`, which may be the same array.

    Args:
        draws: (2 N or more,) random bits.
        factor: Per unit of `standard`.
        outer_gain: (N, 2).
        wheel_gain: (N, 2).
    """
    for i in range(wheel_gain.shape[0]):
        for wheel in range(2):
            noise = np.float64(standard(draws[2 * i + wheel])) * factor
            wheel_gain[i, wheel] = outer_gain[i, wheel] * (1.0 + noise)


@part
def disturb_wheels(
    d: Disturbances, k: int, actions: ActionArray, carried_object: IntArray, limits: FloatArray, outer_gain: FloatArray
) -> None:
    """Write the gain of wheels in tick `k` of `d`, if there is any, into its array; arguments as in `throttle`."""
    if d.gain.shape[0] == 0:
        return
    if d.throttles.shape[0] > 0 and d.throttles[k] > 0.0:
        throttle(actions, d.throttles[k], d.only_carriers, carried_object, limits, outer_gain, d.gain)
    else:
        for i in range(outer_gain.shape[0]):
            for wheel in range(2):
                d.gain[i, wheel] = outer_gain[i, wheel]
    if d.wheel_lanes.shape[0] > 0:
        draw_bits(d.wheel_lanes, d.wheel_draws)
        noisy_gain(d.wheel_draws, d.wheel_factors[k], d.gain, d.gain)
