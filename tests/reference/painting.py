"""The slow twin of painting: every pixel asks every shape how much of it that covers."""

import math

import numpy as np


def distance_to_line(x, y, middle, direction, half_length):
    """Distance of a point from the line of `2 * half_length` around `middle`."""
    dx, dy = x - middle[0], y - middle[1]
    forward = min(max(dx * direction[0] + dy * direction[1], -half_length), half_length)
    return math.hypot(dx - forward * direction[0], dy - forward * direction[1])


def round_share(x, y, middle, direction, half_length, radius, reach):
    """How far a disc, ring or needle covers the pixel with the centre (x, y)."""
    gap = abs(distance_to_line(x, y, middle, direction, half_length) - radius)
    return min(max(reach - gap, 0.0), 1.0)


def square_share(x, y, middle, half):
    """How much of the pixel with the centre (x, y) lies in a square."""
    lengths = [
        min(place + 0.5, centre + half) - max(place - 0.5, centre - half)
        for place, centre in zip((x, y), middle, strict=True)
    ]
    return min(max(lengths[0], 0.0), 1.0) * min(max(lengths[1], 0.0), 1.0)


def painted(ground, colour, shares):
    """Blend a colour over a picture.

    Args:
        ground: (H, W, 3) colours.
        colour: Red, green, blue.
        shares: One function per shape: centre of a pixel (x, y) -> how far the shape covers it.

    Returns:
        (H, W, 3) colours with fractions.
    """
    picture = np.array(ground, np.float64)
    for row, column in np.ndindex(picture.shape[:2]):
        share = max((shape(column + 0.5, row + 0.5) for shape in shares), default=0.0)
        picture[row, column] += (np.asarray(colour) - picture[row, column]) * share
    return picture
