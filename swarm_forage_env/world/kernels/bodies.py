"""Discs among boxes in a rectangle: who can touch whom in a tick, and a tick of motion with contacts.

The model of contact is Chipmunk's, for bodies that are all equal. In every substep

    1. bodies move by their velocity, and by the push that undoes overlap;
    2. contacts are looked up where they stand now: two discs that overlap, a disc that overlaps a wall or a box;
    3. impulses are worked out, contact by contact in rounds, until they settle.

An impulse along the normal n stops bodies that run into each other and never pulls: it is >= 0. The impulse across it,
friction, is at most `GRIP` times that. A push is worked out in the same way, apart from velocities: it undoes what an
overlap is beyond the slop in the next substep and is then forgotten. So a contact is met one substep late.

Velocities start every tick from the commands. What is left of the tick before are the places. The pushes of its last
substep follow from them and are worked out first. The impulses that then stop the bodies start from those of the tick
before, which changes nothing where they settle. In a heap that goes on pushing they are nearly right already.

All masses are equal and cancel. An impulse is given per mass, in m/s: an impulse j along n changes the velocity of a
disc by j, friction f its turn rate by 2 f / r (the moment of a disc is m r^2 / 2). A box that stands on the floor is a
wall that ends: the normal goes from the centre of a disc to the nearest point of the box. Effective masses of contacts:

    along n:   two discs m / 2, disc and wall m          across:   two discs m / 6, disc and wall m / 3

Contacts are taken in the order of rows: pairs (i, j) with i < j first, then robot by robot walls, west, east, south,
north, and boxes. Each has a number that grows in this order, by which it is found again in the next tick (a float,
which holds whole numbers up to 2^53).
"""

import math
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import inline_kernel, kernel, part
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray
from swarm_forage_env.world.kernels.bins import bin_of, cell_of
from swarm_forage_env.world.kernels.drive import SMALL_RAD, hold_inside, sinc_and_cosine, small_sinc_and_cosine
from swarm_forage_env.world.kernels.obstacles import hold_outside, is_within, nearest
from swarm_forage_env.world.state import Bins

FRICTION = 0.7
"""Of robots, walls and boxes."""
GRIP = FRICTION * FRICTION
"""Friction of a contact: the product of both sides."""
COLLISION_SLOP_M = 0.001
"""Overlap that is left alone. Chipmunk's default of 0.1 m would be more than a robot's radius."""
WALL_INSET_M = COLLISION_SLOP_M + 1e-5
"""How far a wall stands inside of the floor's border, and a box out of its sides, so that a robot that leans on it is
on the floor in spite of the slop; a hundredth of the slop more, or rounding would have it put back in every tick."""
ROUNDS = 160
"""Most rounds per substep; few are needed outside of heaps. Mean of the deepest overlap per tick of robots, packed into
a corner, that all push into it, as a share of a diameter: 512 robots 0.009 with 80 rounds and 0.007 with 160; 1,000
robots 0.99, which is one robot on top of another, and 0.017. Chipmunk with its 80: 0.011 and 0.053."""
SETTLED_M_S = 1e-9
"""Impulses have settled when a round changes no velocity by more than this: a tick moves no body by 1e-9 m of it."""
WALLS = 4
"""Most walls that a robot can touch, besides all the boxes."""
MARGIN_M = 0.01
"""How much farther than by their commands two bodies may come closer in a tick, because others shove them."""

Work = tuple[FloatArray, IntArray, BoolArray, IntArray, FloatArray]
"""Arrays to work in: velocity (N, 5) = x, y, turn rate, push x, push y; rows of busy robots (N,); who is busy (N,);
rows in contact (C, 2), -1 = wall; contacts (C, 7) = normal x, y, wanted push, impulse, friction and push so far,
number."""

Memory = tuple[IntArray, FloatArray]
"""Contacts of the tick before: how many (1,); number, impulse and friction in m/s (C, 3)."""


class BodyState(NamedTuple):
    """Bodies of one run, and what moving them needs."""

    poses: FloatArray
    """(N + 1, 3) x, y in m and unwrapped angle in rad; the last row is nobody."""
    near: BoolArray
    """(N,) who has anything within reach, as of the last proximity sweep."""
    bins: Bins
    """As of that sweep."""
    room: FloatArray
    """x low, y low, x high, y high of centres on the floor, m."""
    obstacles: FloatArray
    """(B, 4) boxes on the floor: x low, y low, x high, y high in m."""
    radius_m: float
    n_substeps: int
    pairs: IntArray
    """(P, 2) scratch."""
    work: Work
    memory: Memory


@kernel
def find_pairs(
    poses: FloatArray,
    present: BoolArray,
    near: BoolArray,
    bins: Bins,
    sight_m: float,
    pairs: IntArray,
) -> int:
    """Write pairs i < j of present robots with centres within `sight_m` into `pairs` (P, 2), sorted by i, then j.

    `near` (N,) and `bins` are those of `beams.proximity` where robots stand now; who has nobody near is passed over as
    long as `sight_m` is within what it looked through. Returns how many pairs there are; what is beyond P is not
    written.
    """
    cell_m, first_in_bin, next_in_bin = bins
    n_bins = first_in_bin.shape[0]
    rings = max(1, int(math.ceil(sight_m / cell_m)))
    n_pairs = 0
    for i in range(present.shape[0]):
        if not present[i] or (rings == 1 and not near[i]):
            continue
        cell_x = cell_of(poses[i, 0], cell_m)
        cell_y = cell_of(poses[i, 1], cell_m)
        first = n_pairs
        for step_x in range(-rings, rings + 1):
            for step_y in range(-rings, rings + 1):
                j = first_in_bin[bin_of(cell_x + step_x, cell_y + step_y, n_bins)]
                while j >= 0:
                    if j > i and present[j]:
                        dx = poses[j, 0] - poses[i, 0]
                        dy = poses[j, 1] - poses[i, 1]
                        # Two places of the nine may share a bin.
                        if dx * dx + dy * dy <= sight_m * sight_m and (
                            cell_of(float(poses[j, 0]), cell_m) == cell_x + step_x
                            and cell_of(float(poses[j, 1]), cell_m) == cell_y + step_y
                        ):
                            if n_pairs < pairs.shape[0]:
                                insert_pair(i, int(j), first, n_pairs, pairs)
                            n_pairs += 1
                    j = next_in_bin[j]
    return n_pairs


@part
def insert_pair(i: int, j: int, first: int, end: int, pairs: IntArray) -> None:
    """Put a pair among those of i, which are rows `first` to `end` of `pairs`, so that they stay sorted by j."""
    at = end
    while at > first and pairs[at - 1, 1] > j:
        pairs[at, 0] = i
        pairs[at, 1] = pairs[at - 1, 1]
        at -= 1
    pairs[at, 0] = i
    pairs[at, 1] = j


@part
def top_speed(twist: FloatArray) -> float:
    """Greatest speed in `twist` (N + 1, 3), m/s."""
    greatest = 0.0
    for i in range(twist.shape[0]):
        greatest = max(greatest, twist[i, 0] * twist[i, 0] + twist[i, 1] * twist[i, 1])
    return math.sqrt(greatest)


@part
def list_busy(b: BodyState, present: BoolArray, wall_m: float, n_pairs: int) -> int:
    """List the rows of robots that are in a pair, or within `wall_m` of where a wall or a box holds them.

    Returns how many there are.
    """
    poses, room, obstacles, pairs, work = b.poses, b.room, b.obstacles, b.pairs, b.work
    busy, is_busy = work[1], work[2]
    for i in range(present.shape[0]):
        to_west_or_east = min(poses[i, 0] - room[0], room[2] - poses[i, 0])
        is_busy[i] = min(to_west_or_east, poses[i, 1] - room[1], room[3] - poses[i, 1]) < wall_m
        for k in range(obstacles.shape[0]):
            is_busy[i] |= is_within(float(poses[i, 0]), float(poses[i, 1]), obstacles, k, b.radius_m + wall_m)
    for k in range(n_pairs):
        is_busy[pairs[k, 0]] = True
        is_busy[pairs[k, 1]] = True
    n_busy = 0
    for i in range(present.shape[0]):
        is_busy[i] = is_busy[i] and present[i]
        if is_busy[i]:
            busy[n_busy] = i
            n_busy += 1
    return n_busy


@part
def add_contact(
    n: int, i: int, j: int, number: float, normal: tuple[float, float], gap_m: float, substep_s: float, work: Work
) -> int:
    """Write contact n of body i with body j (-1 = wall or box) along the normal from i; returns n + 1.

    `gap_m` is negative; the push undoes what is beyond the slop in one substep.
    """
    touching, contact = work[3], work[4]
    touching[n, 0] = i
    touching[n, 1] = j
    contact[n, 0] = normal[0]
    contact[n, 1] = normal[1]
    contact[n, 2] = max(0.0, -(gap_m + COLLISION_SLOP_M)) / substep_s
    contact[n, 3] = 0.0
    contact[n, 4] = 0.0
    contact[n, 5] = 0.0
    contact[n, 6] = number
    return n + 1


@part
def find_contacts(
    poses: FloatArray,
    pairs: IntArray,
    n_pairs: int,
    n_busy: int,
    room: FloatArray,
    obstacles: FloatArray,
    radius: float,
    substep_s: float,
    work: Work,
) -> int:
    """Write the contacts of busy robots as they stand, pairs first; returns how many there are."""
    diameter = 2.0 * radius
    n_robots = work[1].shape[0]
    n = 0
    for k in range(n_pairs):
        i, j = pairs[k, 0], pairs[k, 1]
        dx = poses[j, 0] - poses[i, 0]
        dy = poses[j, 1] - poses[i, 1]
        squared = dx * dx + dy * dy
        if squared < diameter * diameter:
            distance = math.sqrt(squared)
            normal = 1.0, 0.0  # for one on top of the other, where any direction will do
            if distance > 0.0:
                normal = dx / distance, dy / distance
            n = add_contact(n, i, j, float(i) * n_robots + j, normal, distance - diameter, substep_s, work)
    busy = work[1]
    for k in range(n_busy):
        i = busy[k]
        number = float(n_robots) * n_robots + (WALLS + obstacles.shape[0]) * i
        west = poses[i, 0] - room[0] - WALL_INSET_M
        east = room[2] - poses[i, 0] - WALL_INSET_M
        south = poses[i, 1] - room[1] - WALL_INSET_M
        north = room[3] - poses[i, 1] - WALL_INSET_M
        if west < 0.0:
            n = add_contact(n, i, -1, number, (-1.0, 0.0), west, substep_s, work)
        if east < 0.0:
            n = add_contact(n, i, -1, number + 1, (1.0, 0.0), east, substep_s, work)
        if south < 0.0:
            n = add_contact(n, i, -1, number + 2, (0.0, -1.0), south, substep_s, work)
        if north < 0.0:
            n = add_contact(n, i, -1, number + 3, (0.0, 1.0), north, substep_s, work)
        for b in range(obstacles.shape[0]):
            to_x, to_y, distance = nearest(float(poses[i, 0]), float(poses[i, 1]), obstacles, b)
            gap = distance - radius - WALL_INSET_M
            if gap < 0.0:
                n = add_contact(n, i, -1, number + WALLS + b, (to_x, to_y), gap, substep_s, work)
    return n


@part
def push_discs(velocity: FloatArray, i: int, j: int, contact: FloatArray, k: int, radius: float) -> float:
    """One round of the contact k of two discs; returns the largest change of an impulse, m/s."""
    nx, ny = contact[k, 0], contact[k, 1]
    dx = velocity[j, 0] - velocity[i, 0]
    dy = velocity[j, 1] - velocity[i, 1]
    along = dx * nx + dy * ny
    across = dy * nx - dx * ny - radius * (velocity[i, 2] + velocity[j, 2])
    apart = (velocity[j, 3] - velocity[i, 3]) * nx + (velocity[j, 4] - velocity[i, 4]) * ny
    impulse = max(0.0, contact[k, 3] - 0.5 * along)
    most = GRIP * impulse
    friction = min(most, max(-most, contact[k, 4] - across / 6.0))
    push = max(0.0, contact[k, 5] + 0.5 * (contact[k, 2] - apart))
    more, more_across, more_push = impulse - contact[k, 3], friction - contact[k, 4], push - contact[k, 5]
    contact[k, 3], contact[k, 4], contact[k, 5] = impulse, friction, push
    give(velocity, i, -1.0, contact, k, (more, more_across, more_push), radius)
    give(velocity, j, 1.0, contact, k, (more, more_across, more_push), radius)
    return max(abs(more), abs(more_across), abs(more_push))


@part
def push_wall(velocity: FloatArray, i: int, contact: FloatArray, k: int, radius: float) -> float:
    """One round of the contact k of a disc and a wall or a box; returns the largest change of an impulse, m/s."""
    nx, ny = contact[k, 0], contact[k, 1]
    along = -(velocity[i, 0] * nx + velocity[i, 1] * ny)
    across = velocity[i, 0] * ny - velocity[i, 1] * nx - radius * velocity[i, 2]
    apart = -(velocity[i, 3] * nx + velocity[i, 4] * ny)
    impulse = max(0.0, contact[k, 3] - along)
    most = GRIP * impulse
    friction = min(most, max(-most, contact[k, 4] - across / 3.0))
    push = max(0.0, contact[k, 5] + contact[k, 2] - apart)
    more, more_across, more_push = impulse - contact[k, 3], friction - contact[k, 4], push - contact[k, 5]
    contact[k, 3], contact[k, 4], contact[k, 5] = impulse, friction, push
    give(velocity, i, -1.0, contact, k, (more, more_across, more_push), radius)
    return max(abs(more), abs(more_across), abs(more_push))


@part
def give(
    velocity: FloatArray,
    i: int,
    sign: float,
    contact: FloatArray,
    k: int,
    impulses: tuple[float, float, float],
    radius: float,
) -> None:
    """Change the velocity of a body by impulse, friction and push of the contact k; `sign` is -1 for its first body."""
    nx, ny = contact[k, 0], contact[k, 1]
    along, across, push = impulses
    velocity[i, 0] += sign * (along * nx - across * ny)
    velocity[i, 1] += sign * (along * ny + across * nx)
    velocity[i, 2] -= 2.0 * across / radius  # both bodies are turned the same way, like two wheels that rub
    velocity[i, 3] += sign * push * nx
    velocity[i, 4] += sign * push * ny


@part
def settle(n_contacts: int, radius: float, work: Work) -> None:
    """Work out impulses and pushes of all contacts, in rounds, and change the velocities by them."""
    velocity, touching, contact = work[0], work[3], work[4]
    for _ in range(ROUNDS):
        change = 0.0
        for k in range(n_contacts):
            i, j = touching[k, 0], touching[k, 1]
            if j >= 0:
                change = max(change, push_discs(velocity, i, j, contact, k, radius))
            else:
                change = max(change, push_wall(velocity, i, contact, k, radius))
        if change <= SETTLED_M_S:
            return


@part
def recall(n_contacts: int, radius: float, work: Work, memory: Memory) -> None:
    """Start contacts that were there in the tick before with their impulses."""
    velocity, touching, contact = work[0], work[3], work[4]
    n_before, before = memory
    m = 0
    for k in range(n_contacts):
        while m < n_before[0] and before[m, 0] < contact[k, 6]:
            m += 1
        if m < n_before[0] and before[m, 0] == contact[k, 6]:
            contact[k, 3] = before[m, 1]
            contact[k, 4] = before[m, 2]
            given = before[m, 1], before[m, 2], 0.0
            give(velocity, touching[k, 0], -1.0, contact, k, given, radius)
            if touching[k, 1] >= 0:
                give(velocity, touching[k, 1], 1.0, contact, k, given, radius)


@part
def remember(n_contacts: int, work: Work, memory: Memory) -> None:
    """Keep the impulses of all contacts for the next tick."""
    contact = work[4]
    n_before, before = memory
    n_before[0] = n_contacts
    for k in range(n_contacts):
        before[k, 0] = contact[k, 6]
        before[k, 1] = contact[k, 3]
        before[k, 2] = contact[k, 4]


@part
def move_busy(poses: FloatArray, n_busy: int, substep_s: float, work: Work) -> None:
    """Move busy robots by one substep; pushes are spent by it."""
    velocity, busy = work[0], work[1]
    for k in range(n_busy):
        i = busy[k]
        poses[i, 0] += (velocity[i, 0] + velocity[i, 3]) * substep_s
        poses[i, 1] += (velocity[i, 1] + velocity[i, 4]) * substep_s
        poses[i, 2] += velocity[i, 2] * substep_s
        velocity[i, 3] = 0.0
        velocity[i, 4] = 0.0


@kernel
def tell_poses(
    poses: FloatArray, present: BoolArray, position: FloatArray, heading: FloatArray, facing: FloatArray
) -> None:
    """Copy poses of present robots; headings are wrapped to (-pi, pi].

    `facing` is turned with the heading and kept at length 1, which stays within 1e-12 of its cosine and sine over a run
    of 50,000 ticks and takes a fraction of their time.
    """
    places, at, ahead = poses.reshape(poses.size), position.reshape(position.size), facing.reshape(facing.size)
    # Flat arrays, no branch and few arrays in a loop: so processors take several robots at once.
    for i in range(present.shape[0]):
        at[2 * i] = places[3 * i] if present[i] else at[2 * i]
        at[2 * i + 1] = places[3 * i + 1] if present[i] else at[2 * i + 1]
    n_left = 0
    for i in range(present.shape[0]):
        here = present[i]
        cos = ahead[2 * i]
        sin = ahead[2 * i + 1]
        wrapped = _wrapped(places[3 * i + 2])
        turn = _turn_to(wrapped, heading[i])
        is_small = abs(turn) <= SMALL_RAD
        n_left += here & (not is_small)
        sinc, cosine = small_sinc_and_cosine(turn)
        sine = turn * sinc
        x = cos * cosine - sin * sine
        y = cos * sine + sin * cosine
        stretch = 1.5 - 0.5 * (x * x + y * y)
        turns = here & is_small & (turn != 0.0)
        heading[i] = wrapped if turns else heading[i]
        ahead[2 * i] = x * stretch if turns else cos
        ahead[2 * i + 1] = y * stretch if turns else sin
    if n_left > 0:
        for i in range(present.shape[0]):
            wrapped = _wrapped(poses[i, 2])
            turn = _turn_to(wrapped, heading[i])
            if present[i] and abs(turn) > SMALL_RAD:
                heading[i] = wrapped
                sinc, cosine = sinc_and_cosine(turn)
                sine = turn * sinc
                x = facing[i, 0] * cosine - facing[i, 1] * sine
                y = facing[i, 0] * sine + facing[i, 1] * cosine
                stretch = 1.5 - 0.5 * (x * x + y * y)
                facing[i, 0] = x * stretch
                facing[i, 1] = y * stretch


@part
def _wrapped(angle: float) -> float:
    """An angle in (-pi, pi]."""
    return angle - 2.0 * math.pi * np.ceil((angle - math.pi) * (0.5 / math.pi))


@part
def _turn_to(wrapped: float, heading: float) -> float:
    """Turn from one heading to another one; past the back, where headings jump by a full turn, the short way."""
    turn = wrapped - heading
    return turn - math.copysign(2.0 * math.pi, turn) if abs(turn) > math.pi else turn


@inline_kernel
def move_bodies(b: BodyState, twist: FloatArray, present: BoolArray, dt_s: float) -> bool:
    """Move present robots by one tick along `twist` (>= N, 3), with contacts; nobody ends in a wall or a box.

    Returns False if there are more pairs than `b.pairs` holds. Then nobody was moved: call again with more room.
    """
    poses, room, work = b.poses, b.room, b.work
    fastest_m = top_speed(twist) * dt_s
    sight_m = 2.0 * (b.radius_m + fastest_m) + MARGIN_M
    n_pairs = find_pairs(poses, present, b.near, b.bins, sight_m, b.pairs)
    if n_pairs > b.pairs.shape[0]:
        return False
    n_busy = list_busy(b, present, WALL_INSET_M + fastest_m + MARGIN_M, n_pairs)
    velocity, busy, is_busy = work[0], work[1], work[2]
    for i in range(present.shape[0]):
        if present[i] and not is_busy[i]:
            poses[i, 0] += twist[i, 0] * dt_s
            poses[i, 1] += twist[i, 1] * dt_s
            poses[i, 2] += twist[i, 2] * dt_s
    for k in range(n_busy):
        for column in range(5):
            velocity[busy[k], column] = 0.0
    substep_s = dt_s / b.n_substeps
    for substep in range(b.n_substeps):
        n_contacts = find_contacts(poses, b.pairs, n_pairs, n_busy, room, b.obstacles, b.radius_m, substep_s, work)
        if substep == 1:
            recall(n_contacts, b.radius_m, work, b.memory)
        settle(n_contacts, b.radius_m, work)
        if substep == 1:
            remember(n_contacts, work, b.memory)
        if substep == 0:  # so far bodies stood still and got their pushes only
            for k in range(n_busy):
                for column in range(3):
                    velocity[busy[k], column] = twist[busy[k], column]
        move_busy(poses, n_busy, substep_s, work)
    hold_inside(poses, present, room)
    if b.obstacles.shape[0] > 0:
        hold_outside(poses, present, b.obstacles, room, b.radius_m)
    return True
