"""Noise on observations, added to readings and clamped or turning the heading, and on wheels."""

import math

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.detection import sees_obstacle
from swarm_forage_env.contract.layout import RING_SENSORS
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
