"""Slow twin of what robots of several kinds observe and how fast they drive: one robot at a time."""

import numpy as np

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.robots import RobotKind, kind_sizes
from tests.reference import motion, sensing


def kind_of(env: ForageEnv, robot: int) -> RobotKind:
    """The kind of a robot: kinds are counted off from row 0."""
    robots = env.scenario.robots
    row = 0
    for kind, size in zip(robots.robot_kinds, kind_sizes(robots.robot_kinds, robots.n_robots), strict=True):
        if row <= robot < row + size:
            return kind
        row += size
    raise AssertionError(f"robot {robot} is of no kind")


def observe(env: ForageEnv) -> np.ndarray:
    """Observation of every robot, (N, D) float64: what one with every sensor would see, less what its kind does not."""
    every = sensing.observe(env)
    for robot in np.flatnonzero(env.swarm.present).tolist():
        kind, row = kind_of(env, robot), every[robot]
        near = [abs(x) <= kind.window_cells // 2 for x in range(-2, 3)]
        in_window = [across and along for along in near for across in near]
        row[env.layout["los_object"]] *= in_window
        row[env.layout["los_cache"]] = sensing.caches_in_sight(env, robot, kind.window_cells // 2)
        has = {name: name not in kind.lacks for name in ("proximity", "light", "los_object", "los_cache")}
        for name, is_there in has.items():
            row[env.layout[name]] *= is_there
        company = [name not in kind.lacks for name in ("neighbours", "messages")]
        row[env.layout["kind"]] = [kind.speed, kind.window_cells / 5, *has.values(), *company]
    return every


def wheels(kind: RobotKind, command: tuple[float, float], gain: float = 1.0) -> tuple[float, float]:
    """Wheel speeds in m/s of a robot whose motors have a share of the usual speed, under a gain of both wheels."""
    left, right = motion.limited_wheels(*command)
    speed = motion.clip(gain * (left + right) / 2, motion.MAX_SPEED_MPS)
    difference = motion.clip(gain * (right - left), motion.MAX_DIFFERENCE_MPS)
    return kind.speed * (speed - difference / 2), kind.speed * (speed + difference / 2)
