"""The object memory, against a dictionary whose every density decays in every tick."""

import numpy as np
import pytest

from baselines.dpo import DPOPolicy
from baselines.memory import density
from tests.reference.controllers import ObjectDictionary, visible_objects
from tests.support.memories import objects_of
from tests.support.observations import Observations, make_spec

ACTIVE = np.ones(1, bool)


def new_policy(task) -> DPOPolicy:
    policy = DPOPolicy()
    policy.reset(task, np.random.default_rng(0))
    return policy


def look(policy: DPOPolicy, observations: Observations, x: float, y: float, objects: dict) -> dict:
    observations.pose(x, y)
    observations.window(objects)
    policy.act(observations.array, ACTIVE)
    return objects_of(policy, 0)


def test_density_of_an_object_seen_now_and_long_ago():
    log_keep = DPOPolicy().parameters.derived()["log_keep"]
    assert density(0, log_keep) == pytest.approx(1.0 - 0.00001, abs=1e-12)
    assert density(49_999, log_keep) == pytest.approx(0.6065, abs=1e-4)


def test_positions_come_from_the_exact_cell_not_from_the_noisy_position():
    observations = Observations(make_spec())
    policy = new_policy(observations.spec)
    observations.pose(10.1, 8.1)
    observations.believed_position(10.9, 7.3)
    observations.window({(0, 0): 7})
    policy.act(observations.array, ACTIVE)
    assert objects_of(policy, 0)[7][:2] == (50, 40)


@pytest.mark.parametrize("seed", range(2))
def test_memory_equals_the_naive_rule(seed):
    """Robots walk over a patch on which objects move, vanish, come back; some ticks are slept through."""
    rng = np.random.default_rng(seed)
    n_robots, n_objects, side, ticks = 4, 40, 14, 700
    task = make_spec(n_robots, n_objects=n_objects)
    observations = Observations(task)
    policy = new_policy(task)
    twins = [ObjectDictionary() for _ in range(n_robots)]
    places = rng.choice(side * side, n_objects, replace=False)
    present = rng.random(n_objects) < 0.7
    robots = rng.integers(0, side, (n_robots, 2))
    for _ in range(ticks):
        robots = np.clip(robots + rng.integers(-1, 2, robots.shape) * (rng.random((n_robots, 1)) < 0.3), 0, side - 1)
        if rng.random() < 0.4:
            moved = rng.integers(n_objects)
            present[moved] = rng.random() < 0.7
            free = np.setdiff1d(np.arange(side * side), places)
            places[moved] = rng.choice(free)
        active = rng.random(n_robots) < 0.9
        for i, (cell_x, cell_y) in enumerate(robots):
            observations.pose((100 + cell_x + 0.5) * 0.2, (20 + cell_y + 0.5) * 0.2, robots=i)
            objects = {
                (int(place % side - cell_x), int(place // side - cell_y)): row
                for row, place in enumerate(places)
                if present[row]
            }
            observations.window({at: row for at, row in objects.items() if max(map(abs, at)) <= 2}, robots=i)
        policy.act(observations.array, active)
        for i in np.flatnonzero(active):
            senses = {name: observations.get(name, i).astype(float) for name in ("los_cell", "los_object")}
            twins[i].update(*visible_objects(task, senses))
        for i, twin in enumerate(twins):
            known = objects_of(policy, i)
            assert {row: entry[:2] for row, entry in known.items()} == {
                row: cell for row, (cell, _) in twin.known.items()
            }
            for row, entry in known.items():
                assert entry[2] == pytest.approx(twin.known[row][1], abs=1e-12)
    assert policy._robots["n_known"].min() > 5
