"""A policy for tests that uses its gripper all the time, and a population that comes and goes."""

import numpy as np

from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.env import ForageEnv


class BusyPolicy:
    """Drives about at random, grasps when empty, and lets go in a random way after a random while."""

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start with all robots grasping."""
        self._rng = rng
        self._carrying = spec.layout["carrying"]
        self._wheels = np.full((spec.n_robots, 2), 0.5)
        self._release = np.full(spec.n_robots, Grip.GRASP)

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Return (N, 3) actions."""
        rng, n_robots = self._rng, len(obs)
        steered = rng.random(n_robots) < 0.05
        turn = np.where(rng.random(n_robots) < 0.2, 0.4, 0.02) * rng.uniform(-1, 1, n_robots)
        self._wheels[steered] = np.column_stack((0.5 - turn, 0.5 + turn))[steered]
        changed = rng.random(n_robots) < 0.03
        bands = (Grip.GRASP, Grip.RELEASE, Grip.DELIVER, Grip.SITE, Grip.CREATE_CACHE, Grip.CREATE_CACHE)
        self._release[changed] = rng.choice(bands, n_robots)[changed]
        carrying = obs[:, self._carrying].ravel() > 0.5
        return np.column_stack((self._wheels, np.where(carrying, self._release, Grip.GRASP))).astype(np.float32)


def change_population(env: ForageEnv, rng: np.random.Generator) -> None:
    """Let some robots die, come back elsewhere, break or be repaired."""
    swarm = env.swarm
    n_robots = len(swarm.active)
    present = swarm.present ^ (rng.random(n_robots) < 0.05)
    present[0] = True
    active = present & (rng.random(n_robots) < 0.8)
    born = present & ~swarm.present
    arena = env.scenario.arena
    places = rng.uniform((0.5, 0.5), (arena.width_m - 0.9, arena.height_m - 0.5), (n_robots, 2))
    swarm.position[born] = places[born]
    swarm.heading[born] = rng.uniform(-np.pi, np.pi, n_robots)[born]
    env.set_population(active=active, present=present)
