"""CRW, DPO and CPFA for one robot, slow and obvious: complex numbers, dictionaries, strings. Twin of the kernels.

A force is a complex number, forward + 1j * left, in cm/s; distances are in metres.
"""

import cmath
import math
from dataclasses import dataclass, field

import numpy as np

from baselines.cpfa import CPFAParameters
from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.contract.policy import SwarmSpec

RHO = 0.00001
LOCK_TICKS = 50
RECOVERY_TICKS = 10
LONGEST_TURN_TICKS = 12
SENSOR_ANGLES = np.deg2rad(7.5 + 15.0 * np.arange(24))


def sensed(spec: SwarmSpec, row: np.ndarray) -> dict[str, np.ndarray]:
    """One observation row as a dictionary of its slices, in double precision."""
    return {part.name: row[part.start : part.stop].astype(float) for part in spec.layout}


def vector_sum(readings: np.ndarray) -> complex:
    """Ring readings summed as polar vectors."""
    return complex(np.sum(readings * np.exp(1j * SENSOR_ANGLES)))


def with_length(direction: complex, length: float) -> complex:
    """A force of a given length; a zero direction means straight ahead."""
    return cmath.rect(length, cmath.phase(direction))


class ObjectDictionary:
    """Object memory as a dictionary: row -> [cell, density]; every density decays in every tick."""

    def __init__(self) -> None:
        self.known: dict[int, tuple[tuple[int, int], float]] = {}

    def update(self, own_cell: tuple[int, int], visible: dict[tuple[int, int], int]) -> None:
        """One tick: forget what should be visible but is not, remember what is visible, decay."""
        for row, (cell, _) in list(self.known.items()):
            in_window = max(abs(cell[0] - own_cell[0]), abs(cell[1] - own_cell[1])) <= 2
            if in_window and row not in visible.values():
                del self.known[row]
        for cell, row in visible.items():
            for other, (other_cell, _) in list(self.known.items()):
                if other_cell == cell and other != row:
                    del self.known[other]
            self.known[row] = (cell, 1.0)
        for row, (cell, density) in self.known.items():
            self.known[row] = (cell, max(0.0, (1.0 - RHO) * density))


def visible_objects(spec: SwarmSpec, senses: dict[str, np.ndarray]) -> tuple[tuple[int, int], dict]:
    """The robot's own cell, and the objects in its window: cell -> row."""
    size = np.array(spec.arena_size_m)
    own = np.rint((senses["los_cell"] + 1.0) / 2.0 * size / spec.cell_m - 0.5).astype(int)
    visible = {}
    for k, value in enumerate(senses["los_object"]):
        if value > 0:
            cell = (int(own[0]) + k % 5 - 2, int(own[1]) + k // 5 - 2)
            visible[cell] = round(value * spec.n_objects) - 1
    return (int(own[0]), int(own[1])), visible


@dataclass
class ReferenceRobot:
    """One robot under CRW, or under DPO if it has a memory."""

    spec: SwarmSpec
    memory: ObjectDictionary | None = None
    state: str = "acquire"
    wander_deg: float = 0.0
    timer: int | None = None
    """Ticks of exploration; None = not exploring."""
    vector: str = "idle"
    recovery: int = 0
    turning: int = 0
    """Ticks in a row in which it turned on the spot."""
    rest: tuple[float, float] = (0.0, 0.0)
    resting: int = 0
    """Ticks since it was at `rest`, on its way home among obstacles."""
    detour: int = 0
    side: int = 1
    """Ticks that are left of a detour to the left (1) or to the right (-1)."""
    slowing: bool = False
    depth: float = 0.0
    target: int = -1
    goal: tuple[float, float] = (0.0, 0.0)
    tolerance: float = 0.02
    draws: np.ndarray = field(default_factory=lambda: np.zeros(4))

    def act(self, row: np.ndarray, draws: np.ndarray) -> tuple[float, float, float]:
        """One tick; draws are for drop depth, wander, restart wander and free-breaking wander."""
        self.draws = draws
        self.senses = sensed(self.spec, row)
        self.away = vector_sum(self.senses["proximity"])
        size = np.array(self.spec.arena_size_m)
        self.position = (self.senses["position"] + 1.0) / 2.0 * size
        if self.memory is not None:
            self.memory.update(*visible_objects(self.spec, self.senses))
        self.change_state()
        force = 0j
        if self.state == "acquire":
            found, force = self.acquire() if self.memory is not None else self.explore()
            if found:
                self.state = "wait for pick-up"
        elif self.state in ("homing", "homing in nest"):
            force = self.home()
        elif self.state == "leave nest":
            force = self.wander(1) + self.avoid()
        if self.state.startswith("wait"):
            grip = Grip.GRASP if self.state == "wait for pick-up" else Grip.DELIVER
            return (*self.stand(), grip)
        return (*self.drive(force), Grip.GRASP if self.state.startswith("homing") else Grip.RELEASE)

    def stand(self) -> tuple[float, float]:
        self.turning = 0
        return 0.0, 0.0

    def drive(self, force: complex) -> tuple[float, float]:
        left, right = drive(force)
        self.turning = self.turning + 1 if left + right == 0.0 else 0
        return left, right

    def change_state(self) -> None:
        """What the world did to the robot."""
        carrying = self.senses["carrying"][0] == 1.0
        event = round(self.senses["event"][0] * 16)
        failed = event in (Event.NOTHING_HERE, Event.VANISHED)
        if carrying and self.state in ("acquire", "wait for pick-up", "leave nest"):
            self.state, self.resting, self.detour = "homing", 0, 0
            if self.memory is not None:
                self.memory.known.pop(round(self.senses["cargo"][0] * self.spec.n_objects) - 1, None)
        elif carrying and self.state == "wait for drop" and failed:
            self.state, self.resting, self.detour = "homing", 0, 0
        elif not carrying and (self.state.startswith("homing") or (self.state == "wait for pick-up" and failed)):
            self.restart()
        elif not carrying and self.state == "wait for drop":
            self.restart()
            if self.spec.quirks.nest_left_at_random:
                self.state = "leave nest"
        if self.state == "leave nest" and not self.sees(0.6, 0.8, 3):
            self.restart()

    def restart(self) -> None:
        """Acquire from the beginning."""
        self.state, self.timer, self.vector, self.recovery = "acquire", None, "idle", 0

    def nearest_nest(self, place: tuple[float, float]) -> tuple[float, float]:
        """Centre of the nearest nest."""
        centres = [((box[0] + box[2]) / 2, (box[1] + box[3]) / 2) for box in self.spec.nest_boxes_m]
        return min(centres, key=lambda centre: math.dist(centre, place))

    def sees(self, low: float, high: float, at_least: int) -> bool:
        """Whether enough ground sensors read a grey in the band."""
        readings = self.senses["ground"]
        return int(np.sum((readings >= low - 1e-6) & (readings <= high + 1e-6))) >= at_least

    def sees_object(self) -> bool:
        return self.sees(-0.05, 0.05, 4)

    def obstacle(self) -> bool:
        is_behind = abs(cmath.phase(self.away)) > 2.61
        if self.spec.quirks.obstacle_behind_counts and abs(self.away) > 1e-6 and is_behind:
            return True
        return abs(self.away) > 0.1 and not is_behind

    def avoid(self) -> complex:
        return with_length(-self.away, 8.0) if self.obstacle() else 0j

    def wander(self, draw: int) -> complex:
        w = math.radians(self.wander_deg)
        force = with_length(100.0 * cmath.exp(1j * w) - 4.0, 9.0)
        self.wander_deg = math.fmod(self.wander_deg + (-5.0 + 10.0 * self.draws[draw]), 5.0)
        return force

    def explore(self) -> tuple[bool, complex]:
        force = 0j
        if self.timer is None:
            self.timer = 0
            if self.spec.quirks.explore_double_start:
                force += self.wander(2) + self.avoid()
        if self.timer >= LOCK_TICKS and self.sees_object():
            self.timer = None
            return True, 0j
        self.timer += 1
        return False, force + self.wander(1) + self.avoid()

    def acquire(self) -> tuple[bool, complex]:
        if self.vector == "idle":
            if not self.choose():
                return self.explore()
            self.timer, self.vector, self.recovery = None, "vector", 0
            arrived, force = self.go()
        else:
            arrived, force = self.go()
            if self.target not in self.memory.known:
                return self.give_up(force)
        if not arrived:
            return False, force
        if self.sees_object():
            self.vector = "idle"
            return True, 0j
        return self.give_up(force)

    def give_up(self, force: complex) -> tuple[bool, complex]:
        self.vector, self.recovery = "idle", 0
        found, more = self.explore()
        return found, force + more

    def choose(self) -> bool:
        """Best remembered object further than 0.2 m."""
        cell_m = self.spec.cell_m
        utilities = {}
        for row, (cell, density) in self.memory.known.items():
            anchor = (cell[0] * cell_m, cell[1] * cell_m)
            centre = (anchor[0] + cell_m / 2, anchor[1] + cell_m / 2)
            if math.dist(centre, self.position) > 0.2:
                from_nest = math.dist(anchor, self.nearest_nest(anchor))
                utilities[row] = from_nest / math.dist(anchor, self.position) * math.exp(density)
        if not utilities:
            return False
        self.target = max(utilities, key=lambda row: utilities[row])
        cell = self.memory.known[self.target][0]
        self.goal = ((cell[0] + 0.5) * cell_m, (cell[1] + 0.5) * cell_m)
        return True

    def go(self) -> tuple[bool, complex]:
        """One tick of vectoring: whether arrived, and the force. States may follow one another within the tick."""
        force = 0j
        for _ in range(2):
            if self.vector == "recovery":
                force += 7.0
                self.recovery += 1
                if self.obstacle():
                    self.recovery, self.vector = 0, "avoidance"
                elif self.recovery == RECOVERY_TICKS:
                    self.recovery, self.vector = 0, "vector"
                else:
                    return False, force
            elif self.vector == "vector":
                if self.obstacle() and not self.slowing:
                    self.vector = "avoidance"
                    continue
                distance = math.dist(self.goal, self.position)
                return distance <= self.tolerance, force + self.arrive(distance)
            else:
                if self.obstacle():
                    force += self.avoid()
                    left, right = self.senses["wheel_speed"] * 20.0
                    if (left + right) / 2 <= 0.1:
                        force += self.wander(3)
                    return False, force
                self.vector = "recovery"
        raise AssertionError("vectoring changes state at most once in a tick")

    def arrive(self, distance: float) -> complex:
        cos, sin = self.senses["heading"]
        offset = complex(self.goal[0] - self.position[0], self.goal[1] - self.position[1]) * complex(cos, -sin)
        self.slowing = distance <= 0.2
        return with_length(offset, max(1.0, 8.0 * distance / 0.2) if self.slowing else 8.0)

    def is_on_a_detour(self) -> bool:
        """Half a metre in 20 s, or a detour of at most 400 s begins."""
        if math.dist(self.position, self.rest) > 0.5:
            self.rest, self.resting = (float(self.position[0]), float(self.position[1])), 0
        self.resting += 1
        if self.resting > 100 and self.detour == 0:
            self.detour = 1 + int((2.0 * self.draws[0] - 1.0) ** 2 * 2000)
            self.side = 1 if self.draws[0] < 0.5 else -1
            self.resting = 0
        return self.detour > 0

    def go_round(self, light: complex) -> complex:
        self.detour -= 1
        if self.obstacle():
            away = with_length(-self.away, 8.0)
            return 0.1 * away - 1j * self.side * away
        return light * cmath.exp(1j * self.side * math.pi / 4)

    def home(self) -> complex:
        distance = math.dist(self.position, self.nearest_nest(self.position))
        in_nest = self.sees(0.6, 0.8, 3)
        if self.state == "homing" and in_nest:
            self.depth = 0.01 + (distance - 0.01) * self.draws[0]
            self.state = "homing in nest"
        if self.state == "homing in nest" and in_nest and distance <= self.depth:
            self.state = "wait for drop"
            return 0j
        light = with_length(vector_sum(self.senses["light"]), 8.0)
        if self.spec.has_obstacles and self.state == "homing" and self.is_on_a_detour():
            return self.go_round(light)
        force = light + self.avoid()
        if self.state == "homing in nest" or self.turning > LONGEST_TURN_TICKS:
            force += self.wander(1)
        return force


def drive(force: complex) -> tuple[float, float]:
    """Wheel commands in [-1, 1] (1 = 20 cm/s) for a summed force in cm/s."""
    angle = math.degrees(cmath.phase(force))
    if abs(angle) <= 15.0:
        base = min(abs(force), 10.0)
        share = (15.0 - abs(angle)) / 15.0
        slow, fast = base * share, base * (2.0 - share)
    else:
        slow, fast = -10.0, 10.0
    return (slow / 20.0, fast / 20.0) if angle > 0 else (fast / 20.0, slow / 20.0)


# CPFA


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
