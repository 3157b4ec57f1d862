"""Antialiased painting of many small shapes at once on a numpy canvas.

A canvas is an (H, W, 3) float32 array of colour values in [0, 255]. Coordinates are pixels from the upper left corner,
with x to the right and y down; pixel (column 0, row 0) covers [0, 1] x [0, 1]. Every function paints in place. A
function of the distance says how much of a pixel a shape covers, and all shapes of a call are computed together. So
thousands of robots take milliseconds and move smoothly between pixels. Shapes of one call share one colour and do not
add up where they overlap.
"""

from collections.abc import Callable, Iterator
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

Canvas: TypeAlias = NDArray[np.float32]
Colour: TypeAlias = tuple[int, int, int]
"""Red, green, blue in 0..255."""

_STAMP_BUDGET = 2_000_000
"""Pixels computed at once: this limits the memory of a call for any number of shapes."""

_WHOLE_PIXEL = np.dtype((np.void, 12))
_MOST_SPARE = 4
_spare_zeros: dict[int, NDArray[np.float32]] = {}
"""Size -> zeros that nobody uses now: making megabytes of them for each call took longer than the painting itself."""

_Coverage: TypeAlias = Callable[[NDArray[np.float32], NDArray[np.float32], slice], NDArray[np.floating]]


def paint_box(canvas: Canvas, box: tuple[float, float, float, float], colour: Colour, opacity: float = 1.0) -> None:
    """Fill one axis-aligned rectangle (left, top, right, bottom); partly covered edge pixels are blended."""
    height, width = canvas.shape[:2]
    left, top, right, bottom = box
    columns, rows = np.arange(width), np.arange(height)
    across = np.clip(np.minimum(columns + 1, right) - np.maximum(columns, left), 0.0, 1.0)
    down = np.clip(np.minimum(rows + 1, bottom) - np.maximum(rows, top), 0.0, 1.0)
    x, y = np.flatnonzero(across), np.flatnonzero(down)
    if x.size == 0 or y.size == 0:
        return
    window = canvas[y[0] : y[-1] + 1, x[0] : x[-1] + 1]
    share = (opacity * down[y, None] * across[x])[..., None].astype(np.float32)
    window += (np.asarray(colour, np.float32) - window) * share


def paint_frame(
    canvas: Canvas, box: tuple[float, float, float, float], line: float, colour: Colour, opacity: float = 1.0
) -> None:
    """Outline one rectangle with a line of width `line` that lies inside it."""
    left, top, right, bottom = box
    paint_box(canvas, (left, top, right, top + line), colour, opacity)
    paint_box(canvas, (left, bottom - line, right, bottom), colour, opacity)
    paint_box(canvas, (left, top + line, left + line, bottom - line), colour, opacity)
    paint_box(canvas, (right - line, top + line, right, bottom - line), colour, opacity)


def paint_discs(
    canvas: Canvas, centre: ArrayLike, radius: float, colour: Colour, opacity: float | NDArray[np.floating] = 1.0
) -> None:
    """Fill discs at `centre` (n, 2); `opacity` is one number or (n,)."""

    def coverage(dx: NDArray[np.float32], dy: NDArray[np.float32], _: slice) -> NDArray[np.floating]:
        return np.clip(radius + 0.5 - _length(dx, dy), 0.0, 1.0)

    _paint(canvas, centre, radius + 0.5, coverage, colour, opacity)


def paint_rings(canvas: Canvas, centre: ArrayLike, radius: float, line: float, colour: Colour) -> None:
    """Draw circles of mean radius `radius` and line width `line` around `centre` (n, 2)."""

    def coverage(dx: NDArray[np.float32], dy: NDArray[np.float32], _: slice) -> NDArray[np.floating]:
        return np.clip((line + 1.0) / 2.0 - np.abs(_length(dx, dy) - radius), 0.0, 1.0)

    _paint(canvas, centre, radius + (line + 1.0) / 2.0, coverage, colour, 1.0)


def paint_squares(canvas: Canvas, centre: ArrayLike, side: float, colour: Colour, opacity: float = 1.0) -> None:
    """Fill axis-aligned squares of side `side` at `centre` (n, 2)."""
    half = side / 2.0

    def coverage(dx: NDArray[np.float32], dy: NDArray[np.float32], _: slice) -> NDArray[np.floating]:
        across = np.minimum(dx + 0.5, half) - np.maximum(dx - 0.5, -half)
        down = np.minimum(dy + 0.5, half) - np.maximum(dy - 0.5, -half)
        return np.clip(across, 0.0, 1.0) * np.clip(down, 0.0, 1.0)

    _paint(canvas, centre, half + 0.5, coverage, colour, opacity)


def paint_needles(
    canvas: Canvas, start: ArrayLike, direction: NDArray[np.floating], length: float, line: float, colour: Colour
) -> None:
    """Draw round-ended lines of `length` from `start` (n, 2) along the unit vectors `direction` (n, 2)."""
    along = np.asarray(direction, np.float32)
    middle = np.asarray(start, np.float64) + 0.5 * length * along

    def coverage(dx: NDArray[np.float32], dy: NDArray[np.float32], rows: slice) -> NDArray[np.floating]:
        ux, uy = along[rows, 0, None, None], along[rows, 1, None, None]
        forward = np.clip(dx * ux + dy * uy, -length / 2.0, length / 2.0)
        return np.clip((line + 1.0) / 2.0 - _length(dx - forward * ux, dy - forward * uy), 0.0, 1.0)

    _paint(canvas, middle, (length + line + 1.0) / 2.0, coverage, colour, 1.0)


def paint_glows(canvas: Canvas, centre: ArrayLike, radius: float, colour: Colour, opacity: float) -> None:
    """Paint soft spots that fade from `opacity` in the middle to nothing at `radius`."""

    def coverage(dx: NDArray[np.float32], dy: NDArray[np.float32], _: slice) -> NDArray[np.floating]:
        return np.clip(1.0 - (dx * dx + dy * dy) / (radius * radius), 0.0, 1.0) ** 3

    _paint(canvas, centre, radius, coverage, colour, opacity)


def _length(dx: NDArray[np.floating], dy: NDArray[np.floating]) -> NDArray[np.float32]:
    """Length of vectors, broadcast: what `np.hypot` returns, in a third of its time."""
    x, y = dx.astype(np.float64), dy.astype(np.float64)  # squares of these cannot overflow or lose digits
    total = x * x + y * y
    return np.sqrt(total, out=total).astype(np.float32)


def _paint(
    canvas: Canvas,
    centre: ArrayLike,
    reach: float,
    coverage: _Coverage,
    colour: Colour,
    opacity: float | NDArray[np.floating],
) -> None:
    """Blend `colour` over the largest coverage that any shape gives each pixel.

    Args:
        canvas: Painted in place.
        centre: (n, 2) pixel coordinates of the shapes' middles.
        reach: Distance from the middle, along an axis, from which on coverage is zero, pixels.
        coverage: A function of the offsets from the middles to pixel centres, (k, 1, P) and (k, P, 1), and of the
            slice of the k shapes; returns shares in [0, 1], (k, P, P).
        colour: Colour of all shapes.
        opacity: One number or (n,).
    """
    assert canvas.flags.c_contiguous, "painting goes through a flat view"
    height, width = canvas.shape[:2]
    middle = np.asarray(centre, np.float64).reshape(-1, 2)
    if len(middle) == 0:
        return
    strength = np.broadcast_to(np.asarray(opacity, np.float32), (len(middle),))
    share = _borrow_zeros(height * width)
    reached = int(np.ceil(reach + 0.5)) - 1  # the centre of a pixel farther away is beyond reach
    offset = np.arange(-reached, reached + 1)
    around = width * offset[:, None] + offset
    touched = []
    for rows in _chunks(len(middle), offset.size**2):
        corner = np.floor(middle[rows]).astype(np.int64)
        column = corner[:, 0, None, None] + offset[None, None, :]
        row = corner[:, 1, None, None] + offset[None, :, None]
        dx = (column + 0.5 - middle[rows, 0, None, None]).astype(np.float32)
        dy = (row + 0.5 - middle[rows, 1, None, None]).astype(np.float32)
        covered = coverage(dx, dy, rows) * strength[rows, None, None]
        seen = covered > 0
        if corner.min() < reached or (corner >= (width - reached, height - reached)).any():
            seen &= (column >= 0) & (column < width) & (row >= 0) & (row < height)
        place = np.flatnonzero(seen)
        pixel = ((width * corner[:, 1] + corner[:, 0])[:, None, None] + around).reshape(-1)[place]
        np.maximum.at(share, pixel, covered.reshape(-1)[place])
        touched.append(pixel)
    # A pixel that several shapes touch stands here several times; it gets the same value each time.
    pixel = np.concatenate(touched)
    pixels = canvas.reshape(-1, 3)
    ground = pixels.take(pixel, axis=0)
    mixed = np.asarray(colour, np.float32) - ground
    mixed *= share.take(pixel)[:, None]
    mixed += ground
    # As one item of twelve bytes a pixel is stored three times faster than as a row of three numbers.
    pixels.view(_WHOLE_PIXEL)[:, 0][pixel] = mixed.view(_WHOLE_PIXEL)[:, 0]
    share[pixel] = 0.0
    _spare_zeros[share.size] = share


def _borrow_zeros(size: int) -> NDArray[np.float32]:
    """Return an array of zeros; one that is put back into `_spare_zeros`, all zero again, need not be made anew."""
    if len(_spare_zeros) > _MOST_SPARE:
        _spare_zeros.clear()
    spare = _spare_zeros.pop(size, None)
    return np.zeros(size, np.float32) if spare is None else spare


def _chunks(n_shapes: int, stamp_pixels: int) -> Iterator[slice]:
    size = max(1, _STAMP_BUDGET // stamp_pixels)
    for start in range(0, n_shapes, size):
        yield slice(start, start + size)
