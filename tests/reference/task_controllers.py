"""STOCHM and STOCHX for one robot, slow and obvious: dictionaries and words. Twin of the compiled task machines.

Where a Cache Starter goes is not repeated here but handed in (`site`): the geometry has a test of its own.
"""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from swarm_forage_env.contract.codes import Event, Grip
from tests.reference.controllers import RHO, ReferenceRobot, sensed, vector_sum, visible_objects

JOBS = {
    "generalist": ("object", "nest"),
    "harvester": ("object", "cache"),
    "collector": ("cache", "nest"),
    "starter": ("object", "site"),
    "finisher": ("object", "isolated"),
    "transferer": ("cache", "cache"),
    "cache_collector": ("cache", "nest"),
}
"""Task -> source and destination."""
TASKS = ("", *JOBS)
"""Names by task code."""
WAITS = ("wait for pick-up", "wait for drop", "let go")
Cell = tuple[int, int]


@dataclass
class RememberedCache:
    """What a robot knows of a cache."""

    serial: int
    count: int
    density: float
    refused: bool = False


@dataclass
class ReferenceTaskRobot(ReferenceRobot):
    """One robot that allocates tasks. The first estimates, probabilities and coins are handed in."""

    estimates: dict[str, float] = field(default_factory=dict)
    partition: dict[str, float] = field(default_factory=dict)
    last_child: dict[str, str] = field(default_factory=dict)
    block: str = ""
    numbers: tuple[float, float, float, float] = (1.0, 1.0, 1.0, 1.0)
    """k and gamma of partition and switch."""
    smallest_cache: int = 0
    site: Callable[[], tuple[float, float] | None] = lambda: None
    """Where the compiled robot goes with a site as its goal, or None if it found none."""
    last_forgotten: Callable[[], Cell] = lambda: (0, 0)
    """Which cache the compiled robot forgot last when it forgot several at once: their order means nothing."""
    job: str = ""
    caches: dict[Cell, RememberedCache] = field(default_factory=dict)
    last_cache: Cell | None = None
    cargo_from: Cell | None = None
    """Cache of the object that a Cache Transferer carries."""
    goal_serial: int = 0
    shunned: set[int] = field(default_factory=set)
    shunned_now: bool = False
    shunned_cache_now: bool = False
    not_to_take: set[int] = field(default_factory=set)
    not_to_add: set[int] = field(default_factory=set)
    """Serials of caches, remembered or not."""
    searching: bool = False
    started: dict[str, int] = field(default_factory=dict)
    lasted: dict[str, int] = field(default_factory=dict)
    p_abort: dict[str, float] = field(default_factory=dict)
    interface: dict[str, bool] = field(default_factory=dict)

    def tick(self, row: np.ndarray, draws: np.ndarray, now: int) -> tuple[float, float, float]:
        """One tick; the first four draws are those of `act`."""
        self.draws, self.now = draws, now
        self.senses = sensed(self.spec, row)
        self.away = vector_sum(self.senses["proximity"])
        self.position = (self.senses["position"] + 1.0) / 2.0 * np.array(self.spec.arena_size_m)
        self.carrying = self.senses["carrying"][0] == 1.0
        own_cell, visible = visible_objects(self.spec, self.senses)
        self.memory.update(own_cell, visible)
        self.update_caches(own_cell)
        self.follow_events()
        is_new = self.manage()
        force = self.work()
        if not is_new:
            self.account()
        wheels = self.stand() if self.state in WAITS else self.drive(force)
        return (*wheels, self.grip())

    def grip(self) -> float:
        if self.state == "wait for drop":
            return {"starter": Grip.SITE, "finisher": Grip.CREATE_CACHE}.get(self.job, Grip.DELIVER)
        if self.state == "wait for pick-up" and JOBS[self.job][0] == "cache" and not self.valid():
            return Grip.RELEASE  # quirk waits_for_cache: for more objects
        return Grip.RELEASE if self.state in ("acquire", "let go") else Grip.GRASP

    # Memory

    def decode(self, fields: np.ndarray) -> tuple[int, Cell, int]:
        """Serial, centre cell and count of four cache fields."""
        metres = (fields[1:3] + 1.0) / 2.0 * np.array(self.spec.arena_size_m)
        x, y = np.floor(metres / self.spec.cell_m).astype(int).tolist()
        return round(fields[0] * 2**24), (x, y), round(fields[3] * self.spec.n_objects)

    def covered(self, cell: Cell, point: tuple[float, float]) -> bool:
        centre = ((cell[0] + 0.5) * 0.2, (cell[1] + 0.5) * 0.2)
        return max(abs(centre[0] - point[0]), abs(centre[1] - point[1])) <= self.spec.cache_side_m / 2

    def update_caches(self, own_cell: Cell) -> None:
        seen = [self.decode(fields) for fields in self.senses["los_cache"].reshape(4, 4) if fields[0] > 0]
        shown = [cell for _, cell, _ in seen]
        gone = [cell for cell in self.caches if cell not in shown and self.should_show(cell, own_cell)]
        for cell in gone:
            del self.caches[cell]
        if gone and not self.caches:
            self.last_cache = gone[0] if len(gone) == 1 else self.last_forgotten()
        for serial, cell, count in seen:
            self.know(serial, cell, count)
        for cache in self.caches.values():
            cache.density *= 1.0 - RHO

    def should_show(self, cell: Cell, own_cell: Cell) -> bool:
        side = self.spec.cache_side_m
        if self.spec.quirks.cache_forget_unit_mismatch:
            reach = [abs((cell[k] + 0.5) * 0.2 - (own_cell[k] + 0.5)) < side / 2 + 2.5 for k in range(2)]
            return any(reach)
        half = round(side / 0.2) // 2
        return all(abs(cell[k] - own_cell[k]) <= half + 2 for k in range(2))

    def know(self, serial: int, cell: Cell, count: int, density: float = 1.0) -> None:
        if self.spec.quirks.last_cache_at_every_sight and list(self.caches) == [cell]:
            self.last_cache = cell
        if cell not in self.caches or self.caches[cell].serial != serial:
            self.caches[cell] = RememberedCache(serial, count, density)
            for row, (lies, _) in list(self.memory.known.items()):
                if self.covered(cell, ((lies[0] + 0.5) * 0.2, (lies[1] + 0.5) * 0.2)):
                    del self.memory.known[row]
        self.caches[cell].count, self.caches[cell].density = count, density

    # Events and the executive

    def follow_events(self) -> None:
        event = round(self.senses["event"][0] * 16)
        failed = event in (Event.NOTHING_HERE, Event.VANISHED)
        destination = JOBS[self.job][1] if self.job else "object"
        onward = "homing" if destination == "nest" else "transport"
        serial, cell, count = self.decode(self.senses["event_cache"])
        if self.carrying and self.state in ("acquire", "wait for pick-up"):
            self.set_out(onward)
            self.memory.known.pop(round(self.senses["cargo"][0] * self.spec.n_objects) - 1, None)
            self.cargo_from = None
            if self.job == "transferer" and serial:
                self.cargo_from = cell
                self.not_to_add.add(serial)
                self.shunned_cache_now = True
            return
        if self.carrying and self.state == "wait for drop" and failed:
            self.set_out(onward)
        elif not self.carrying and (
            self.state in ("homing", "homing in nest", "transport", "let go")
            or (self.state == "wait for pick-up" and failed)
        ):
            self.restart()
        elif not self.carrying and self.state == "wait for drop":
            self.state = "finished"
            row = round(self.senses["event_object"][0] * self.spec.n_objects) - 1
            if self.job in ("starter", "finisher") and row >= 0:
                self.shunned.add(row)
                self.shunned_now = True
            if self.job == "transferer" and serial:
                self.not_to_take.add(serial)
                self.shunned_cache_now = True
            return
        if event == Event.CACHE_TOO_NEAR:
            if serial:
                self.know(serial, cell, count, density=1.0 - RHO)
                self.caches[cell].refused = not self.spec.quirks.refusals_not_remembered
            if self.state == "wait for drop":
                self.set_out(onward)
        elif self.state == "wait for pick-up" and JOBS[self.job][0] == "cache" and not self.valid():
            self.restart_unless_waiting()

    def restart_unless_waiting(self) -> None:
        """Look for another cache; under the quirk, only when there is none here to wait in."""
        if not (self.spec.quirks.waits_for_cache and self.goal_cache()):
            self.restart()

    def set_out(self, state: str) -> None:
        self.restart()
        self.state = state

    def restart(self) -> None:
        super().restart()
        self.searching = False

    def manage(self) -> bool:
        """End and begin tasks; whether one was begun."""
        if self.job:
            if self.state != "finished" and self.draws[4] >= self.p_abort.get(self.job, 0.0):
                return False
            self.end()
        self.move()
        self.choose_job()
        self.shunned = self.shunned if self.shunned_now else set()
        if not (self.shunned_cache_now and self.job == "transferer"):
            self.not_to_take, self.not_to_add = set(), set()
        for cache in self.caches.values():
            cache.refused = False
        self.shunned_now = self.shunned_cache_now = False
        self.restart()
        if self.carrying:
            self.state = "let go"
        quirks = self.spec.quirks
        if not quirks.exec_time_since_last_completion:
            self.started[self.job], self.lasted[self.job], self.p_abort[self.job] = self.now, 0, 0.0
        if not quirks.interface_flag_survives_abort:
            self.interface[self.job] = False
        return True

    def end(self) -> None:
        integer = self.spec.quirks.integer_estimates
        mean = (self.estimates[self.job] + self.lasted.get(self.job, 0)) / 2
        self.estimates[self.job] = whole(mean, integer)
        self.started[self.job] = self.now
        k, gamma = self.numbers[:2]
        self.partition[self.block] = partition(self.estimates, self.block, k, gamma, integer)

    def move(self) -> None:
        there = self.block
        if self.block == self.job != "generalist":
            there = "generalist"
        elif self.block == "generalist" and self.job in ("harvester", "collector") and len(self.partition) == 3:
            there = self.job
        if there != self.block:
            p = move(self.estimates, self.block, there, self.spec.quirks.integer_estimates)
            if self.draws[5] < p:
                self.block = there

    def choose_job(self) -> None:
        self.job = self.block
        if self.draws[6] < self.partition[self.block]:
            last = self.last_child[self.block]
            other = next(child for child in CHILDREN[self.block] if child != last)
            if self.draws[7] < switch(self.estimates, last, other, *self.numbers[2:]):
                last = other
            self.last_child[self.block] = self.job = last

    def account(self) -> None:
        """Execution time, abort probability and interface after a tick of work."""
        job = self.job
        self.lasted[job] = self.now - self.started.get(job, 0)
        self.p_abort[job] = 0.0001
        if job == "generalist" or self.interface.get(job):
            ratio = self.lasted[job] / self.estimates[job]
            self.p_abort[job] = 1.0 / (1.0 + math.exp(min(700.0, 4.0 * abs(ratio - 3.0))))
        source, destination = JOBS[job]
        enters, leaves = set(), set()
        if source == "cache":
            enters.add("acquire")
            leaves.add("wait for pick-up")
        if destination != "nest":
            enters.add("transport")
            leaves.add("wait for drop")
        if job == "transferer" and self.spec.quirks.transferer_interface_never_leaves:
            enters, leaves = {"transport"}, set()
        if self.state in enters:
            self.interface[job] = True
        elif self.state in leaves:
            self.interface[job] = False

    # The machine

    def work(self) -> complex:
        if self.state in ("homing", "homing in nest"):
            return self.home()
        if self.state not in ("acquire", "transport"):
            return 0j
        found, force = self.approach()
        if found:
            self.state = "wait for pick-up" if self.state == "acquire" else "wait for drop"
        return force

    @property
    def kind(self) -> str:
        """What is being acquired, or was and is waited for."""
        return JOBS[self.job][self.state == "transport"]

    def approach(self) -> tuple[bool, complex]:
        starts = self.vector == "idle" or self.searching
        if self.spec.quirks.no_walk_at_site and starts and self.kind == "site" and self.choose_goal():
            distance = math.dist(self.goal, self.position)
            if distance <= self.tolerance:
                self.timer = None
                return False, self.arrive(distance)
        if starts:
            if not self.choose_goal():
                return self.look()
            self.timer, self.vector, self.recovery, self.searching = None, "vector", 0, False
        arrived, force = self.go()
        given_up = not starts and not self.valid()
        if not arrived and not given_up:
            return False, force
        self.vector, self.recovery = "idle", 0
        counts = not (starts and self.spec.quirks.finisher_tolerance_mismatch)
        if not given_up and counts and self.reached():
            return True, 0j
        found, more = self.look()
        return found, force + more

    def choose_goal(self) -> bool:
        if self.kind == "object":
            known = dict(self.memory.known)
            self.memory.known = {row: value for row, value in known.items() if row not in self.shunned}
            found = self.choose()
            self.memory.known = known
            if found:
                self.tolerance = 0.02
            return found
        if self.kind == "site":
            goal = self.site()
            if goal is not None:
                self.goal, self.tolerance = goal, 0.8
            return goal is not None
        return self.choose_cache() if self.kind == "cache" else self.choose_isolated()

    def nest_distance(self, cell: Cell) -> float:
        centre = (cell[0] + 0.5) * 0.2, (cell[1] + 0.5) * 0.2
        return math.dist(centre, self.nearest_nest(centre))

    def choose_cache(self) -> bool:
        utilities, serials = {}, {}
        for cell, cache in self.caches.items():
            centre = ((cell[0] + 0.5) * 0.2, (cell[1] + 0.5) * 0.2)
            taking = self.state == "acquire"
            unwanted = cache.serial in (self.not_to_take if taking else self.not_to_add)
            unwanted = unwanted or (taking and cache.count < self.smallest_cache)
            if not taking and self.cargo_from and not self.spec.quirks.transferer_goes_anywhere:
                unwanted = unwanted or self.nest_distance(cell) >= self.nest_distance(self.cargo_from)
            if not unwanted and not self.covered(cell, tuple(self.position)):
                away = math.dist(centre, self.position) * math.dist(centre, self.nearest_nest(centre))
                utilities[centre] = math.exp(cache.density) * cache.count / away
                serials[centre] = cache.serial
        if not utilities:
            return False
        centre = max(utilities, key=lambda key: utilities[key])
        self.goal_serial = serials[centre]
        spread = self.spec.cache_side_m - 0.4
        self.goal = (centre[0] + spread * (self.draws[8] - 0.5), centre[1] + spread * (self.draws[9] - 0.5))
        self.tolerance = 0.02
        return True

    def choose_isolated(self) -> bool:
        near = self.spec.cache_side_nominal_m
        places = {row: ((x + 0.5) * 0.2, (y + 0.5) * 0.2) for row, ((x, y), _) in self.memory.known.items()}
        far = self.spec.cache_proximity_m + 0.8
        caches = [
            ((x + 0.5) * 0.2, (y + 0.5) * 0.2, far if cache.refused else near) for (x, y), cache in self.caches.items()
        ]
        utilities = {}
        for row, place in places.items():
            others = (other for key, other in places.items() if key != row)
            is_clear = all(math.dist(place, (x, y)) > distance for x, y, distance in caches)
            if is_clear and all(math.dist(place, other) > near for other in others):
                away = math.dist(place, self.position) * math.dist(place, self.nearest_nest(place))
                utilities[place] = math.exp(self.memory.known[row][1]) / away
        if not utilities:
            return False
        self.goal = max(utilities, key=lambda key: utilities[key])
        loose = 0.15 * max(self.spec.arena_size_m)
        self.tolerance = loose if self.spec.quirks.finisher_tolerance_mismatch else 0.8
        return True

    def valid(self) -> bool:
        if self.kind == "object":
            return self.target in self.memory.known
        if self.kind == "cache":
            cache = self.goal_cache()
            return cache is not None and (self.state == "transport" or cache.count >= self.smallest_cache)
        return True

    def goal_cache(self) -> RememberedCache | None:
        """The remembered cache in which the goal lies, if it is the one that was chosen."""
        holding = [cache for cell, cache in self.caches.items() if self.covered(cell, self.goal)]
        if not holding or (self.spec.quirks.cache_goal_by_identity and holding[0].serial != self.goal_serial):
            return None
        return holding[0]

    def reached(self) -> bool:
        if self.kind == "object":
            return self.sees_object()
        if self.kind == "cache":
            return self.sees(0.3, 0.5, 3)
        places = [((x + 0.5) * 0.2, (y + 0.5) * 0.2) for (x, y), _ in self.memory.known.values()]
        return self.kind == "site" or any(math.dist(place, self.position) <= 0.8 for place in places)

    def look(self) -> tuple[bool, complex]:
        """One tick of the search for a goal."""
        if self.kind == "object":
            return self.explore()
        force = 0j
        if self.timer is None:
            self.timer = 0
            if self.kind == "cache" and self.last_cache is not None:
                self.goal = ((self.last_cache[0] + 0.5) * 0.2, (self.last_cache[1] + 0.5) * 0.2)
                self.tolerance, self.vector, self.recovery, self.searching = 0.02, "vector", 0, True
            if self.spec.quirks.explore_double_start:
                force += self.look_step(2)
        self.timer += 1
        return False, force + self.look_step(1)

    def look_step(self, draw: int) -> complex:
        if not self.searching:
            return self.wander(draw) + self.avoid()
        arrived, force = self.go()
        if arrived:
            self.vector, self.recovery, self.searching = "idle", 0, False
        return force


CHILDREN = {
    "generalist": ("harvester", "collector"),
    "harvester": ("starter", "finisher"),
    "collector": ("transferer", "cache_collector"),
}
"""Root of each block -> its subtasks. Blocks are called by their roots."""


def whole(value: float, integer: bool) -> float:
    """Truncate towards zero if asked."""
    return math.trunc(value) if integer else value


def partition(estimates: Mapping[str, float], root: str, k: float, gamma: float, integer: bool) -> float:
    """Probability of a subtask instead of `root`."""
    t, s = estimates[root], sum(estimates[child] for child in CHILDREN[root])
    bracket = whole(t / s, integer) - 1.25 if t > s else 1.25 - whole(s / t, integer)
    return min(1.0, gamma / (1.0 + math.exp(-k * whole(bracket, integer))))


def switch(estimates: Mapping[str, float], last: str, other: str, k: float, gamma: float) -> float:
    """Probability of switching to the other subtask."""
    ratio = min(1.0, estimates[last] / estimates[other])
    return gamma / (1.0 + math.exp(-k * (ratio - 1.25)))


def move(estimates: Mapping[str, float], here: str, there: str, integer: bool) -> float:
    """Probability of moving to a neighbouring block."""
    rho = [
        whole(abs(estimates[root] - sum(estimates[child] for child in CHILDREN[root])) / estimates[root], integer)
        for root in (here, there)
    ]
    if 0 in rho:
        return 0.5
    return 0.5 / (1.0 + math.exp(-4.0 * (rho[0] / rho[1] - 3.0)))
