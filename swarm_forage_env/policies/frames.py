"""Frames of robots' own: what a robot would see if its world were turned by quarter turns, or mirrored.

A policy that always sees the nest in the west learns the compass by heart. A world that is turned has the same physics,
so nothing in it needs to change: it is enough to turn what robots see of it. That moves columns and changes signs, and
is exact. `policies.kernels.frames` says when a robot takes which frame.
"""

import numpy as np

from swarm_forage_env.contract.layout import (
    CACHE_FIELDS,
    GROUND_SENSORS,
    NEIGHBOUR_FIELDS,
    NEIGHBOURS,
    RING_SENSORS,
    WINDOW_CELLS,
    ObservationLayout,
    ObservationSlice,
)
from swarm_forage_env.contract.types import IntArray, ObsArray
from swarm_forage_env.policies.kernels.frames import N_FRAMES, N_UPRIGHT, Frames

_ABSOLUTE = {"position": (0,), "heading": (0,), "los_cell": (0,), "event_cache": (1,)}
"""Slices with directions or places of the arena: the columns of x, each before its y."""
_AHEAD_LEFT = ("object", "cache", "pickup_site", "sighting_site")
"""Slices of the learner whose second column is to the left of the robot."""


TURNS = tuple(
    np.array([[mirror * cos, -sin], [mirror * sin, cos]], np.float32)
    for mirror in (1, -1)
    for cos, sin in ((1, 0), (0, 1), (-1, 0), (0, -1))
)
"""Per frame, (2, 2): what becomes of a vector (x, y) if the world is mirrored, x to -x, or not, and then turned
counter-clockwise by quarter turns. These are all ways to lay a rectangle along the axes."""


def frames_of(length: int, layout: ObservationLayout, n_robots: int) -> Frames:
    """Return what kernels need so that robots see the world in frames of their own.

    Args:
        length: Decisions for which a robot keeps a frame, 0 = all see the world as it is.
        layout: Columns of what they see.
        n_robots: Number of robots.
    """
    source, sign = zip(*(turned_columns(frame, layout) for frame in range(N_FRAMES)), strict=True)
    return Frames(
        length=length,
        source=np.array(source, np.int32),
        sign=np.array(sign, np.float32),
        taken=np.zeros(n_robots, np.int32),
        row=np.zeros(layout.size, np.float32),
    )


def turned_columns(frame: int, layout: ObservationLayout) -> tuple[IntArray, ObsArray]:
    """Return how rows with columns as in `layout` become those of the turned world: `rows[:, source] * sign`."""
    turn = TURNS[frame]
    source, sign = np.arange(layout.size, dtype=np.int32), np.ones(layout.size, np.float32)
    for part in layout:
        own_source, own_sign = source[part.start : part.stop], sign[part.start : part.stop]
        for x in _places_of_x(part):
            own_source[x : x + 2] = part.start + x + np.abs(turn).argmax(axis=1)
            own_sign[x : x + 2] = turn.sum(axis=1)
        if part.name == "los_object":
            own_source[:] = part.start + _window(turn)
        elif frame >= N_UPRIGHT:
            own_source[:] = own_source[_mirrored_order(part)]
            own_sign[_places_of_left(part)] = -1.0
    return source, sign


def _places_of_x(part: ObservationSlice) -> list[int]:
    """Columns of a slice with the x of a place or direction in the arena; y stands behind each."""
    if part.name == "los_cache":
        return list(range(1, part.size, CACHE_FIELDS))
    return list(_ABSOLUTE.get(part.name, ()))


def _places_of_left(part: ObservationSlice) -> list[int]:
    """Columns of a slice that count how far something is to the left of the robot."""
    if part.name == NEIGHBOURS:
        return list(range(1, part.size, NEIGHBOUR_FIELDS))
    is_sum = part.name in ("proximity", "light") and part.size < RING_SENSORS
    return [1] if is_sum or part.name in _AHEAD_LEFT else []


def _mirrored_order(part: ObservationSlice) -> np.ndarray:
    """Where the columns of a slice come from in a mirrored world: what is left and right of the robot changes place."""
    order = np.arange(part.size)
    if part.size == RING_SENSORS and part.name in ("proximity", "light"):
        return order[::-1]
    if part.name == "wheel_speed" or (part.name == "ground" and part.size == GROUND_SENSORS):
        return order ^ 1
    return order


def _window(turn: ObsArray) -> np.ndarray:
    """Where the cells of the line-of-sight window come from, row by row from the lower left."""
    half = WINDOW_CELLS // 2
    dy, dx = np.divmod(np.arange(WINDOW_CELLS**2), WINDOW_CELLS) - np.array(half)
    x, y = turn.T.astype(int) @ np.array([dx, dy])
    return (y + half) * WINDOW_CELLS + x + half
