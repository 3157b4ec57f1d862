"""No robot leaves the arena, whatever a policy does: swarms driven against every wall and corner, with all wrappers."""

import numpy as np
import pytest

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import PHYSICS_ENGINES
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.base import wrap_in_order
from tests.support.drivers import WAYS, towards
from tests.support.foraging import mild_wrappers

TICKS = 3000
PLACES = (*WAYS, "random")
CASES = [(n, place, wrapped) for n in (50, 128) for place in PLACES for wrapped in (False, True)]
CASES += [(200, "NE", True), (200, "S", False), (512, "SW", False), (512, "NE", True), (512, "random", True)]


def actions_towards(env: ForageEnv, place: str, rng: np.random.Generator) -> np.ndarray:
    """Towards a wall or a corner; or at random."""
    if place == "random":
        return rng.uniform(-1, 1, (len(env.active), 3)).astype(np.float32)
    return towards(env, place)


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
        stack.step_batch(actions_towards(env, place, rng))
        x, y = env.swarm.position[env.swarm.present].T
        low, high = min((x - x_low).min(), (y - y_low).min()), min((x_high - x).min(), (y_high - y).min())
        assert min(low, high) >= radius - 1e-9
        arrived += min(low, high) < radius + 0.01
    assert place == "random" or arrived > TICKS / 3, "they push"
