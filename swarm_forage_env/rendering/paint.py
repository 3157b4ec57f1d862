"""Antialiased painting of many small shapes at once.

Coordinates are pixels from the upper left corner, with x to the right and y down; pixel (column 0, row 0) covers
[0, 1] x [0, 1]. Every function paints in place. How much of a pixel a shape covers decides its colour there, so robots
move smoothly between pixels. Shapes of one call share one colour and do not add up where they overlap.
"""

from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.rendering import kernels

Colour: TypeAlias = tuple[int, int, int]
"""Red, green, blue in 0..255."""
_NOWHERE = np.zeros((0, 2), np.float32)


class Canvas:
    """Something to paint on. It shows its ground at first, and again after every picture that was taken.

    Colours are kept with fractions until a picture is taken. Only pixels that were painted are then rounded and
    cleaned: a frame with a thousand robots takes milliseconds.

    Args:
        ground: (H, W, 3) uint8 picture; it is kept and must not change.
    """

    def __init__(self, ground: NDArray[np.uint8]) -> None:
        n_pixels = ground.shape[0] * ground.shape[1]
        self._ground = ground
        self.sheet = kernels.Sheet(
            height=ground.shape[0],
            width=ground.shape[1],
            colours=ground.reshape(-1, 3).astype(np.float32),
            share=np.zeros(n_pixels, np.float32),
            touched=np.empty(n_pixels, np.int32),
            is_changed=np.zeros(n_pixels, np.bool_),
            changed=np.empty(n_pixels, np.int32),
            n_changed=np.zeros(1, np.int64),
        )

    @property
    def colours(self) -> NDArray[np.float32]:
        """(H, W, 3) what has been painted so far, in 0..255."""
        return self.sheet.colours.reshape(self._ground.shape)

    def take_picture(self) -> NDArray[np.uint8]:
        """Return what has been painted, (H, W, 3), and clean the canvas."""
        picture = self._ground.copy()
        kernels.take_picture(self.sheet, self._ground.reshape(-1, 3), picture.reshape(-1, 3))
        return picture


class Canvases:
    """Canvases of one ground, made when they are needed and used again; making them takes longer than painting.

    Args:
        ground: See `Canvas`.
    """

    def __init__(self, ground: NDArray[np.uint8]) -> None:
        self._ground = ground
        self._spare: list[Canvas] = []

    def borrow(self) -> Canvas:
        """Return a clean canvas that nobody else has."""
        try:
            return self._spare.pop()
        except IndexError:
            return Canvas(self._ground)

    def give_back(self, canvas: Canvas) -> None:
        """Take a clean canvas back; one that is not given back is forgotten."""
        self._spare.append(canvas)


def plain(height: int, width: int, colour: Colour) -> NDArray[np.uint8]:
    """Return a ground of one colour."""
    ground = np.empty((height, width, 3), np.uint8)
    ground[:] = colour
    return ground


def paint_box(canvas: Canvas, box: tuple[float, float, float, float], colour: Colour, opacity: float = 1.0) -> None:
    """Fill one axis-aligned rectangle (left, top, right, bottom); partly covered edge pixels are blended."""
    height, width = canvas.sheet.height, canvas.sheet.width
    left, top, right, bottom = box
    columns, rows = np.arange(width), np.arange(height)
    across = np.clip(np.minimum(columns + 1, right) - np.maximum(columns, left), 0.0, 1.0)
    down = np.clip(np.minimum(rows + 1, bottom) - np.maximum(rows, top), 0.0, 1.0)
    x, y = np.flatnonzero(across), np.flatnonzero(down)
    if x.size and y.size:
        share = (opacity * down[y, None] * across[x]).astype(np.float32)
        kernels.paint_share(canvas.sheet, int(y[0]), int(x[0]), share, _stored(colour))


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
    _paint_round(canvas, centre, _NOWHERE, 0.0, 0.0, radius + 0.5, colour, opacity)


def paint_rings(canvas: Canvas, centre: ArrayLike, radius: float, line: float, colour: Colour) -> None:
    """Draw circles of mean radius `radius` and line width `line` around `centre` (n, 2)."""
    _paint_round(canvas, centre, _NOWHERE, 0.0, radius, (line + 1.0) / 2.0, colour)


def paint_needles(
    canvas: Canvas, start: ArrayLike, direction: NDArray[np.floating], length: float, line: float, colour: Colour
) -> None:
    """Draw round-ended lines of `length` from `start` (n, 2) along the unit vectors `direction` (n, 2)."""
    along = np.ascontiguousarray(direction, np.float32)
    middle = np.asarray(start, np.float64) + 0.5 * length * along
    _paint_round(canvas, middle, along, length / 2.0, 0.0, (line + 1.0) / 2.0, colour)


def paint_crosses(canvas: Canvas, centre: ArrayLike, radius: float, line: float, colour: Colour) -> None:
    """Draw two crossing lines of length 2 `radius` at `centre` (n, 2)."""
    middle = _places(centre)
    for tilt in (-1.0, 1.0):
        along = np.tile(np.array([1.0, tilt]) / np.sqrt(2.0), (len(middle), 1))
        paint_needles(canvas, middle - radius * along, along, 2.0 * radius, line, colour)


def paint_squares(canvas: Canvas, centre: ArrayLike, side: float, colour: Colour, opacity: float = 1.0) -> None:
    """Fill axis-aligned squares of side `side` at `centre` (n, 2)."""
    half = side / 2.0
    kernels.paint_square(
        canvas.sheet,
        _places(centre),
        np.float32(opacity),
        np.float32(half),
        _stored(colour),
    )


def paint_glows(canvas: Canvas, centre: ArrayLike, radius: float, colour: Colour, opacity: float) -> None:
    """Paint soft spots that fade from `opacity` in the middle to nothing at `radius`."""
    height, width = canvas.sheet.height, canvas.sheet.width
    share = np.zeros((height, width), np.float32)
    for x, y in _places(centre):
        rows = slice(max(0, int(y - radius)), max(0, int(y + radius) + 1))
        columns = slice(max(0, int(x - radius)), max(0, int(x + radius) + 1))
        dx = (np.arange(width)[columns] + 0.5 - x).astype(np.float32)
        dy = (np.arange(height)[rows] + 0.5 - y).astype(np.float32)[:, None]
        spot = np.clip(1.0 - (dx * dx + dy * dy) / (radius * radius), 0.0, 1.0) ** 3
        share[rows, columns] = np.maximum(share[rows, columns], np.float32(opacity) * spot)
    kernels.paint_share(canvas.sheet, 0, 0, share, _stored(colour))


def _paint_round(
    canvas: Canvas,
    middle: ArrayLike,
    along: NDArray[np.float32],
    half_length: float,
    radius: float,
    reach: float,
    colour: Colour,
    opacity: float | NDArray[np.floating] = 1.0,
) -> None:
    """Call `kernels.paint_round`, which see, with numbers of the types that are stored."""
    places = _places(middle)
    kernels.paint_round(
        canvas.sheet,
        places,
        along,
        np.ascontiguousarray(np.broadcast_to(np.asarray(opacity, np.float32), (len(places),))),
        np.float32(half_length),
        np.float32(radius),
        np.float32(reach),
        _stored(colour),
    )


def _places(centre: ArrayLike) -> FloatArray:
    return np.ascontiguousarray(np.asarray(centre, np.float64).reshape(-1, 2))


def _stored(colour: Colour) -> NDArray[np.float32]:
    return np.asarray(colour, np.float32)
