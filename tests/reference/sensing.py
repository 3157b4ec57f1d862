"""Slow twin of observations: every robot, every sensor, and everything that it could sense."""

import cmath
import math

import numpy as np

from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY, CELL_NEST, CELL_OBJECT, CELL_OBSTACLE, Counter
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.world.kernels import interact
from swarm_forage_env.world.state import SwarmState

RADIUS_M = 0.085036758
REACH_M = 0.1
GROUND_SENSORS_M = ((0.063, 0.0116), (0.063, -0.0116), (-0.063, 0.0116), (-0.063, -0.0116))
Pair = tuple[float, float]
RING_DEG = [7.5 + 15.0 * k for k in range(24)]


def reading(gap_m: float) -> float:
    """Proximity reading for the free distance along a beam."""
    if gap_m > REACH_M:
        return 0.0
    return 1.0 if gap_m < 0.00989 else 0.0100527 / (gap_m + 0.000163144)


def to_box(place: Pair, way: Pair, box: tuple[float, float, float, float]) -> float:
    """Way to the first of a box's four sides that a beam meets: where it crosses the side's line, within its ends."""
    (x, y), (ux, uy) = place, way
    x_low, y_low, x_high, y_high = box
    nearest = math.inf
    for side in (x_low, x_high):
        if (side - x) * ux > 0 and y_low <= y + (side - x) / ux * uy <= y_high:
            nearest = min(nearest, (side - x) / ux)
    for side in (y_low, y_high):
        if (side - y) * uy > 0 and x_low <= x + (side - y) / uy * ux <= x_high:
            nearest = min(nearest, (side - y) / uy)
    return nearest


def proximity(env: ForageEnv, robot: int) -> list[float]:
    """24 beams against all other robots, all four walls and all boxes."""
    swarm = env.swarm
    x, y = swarm.position[robot].tolist()
    x_low, y_low, x_high, y_high = env.scenario.arena.interior_m
    readings = []
    for ring_deg in RING_DEG:
        angle = swarm.heading[robot] + math.radians(ring_deg)
        ux, uy = math.cos(angle), math.sin(angle)
        nearest = math.inf
        for wall, at, along in ((x_low, x, ux), (x_high, x, ux), (y_low, y, uy), (y_high, y, uy)):
            if (wall - at) * along > 0:
                nearest = min(nearest, (wall - at) / along)
        for box in env.scenario.arena.obstacles:
            nearest = min(nearest, to_box((x, y), (ux, uy), box))
        for other in np.flatnonzero(swarm.present).tolist():
            dx, dy = swarm.position[other] - (x, y)
            ahead = dx * ux + dy * uy
            miss = abs(dx * uy - dy * ux)
            if other != robot and ahead > 0 and miss <= RADIUS_M:
                nearest = min(nearest, ahead - math.sqrt(RADIUS_M**2 - miss**2))
        readings.append(reading(nearest - RADIUS_M))
    return readings


def interferes(env: ForageEnv, robot: int) -> bool:
    """Whether a robot at work is in interference: its beams add up to more than 0.1 in its field of view."""
    beams = zip(proximity(env, robot), RING_DEG, strict=True)
    away = sum(cmath.rect(value, math.radians(ring_deg)) for value, ring_deg in beams)
    if not env.active[robot] or abs(away) < 1e-6:
        return False
    if abs(cmath.phase(away)) > 2.61:
        return env.scenario.quirks.obstacle_behind_counts
    return abs(away) > 0.1


def is_near_cache(env: ForageEnv, robot: int) -> bool:
    """Whether the robot is within 2 m of the centre of a cache."""
    centres = [(0.2 * x + 0.1, 0.2 * y + 0.1) for x, y in env.caches.cell[env.caches.alive]]
    return any(math.dist(env.swarm.position[robot], centre) <= 2.0 for centre in centres)


def work(swarm: SwarmState, robot: int) -> Counter:
    """What a robot at work that avoids nothing is counted as."""
    pending = swarm.pending_kind[robot]
    if pending in (interact.CACHE_PICKUP, interact.CACHE_DROP):
        return Counter.AT_CACHES
    if pending != interact.NO_REQUEST:
        return Counter.HANDLING
    return Counter.SEARCHING if swarm.carried_object[robot] < 0 else Counter.HOMING


def light(env: ForageEnv, robot: int) -> list[float]:
    """24 sensors, each against every nest light."""
    swarm, arena = env.swarm, env.scenario.arena
    readings = []
    for ring_deg in RING_DEG:
        total = 0.0
        for x, y, height in arena.lights_m:
            dx, dy = x - swarm.position[robot, 0], y - swarm.position[robot, 1]
            scaled = math.sqrt(dx**2 + dy**2 + height**2) / arena.light_intensity
            axis = swarm.heading[robot] + math.radians(ring_deg)
            away = abs(math.remainder(math.atan2(dy, dx) - axis, 2 * math.pi))
            if scaled <= 2.5 and away < math.pi / 2:
                total += math.exp(-2 * scaled) * (1 - 2 * away / math.pi)
        readings.append(min(1.0, total))
    return readings


def grey(env: ForageEnv, x: float, y: float) -> float:
    """Grey level of the floor under a point."""
    column, row = math.floor(x * 5), math.floor(y * 5)
    ny, nx = env.objects.floor.shape
    if not (0 <= column < nx and 0 <= row < ny):
        return 1.0
    code = env.objects.floor[row, column]
    if code >= CELL_OBJECT:
        return 0.0
    return {CELL_EMPTY: 1.0, CELL_OBSTACLE: 1.0, CELL_NEST: 179 / 255}.get(code, 102 / 255)


def ground(env: ForageEnv, robot: int) -> list[float]:
    """Four grey levels under the body."""
    x, y = env.swarm.position[robot].tolist()
    cos, sin = math.cos(env.swarm.heading[robot]), math.sin(env.swarm.heading[robot])
    return [grey(env, x + cos * ahead - sin * left, y + sin * ahead + cos * left) for ahead, left in GROUND_SENSORS_M]


def place_fields(env: ForageEnv, cell: tuple[int, int]) -> list[float]:
    """Centre of a cell as a position in [-1, 1]."""
    nx, ny = env.scenario.arena.n_cells
    return [(2 * cell[0] + 1) / nx - 1.0, (2 * cell[1] + 1) / ny - 1.0]


def cell_of(env: ForageEnv, robot: int) -> tuple[int, int]:
    """Cell under the robot's centre."""
    nx, ny = env.scenario.arena.n_cells
    x, y = env.swarm.position[robot].tolist()
    return min(nx - 1, max(0, math.floor(x * 5))), min(ny - 1, max(0, math.floor(y * 5)))


def cache_fields(env: ForageEnv, serial: int, cell: tuple[int, int], count: int) -> list[float]:
    """The four numbers that stand for a cache."""
    return [serial * 2.0**-24, *place_fields(env, cell), count / env.scenario.objects.n_objects]


def objects_in_sight(env: ForageEnv, robot: int) -> list[float]:
    """The 5 x 5 window, row by row from the lower left."""
    column, row = cell_of(env, robot)
    nx, ny = env.scenario.arena.n_cells
    window = []
    for y in range(row - 2, row + 3):
        for x in range(column - 2, column + 3):
            code = env.objects.floor[y, x] if 0 <= x < nx and 0 <= y < ny else CELL_EMPTY
            lying = code - CELL_OBJECT
            window.append((lying + 1) / env.scenario.objects.n_objects if lying >= 0 else 0.0)
    return window


def caches_in_sight(env: ForageEnv, robot: int, half: int = 2) -> list[float]:
    """The nearest four caches that have a cell in the window, which ends `half` cells from its middle."""
    column, row = cell_of(env, robot)
    seen = set()
    ny, nx = env.objects.floor.shape
    for y in range(max(0, row - half), min(ny, row + half + 1)):
        for x in range(max(0, column - half), min(nx, column + half + 1)):
            if env.objects.floor[y, x] <= CELL_CACHE:
                seen.add(CELL_CACHE - int(env.objects.floor[y, x]))
    caches = env.caches

    def distance(slot: int) -> float:
        return math.dist(env.swarm.position[robot], (caches.cell[slot] + 0.5) * 0.2)

    fields: list[float] = []
    for slot in sorted(seen, key=lambda slot: (distance(slot), slot))[:4]:
        cell = (int(caches.cell[slot, 0]), int(caches.cell[slot, 1]))
        fields += cache_fields(env, int(caches.serial[slot]), cell, int(caches.count[slot]))
    return fields + [0.0] * (16 - len(fields))


def event_fields(env: ForageEnv, robot: int) -> list[float]:
    """Object, code and cache of this tick's event."""
    events = env.events
    if events.code[robot] == 0:
        return [0.0] * 6
    row, serial, x, y, count = (int(value) for value in (events.event_object[robot], *events.event_cache[robot]))
    cache = cache_fields(env, serial, (x, y), count) if serial else [0.0] * 4
    return [(row + 1) / env.scenario.objects.n_objects, events.code[robot] / 16, *cache]


def observe(env: ForageEnv) -> np.ndarray:
    """Observation of every robot from the state of the world, (N, D) float64; events as the state tells them."""
    swarm, arena = env.swarm, env.scenario.arena
    n_objects = env.scenario.objects.n_objects
    observations = np.zeros((len(swarm.active), env.layout.size))
    for robot in np.flatnonzero(swarm.present).tolist():
        carried = int(swarm.carried_object[robot])
        heading = swarm.heading[robot]
        parts = {
            "proximity": proximity(env, robot),
            "light": light(env, robot),
            "ground": ground(env, robot),
            "wheel_speed": [max(-1.0, min(1.0, speed / 0.20)) for speed in swarm.wheel_speed[robot].tolist()],
            "position": (2 * swarm.position[robot] / (arena.width_m, arena.height_m) - 1).tolist(),
            "heading": [math.cos(heading), math.sin(heading)],
            "carrying": [float(carried >= 0)],
            "interacting": [float(swarm.pending_kind[robot] != 0)],
            "active": [float(swarm.active[robot])],
            "cargo": [(carried + 1) / n_objects if carried >= 0 else 0.0],
            "los_cell": place_fields(env, cell_of(env, robot)),
            "los_object": objects_in_sight(env, robot),
            "los_cache": caches_in_sight(env, robot),
        }
        parts["event_object"], parts["event"], parts["event_cache"] = np.split(event_fields(env, robot), [1, 2])
        for name, values in parts.items():
            observations[robot, env.layout[name]] = values
    return observations


def others_within(env: ForageEnv, robot: int, range_m: float) -> list[tuple[float, int]]:
    """Distance in m and row of every other robot in the world and within range, the nearest first."""
    swarm = env.swarm
    if not swarm.present[robot]:
        return []
    away = ((float(np.hypot(*(swarm.position[other] - swarm.position[robot]))), other) for other in present_rows(env))
    return sorted((distance, other) for distance, other in away if other != robot and distance <= range_m)


def present_rows(env: ForageEnv) -> list[int]:
    return np.flatnonzero(env.swarm.present).tolist()


def neighbours(env: ForageEnv, robot: int) -> list[float]:
    """The slice of neighbours of one robot."""
    robots, swarm = env.scenario.robots, env.swarm
    row: list[float] = []
    for _, other in others_within(env, robot, robots.neighbour_range_m)[: robots.neighbours_seen]:
        offset = complex(*(swarm.position[other] - swarm.position[robot])) / robots.neighbour_range_m
        ahead = offset * cmath.exp(-1j * swarm.heading[robot])
        row += [ahead.real, ahead.imag, float(swarm.carried_object[other] >= 0), 1.0]
    return row + [0.0] * (4 * robots.neighbours_seen - len(row))


def heard(env: ForageEnv, robot: int, said: np.ndarray) -> list[float]:
    """The slice of messages of one robot, if these (N, m) were said in the last tick by all robots at work."""
    robots, swarm = env.scenario.robots, env.swarm
    near = [other for _, other in others_within(env, robot, robots.message_range_m) if swarm.active[other]]
    if not near:
        return [0.0] * (robots.message_size + 1)
    return [*np.mean([np.clip(said[other], -1.0, 1.0) for other in near], axis=0).tolist(), 1.0]
