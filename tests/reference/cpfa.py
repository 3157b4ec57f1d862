"""CPFA for one robot, slow and obvious: the twin of `baselines.cpfa`. Conventions are those of `controllers`."""

import cmath
import math
from dataclasses import dataclass, field

import numpy as np

from baselines.cpfa import CPFAParameters
from tests.reference.controllers import ReferenceRobot, visible_objects, with_length

DECISION, TURN, TURN_SIDE = 4, 5, 6
STEP_TICKS = 5


def poisson_cdf(count: int, rate: float) -> float:
    """POIS(count, rate) of the paper."""
    return math.exp(-rate) * sum(rate**i / math.factorial(i) for i in range(count + 1))


@dataclass
class CPFARobot(ReferenceRobot):
    """One robot under CPFA."""

    parameters: CPFAParameters = field(default_factory=CPFAParameters)
    stage: str = "choose"
    site: tuple[tuple[float, float], int] | None = None
    """Where the last trip found an object, and how many others were there."""
    informed: bool = False
    course: complex = 1.0
    """Direction of the search."""
    searched: int = 0
    step: int = 0

    def change_state(self) -> None:
        before = self.state
        super().change_state()
        if self.state == "leave nest":  # no robot of CPFA walks out at random
            self.restart()
        if before in ("acquire", "wait for pick-up") and self.state == "homing":
            self.site = (tuple(self.position), len(self.visible()))
        if before in ("homing", "homing in nest", "wait for drop") and self.state == "acquire":
            self.stage = "choose"

    def visible(self) -> dict[tuple[int, int], int]:
        return visible_objects(self.spec, self.senses)[1]

    @property
    def heading(self) -> complex:
        return complex(*self.senses["heading"])

    def head_for(self, goal: tuple[float, float], tolerance: float) -> None:
        self.goal, self.tolerance, self.vector, self.recovery = goal, tolerance, "vector", 0

    def explore(self) -> tuple[bool, complex]:
        """One tick of a trip."""
        if self.stage == "give up" and self.sees(0.6, 0.8, 3):
            self.stage = "choose"
        if self.stage == "choose":
            self.set_out()
        elif self.stage == "travel" and not self.informed and self.draws[DECISION] < self.parameters.search_per_tick:
            self.start_search()
        elif self.stage == "search" and self.draws[DECISION] < self.parameters.give_up_per_tick:
            self.stage, self.site, self.tells = "give up", None, False
            self.head_for(self.nearest_nest(self.position), self.parameters.site_tolerance_m)
        if self.stage == "search":
            return self.search()
        arrived, force = self.go()
        if arrived and self.stage == "travel":
            self.start_search()
        return False, force

    def set_out(self) -> None:
        rate = self.parameters.site_fidelity_rate
        self.stage = "travel"
        self.informed = self.site is not None and poisson_cdf(self.site[1], rate) > self.draws[DECISION]
        self.head_for(self.site[0] if self.informed else self.at_the_wall(), self.parameters.site_tolerance_m)

    def at_the_wall(self) -> tuple[float, float]:
        """The last point that is not too near to a wall ahead, by halving."""
        angle = 2.0 * math.pi * self.draws[TURN]
        ahead = np.array((math.cos(angle), math.sin(angle)))
        margin = self.parameters.wall_margin_m
        far = np.array(self.spec.arena_size_m) - margin
        low, high = 0.0, 50.0
        for _ in range(60):
            place = self.position + 0.5 * (low + high) * ahead
            # A robot nearer to a wall than that may still drive away from it.
            is_clear = all(((place >= margin) | (ahead > 0.0)) & ((place <= far) | (ahead < 0.0)))
            low, high = (0.5 * (low + high), high) if is_clear else (low, 0.5 * (low + high))
        return tuple(self.position + low * ahead)

    def start_search(self) -> None:
        self.stage, self.searched = "search", 0
        self.keep_course()

    def keep_course(self) -> None:
        self.course, self.step, self.vector = self.heading, STEP_TICKS, "idle"

    def search(self) -> tuple[bool, complex]:
        self.searched += 1
        if self.sees_object():
            self.keep_course()
            return True, 0j
        cell_m = self.spec.cell_m
        places = [((x + 0.5) * cell_m, (y + 0.5) * cell_m) for x, y in self.visible()]
        if places:
            self.goal = min(places, key=lambda place: math.dist(place, self.position))
            self.tolerance = self.parameters.object_tolerance_m
            if self.vector == "idle":
                self.vector, self.recovery = "vector", 0
            return False, self.go()[1]
        if self.vector != "idle":
            self.keep_course()
        return False, self.walk()

    def walk(self) -> complex:
        if self.obstacle():
            force = self.wander(1) + self.avoid()
            self.course = self.heading * force
            return force
        self.step -= self.turning == 0
        if self.step < 0:
            self.course, self.step = self.heading * cmath.exp(1j * self.turn()), STEP_TICKS
        return with_length(self.course / self.heading, 9.0)

    def turn(self) -> float:
        """A turn from a normal distribution, by Box and Muller."""
        omega, decay = self.parameters.uninformed_turn_rad, self.parameters.informed_decay_per_tick
        deviation = omega + (4 * math.pi - omega) * math.exp(-decay * self.searched) if self.informed else omega
        size = math.sqrt(-2.0 * math.log1p(-self.draws[TURN]))
        return deviation * size * math.cos(2.0 * math.pi * self.draws[TURN_SIDE])
