"""Shapes on a sheet of colours: which pixels they cover how far, and what colour these get.

Numbers are of 32 bits where they are stored, so that a large sheet is not twice as large. Lengths are worked out in 64
bits and then rounded.
"""

import math
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import BoolArray, FloatArray

_ZERO = np.float32(0.0)
_HALF = np.float32(0.5)
_ONE = np.float32(1.0)
_SLACK_PX = 1e-3
"""So far from an edge, rounding cannot decide whether a pixel is covered. Saves most square roots."""


class Sheet(NamedTuple):
    """What is painted on, and what is known of it. P = height x width pixels, row by row from the upper left corner."""

    height: int
    width: int
    colours: NDArray[np.float32]
    """(P, 3) in 0..255."""
    share: NDArray[np.float32]
    """(P,) how far the shapes of one call cover a pixel; all zero between calls."""
    touched: NDArray[np.int32]
    """(P,) room for the pixels that the shapes of one call touch."""
    is_changed: BoolArray
    """(P,) whether a pixel was painted since the sheet was clean."""
    changed: NDArray[np.int32]
    """(P,) these pixels in the order in which they were painted first."""
    n_changed: NDArray[np.int64]
    """(1,) how many there are."""


@kernel
def paint_round(
    sheet: Sheet,
    middle: FloatArray,
    along: NDArray[np.float32],
    strength: NDArray[np.float32],
    half_length: np.float32,
    radius: np.float32,
    reach: np.float32,
    colour: NDArray[np.float32],
) -> None:
    """Blend a colour over all points near lines or circles: discs, rings and needles.

    The distance of a point is that from the nearest point of a line of `2 * half_length` along `along`, and then from
    `radius`. A disc has neither length nor radius, a ring no length, a needle no radius. A pixel is covered by `reach`
    less its distance, at least 0 and at most 1. Where shapes overlap, the one that covers most counts.

    Args:
        sheet: Painted in place.
        middle: (n, 2) pixel coordinates.
        along: (n, 2) unit vectors; not read for shapes without a length.
        strength: (n,) factor of what each shape covers.
        half_length: Pixels.
        radius: Pixels.
        reach: Pixels.
        colour: (3,) in 0..255.
    """
    is_long = half_length > _ZERO
    beyond = np.float64(reach) + _SLACK_PX
    extent = np.float64(radius) + beyond
    farthest = extent**2
    nearest = max(0.0, np.float64(radius) - beyond) ** 2
    whole = max(0.0, np.float64(reach) - 1.0 - _SLACK_PX) ** 2 if radius == _ZERO else 0.0
    n_touched = 0
    for i in range(middle.shape[0]):
        x = middle[i, 0]
        y = middle[i, 1]
        ux = along[i, 0] if is_long else _ZERO
        uy = along[i, 1] if is_long else _ZERO
        wide = extent + half_length * abs(ux)
        high = extent + half_length * abs(uy)
        if not (-wide < x < sheet.width + wide and -high < y < sheet.height + high):
            continue
        for r in range(_first(y - high), _end(y + high, sheet.height)):
            dy = np.float32(r + 0.5 - y)
            if not is_long:  # the part of the circle in this row
                wide = math.sqrt(max(0.0, farthest - np.float64(dy) * np.float64(dy)))
            for c in range(_first(x - wide), _end(x + wide, sheet.width)):
                ex = np.float32(c + 0.5 - x)
                ey = dy
                if is_long:
                    forward = min(max(ex * ux + ey * uy, -half_length), half_length)
                    ex -= forward * ux
                    ey -= forward * uy
                square = np.float64(ex) * np.float64(ex) + np.float64(ey) * np.float64(ey)
                if square > farthest or square < nearest:
                    continue
                covered = _ONE
                if square >= whole:
                    covered = min(max(reach - abs(np.float32(math.sqrt(square)) - radius), _ZERO), _ONE)
                n_touched = _note(sheet, n_touched, r * sheet.width + c, covered * strength[i])
    _blend(sheet, n_touched, colour)


@kernel
def paint_square(
    sheet: Sheet, middle: FloatArray, strength: np.float32, half: np.float32, colour: NDArray[np.float32]
) -> None:
    """Blend a colour over squares; a pixel is covered by the share of it that lies inside one.

    Args:
        sheet: Painted in place.
        middle: (n, 2) pixel coordinates.
        strength: Factor of what each square covers.
        half: Half the side of a square, pixels.
        colour: (3,) in 0..255.
    """
    extent = half + 0.5 + _SLACK_PX
    n_touched = 0
    for i in range(middle.shape[0]):
        x = middle[i, 0]
        y = middle[i, 1]
        if not (-extent < x < sheet.width + extent and -extent < y < sheet.height + extent):
            continue
        for r in range(_first(y - extent), _end(y + extent, sheet.height)):
            down = _overlap(np.float32(r + 0.5 - y), half)
            for c in range(_first(x - extent), _end(x + extent, sheet.width)):
                across = _overlap(np.float32(c + 0.5 - x), half)
                n_touched = _note(sheet, n_touched, r * sheet.width + c, across * down * strength)
    _blend(sheet, n_touched, colour)


@kernel
def paint_share(sheet: Sheet, top: int, left: int, share: NDArray[np.float32], colour: NDArray[np.float32]) -> None:
    """Blend a colour over a rectangle of the sheet, whose upper left pixel is (top, left), by a share per pixel."""
    for r in range(share.shape[0]):
        for c in range(share.shape[1]):
            if share[r, c] > _ZERO:
                _mix(sheet, (top + r) * sheet.width + left + c, share[r, c], colour)


@kernel
def take_picture(sheet: Sheet, ground: NDArray[np.uint8], picture: NDArray[np.uint8]) -> None:
    """Round what has been painted into a picture that shows the ground, and make the sheet show the ground again.

    Args:
        sheet: No pixel is noted as changed afterwards.
        ground: (P, 3) what the sheet shows where nothing was painted.
        picture: (P, 3) equal to `ground`; gets the changed pixels.
    """
    for k in range(sheet.n_changed[0]):
        pixel = int(sheet.changed[k])
        for part in range(3):
            picture[pixel, part] = np.uint8(np.rint(sheet.colours[pixel, part]))
            sheet.colours[pixel, part] = np.float32(ground[pixel, part])
        sheet.is_changed[pixel] = False
    sheet.n_changed[0] = 0


@kernel
def _first(low: float) -> int:
    """First pixel whose centre lies at `low` or beyond, or one before it; none before the edge."""
    return max(0, int(math.floor(low - 0.5)))


@kernel
def _end(high: float, size: int) -> int:
    """One beyond the last pixel whose centre lies at `high` or before; none beyond the edge."""
    return min(size, int(math.floor(high + 0.5)))


@kernel
def _overlap(offset: np.float32, half: np.float32) -> np.float32:
    """Share of a pixel, `offset` away, that lies within `half` of the middle along one axis."""
    return min(max(min(offset + _HALF, half) - max(offset - _HALF, -half), _ZERO), _ONE)


@kernel
def _note(sheet: Sheet, n_touched: int, pixel: int, covered: np.float32) -> int:
    """Let a shape cover a pixel, unless another one covers more of it; returns the number of pixels touched."""
    if covered <= sheet.share[pixel]:
        return n_touched
    if sheet.share[pixel] == _ZERO:
        sheet.touched[n_touched] = pixel
        n_touched += 1
    sheet.share[pixel] = covered
    return n_touched


@kernel
def _blend(sheet: Sheet, n_touched: int, colour: NDArray[np.float32]) -> None:
    """Give the pixels that were touched their colour, and forget them."""
    for k in range(n_touched):
        pixel = int(sheet.touched[k])
        _mix(sheet, pixel, sheet.share[pixel], colour)
        sheet.share[pixel] = _ZERO


@kernel
def _mix(sheet: Sheet, pixel: int, share: np.float32, colour: NDArray[np.float32]) -> None:
    for part in range(3):
        ground = sheet.colours[pixel, part]
        sheet.colours[pixel, part] = (colour[part] - ground) * share + ground
    if not sheet.is_changed[pixel]:
        sheet.is_changed[pixel] = True
        sheet.changed[sheet.n_changed[0]] = pixel
        sheet.n_changed[0] += 1
