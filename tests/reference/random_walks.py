"""Single walkers, step by step: the slow twin of `metrics.random_search`."""

import math

import numpy as np
from metrics.random_search import SearchFloor, Walker


def wander_turns(most_rad: float, n_walkers: int, n_ticks: int, seed: int) -> np.ndarray:
    """Headings (walkers,) after some ticks of w <- fmod(w + U(-m, m), m), settled before."""
    rng = np.random.default_rng(seed)
    turn, heading = np.zeros(n_walkers), np.zeros(n_walkers)
    for tick in range(100 + n_ticks):
        turn = np.fmod(turn + rng.uniform(-most_rad, most_rad, n_walkers), most_rad)
        if tick >= 100:
            heading += turn
    return heading


def share_of_strip(side_m: float, sensors_m: tuple[float, float], step_m: float, n_rides: int, seed: int) -> float:
    """Width of the strip in which a robot that rides straight through sees an object, by rides at random."""
    rng = np.random.default_rng(seed)
    widest = side_m
    seen = 0
    for _ in range(n_rides):
        angle, aside, phase = rng.uniform(0.0, 2.0 * math.pi), rng.uniform(-widest, widest), rng.random()
        ahead, left = np.array([math.cos(angle), math.sin(angle)]), np.array([-math.sin(angle), math.cos(angle)])
        for tick in range(-math.ceil(side_m / step_m), math.ceil(side_m / step_m) + 1):
            centre = aside * left + (tick + phase) * step_m * ahead
            corners = [centre + a * sensors_m[0] * ahead + b * sensors_m[1] * left for a in (-1, 1) for b in (-1, 1)]
            if all(abs(x) <= 0.5 * side_m and abs(y) <= 0.5 * side_m for x, y in corners):
                seen += 1
                break
    return 2.0 * widest * seen / n_rides


def search_times(
    walker: Walker, floor: SearchFloor, starts: np.ndarray, headings: np.ndarray, dt_s: float, seed: int
) -> np.ndarray:
    """Time until each walker (walkers, 2) finds an object, where those lie as they are placed."""
    rng = np.random.default_rng(seed)
    x_low, y_low, x_high, y_high = floor.interior
    area = sum((box[2] - box[0]) * (box[3] - box[1]) for box in floor.sources)
    chance = walker.search_mps * walker.strip_m * floor.n_objects / area * dt_s
    place, heading = starts.copy(), headings.copy()
    found, time_s = np.full(len(starts), np.nan), 0.0
    while np.isnan(found).any():
        time_s += dt_s
        heading += rng.normal(0.0, math.sqrt(2.0 * walker.turning_per_s * dt_s), len(starts))
        place += walker.search_mps * dt_s * np.column_stack([np.cos(heading), np.sin(heading)])
        for wall, beyond in (
            (math.pi, place[:, 0] < x_low),
            (0.0, place[:, 0] > x_high),
            (-0.5 * math.pi, place[:, 1] < y_low),
            (0.5 * math.pi, place[:, 1] > y_high),
        ):
            bearing = (wall - heading + math.pi) % (2.0 * math.pi) - math.pi
            is_met = beyond & (np.abs(bearing) < 0.5 * math.pi)
            heading = np.where(is_met, wall - np.copysign(walker.turn_rad, bearing), heading)
        place = np.clip(place, (x_low, y_low), (x_high, y_high))
        is_inside = np.zeros(len(starts), np.bool_)
        for box in floor.sources:
            is_inside |= ((place >= box[:2]) & (place <= box[2:])).all(axis=1)
        found[np.isnan(found) & is_inside & (rng.random(len(starts)) < chance)] = time_s
    return found
