"""The arena as a whole: the order of a tick, which robots are in the world, what is counted, what `state` shows."""

import math

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Counter, Event, Grip, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from tests.support.stage import (
    OPEN_CELL,
    act,
    assert_conserved,
    build_cache,
    cell_centre,
    lay,
    load,
    put,
    tidy_world,
)

STRAIGHT = np.array([[0.5, 0.5, Grip.GRASP]] * 4, np.float32)


# Order of a tick


def test_interactions_see_where_the_robot_is_after_it_moved():
    env = tidy_world()
    lay(env, 0, OPEN_CELL)
    put(env, 0, 12.19, 8.1)  # on the object's cell, which it leaves in this tick
    env.step_batch(STRAIGHT)
    assert env.events.code[0] == Event.NOTHING_HERE


def test_interference_is_measured_after_motion():
    env = tidy_world()
    put(env, 0, 16.0, 8.0)
    put(env, 1, 16.28, 8.0, math.pi)
    env.step_batch(STRAIGHT)  # 4 cm nearer
    assert env.events.interfering[:2].tolist() == [True, True]


def test_the_observation_shows_the_world_after_the_step():
    env = tidy_world()
    put(env, 0, 16.0, 8.0)
    obs = env.step_batch(STRAIGHT)[0]
    assert obs[0, env.layout["position"]] == pytest.approx((2 * 16.02 / 32 - 1, 0.0), abs=1e-6)
    assert obs[0, env.layout["wheel_speed"]].tolist() == pytest.approx([0.5, 0.5])


def test_objects_walk_in_every_tick():
    env = ForageEnv(scenario("warehouse_small", n_robots=1, walk_probability=1.0))
    env.reset_batch(0)
    before = env.objects.cell.copy()
    env.step_batch(np.zeros((1, 3), np.float32))
    moved = np.any(env.objects.cell != before, axis=1)
    assert env.events.counters[Counter.OBJECTS_MOVED] == np.count_nonzero(moved) > 190
    assert_conserved(env)


# Who is in the world


def population(env, *, away=(), gone=()):
    present = np.ones(len(env.active), np.bool_)
    present[list(gone)] = False
    active = present.copy()
    active[list(away)] = False
    return {"active": active, "present": present}


def test_the_dead_are_out_of_the_way():
    env = tidy_world()
    put(env, 0, 16.0, 8.0)
    put(env, 1, 16.3, 8.0)
    env.set_population(**population(env, gone=(1,)))
    for _ in range(30):
        env.step_batch(STRAIGHT)
    assert env.swarm.position[0] == pytest.approx((16.6, 8.0))
    assert env.swarm.wheel_speed[1].tolist() == [0.0, 0.0]


def test_only_permanent_death_terminates():
    env = tidy_world()
    away = population(env, away=(0,), gone=(1,))
    env.set_population(**away, terminated=np.array([False, True, False, False]))
    terminated = env.step_batch(STRAIGHT)[2]
    assert terminated.tolist() == [False, True, False, False]
    env.set_population(**away)
    assert env.step_batch(STRAIGHT)[2].tolist() == [False, True, False, False], "death lasts"
    env.reset_batch(0)
    assert not env.step_batch(STRAIGHT)[2].any()


def test_a_reset_brings_everybody_back():
    env = tidy_world()
    env.set_population(**population(env, gone=(0, 1)))
    act(env, {})
    env.reset_batch(5)
    fresh = tidy_world()
    fresh.reset_batch(5)
    assert env.swarm.present.all()
    for _ in range(5):
        np.testing.assert_array_equal(env.step_batch(STRAIGHT)[0], fresh.step_batch(STRAIGHT)[0])


# Global state


def test_state_shows_robots_and_objects():
    env = tidy_world(n_robots=3, n_objects=5, caches="static")
    build_cache(env, [3, 4], (70, 40))
    put(env, 0, 16.0, 4.0, math.pi / 2)
    load(env, 0, 1)
    env.set_population(**population(env, away=(1,), gone=(2,)))
    state = env.state()
    assert state.shape == env.state_space.shape == (6 * 3 + 3 * 5,)
    robots, objects = state[:18].reshape(3, 6), state[18:].reshape(5, 3)
    assert robots[0] == pytest.approx([0.0, -0.5, 0.0, 1.0, 1.0, 1.0], abs=1e-6)
    assert robots[1, 4:].tolist() == [0.0, 0.0]
    assert robots[2].tolist() == [0.0] * 6
    assert objects[1] == pytest.approx([0.0, -0.5, ObjectStatus.CARRIED / 3])
    x, y = cell_centre((70, 40))
    assert objects[3] == pytest.approx([2 * x / 32 - 1, 2 * y / 16 - 1, ObjectStatus.CACHED / 3])
    x, y = cell_centre(tuple(env.objects.cell[0].tolist()))
    assert objects[0] == pytest.approx([2 * x / 32 - 1, 2 * y / 16 - 1, 0.0])
