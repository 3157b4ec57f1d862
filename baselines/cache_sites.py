"""Where a Cache Starter lays its object: as near as allowed to half way between itself and the nest.

The authors' program maximises a utility that grows without bound towards the midpoint m,

    U(s) = 1 / (1 + exp(4 (e - 1))) / (max(1, |s - robot|) e),   e = |s - m|,

under the constraints that s keeps the proximity distance from the nest's centre and from every remembered cache (more
from one that has refused, see `cache_memory.keep_away_m`), and lies in a box. Its stochastic optimiser therefore ends
near the allowed point nearest to m. This module computes that point exactly and without iterations (our choice). It is
m itself, or m pushed out of one disc or into the box, or a crossing of the border of a disc with another disc or the
box. A random offset replaces the scatter of the optimiser; it is far below the distance at which robots count as
arrived. Quirk `scattered_sites`: the scatter as it was measured.
"""

import math
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part

from .cache_memory import OneTaskMemory, keep_away_m
from .robots import Senses, nearest_nest
from .tasks import DRAW_POINT_X, DRAW_POINT_Y

_RIM_M = 1e-6
"""Distance by which points on a border are moved to its allowed side."""
_TURNS, _TURN_RAD = 16, 2.4
"""Directions in which a scattered site is looked for, and the angle between them."""
_RANDOM_SITES = 256
"""Points looked at for a random site; with 2 % of the box allowed, one is found in 99 % of the cases."""
_MULTIPLIER, _MODULUS = 48271, 2**31 - 1
"""Of the random numbers behind a draw (Park, Miller and Stockmeyer, 1993): kernels draw nothing themselves."""


class Best(NamedTuple):
    """The allowed point nearest to the midpoint among those looked at."""

    x: float
    y: float
    distance: float
    """Squared; infinite while none was allowed."""


@part
def _disc(k: int, c: np.record, memory: OneTaskMemory) -> tuple[float, float, float]:
    """Centre and radius of forbidden disc k: every nest, then every remembered cache."""
    nests = c.nests_m
    if k < nests.shape[0]:
        return nests[k, 0], nests[k, 1], c.proximity_m
    cache = memory.caches[k - nests.shape[0]]
    return (cache.cell_x + 0.5) * c.cell_m, (cache.cell_y + 0.5) * c.cell_m, keep_away_m(cache, c)


@kernel
def is_allowed(robot: np.record, x: float, y: float, c: np.record, memory: OneTaskMemory) -> bool:
    """Whether a cache may be started at a point, as far as the robot knows."""
    if not (c.site_x_low_m <= x <= c.site_x_high_m and c.site_y_low_m <= y <= c.site_y_high_m):
        return False
    for k in range(robot.n_caches + c.nests_m.shape[0]):
        disc_x, disc_y, radius = _disc(k, c, memory)
        dx = disc_x - x
        dy = disc_y - y
        if dx * dx + dy * dy < radius * radius:
            return False
    return True


@part
def _better(
    best: Best,
    robot: np.record,
    x: float,
    y: float,
    middle_x: float,
    middle_y: float,
    c: np.record,
    memory: OneTaskMemory,
) -> Best:
    """Return the point (x, y) if it is allowed and nearer to the midpoint than `best`, else `best`."""
    dx = x - middle_x
    dy = y - middle_y
    distance = dx * dx + dy * dy
    if distance < best.distance and is_allowed(robot, x, y, c, memory):
        return Best(x, y, distance)
    return best


@part
def _edge_crossings(
    best: Best, robot: np.record, k: int, middle_x: float, middle_y: float, c: np.record, memory: OneTaskMemory
) -> Best:
    """Look at the crossings of disc k with the four edges of the box."""
    disc_x, disc_y, radius = _disc(k, c, memory)
    radius += _RIM_M
    for side in range(2):
        edge = c.site_x_high_m if side else c.site_x_low_m
        square = radius * radius - (edge - disc_x) * (edge - disc_x)
        if square >= 0.0:
            reach = math.sqrt(square)
            best = _better(best, robot, edge, disc_y - reach, middle_x, middle_y, c, memory)
            best = _better(best, robot, edge, disc_y + reach, middle_x, middle_y, c, memory)
        edge = c.site_y_high_m if side else c.site_y_low_m
        square = radius * radius - (edge - disc_y) * (edge - disc_y)
        if square >= 0.0:
            reach = math.sqrt(square)
            best = _better(best, robot, disc_x - reach, edge, middle_x, middle_y, c, memory)
            best = _better(best, robot, disc_x + reach, edge, middle_x, middle_y, c, memory)
    return best


@part
def _disc_crossings(
    best: Best,
    robot: np.record,
    k: int,
    other: int,
    middle_x: float,
    middle_y: float,
    c: np.record,
    memory: OneTaskMemory,
) -> Best:
    """Look at the crossings of two discs."""
    disc_x, disc_y, radius = _disc(k, c, memory)
    other_x, other_y, other_radius = _disc(other, c, memory)
    radius += _RIM_M
    other_radius += _RIM_M
    line_x = other_x - disc_x
    line_y = other_y - disc_y
    line = line_x * line_x + line_y * line_y
    if line == 0.0:
        return best
    # The crossings lie across the line between the centres, at this share of it.
    along = 0.5 * (1.0 + (radius * radius - other_radius * other_radius) / line)
    square = radius * radius / line - along * along
    if square < 0.0:
        return best
    across = math.sqrt(square)
    x = disc_x + along * line_x
    y = disc_y + along * line_y
    best = _better(best, robot, x - across * line_y, y + across * line_x, middle_x, middle_y, c, memory)
    return _better(best, robot, x + across * line_y, y - across * line_x, middle_x, middle_y, c, memory)


@kernel
def nearest_allowed(
    robot: np.record, middle_x: float, middle_y: float, turn: float, c: np.record, memory: OneTaskMemory
) -> Best:
    """Return the allowed point nearest to the midpoint.

    Args:
        robot: Record of the robot.
        middle_x: The midpoint, m.
        middle_y: The same along y.
        turn: Direction in which a midpoint exactly at a disc's centre is pushed out, rad.
        c: Constants of the run.
        memory: The robot's memory.
    """
    best = Best(0.0, 0.0, math.inf)
    boxed_x = min(max(middle_x, c.site_x_low_m), c.site_x_high_m)
    boxed_y = min(max(middle_y, c.site_y_low_m), c.site_y_high_m)
    best = _better(best, robot, boxed_x, boxed_y, middle_x, middle_y, c, memory)
    if best.distance == 0.0:
        return best
    for k in range(robot.n_caches + c.nests_m.shape[0]):
        disc_x, disc_y, radius = _disc(k, c, memory)
        dx = middle_x - disc_x
        dy = middle_y - disc_y
        distance = math.sqrt(dx * dx + dy * dy)
        if distance == 0.0:
            dx, dy, distance = math.cos(turn), math.sin(turn), 1.0
        share = (radius + _RIM_M) / distance
        best = _better(best, robot, disc_x + share * dx, disc_y + share * dy, middle_x, middle_y, c, memory)
        best = _edge_crossings(best, robot, k, middle_x, middle_y, c, memory)
        for other in range(k):
            best = _disc_crossings(best, robot, k, other, middle_x, middle_y, c, memory)
    return best  # a corner of the box is nearest only to a midpoint that was put into the box there


@part
def scattered_site(
    robot: np.record, best: Best, turn: float, u: float, c: np.record, memory: OneTaskMemory
) -> tuple[float, float]:
    """Return the site under the quirk `scattered_sites`: around the best place, as that optimiser ends around it.

    With a small probability it is a random allowed point. Else it lies r = a / u', u' uniform in (0, 1], from the best
    place, in a random direction that is turned while the point is not allowed; after some turns the best place itself.

    Args:
        robot: Record of the robot.
        best: The best place.
        turn: Random direction, rad.
        u: Uniform draw in [0, 1).
        c: Constants of the run.
        memory: The robot's memory.
    """
    is_inside = best.distance == 0.0
    far_share = c.far_site_share if is_inside else c.far_site_share_at_border
    if u < far_share:
        return _random_site(robot, best, turn / (2.0 * math.pi), u / far_share, c, memory)
    scale = c.site_scatter_m if is_inside else c.site_scatter_at_border_m
    length = scale * (1.0 - far_share) / (1.0 - u)
    for _ in range(_TURNS):
        x = best.x + length * math.cos(turn)
        y = best.y + length * math.sin(turn)
        if is_allowed(robot, x, y, c, memory):
            return x, y
        turn += _TURN_RAD
    return best.x, best.y


@part
def _random_site(
    robot: np.record, best: Best, u: float, v: float, c: np.record, memory: OneTaskMemory
) -> tuple[float, float]:
    """Return the first allowed point of a random sequence in the box, which begins with the draws u and v."""
    column = 1 + int(u * (_MODULUS - 2))
    row = 1 + int(v * (_MODULUS - 2))
    for _ in range(_RANDOM_SITES):
        x = c.site_x_low_m + (c.site_x_high_m - c.site_x_low_m) * column / _MODULUS
        y = c.site_y_low_m + (c.site_y_high_m - c.site_y_low_m) * row / _MODULUS
        if is_allowed(robot, x, y, c, memory):
            return x, y
        column = column * _MULTIPLIER % _MODULUS
        row = row * _MULTIPLIER % _MODULUS
    return best.x, best.y


@kernel
def select_site(robot: np.record, senses: Senses, c: np.record, draws: np.ndarray, memory: OneTaskMemory) -> bool:
    """Choose a site for a new cache as goal.

    Returns:
        Whether any point is allowed; then goal and tolerance of the robot are set.
    """
    turn = 2.0 * math.pi * draws[DRAW_POINT_X]
    nest_x, nest_y = nearest_nest(senses.x, senses.y, c)
    middle_x = 0.5 * (senses.x + nest_x)
    middle_y = 0.5 * (senses.y + nest_y)
    best = nearest_allowed(robot, middle_x, middle_y, turn, c, memory)
    if best.distance == math.inf:
        return False
    if c.scattered_sites:
        robot.goal_x_m, robot.goal_y_m = scattered_site(robot, best, turn, draws[DRAW_POINT_Y], c, memory)
        robot.goal_tolerance_m = c.site_tolerance_m
        return True
    length = c.site_jitter_m * draws[DRAW_POINT_Y]
    if best.distance == 0.0:
        length = c.site_offset_low_m + (c.site_offset_high_m - c.site_offset_low_m) * draws[DRAW_POINT_Y]
    offset_x = length * math.cos(turn)
    offset_y = length * math.sin(turn)
    robot.goal_x_m = best.x
    robot.goal_y_m = best.y
    for side in range(2):  # the offset; if it is not allowed, the opposite one; else none
        sign = 1.0 - 2.0 * side
        if is_allowed(robot, best.x + sign * offset_x, best.y + sign * offset_y, c, memory):
            robot.goal_x_m = best.x + sign * offset_x
            robot.goal_y_m = best.y + sign * offset_y
            break
    robot.goal_tolerance_m = c.site_tolerance_m
    return True
