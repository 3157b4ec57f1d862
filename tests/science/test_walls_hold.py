"""No robot leaves the arena, whatever a policy does: swarms driven against every wall and corner, with all wrappers."""

import numpy as np
import pytest

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import PHYSICS_ENGINES
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.base import wrap_in_order
from tests.support.foraging import mild_wrappers

TICKS = 3000
WAYS = {
    "E": (1, 0),
    "W": (-1, 0),
    "N": (0, 1),
    "S": (0, -1),
    "NE": (1, 1),
    "NW": (-1, 1),
    "SE": (1, -1),
    "SW": (-1, -1),
}
PLACES = (*WAYS, "random")
CASES = [(n, place, wrapped) for n in (50, 128) for place in PLACES for wrapped in (False, True)]
CASES += [(200, "NE", True), (200, "S", False), (512, "SW", False), (512, "NE", True), (512, "random", True)]


def towards(env: ForageEnv, place: str, rng: np.random.Generator) -> np.ndarray:
    """Full speed towards a wall or a corner, turning on the spot to face it; or at random."""
    swarm, arena = env.swarm, env.scenario.arena
    actions = np.zeros((len(swarm.active), 3), np.float32)
    if place == "random":
        return rng.uniform(-1, 1, actions.shape).astype(np.float32)
    way = np.array(WAYS[place])
    target = np.where(way > 0, (arena.width_m, arena.height_m), 0.0)
    to = np.where(way == 0, 0.0, target - swarm.position)
    turn = np.angle(np.exp(1j * (np.arctan2(to[:, 1], to[:, 0]) - swarm.heading)))
    actions[:, 0] = np.where(np.abs(turn) < 0.3, 1.0, -np.sign(turn))
    actions[:, 1] = np.where(np.abs(turn) < 0.3, 1.0, np.sign(turn))
    return actions


@pytest.mark.slow
@pytest.mark.parametrize("physics", PHYSICS_ENGINES)
@pytest.mark.parametrize(("n_robots", "place", "wrapped"), CASES)
def test_nobody_is_outside(n_robots, place, wrapped, physics):
    env = ForageEnv(scenario("warehouse_small", n_robots=n_robots, n_objects=5, physics=physics))
    stack = wrap_in_order(env, mild_wrappers()) if wrapped else env
    stack.reset_batch(n_robots)
    x_low, y_low, x_high, y_high = env.scenario.arena.interior_m
    radius, rng = env.scenario.robots.radius_m, np.random.default_rng(1)
    arrived = 0.0
    for _ in range(TICKS):
        stack.step_batch(towards(env, place, rng))
        x, y = env.swarm.position[env.swarm.present].T
        low, high = min((x - x_low).min(), (y - y_low).min()), min((x_high - x).min(), (y_high - y).min())
        assert min(low, high) >= radius - 1e-9
        arrived += min(low, high) < radius + 0.01
    assert place == "random" or arrived > TICKS / 3, "they push"
