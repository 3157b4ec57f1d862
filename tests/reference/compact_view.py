"""Slow twin of the compact view, from the named slices of the observation row."""

import math

import numpy as np

from swarm_forage_env.contract.layout import ObservationLayout

RING = [math.radians(7.5 + 15 * k) for k in range(24)]


def ring_vector(readings: np.ndarray) -> tuple[float, float]:
    """Sum of 24 readings as vectors, forward and left."""
    return (
        sum(float(reading) * math.cos(angle) for reading, angle in zip(readings, RING, strict=True)),
        sum(float(reading) * math.sin(angle) for reading, angle in zip(readings, RING, strict=True)),
    )


def in_band(ground: np.ndarray, low: float, high: float) -> int:
    """How many ground readings lie in a band."""
    return sum(low - 1e-6 <= reading <= high + 1e-6 for reading in ground)


def direction(dx: float, dy: float, cos: float, sin: float) -> list[float]:
    """Forward and left share of a vector in m, cut to length 1; and that there is one."""
    length = max(1.0, math.hypot(dx, dy))
    return [(dx * cos + dy * sin) / length, (dy * cos - dx * sin) / length, 1.0]


def compact_row(row: np.ndarray, layout: ObservationLayout, *, behind_counts: bool = False) -> list[float]:
    """One robot's compact view."""
    part = {name: row[layout[name]] for name in layout.names}
    cos, sin = (float(value) for value in part["heading"])
    if cos == 0.0 and sin == 0.0:
        return [0.0] * 23
    half_x, half_y = layout.part("position").scale
    x, y = float(part["position"][0]) * half_x, float(part["position"][1]) * half_y
    cell_x, cell_y = float(part["los_cell"][0]) * half_x, float(part["los_cell"][1]) * half_y

    px, py = ring_vector(part["proximity"])
    length = math.hypot(px, py)
    is_behind = abs(math.atan2(py, px)) > 2.61
    obstacle = length > 1e-6 if is_behind and behind_counts else length > 0.1 and not is_behind
    lx, ly = ring_vector(part["light"])
    light = math.hypot(lx, ly)

    thing, nearest = [0.0, 0.0, 0.0], math.inf
    at_x, at_y = min(max(x, cell_x - 0.1), cell_x + 0.1), min(max(y, cell_y - 0.1), cell_y + 0.1)
    for k in range(25):
        dx, dy = cell_x + (k % 5 - 2) * 0.2 - at_x, cell_y + (k // 5 - 2) * 0.2 - at_y
        if part["los_object"][k] > 0 and dx**2 + dy**2 < nearest - 1e-6:
            thing, nearest = direction(dx, dy, cos, sin), dx**2 + dy**2
    cache = [0.0, 0.0, 0.0]
    if part["los_cache"][0] > 0:
        dx, dy = float(part["los_cache"][1]) * half_x - x, float(part["los_cache"][2]) * half_y - y
        cache = direction(dx, dy, cos, sin)
    return [
        px / max(1.0, length),
        py / max(1.0, length),
        float(obstacle),
        lx / light if light else 0.0,
        ly / light if light else 0.0,
        float(part["los_object"][12] > 0),
        float(in_band(part["ground"], 0.6, 0.8) >= 3),
        float(in_band(part["ground"], 0.3, 0.5) >= 3),
        *part["wheel_speed"],
        *part["position"],
        *part["heading"],
        *part["carrying"],
        *part["interacting"],
        *part["active"],
        *thing,
        *cache,
    ]
