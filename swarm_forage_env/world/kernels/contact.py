"""Robots that press against each other: commanded velocities to those that wheel motors of limited force allow."""

import math

from swarm_forage_env._internal.compiling import inline_kernel, part
from swarm_forage_env.contract.types import BoolArray, FloatArray
from swarm_forage_env.world.kernels.bins import bin_of, cell_of
from swarm_forage_env.world.state import Bins, Touching

LEAST_SPEED_M_S = 3e-4
"""Slowest common speed. Our choice: two robots that are equally strong would stand against each other for ever. At this
speed a pair leaves the point between them within 1,400 ticks of 0.2 s."""


@part
def common_speed(closing_i: float, closing_j: float, before: float, tie: float) -> float:
    """Speed of a pressing pair along the line from i to j, m/s, seen from i.

    Each robot closes in with its commanded speed (m/s, positive towards the other). `before` is the common speed of the
    tick before, NaN at first touch. Both motors work at their limit, so that the pair keeps the speed it has while
    both press; at first touch that is the mean of the two commands. It is never slower than `LEAST_SPEED_M_S` while
    both want to go on; `tie` is the sign that it gets where neither is stronger: that seen from j is the opposite.
    """
    speed = 0.5 * (closing_i - closing_j) if math.isnan(before) else before
    if abs(speed) < LEAST_SPEED_M_S:
        speed = math.copysign(LEAST_SPEED_M_S, speed if speed != 0.0 else tie)
    return min(closing_i, max(-closing_j, speed))


@part
def east_or_north(dx: float, dy: float) -> float:
    """Sign of a direction: of its x, of its y if that is 0. The opposite direction has the opposite sign."""
    return dx if dx != 0.0 else dy


@part
def remembered(memory: Touching, i: int, j: int) -> float:
    """Common speed of the pair i, j in the tick before, seen from i, m/s; NaN if they did not press."""
    n_partners, partner, speed = memory
    for slot in range(n_partners[i]):
        if partner[i, slot] == j:
            return speed[i, slot]
    return math.nan


@inline_kernel
def press(
    position: FloatArray,
    present: BoolArray,
    near: BoolArray,
    bins: Bins,
    touch_m: float,
    memory: Touching,
    next_memory: Touching,
    command: FloatArray,
    twist: FloatArray,
) -> None:
    """Give touching pairs that press their common speed: edits the velocities in `twist` (N + 1, 3), in m/s.

    `near` (N,) and `bins` = (cell size in m, first_in_bin, next_in_bin) are those of `beams.proximity` at the present
    positions; centres within `touch_m` touch. `memory` is that of the tick before, `next_memory` is written: number of
    partners (N,), partners (N, slots), common speeds (N, slots). `command` (N, 2) is room to work in.

    A robot with several partners changes its velocity by the mean of what each pair asks for, weighted by the speed
    at which the two close in. Everything follows from commands, none from the order of rows.
    """
    cell_m, first_in_bin, next_in_bin = bins
    n_partners, partner, partner_speed = next_memory
    n_bins = first_in_bin.shape[0]
    touch_squared = touch_m * touch_m
    for i in range(position.shape[0]):
        n_partners[i] = 0
        command[i, 0] = twist[i, 0]
        command[i, 1] = twist[i, 1]
    for i in range(position.shape[0]):
        if not (near[i] and present[i]):
            continue
        weight = 0.0
        change_x = 0.0
        change_y = 0.0
        cell_x = cell_of(position[i, 0], cell_m)
        cell_y = cell_of(position[i, 1], cell_m)
        for step_x in range(-1, 2):
            for step_y in range(-1, 2):
                j = first_in_bin[bin_of(cell_x + step_x, cell_y + step_y, n_bins)]
                while j >= 0:
                    dx = position[j, 0] - position[i, 0]
                    dy = position[j, 1] - position[i, 1]
                    distance_squared = dx * dx + dy * dy
                    # A robot is no partner of itself, and two places of the nine may share a bin.
                    if 0.0 < distance_squared <= touch_squared and (
                        cell_of(float(position[j, 0]), cell_m) == cell_x + step_x
                        and cell_of(float(position[j, 1]), cell_m) == cell_y + step_y
                    ):
                        distance = math.sqrt(distance_squared)
                        dx /= distance
                        dy /= distance
                        closing_i = command[i, 0] * dx + command[i, 1] * dy
                        closing_j = -(command[j, 0] * dx + command[j, 1] * dy)
                        pressing = closing_i + closing_j
                        if pressing > 0.0:
                            before = remembered(memory, i, int(j))
                            speed = common_speed(closing_i, closing_j, before, east_or_north(dx, dy))
                            if n_partners[i] < partner.shape[1]:
                                partner[i, n_partners[i]] = j
                                partner_speed[i, n_partners[i]] = speed
                                n_partners[i] += 1
                            weight += pressing
                            change_x += pressing * (speed - closing_i) * dx
                            change_y += pressing * (speed - closing_i) * dy
                    j = next_in_bin[j]
        if weight > 0.0:
            twist[i, 0] += change_x / weight
            twist[i, 1] += change_y / weight
