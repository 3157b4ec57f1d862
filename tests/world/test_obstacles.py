"""Obstacles in the world: beams meet them, and objects, caches and start poses keep out of them."""

import math

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.obstacles import distances_m
from swarm_forage_env.scenarios.presets import scenario
from tests.reference.sensing import RADIUS_M, interferes, observe
from tests.support.stage import assert_conserved, put, tidy_world

BLOCK = (16.0, 8.0, 16.4, 8.6)


@pytest.mark.parametrize("seed", range(3))
def test_beams_and_interference_are_those_of_the_slow_twin(seed):
    env = tidy_world(n_robots=6, obstacles=(BLOCK, (20.0, 4.0, 20.4, 12.0)))
    rng = np.random.default_rng(seed)
    for robot in range(6):
        angle = rng.uniform(-math.pi, math.pi)
        while True:
            place = rng.uniform((15.8, 7.8), (16.6, 8.8))
            away = distances_m((BLOCK,), place[None])[0]
            if away > RADIUS_M and (
                robot == 0 or np.hypot(*(env.swarm.position[:robot] - place).T).min() > 2 * RADIUS_M
            ):
                break
        put(env, robot, *place, angle)
    obs = env.arena.observe()
    np.testing.assert_allclose(obs, observe(env), atol=2e-6)
    assert obs[:, env.layout["proximity"]].any()
    env.step_batch(np.zeros((6, 3), np.float32))
    assert env.events.interfering.tolist() == [interferes(env, robot) for robot in range(6)]


@pytest.mark.parametrize(
    ("placement", "caches"), [("single_source", "dynamic"), ("random", "none"), ("power_law", "none")]
)
def test_robots_objects_and_caches_start_clear_of_boxes(placement, caches):
    boxes = ((24.0, 3.0, 25.0, 13.0), (10.0, 5.0, 12.0, 11.0), (17.1, 2.0, 17.53, 9.0))
    config = scenario(
        "warehouse_small", n_robots=60, n_objects=120, placement=placement, caches=caches, obstacles=boxes,
        walk_probability=0.5,
    )  # fmt: skip
    env = ForageEnv(config)
    env.reset_batch(0)
    assert distances_m(boxes, env.swarm.position).min() >= RADIUS_M
    assert np.count_nonzero(env.objects.status == ObjectStatus.FREE) == 120
    for _ in range(5):
        env.step_batch(np.zeros((60, 3), np.float32))
        assert_conserved(env)
    assert env.events.counters[Counter.OBJECTS_MOVED] > 100


def test_objects_appear_at_positions_of_ones_own_and_nowhere_else():
    places = ((20.1, 8.1), (20.1, 8.9), (21.0, 8.3), (9.05, 5.55))
    config = scenario("warehouse_small", n_robots=2, n_objects=3, placement="positions", object_positions_m=places)
    env, seen = ForageEnv(config), set()
    cells = {(math.floor(x * 5), math.floor(y * 5)) for x, y in places}
    for seed in range(12):
        env.reset_batch(seed)
        lying = set(map(tuple, env.objects.cell.tolist()))
        assert len(lying) == 3
        assert lying <= cells
        seen |= lying
    assert seen == cells
