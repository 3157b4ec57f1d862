"""Obstacles: boxes on the floor that robots cannot enter, and the cells and the area that they take.

Example: `scenario("warehouse_small", obstacles=((14.0, 4.0, 14.4, 12.0),))` puts a wall of 0.4 x 8 m into the small
warehouse. An obstacle is (x low, y low, x high, y high) in m, like `ArenaConfig.nest_box_m`. It stands exactly there.
Obstacles may touch and overlap each other, and reach into the walls.
"""

import math
from collections.abc import Iterable, Sequence
from typing import Annotated, TypeAlias

import numpy as np
from msgspec import Meta
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.floor import CELL_M, CELLS_PER_M, Box, Rectangle

Boxes: TypeAlias = Annotated[tuple[Rectangle, ...], Meta(max_length=200)]
"""Obstacles, or further nests; at most 200 (our choice: every robot looks at all of them in every tick)."""
MIN_SIDE_M = CELL_M
"""Shortest side: a cell, as of the nest. A robot that is pushed never gets past the middle of one in a tick."""
_ROUNDING_CELLS = 1e-6
"""Edges this close to a line between cells lie on it."""


def check_boxes(
    name: str,
    boxes: Sequence[Rectangle],
    width_m: float,
    height_m: float,
    *,
    clear_of: Sequence[Rectangle],
    are_apart: bool = False,
) -> None:
    """Refuse boxes that are too thin, outside of an arena, on its nests, or, if they have to be apart, on each other.

    Raises:
        ConfigError: names the first box of `arena.name` that cannot be.
    """
    for index, box in enumerate(boxes):
        where, (x_low, y_low, x_high, y_high) = f"arena.{name}[{index}]", box
        if min(x_high - x_low, y_high - y_low) < MIN_SIDE_M - 1e-9:
            raise ConfigError(
                f"Expected {where} with x low < x high and y low < y high, at least {MIN_SIDE_M} m apart, got {box}."
            )
        if min(x_low, y_low) < 0.0 or x_high > width_m or y_high > height_m:
            raise ConfigError(f"Expected {where} inside the {width_m} x {height_m} m arena, got {box}.")
        for nest in (*clear_of, *boxes[:index]) if are_apart else clear_of:
            if x_low < nest[2] and nest[0] < x_high and y_low < nest[3] and nest[1] < y_high:
                raise ConfigError(f"Expected {where} clear of the nest {nest}, got {box}; move the box or the nest.")


def blocked_cells(box: Rectangle, nx: int, ny: int, radius_m: float) -> Box:
    """Return the cells that an obstacle keeps free of objects, half-open.

    These are the cells that it covers, also in part, and those whose centre is nearer to it than a robot's radius: no
    robot could stand on an object there. (Near corners that is a little more than needed.)
    """
    low: list[int] = []
    high: list[int] = []
    for start, end, n_cells in ((box[0], box[2], nx), (box[1], box[3], ny)):
        covered = math.floor(start * CELLS_PER_M + _ROUNDING_CELLS), math.ceil(end * CELLS_PER_M - _ROUNDING_CELLS)
        first_near = math.floor((start - radius_m) * CELLS_PER_M - 0.5) + 1
        last_near = math.ceil((end + radius_m) * CELLS_PER_M - 0.5) - 1
        low.append(max(0, min(covered[0], first_near)))
        high.append(min(n_cells, max(covered[1], last_near + 1)))
    return low[0], low[1], high[0], high[1]


def stretched(
    obstacles: Iterable[Rectangle], factors: tuple[float, float], extents_m: tuple[float, float]
) -> tuple[Rectangle, ...]:
    """Return boxes that keep their places and shares in an arena so much wider and higher.

    A side that shrinks below `MIN_SIDE_M` is widened to it about its middle, and stays inside the arena.

    Args:
        obstacles: Boxes, m.
        factors: How much wider along x and along y.
        extents_m: Of the new arena along x and along y, m.
    """
    found: list[Rectangle] = []
    for x_low, y_low, x_high, y_high in obstacles:
        x = _widened(x_low * factors[0], x_high * factors[0], extents_m[0])
        y = _widened(y_low * factors[1], y_high * factors[1], extents_m[1])
        found.append((x[0], y[0], x[1], y[1]))
    return tuple(found)


def _widened(low: float, high: float, extent_m: float) -> tuple[float, float]:
    if high - low >= MIN_SIDE_M - 1e-9:
        return low, high
    start = min(max(0.0, (low + high - MIN_SIDE_M) / 2), extent_m - MIN_SIDE_M)
    return start, start + MIN_SIDE_M


def distances_m(obstacles: Iterable[Rectangle], position: NDArray[np.float64]) -> NDArray[np.float64]:
    """Return how far positions (N, 2) m are from the nearest obstacle, (N,) m: 0 inside, inf where there is none."""
    nearest = np.full(len(position), np.inf)
    for box in obstacles:
        away = np.maximum(0.0, np.maximum(np.array(box[:2]) - position, position - np.array(box[2:])))
        nearest = np.minimum(nearest, np.hypot(away[:, 0], away[:, 1]))
    return nearest
