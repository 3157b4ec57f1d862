"""Discs among boxes in a rectangle told slowly: all pairs in every substep, places and velocities as complex numbers.

Masses are in kg and impulses in kg m/s, as in a textbook; impulses that a contact starts with are in a dictionary.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field

from swarm_forage_env.world.kernels.bodies import ROUNDS, SETTLED_M_S

MASS_KG = 1.6
GRIP = 0.49
SLOP_M = 0.001
INSET_M = 0.00101
WALLS = {"west": -1, "east": 1, "south": -1j, "north": 1j}
"""Normals from the floor into the walls."""

Key = tuple[int, int | str]
Impulses = dict[Key, tuple[float, float]]
Pose = tuple[float, float, float]
Box = tuple[float, float, float, float]
"""x low, y low, x high, y high in m."""


@dataclass
class Disc:
    """A present robot."""

    place: complex
    angle: float
    velocity: complex = 0j
    turn: float = 0.0
    push: complex = 0j


@dataclass
class Touch:
    """A contact and what its bodies have been given so far: along the normal, across it, and as a push."""

    one: Disc
    other: Disc | None
    normal: complex
    gap_m: float
    given: list[float] = field(default_factory=lambda: [0.0, 0.0, 0.0])

    def give(self, more: list[float], radius: float) -> None:
        """Change the velocities of both bodies."""
        moment = MASS_KG * radius**2 / 2
        impulse = complex(more[0], more[1]) * self.normal
        for disc, sign in ((self.one, -1.0), (self.other, 1.0)):
            if disc is not None:
                disc.velocity += sign * impulse / MASS_KG
                disc.turn -= radius * more[1] / moment
                disc.push += sign * more[2] * self.normal / MASS_KG
        self.given = [before + change for before, change in zip(self.given, more, strict=True)]

    def improve(self, substep_s: float, radius: float) -> float:
        """One round; returns the largest change in m/s."""
        bodies = [self.one] if self.other is None else [self.one, self.other]
        velocity, push, turn = -self.one.velocity, -self.one.push, self.one.turn
        if self.other is not None:
            velocity, push, turn = velocity + self.other.velocity, push + self.other.push, turn + self.other.turn
        # Seen in the frame of the normal: real part along it, imaginary part across it.
        seen = velocity * self.normal.conjugate()
        apart = (push * self.normal.conjugate()).real
        moment = MASS_KG * radius**2 / 2
        mass_along = 1 / (len(bodies) / MASS_KG)
        mass_across = 1 / (len(bodies) / MASS_KG + len(bodies) * radius**2 / moment)
        wanted = max(0.0, -self.gap_m - SLOP_M) / substep_s
        along = max(0.0, self.given[0] - mass_along * seen.real)
        across = self.given[1] - mass_across * (seen.imag - radius * turn)
        across = math.copysign(min(abs(across), GRIP * along), across)
        pushed = max(0.0, self.given[2] + mass_along * (wanted - apart))
        more = [along - self.given[0], across - self.given[1], pushed - self.given[2]]
        self.give(more, radius)
        return max(map(abs, more)) / MASS_KG


def towards(place: complex, box: Box) -> tuple[complex, float]:
    """Direction to the nearest point of a box, and its distance; from within, that of the nearest side, negative."""
    x_low, y_low, x_high, y_high = box
    at = complex(min(max(place.real, x_low), x_high), min(max(place.imag, y_low), y_high))
    if at != place:
        return (at - place) / abs(at - place), abs(at - place)
    depths = {1: place.real - x_low, -1: x_high - place.real, 1j: place.imag - y_low, -1j: y_high - place.imag}
    inwards = min(depths, key=lambda way: depths[way])
    return inwards, -depths[inwards]


def touches(
    discs: dict[int, Disc], room: tuple[float, float, float, float], radius: float, boxes: Sequence[Box]
) -> dict[Key, Touch]:
    """All contacts, pairs first."""
    found: dict[Key, Touch] = {}
    for i, one in discs.items():
        for j, other in discs.items():
            between = other.place - one.place
            if i < j and abs(between) < 2 * radius:
                normal = between / abs(between) if between else 1
                found[i, j] = Touch(one, other, normal, abs(between) - 2 * radius)
    low, high = complex(*room[:2]), complex(*room[2:])
    for i, disc in discs.items():
        below, above = disc.place - low, high - disc.place
        gaps = {"west": below.real, "east": above.real, "south": below.imag, "north": above.imag}
        for wall, normal in WALLS.items():
            if gaps[wall] < INSET_M:
                found[i, wall] = Touch(disc, None, normal, gaps[wall] - INSET_M)
        for number, box in enumerate(boxes):
            normal, distance = towards(disc.place, box)
            if distance - radius < INSET_M:
                found[i, f"box {number}"] = Touch(disc, None, normal, distance - radius - INSET_M)
    return found


def moved(
    poses: list[Pose],
    twists: list[Pose],
    present: list[bool],
    room: tuple[float, float, float, float],
    sizes: tuple[float, float, int],
    before: Impulses,
    boxes: Sequence[Box] = (),
) -> tuple[list[Pose], Impulses]:
    """Poses after a tick, and the impulses of the contacts that stopped the bodies.

    `sizes` = radius in m, length of the tick in s, number of substeps; `before` are the impulses of the last tick.
    """
    radius, dt_s, n_substeps = sizes
    discs = {i: Disc(complex(*poses[i][:2]), poses[i][2]) for i in range(len(poses)) if present[i]}
    substep_s = dt_s / n_substeps
    after: Impulses = {}
    for substep in range(n_substeps):
        contacts = touches(discs, room, radius, boxes)
        if substep == 1:
            for key in contacts.keys() & before.keys():
                contacts[key].give([*before[key], 0.0], radius)
        for _ in range(ROUNDS):
            change = max([0.0, *(contact.improve(substep_s, radius) for contact in contacts.values())])
            if change <= SETTLED_M_S:
                break
        if substep == 1:
            after = {key: (contact.given[0], contact.given[1]) for key, contact in contacts.items()}
        for i, disc in discs.items():
            if substep == 0:  # until now it stood still
                disc.velocity, disc.turn = complex(*twists[i][:2]), twists[i][2]
            disc.place += (disc.velocity + disc.push) * substep_s
            disc.angle += disc.turn * substep_s
            disc.push = 0j
    ended = list(poses)
    for i, disc in discs.items():
        ended[i] = (*held_outside(held(disc.place, room), room, radius, boxes), disc.angle)
    return ended, after


def held(place: complex, room: tuple[float, float, float, float]) -> complex:
    """The nearest place on the floor."""
    return complex(min(max(place.real, room[0]), room[2]), min(max(place.imag, room[1]), room[3]))


def held_outside(
    place: complex, room: tuple[float, float, float, float], radius: float, boxes: Sequence[Box]
) -> tuple[float, float]:
    """Place (x, y) of a disc after it was moved out of each box in turn, at most four times round."""
    for _ in range(4):
        before = place
        for box in boxes:
            inwards, distance = towards(place, box)
            if distance < radius:
                place = held(place - (radius - distance) * inwards, room)
        if place == before:
            break
    return place.real, place.imag
