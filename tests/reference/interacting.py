"""Slow twin of pick-ups and drops: the rules in the words of the contract, with dictionaries and sets."""

import math
from dataclasses import dataclass, field

from swarm_forage_env.contract.codes import Event
from swarm_forage_env.scenarios.floor import Box

GRASP, RELEASE, DELIVER, SITE, CREATE_CACHE = "grasp", "release", "deliver", "site", "create"
Request = tuple[str, int | None]
"""What is asked, and the object row or the cache serial that it is about."""


def band_of(grip: float) -> str:
    """Band of a gripper command."""
    for band, above in ((GRASP, 0.0), (RELEASE, -0.25), (DELIVER, -0.5), (SITE, -0.75)):
        if grip > above:
            return band
    return CREATE_CACHE


@dataclass
class SlowCache:
    """A cache: its centre cell and what is inside."""

    centre: tuple[int, int]
    contents: set[int]


@dataclass
class SlowWorld:
    """Everything that interactions can see and change."""

    nests: tuple[tuple[float, float, float, float], ...]
    area: Box
    side_cells: int
    proximity_m: float
    dynamic: bool
    serialized: bool
    only_delivering_counts: bool
    position: list[tuple[float, float]]
    active: list[bool]
    cargo: dict[int, int]
    pending: dict[int, tuple[str, Request]]
    until: dict[int, int]
    """Tick before which a robot's interaction does not take effect."""
    pickup_ticks: int
    drop_ticks: int
    floor: dict[tuple[int, int], int]
    caches: dict[int, SlowCache]
    carriers: dict[int, int]
    from_cache: set[int]
    """Robots whose cargo comes from a cache."""
    events: dict[int, tuple[Event, int, tuple[int, int, int, int]]] = field(default_factory=dict)
    first_picked: set[int] = field(default_factory=set)
    displaced: list[int] = field(default_factory=list)
    creators: list[int] = field(default_factory=list)
    finished: set[str] = field(default_factory=set)
    tick: int = 0

    def cell(self, robot: int) -> tuple[int, int]:
        """Cell under a robot's centre."""
        x, y = self.position[robot]
        return math.floor(x * 5), math.floor(y * 5)

    def cache_at(self, cell: tuple[int, int]) -> int | None:
        """Serial of the cache that covers a cell."""
        for serial, cache in self.caches.items():
            if max(abs(cell[0] - cache.centre[0]), abs(cell[1] - cache.centre[1])) <= self.side_cells // 2:
                return serial
        return None

    def in_nest(self, robot: int) -> bool:
        """Whether a robot's centre lies in the closed rectangle of a nest."""
        x, y = self.position[robot]
        return any(nest[0] <= x <= nest[2] and nest[1] <= y <= nest[3] for nest in self.nests)

    def cache_too_near(self, robot: int) -> int | None:
        """Serial of the nearest cache whose centre is within the proximity distance."""
        distances = {
            math.dist(self.position[robot], ((2 * cache.centre[0] + 1) / 10, (2 * cache.centre[1] + 1) / 10)): serial
            for serial, cache in self.caches.items()
        }
        nearest = min(distances, default=math.inf)
        return distances[nearest] if nearest <= self.proximity_m else None

    def request(self, robot: int, band: str) -> Request | None:
        """What a robot asks for where it is, None for nothing at all."""
        cell, cache = self.cell(robot), self.cache_at(self.cell(robot))
        if robot not in self.cargo:
            if band != GRASP:
                return None
            if cache is not None:
                return "take from cache", cache
            return ("take from floor", self.floor[cell]) if cell in self.floor else ("nothing", None)
        if band == GRASP:
            return None
        if self.in_nest(robot) and (band == DELIVER or not self.only_delivering_counts):
            return "deliver", None
        if cache is not None:
            return "drop into cache", cache
        if band == DELIVER:
            return "nothing", None
        if band == RELEASE or not self.dynamic:
            return "let go", None
        near = self.cache_too_near(robot)
        return ("too near", near) if near is not None else (band, None)

    def serve(self, grips: list[float], tick: int, chance: list[float]) -> None:
        """One interaction phase."""
        self.events, self.first_picked, self.displaced, self.creators = {}, set(), [], []
        self.finished, self.tick = set(), tick
        n_robots = len(self.position)
        order = sorted(range(n_robots), key=lambda robot: (robot - tick) % n_robots)
        asked: dict[int, tuple[str, Request | None]] = {}
        for robot in order:
            if self.active[robot]:
                band = band_of(grips[robot])
            elif robot in self.pending:
                band = self.pending[robot][0]  # in repair: what is running goes on
            else:
                continue
            asked[robot] = band, self.request(robot, band)
        phases = {"deliver": 0, "drop into cache": 1}
        for phase in range(4):
            for robot, (band, request) in asked.items():
                kind = request[0] if request else ""
                if phases.get(kind, 3 if band == GRASP else 2) == phase:
                    self.serve_one(robot, band, chance[robot])

    def serve_one(self, robot: int, band: str, chance: float) -> None:
        """Start, finish, refuse or cancel."""
        request = self.request(robot, band)
        running = self.pending.get(robot)
        if running is not None and running[0] == band:
            if request == running[1]:
                if self.tick < self.until[robot]:
                    return
                handler = self.handler(request[0])
                if self.serialized and handler in self.finished:
                    return
                self.finished.add(handler)
                del self.pending[robot], self.until[robot]
                self.finish(robot, request, chance)
            else:
                del self.pending[robot], self.until[robot]
                self.report(robot, Event.VANISHED)
            return
        if running is not None:
            del self.pending[robot], self.until[robot]
        if request is None:
            return
        if request[0] == "nothing":
            self.report(robot, Event.NOTHING_HERE)
        elif request[0] == "too near":
            self.report(robot, Event.CACHE_TOO_NEAR, cache=request[1])
        elif request[0] == "let go":
            self.lay_down(robot)
        else:
            self.pending[robot] = band, request
            self.until[robot] = self.tick + (self.pickup_ticks if "take" in request[0] else self.drop_ticks)

    @staticmethod
    def handler(kind: str) -> str:
        """Interactions of one handler finish one per tick under the quirk; those with caches share one."""
        return "cache" if "cache" in kind else kind

    def finish(self, robot: int, request: Request, chance: float) -> None:
        """An interaction takes effect."""
        kind, target = request
        if kind == "deliver":
            row = self.let_go(robot)
            self.displaced.append(row)
            self.report(robot, Event.DELIVERED, row)
        elif kind == "drop into cache":
            assert target is not None
            row = self.let_go(robot)
            self.caches[target].contents.add(row)
            self.report(robot, Event.JOINED_CACHE, row, target)
        elif kind == "take from floor":
            row = self.floor.pop(self.cell(robot))
            self.take(robot, row)
            self.report(robot, Event.PICKED_UP, row)
        elif kind == "take from cache":
            assert target is not None
            cache = self.caches[target]
            row = sorted(cache.contents)[int(chance * len(cache.contents))]
            cache.contents.remove(row)
            self.take(robot, row)
            self.from_cache.add(robot)
            self.report(robot, Event.PICKED_FROM_CACHE, row, target)
            if len(cache.contents) == 1:
                self.floor[cache.centre] = cache.contents.pop()
                del self.caches[target]
        elif self.lay_down(robot) and kind == CREATE_CACHE:
            self.creators.append(robot)

    def take(self, robot: int, row: int) -> None:
        """A robot takes an object into its gripper."""
        if self.carriers[row] == 0:
            self.first_picked.add(robot)
        self.carriers[row] += 1
        self.cargo[robot] = row

    def let_go(self, robot: int) -> int:
        """A robot gives away its cargo."""
        self.from_cache.discard(robot)
        return self.cargo.pop(robot)

    def lay_down(self, robot: int) -> bool:
        """A robot lets go over open floor."""
        row, cell = self.let_go(robot), self.cell(robot)
        inside = self.area[0] <= cell[0] < self.area[2] and self.area[1] <= cell[1] < self.area[3]
        if inside and cell not in self.floor and not self.cell_in_nest(cell):
            self.floor[cell] = row
            self.report(robot, Event.DROPPED, row)
            return True
        self.displaced.append(row)
        self.report(robot, Event.DROPPED_ELSEWHERE, row)
        return False

    def cell_in_nest(self, cell: tuple[int, int]) -> bool:
        """Whether a cell belongs to a nest."""
        x, y = (2 * cell[0] + 1) / 10, (2 * cell[1] + 1) / 10
        return any(nest[0] < x < nest[2] and nest[1] < y < nest[3] for nest in self.nests)

    def report(self, robot: int, event: Event, row: int = -1, cache: int | None = None) -> None:
        """Note what happened to a robot."""
        about = (0, 0, 0, 0)
        if cache is not None:
            about = (cache, *self.caches[cache].centre, len(self.caches[cache].contents))
        self.events[robot] = event, row, about
