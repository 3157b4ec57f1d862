"""Boxes that stand on the floor: how near a place is to one, and bodies kept out of them.

Boxes are rows of `obstacles` (B, 4): x low, y low, x high, y high in m; there may be none.
"""

import math

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.types import BoolArray, FloatArray

PASSES = 4
"""Most times that a body is moved out of all boxes: out of one it may come into another."""


@part
def nearest(x: float, y: float, obstacles: FloatArray, b: int) -> tuple[float, float, float]:
    """Return the direction (x, y) from a place to the nearest point of box b, and its distance in m.

    Inside of the box the distance is negative: how deep the place is below the nearest side, with the direction inwards
    from that side.
    """
    dx = min(max(x, obstacles[b, 0]), obstacles[b, 2]) - x
    dy = min(max(y, obstacles[b, 1]), obstacles[b, 3]) - y
    if dx != 0.0 or dy != 0.0:
        distance = math.sqrt(dx * dx + dy * dy)
        return dx / distance, dy / distance, distance
    west, east = x - obstacles[b, 0], obstacles[b, 2] - x
    south, north = y - obstacles[b, 1], obstacles[b, 3] - y
    depth = min(west, east, south, north)
    if depth == west:
        return 1.0, 0.0, -depth
    if depth == east:
        return -1.0, 0.0, -depth
    if depth == south:
        return 0.0, 1.0, -depth
    return 0.0, -1.0, -depth


@part
def is_within(x: float, y: float, obstacles: FloatArray, b: int, reach: float) -> bool:
    """Return whether a place is in box b grown by `reach` on all sides; corners stay square."""
    in_x = obstacles[b, 0] - reach < x < obstacles[b, 2] + reach
    return in_x and obstacles[b, 1] - reach < y < obstacles[b, 3] + reach


@kernel
def hold_outside(poses: FloatArray, present: BoolArray, obstacles: FloatArray, room: FloatArray, radius: float) -> int:
    """Move present bodies in `poses` (>= N, 3) out of boxes, but not out of `room`; returns how many moved.

    `room` = x low, y low, x high, y high of centres on the floor. In a gap too narrow for a body it stays in a box.
    """
    n_moved = 0
    for i in range(present.shape[0]):
        if not present[i]:
            continue
        for k in range(PASSES):
            is_inside = False
            for b in range(obstacles.shape[0]):
                x, y = poses[i, 0], poses[i, 1]
                if is_within(x, y, obstacles, b, radius):
                    to_x, to_y, distance = nearest(x, y, obstacles, b)
                    if distance < radius:
                        is_inside = True
                        poses[i, 0] = min(room[2], max(room[0], x - (radius - distance) * to_x))
                        poses[i, 1] = min(room[3], max(room[1], y - (radius - distance) * to_y))
            n_moved += is_inside and k == 0
            if not is_inside:
                break
    return n_moved
