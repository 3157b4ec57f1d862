"""Several nests: which cells they take, where their lights hang, and that they take deliveries."""

import numpy as np
import pytest

from swarm_forage_env.contract.codes import CELL_NEST, Event, Grip
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.scenarios.config import PHYSICS_ENGINES
from swarm_forage_env.scenarios.presets import scenario
from tests.support.stage import load, put, tidy_world

EAST = (28.0, 6.0, 30.0, 10.0)
SQUARE = (16.0, 2.0, 18.0, 4.0)


def test_nests_are_whole_cells_with_lights_of_their_own():
    arena = scenario("warehouse_small", further_nests=(EAST, SQUARE, (10.05, 8.05, 10.26, 8.26))).arena
    assert arena.all_nest_cells[1:] == ((140, 30, 150, 50), (80, 10, 90, 20), (50, 40, 51, 41))
    assert arena.nest_boxes_m[1] == EAST
    assert arena.nest_centres_m == ((3.2, 8.0), (29.0, 8.0), (17.0, 3.0), (10.1, 8.1))
    height = (32.0 * 16.0) ** 0.25
    places = [(29.0, 7.0), (29.0, 8.0), (29.0, 9.0), (17.0, 3.0), (10.1, 8.1)]
    assert arena.lights_m[3:] == tuple(pytest.approx((x, y, height)) for x, y in places)
    assert arena.lights_m[:3] == scenario("warehouse_small").arena.lights_m


@pytest.mark.parametrize("physics", PHYSICS_ENGINES)
def test_every_nest_takes_deliveries_and_holds_no_objects(physics):
    env = tidy_world(n_robots=2, physics=physics, further_nests=(EAST, SQUARE))
    for robot, (x, y) in enumerate(((29.0, 6.0), (17.0, 3.0))):
        put(env, robot, x, y)
        load(env, robot, robot)
    release = np.zeros((2, 3), np.float32)
    release[:, 2] = Grip.DELIVER
    for _ in range(20):
        env.step_batch(release)
        if env.arena.events.code.all():
            break
    assert env.arena.events.code.tolist() == [Event.DELIVERED, Event.DELIVERED]
    for x_low, y_low, x_high, y_high in env.scenario.arena.all_nest_cells:
        assert (env.arena.objects.floor[y_low:y_high, x_low:x_high] == CELL_NEST).all()


@pytest.mark.parametrize(("policy", "caches"), [("dpo", "none"), ("stochx", "dynamic")])
def test_the_controllers_bring_objects_to_both_nests(policy, caches):
    """Two nests of one size with objects between them, and each gets its part."""
    world = scenario(
        "warehouse_small", n_robots=30, n_objects=300, horizon_s=2000.0, caches=caches, placement="random",
        nest_centre_m=(3.2, 8.0), nest_size_m=(2.0, 8.0), further_nests=((27.8, 4.0, 29.8, 12.0),),
    )  # fmt: skip
    env, chosen = ForageEnv(world), load_policy(policy)
    chosen.reset(env.swarm_spec, np.random.default_rng(3))
    obs, truncated, places = env.reset_batch(3), False, []
    while not truncated:
        obs, _, _, truncated = env.step_batch(chosen.act(obs, env.active))
        places.extend(env.swarm.position[env.arena.events.code == Event.DELIVERED, 0].tolist())
    west = sum(x < 16.0 for x in places)
    assert min(west, len(places) - west) >= 5, (west, len(places))
