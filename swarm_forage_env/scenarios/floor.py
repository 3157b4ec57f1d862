"""The floor: its cells and walls, and which cells objects may lie on, as pure integer geometry.

A box is (x low, y low, x high, y high) in cells, half-open: x low <= x < x high.
Integer arithmetic throughout, because 0.2 m and the shares below are not exact in binary.
"""

from collections.abc import Iterable
from typing import TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import Number

CELL_M = 0.2
"""Side of a floor cell and of an object."""
CELLS_PER_M = 5.0
"""Cell index = floor(coordinate * 5); dividing by 0.2 would truncate 0.6 m to cell 2."""
WALL_M = 0.2
"""How far the walls in the west, south and north reach into the arena: half of their 0.4 m; the other half stands
outside."""
EAST_WALL_M = 0.4
"""How far the wall in the east reaches into the arena: all of it."""
NEAR_CACHE_M = 2.0
"""From the centre of a cache: time lost within this distance is lost near it (our choice: robots that use a cache crowd
at its centre, and most of them within this distance, whatever its size)."""
WHEEL_SCALE_MPS = 0.20
"""Wheel speed that an action or an observation of 1.0 stands for."""

Box: TypeAlias = tuple[int, int, int, int]
Rectangle: TypeAlias = tuple[Number, Number, Number, Number]
"""x low, y low, x high, y high in m."""

PLACEMENTS = ("single_source", "dual_source", "quad_source", "random", "power_law", "heap")
POSITIONS = "positions"
"""The placement with places of one's own instead of regions by rule."""


def distributable_box(nx: int, ny: int) -> Box:
    """Cells on which objects may lie at all: 15 % to 85 % of each axis, both end cells included."""
    return (15 * nx // 100, 15 * ny // 100, 85 * nx // 100 + 1, 85 * ny // 100 + 1)


def source_boxes(placement: str, nx: int, ny: int) -> tuple[Box, ...]:
    """Return the source regions of a placement on an nx x ny grid; `POSITIONS` has those of its scenario instead.

    Power-law clusters and heaps are drawn later; for them the answer is the whole distributable range.
    The bands are 0.75/0.85 and 0.25/0.85 of the upper distributable index, as in the paper's study; like there, the
    regions end one cell before the distributable range does.
    """
    x_low, y_low, x_end, y_end = distributable_box(nx, ny)
    x_high, y_high = x_end - 1, y_end - 1
    right = (75 * x_high // 85, y_low, x_high, y_high)
    left = (x_low, y_low, 25 * x_high // 85, y_high)
    bottom = (x_low, y_low, x_high, 25 * y_high // 85)
    top = (x_low, 75 * y_high // 85, x_high, y_high)
    boxes: dict[str, tuple[Box, ...]] = {
        "single_source": (right,),
        "dual_source": (right, left),
        "quad_source": (right, left, bottom, top),
        "random": ((x_low, y_low, x_high, y_high),),
        "power_law": ((x_low, y_low, x_end, y_end),),
        "heap": ((x_low, y_low, x_end, y_end),),
    }
    return boxes[placement]


def square_box(centre_cell: tuple[int, int], side_cells: int) -> Box:
    """Cells of a square of an odd number of cells around its centre, such as a cache."""
    x, y = centre_cell
    half = side_cells // 2
    return (x - half, y - half, x + half + 1, y + half + 1)


def cache_centre_box(nx: int, ny: int, margin: int) -> Box:
    """Cells for centres of dynamic caches: distributable, and at least `margin`, the nominal side, from the border.

    In an arena narrower than two margins low is not below end; the last cell before the end is used.
    """
    x_low, y_low, x_end, y_end = distributable_box(nx, ny)
    return max(margin, x_low), max(margin, y_low), min(nx - margin, x_end), min(ny - margin, y_end)


def overlap_cells(a: Box, b: Box) -> int:
    """Number of cells that two boxes share."""
    return max(0, min(a[2], b[2]) - max(a[0], b[0])) * max(0, min(a[3], b[3]) - max(a[1], b[1]))


def free_area(inside: Iterable[Box | Rectangle], taken: Iterable[Box | Rectangle]) -> float:
    """Return the area of boxes `inside` that no box of `taken` covers, in cells or m^2; overlaps count once.

    A cell holds one object, so sources less nest and obstacles have room for so many.
    """
    every = [np.array([*boxes], np.float64).reshape(-1, 4) for boxes in (inside, taken)]
    # Nothing changes between two edges, so a huge floor is looked at as the few rectangles that edges cut it into.
    x, y = (np.unique(np.concatenate(every)[:, axis::2]) for axis in (0, 1))
    is_free = np.zeros((max(0, len(y) - 1), max(0, len(x) - 1)), np.bool_)
    for boxes, becomes in zip(every, (True, False), strict=True):
        for (x_low, x_high), (y_low, y_high) in zip(
            np.searchsorted(x, boxes[:, 0::2]), np.searchsorted(y, boxes[:, 1::2]), strict=True
        ):
            is_free[y_low:y_high, x_low:x_high] = becomes
    return float(np.diff(y) @ is_free @ np.diff(x))
