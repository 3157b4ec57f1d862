"""Frames of robots' own: what a robot would see if its world were turned by quarter turns, or mirrored.

A policy that always sees the nest in the west learns the compass by heart. A world that is turned has the same physics,
so nothing in it needs to change: it is enough to turn what robots see of it. That moves columns and changes signs, and
is exact. `policies.kernels.frames` says when a robot takes which frame.
"""

from dataclasses import dataclass
from typing import NamedTuple

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
from swarm_forage_env.policies.kernels.frames import N_FRAMES, Frames

_ABSOLUTE = {"position": (0,), "heading": (0,), "los_cell": (0,), "event_cache": (1,)}
"""Slices with directions or places of the arena: the columns of x, each before its y."""
_AHEAD_LEFT = ("object", "cache", "pickup_site", "sighting_site")
"""Slices of the learner whose second column is to the left of the robot."""


class TurnedColumns(NamedTuple):
    """How columns of a turned row come from those of the row as it is: `row[:, source] * sign`."""

    source: IntArray
    sign: ObsArray


@dataclass(frozen=True, slots=True)
class Turn:
    """The world mirrored, if it is, from left to right (x becomes -x), and then turned counter-clockwise."""

    quarters: int = 0
    """Quarter turns, 0 to 3."""
    is_mirrored: bool = False

    @property
    def matrix(self) -> np.ndarray:
        """(2, 2) float32: what becomes of a vector (x, y)."""
        cos, sin = ((1, 0), (0, 1), (-1, 0), (0, -1))[self.quarters]
        mirror = -1 if self.is_mirrored else 1
        return np.array([[cos * mirror, -sin], [sin * mirror, cos]], np.float32)


TURNS = tuple(Turn(quarters, is_mirrored) for is_mirrored in (False, True) for quarters in range(4))
"""All ways to lay a rectangle along the axes."""


def frames_of(length: int, layout: ObservationLayout, n_robots: int) -> Frames:
    """Return what kernels need so that robots see the world in frames of their own.

    Args:
        length: Decisions for which a robot keeps a frame, 0 = all see the world as it is.
        layout: Columns of what they see.
        n_robots: Number of robots.
    """
    columns = [turned_columns(turn, layout) for turn in TURNS]
    assert len(columns) == N_FRAMES
    return Frames(
        length=length,
        source=np.array([each.source for each in columns], np.int32),
        sign=np.array([each.sign for each in columns], np.float32),
        taken=np.zeros(n_robots, np.int32),
        row=np.zeros(layout.size, np.float32),
    )


def turned_columns(turn: Turn, layout: ObservationLayout) -> TurnedColumns:
    """Return how a row with columns as in `layout` becomes that of the turned world."""
    source, sign = np.arange(layout.size, dtype=np.int32), np.ones(layout.size, np.float32)
    for part in layout:
        own_source, own_sign = source[part.start : part.stop], sign[part.start : part.stop]
        for x in _places_of_x(part):
            matrix = turn.matrix
            own_source[x : x + 2] = part.start + x + np.abs(matrix).argmax(axis=1)
            own_sign[x : x + 2] = matrix.sum(axis=1)
        if part.name == "los_object":
            own_source[:] = part.start + _window(turn)
        elif turn.is_mirrored:
            own_source[:] = own_source[_mirrored_order(part)]
            own_sign[_places_of_left(part)] = -1.0
    return TurnedColumns(source, sign)


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


def _window(turn: Turn) -> np.ndarray:
    """Where the cells of the line-of-sight window come from, row by row from the lower left."""
    half = WINDOW_CELLS // 2
    dy, dx = np.divmod(np.arange(WINDOW_CELLS**2), WINDOW_CELLS) - np.array(half)
    x, y = turn.matrix.T.astype(int) @ np.array([dx, dy])
    return (y + half) * WINDOW_CELLS + x + half
