"""Slow twins of what a learner sees and does: compact view, memory of sites, commands, frames of robots' own."""

import copy
import math

import numpy as np

from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.policies.frames import turned_columns

RING = [math.radians(7.5 + 15 * k) for k in range(24)]


def ring_vector(readings: np.ndarray) -> tuple[float, float]:
    """Sum of 24 readings as vectors, forward and left."""
    return (
        sum(float(reading) * math.cos(angle) for reading, angle in zip(readings, RING, strict=True)),
        sum(float(reading) * math.sin(angle) for reading, angle in zip(readings, RING, strict=True)),
    )


def in_band(ground: np.ndarray, low: float, high: float) -> int:
    """How many ground readings lie in a band."""
    return sum(low - 1e-6 <= reading <= high + 1e-6 for reading in ground)


def direction(dx: float, dy: float, cos: float, sin: float) -> list[float]:
    """Forward and left share of a vector in m, cut to length 1; and that there is one."""
    length = max(1.0, math.hypot(dx, dy))
    return [(dx * cos + dy * sin) / length, (dy * cos - dx * sin) / length, 1.0]


def compact_row(row: np.ndarray, layout: ObservationLayout, *, behind_counts: bool = False) -> list[float]:
    """One robot's compact view."""
    part = {name: row[layout[name]] for name in layout.names}
    cos, sin = (float(value) for value in part["heading"])
    if cos == 0.0 and sin == 0.0:
        return [0.0] * 23
    half_x, half_y = layout.part("position").scale
    x, y = float(part["position"][0]) * half_x, float(part["position"][1]) * half_y
    cell_x, cell_y = float(part["los_cell"][0]) * half_x, float(part["los_cell"][1]) * half_y

    px, py = ring_vector(part["proximity"])
    length = math.hypot(px, py)
    is_behind = abs(math.atan2(py, px)) > 2.61
    obstacle = length > 1e-6 if is_behind and behind_counts else length > 0.1 and not is_behind
    lx, ly = ring_vector(part["light"])
    light = math.hypot(lx, ly)

    thing, nearest = [0.0, 0.0, 0.0], math.inf
    at_x, at_y = min(max(x, cell_x - 0.1), cell_x + 0.1), min(max(y, cell_y - 0.1), cell_y + 0.1)
    for k in range(25):
        dx, dy = cell_x + (k % 5 - 2) * 0.2 - at_x, cell_y + (k // 5 - 2) * 0.2 - at_y
        if part["los_object"][k] > 0 and dx**2 + dy**2 < nearest - 1e-6:
            thing, nearest = direction(dx, dy, cos, sin), dx**2 + dy**2
    cache = [0.0, 0.0, 0.0]
    if part["los_cache"][0] > 0:
        dx, dy = float(part["los_cache"][1]) * half_x - x, float(part["los_cache"][2]) * half_y - y
        cache = direction(dx, dy, cos, sin)
    return [
        px / max(1.0, length),
        py / max(1.0, length),
        float(obstacle),
        lx / light if light else 0.0,
        ly / light if light else 0.0,
        float(part["los_object"][12] > 0),
        float(in_band(part["ground"], 0.6, 0.8) >= 3),
        float(in_band(part["ground"], 0.3, 0.5) >= 3),
        *part["wheel_speed"],
        *part["position"],
        *part["heading"],
        *part["carrying"],
        *part["interacting"],
        *part["active"],
        *thing,
        *cache,
    ]


class RobotSites:
    """What one robot remembers: `pickup` and `sighting`, places in m from the middle of the arena, or None."""

    def __init__(self) -> None:
        self.pickup: tuple[float, float] | None = None
        self.sighting: tuple[float, float] | None = None
        self.carried = False
        self.since = 0
        self.here: tuple[float, float] | None = None

    def look(self, row: np.ndarray, layout: ObservationLayout, decision: int) -> None:
        """Bring the memory up to date with a row of the environment."""
        part = {name: row[layout[name]] for name in layout.names}
        if not part["heading"].any():
            self.__init__()
            return
        half_x, half_y = layout.part("position").scale
        self.here = here = float(part["position"][0]) * half_x, float(part["position"][1]) * half_y
        carries = part["carrying"][0] == 1.0
        seen = self._nearest(part, here, (half_x, half_y))
        if carries and not self.carried:
            self.pickup, self.since = here, decision
            if self._is_near(self.sighting, here):
                self.sighting = None
        if carries and seen is not None:
            self.sighting = seen
        if not carries and seen is None:
            if self._is_near(self.pickup, here):
                self.pickup, self.since = None, decision
            self.sighting = None if self._is_near(self.sighting, here) else self.sighting
        self.carried = carries

    def hear(self, others: "list[RobotSites]") -> None:
        """Learn of others where the latest object was."""
        latest = max((other for other in others if other.pickup), key=lambda other: other.since, default=self)
        if latest.since > self.since:
            self.pickup, self.since = latest.pickup, latest.since

    def columns(self, row: np.ndarray, layout: ObservationLayout) -> list[float]:
        """Return the eight columns."""
        cos, sin = (float(value) for value in row[layout["heading"]])
        columns = []
        for site in (self.pickup, self.sighting):
            if site is None:
                columns += [0.0] * 4
            else:
                x, y = site[0] - self.here[0], site[1] - self.here[1]
                columns += [*direction(x, y, cos, sin), min(1.0, math.hypot(x, y) / 20.0)]
        return columns

    def _is_near(self, site: tuple[float, float] | None, here: tuple[float, float]) -> bool:
        return site is not None and max(abs(site[0] - here[0]), abs(site[1] - here[1])) < 0.4

    @staticmethod
    def _nearest(part: dict, here: tuple[float, float], half: tuple[float, float]) -> tuple[float, float] | None:
        cell = [float(share) * extent for share, extent in zip(part["los_cell"], half, strict=True)]
        off = [min(0.1, max(-0.1, h - c)) for h, c in zip(here, cell, strict=True)]
        found = [
            ((k % 5 - 2) * 0.2 - off[0], (k // 5 - 2) * 0.2 - off[1]) for k in range(25) if part["los_object"][k] > 0.0
        ]
        if not found:
            return None
        closest = min(math.hypot(*there) for there in found)
        x, y = next(there for there in found if there[0] ** 2 + there[1] ** 2 < closest**2 + 1e-6)
        return here[0] + x, here[1] + y


def tell(twins: list[RobotSites], hearing_m: float) -> None:
    """Let all robots tell at once, each to those within `hearing_m`."""
    said = copy.deepcopy(twins)
    for twin in twins:
        if twin.here is not None:
            twin.hear([other for other in said if other.here and math.dist(other.here, twin.here) <= hearing_m])


WHEELS = {
    "stand": (0.0, 0.0),
    "forward": (0.5, 0.5),
    "arc left": (0.4, 0.6),
    "arc right": (0.6, 0.4),
    "turn left": (-0.25, 0.25),
    "turn right": (0.25, -0.25),
}
MOTIONS = list(WHEELS)
GRIPS = [Grip.GRASP, Grip.RELEASE, Grip.DELIVER, Grip.SITE, Grip.CREATE_CACHE]


class Sight:
    """What one robot knows that decides about its gripper."""

    def __init__(self, row: np.ndarray, layout: ObservationLayout) -> None:
        part = {name: row[layout[name]] for name in layout.names}
        self.at_work = part["active"][0] == 1.0
        self.busy = part["interacting"][0] == 1.0
        self.carrying = part["carrying"][0] == 1.0
        self.in_nest = in_band(part["ground"], 0.6, 0.8) >= 3
        self.in_cache = in_band(part["ground"], 0.3, 0.5) >= 3
        self.over_object = part["los_object"][12] > 0.0


def automatic_grip(row: np.ndarray, layout: ObservationLayout) -> Grip:
    """What the gripper does by itself."""
    sight = Sight(row, layout)
    if sight.carrying and sight.in_nest:
        return Grip.DELIVER
    if sight.carrying or sight.over_object or sight.in_cache:
        return Grip.GRASP  # what is carried is held
    return Grip.RELEASE


def numbered_action(number: int, row: np.ndarray, layout: ObservationLayout) -> tuple[float, float, float]:
    """Command of one robot for an action by number: motions first, then what the gripper can do."""
    if number >= len(MOTIONS):
        return (0.0, 0.0, GRIPS[number - len(MOTIONS)])
    return (*WHEELS[MOTIONS[number]], Grip.GRASP if Sight(row, layout).carrying else Grip.RELEASE)


def allowed_actions(row: np.ndarray, layout: ObservationLayout, *, with_grips: bool, dynamic_caches: bool) -> set[int]:
    """Numbers of the actions that make sense for one robot."""
    sight = Sight(row, layout)
    stand = {MOTIONS.index("stand")}
    if not sight.at_work:
        return stand
    motions = set() if sight.busy else set(range(len(MOTIONS)))
    if not with_grips:
        return motions | stand
    grips = set()
    if sight.carrying:
        grips.add(Grip.RELEASE)
        if sight.in_nest or sight.in_cache:
            grips.add(Grip.DELIVER)
        if dynamic_caches and not sight.in_nest:
            grips |= {Grip.SITE, Grip.CREATE_CACHE}
    elif sight.busy or sight.over_object or sight.in_cache:
        grips.add(Grip.GRASP)
    return motions | {len(MOTIONS) + GRIPS.index(grip) for grip in grips}


_BITS = 2**64


def frame(robot: int, decision: int, length: int) -> int:
    """Number of the frame: SplitMix64 of the robot's number and the period, its three highest bits."""
    period = (decision + 7 * robot) // length
    mixed = ((robot + 1) * 0x9E3779B97F4A7C15 + period * 0xD1B54A32D192ED03) % _BITS
    mixed = (mixed ^ (mixed >> 30)) * 0xBF58476D1CE4E5B9 % _BITS
    mixed = (mixed ^ (mixed >> 27)) * 0x94D049BB133111EB % _BITS
    return (mixed ^ (mixed >> 31)) >> 61


def seen(rows: np.ndarray, layout: ObservationLayout, decision: int, length: int) -> np.ndarray:
    """What robots see in their frames, (N, d), from what they would see in the world as it is."""
    turned = []
    for robot, row in enumerate(rows):
        source, sign = turned_columns(frame(robot, decision, length), layout)
        turned.append(row[source] * sign)
    return np.array(turned)


def commands(wanted: np.ndarray, decision: int, length: int) -> np.ndarray:
    """What robots do, (N, A), who want this in what they see."""
    done = wanted.copy()
    for robot, row in enumerate(done):
        if frame(robot, decision, length) >= 4:  # mirrored
            row[:2] = row[1::-1]
    return done
