"""Slow twins of neighbours and messages: every robot is held against every other."""

import cmath

import numpy as np

from swarm_forage_env.env import ForageEnv


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
