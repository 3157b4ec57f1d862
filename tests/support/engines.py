"""Bodies in either engine, without an arena around them."""

import math
from typing import Any

import numpy as np
import pytest

from swarm_forage_env.contract.layout import observation_layout
from swarm_forage_env.scenarios.config import PHYSICS_ENGINES, ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.bodies import Bodies
from swarm_forage_env.world.chipmunk import ChipmunkBodies
from swarm_forage_env.world.kernels.beams import proximity
from swarm_forage_env.world.kernels.bins import bin_robots, mark_cells
from swarm_forage_env.world.sensors import new_sensors
from swarm_forage_env.world.state import SwarmState

in_each_engine = pytest.mark.parametrize("physics", PHYSICS_ENGINES)


class SensedBodies(Bodies):
    """Compiled bodies that look for neighbours before they move, as the arena does after each move."""

    def __init__(self, config: ScenarioConfig, swarm: SwarmState) -> None:
        arena = config.arena
        layout = observation_layout(arena.width_m, arena.height_m, config.objects.n_objects)
        self.sensors = new_sensors(config, layout, ())
        super().__init__(config, swarm.position, swarm.heading, self.sensors.near, self.sensors.bins)

    def look(self, swarm: SwarmState) -> None:
        """Find out who is near whom."""
        s = self.sensors
        bin_robots(swarm.position, swarm.present, *s.bins)
        mark_cells(swarm.position, swarm.present, s.bins[0], s.occupied)
        standing = s.bins, s.occupied, s.interior
        seen = (*standing, s.obstacles, s.radius_m, s.reach_m, s.obs, s.columns.proximity, s.near, s.kept[0])
        proximity(swarm.position, swarm.facing, swarm.present, *seen)

    def advance(self, swarm: SwarmState) -> None:
        self.look(swarm)
        super().advance(swarm)


def make_bodies(config: ScenarioConfig, swarm: SwarmState) -> ChipmunkBodies | SensedBodies:
    """Bodies where the robots of a state are, in the engine of the configuration."""
    if config.physics == "compiled":
        return SensedBodies(config, swarm)
    return ChipmunkBodies(config, swarm.position, swarm.heading)


def bodies_at(
    places: Any, heading: Any, physics: str = "compiled", **overrides: Any
) -> tuple[ChipmunkBodies | SensedBodies, SwarmState]:
    """Bodies of robots at these poses in the small warehouse, and their state."""
    swarm = SwarmState.empty(len(places))
    swarm.position[:], swarm.heading[:] = places, heading
    swarm.facing[:] = np.column_stack((np.cos(swarm.heading), np.sin(swarm.heading)))
    return make_bodies(scenario("warehouse_small", n_robots=len(places), physics=physics, **overrides), swarm), swarm


def drive_at(
    physics: ChipmunkBodies | Bodies, swarm: SwarmState, heading: np.ndarray, speed: float | np.ndarray
) -> None:
    """One tick in which robots move in these directions (N,) at this speed in m/s, without turning."""
    physics.twist[:-1, 0] = speed * np.cos(heading)
    physics.twist[:-1, 1] = speed * np.sin(heading)
    physics.advance(swarm)


RADIUS_M = 0.085036758
DIAMETER_M = 2 * RADIUS_M


def heap(rng: np.random.Generator, n_robots: int) -> np.ndarray:
    """Places (N, 2) in m around the origin, of robots that touch and overlap a little."""
    side = math.sqrt(n_robots) * DIAMETER_M * 0.95
    while True:
        places = rng.uniform(-side / 2, side / 2, (n_robots, 2))
        for _ in range(400):  # pushed apart, not quite
            away = places[:, None] - places[None]
            distance = np.hypot(away[..., 0], away[..., 1]) + np.eye(n_robots)
            overlap = np.clip(0.99 * DIAMETER_M - distance, 0.0, None) * (1 - np.eye(n_robots))
            places = places + 0.25 * np.sum(overlap[..., None] * away / distance[..., None], axis=1)
        if distance[~np.eye(n_robots, dtype=bool)].min() > 0.9 * DIAMETER_M:
            return places
