"""Where robots start: uniform positions and headings without overlap."""

import numpy as np
from scipy.spatial import KDTree

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.obstacles import distances_m

_TRIALS = 1000
"""Redraws before giving up, as in the study."""


def draw_start_poses(config: ScenarioConfig, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw start positions (N, 2) m and headings (N,) rad in (-pi, pi].

    Positions are uniform at least `start_margin_m` from the arena border; robots that overlap an obstacle are drawn
    again, and of two overlapping robots the one with the higher row. Robots may start inside the nest.

    Raises:
        ConfigError: no layout without overlap was found.
    """
    n_robots, margin = config.robots.n_robots, config.robots.start_margin_m
    low = np.array([margin, margin])
    high = np.array([config.arena.width_m - margin, config.arena.height_m - margin])
    position = rng.uniform(low, high, (n_robots, 2))
    for _ in range(_TRIALS):
        pairs = KDTree(position).query_pairs(2 * config.robots.radius_m, output_type="ndarray")
        blocked = np.flatnonzero(distances_m(config.arena.obstacles, position) < config.robots.radius_m)
        if len(pairs) == 0 and len(blocked) == 0:
            return position, -rng.uniform(-np.pi, np.pi, n_robots)
        again = np.union1d(pairs.max(axis=1), blocked)
        position[again] = rng.uniform(low, high, (len(again), 2))
    raise ConfigError(
        f"Found no start positions without overlap for {n_robots} robots in {_TRIALS} trials; "
        "use fewer robots, a larger arena or a smaller robots.start_margin_m."
    )
