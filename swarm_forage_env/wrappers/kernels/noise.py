"""Noise on observations, added to readings and clamped or turning the heading, and on wheels."""

import math

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.detection import sees_obstacle
from swarm_forage_env.contract.layout import NEIGHBOUR_FIELDS, RING_SENSORS
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray, ObsArray


@kernel
def perturb_readings(
    obs: ObsArray,
    present: BoolArray,
    draws: ObsArray,
    centre: float,
    factors: ObsArray,
    spans: IntArray,
    lows: ObsArray,
) -> None:
    """Add (draw - centre) * factor to columns of present robots and clamp them to [low, 1].

    Args:
        obs: (N, D), edited.
        present: (N,) robots with a body; other rows stay as they are.
        draws: (N, C) float32, one per robot and noisy column.
        centre: Mean of the draws.
        factors: (C,) float32, observation units per unit of draw.
        spans: (S, 3) runs of neighbouring columns: first in obs, first in draws, length.
        lows: (S,) float32, lower clamp of each run.
    """
    one = lows.dtype.type(1.0)
    shift = lows.dtype.type(centre)
    for i in range(obs.shape[0]):
        if not present[i]:
            continue
        for span in range(spans.shape[0]):
            low = lows[span]
            size = spans[span, 2]
            row = obs[i, spans[span, 0] : spans[span, 0] + size]
            draw = draws[i, spans[span, 1] : spans[span, 1] + size]
            factor = factors[spans[span, 1] : spans[span, 1] + size]
            for k in range(size):
                row[k] = min(one, max(low, row[k] + (draw[k] - shift) * factor[k]))


@kernel
def turn_heading(
    obs: ObsArray, present: BoolArray, draws: ObsArray, centre: float, factors: ObsArray, start: int, column: int
) -> None:
    """Turn the heading (cos, sin), two columns of `obs` from `start`, by (draw - centre) * factor rad.

    `column` is the heading's column in `draws` (N, C) and `factors` (C,); the rest as in `perturb_readings`.
    """
    factor = float(factors[column])
    for i in range(obs.shape[0]):
        if not present[i]:
            continue
        angle = (float(draws[i, column]) - centre) * factor
        cos = math.cos(angle)
        sin = math.sin(angle)
        x = float(obs[i, start])
        y = float(obs[i, start + 1])
        # Rounding to float32 can leave the unit circle by one unit in the last place.
        obs[i, start] = min(1.0, max(-1.0, x * cos - y * sin))
        obs[i, start + 1] = min(1.0, max(-1.0, x * sin + y * cos))


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
def share_that_sees_obstacles(obs: ObsArray, proximity: int, active: BoolArray, behind_counts: bool) -> float:
    """Share of active robots that see an obstacle in (N, D) observations; 0 if no robot is active.

    Args:
        obs: (N, D).
        proximity: First column of the proximity readings.
        active: (N,) robots at work.
        behind_counts: Quirk `obstacle_behind_counts`.
    """
    n_active = 0
    n_seeing = 0
    for i in range(obs.shape[0]):
        if active[i]:
            n_active += 1
            n_seeing += sees_obstacle(obs[i, proximity : proximity + RING_SENSORS], behind_counts)
    return n_seeing / n_active if n_active > 0 else 0.0


@kernel
def noisy_gain(draws: ObsArray, centre: float, factor: float, outer_gain: FloatArray, wheel_gain: FloatArray) -> None:
    """Write outer_gain * (1 + (draw - centre) * factor) into `wheel_gain`; all (N, 2)."""
    for i in range(draws.shape[0]):
        for wheel in range(2):
            wheel_gain[i, wheel] = outer_gain[i, wheel] * (1.0 + (float(draws[i, wheel]) - centre) * factor)
