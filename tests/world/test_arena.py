"""The arena as a whole: the order of a tick, which robots are in the world, what is counted, what `state` shows."""

import math
import sys

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Counter, Event, Grip, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.arena import ForagingArena
from tests.support.foraging import NEAR
from tests.support.stage import (
    OPEN_CELL,
    act,
    assert_conserved,
    build_cache,
    cell_centre,
    lay,
    load,
    put,
    stand,
    tidy_world,
)

pytestmark = pytest.mark.usefixtures("each_engine")

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


def test_robots_in_repair_stand_still_and_are_in_the_way():
    env = tidy_world()
    put(env, 0, 16.0, 8.0)
    put(env, 1, 16.3, 8.0)
    env.set_population(**population(env, away=(1,)))
    assert env.active.tolist() == [True, False, True, True]
    for _ in range(30):
        env.step_batch(STRAIGHT)
    assert env.swarm.wheel_speed[1].tolist() == [0.0, 0.0]
    assert env.swarm.position[1, 0] - env.swarm.position[0, 0] >= 0.95 * 2 * 0.085


def test_the_dead_are_out_of_the_way():
    env = tidy_world()
    put(env, 0, 16.0, 8.0)
    put(env, 1, 16.3, 8.0)
    env.set_population(**population(env, gone=(1,)))
    for _ in range(30):
        env.step_batch(STRAIGHT)
    assert env.swarm.position[0] == pytest.approx((16.6, 8.0))
    assert env.swarm.wheel_speed[1].tolist() == [0.0, 0.0]


def test_a_robot_repaired_goes_on_with_its_cargo():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    load(env, 0, 3)
    env.set_population(**population(env, away=(0,)))
    act(env, {0: Grip.RELEASE})
    assert env.swarm.carried_object[0] == 3
    env.set_population(**population(env))
    assert act(env, {0: Grip.RELEASE})[0] == Event.DROPPED


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


# Tasks and constants


@pytest.mark.parametrize("caches", ["none", "static", "dynamic"])
@pytest.mark.parametrize("name", NEAR)
def test_policies_are_told_the_constants_of_the_world(name, caches):
    config = scenario(name, caches=caches)
    env = ForageEnv(config)
    task = env.swarm_spec
    assert (task.n_robots, task.n_objects) == (config.robots.n_robots, config.objects.n_objects)
    assert (task.dt_s, task.horizon_s) == (0.2, 10_000.0)
    assert (task.max_speed_mps, task.max_wheel_difference_mps, task.wheel_scale_mps) == (0.10, 0.20, 0.20)
    assert (task.wheel_base_m, task.cell_m) == (0.14, 0.2)
    assert task.arena_size_m == (config.arena.width_m, config.arena.height_m)
    assert task.nest_centre_m == pytest.approx(config.arena.nest_centre_m)
    assert task.nest_size_m == pytest.approx(config.arena.nest_size_m)
    assert (task.placement, task.caches) == (config.objects.placement, caches)
    longer, shorter = max(task.arena_size_m), min(task.arena_size_m)
    assert task.cache_side_nominal_m == pytest.approx(0.2 * longer)
    assert task.cache_side_m == pytest.approx({32.0: 6.2, 48.0: 9.4}[longer])
    assert task.min_dist_m == pytest.approx(0.2 * shorter)
    assert task.cache_proximity_m == pytest.approx(max(0.4 * longer, 0.2 * shorter))
    assert task.layout is env.layout


# Batch over robots


def test_a_tick_runs_the_same_lines_for_any_number_of_robots():
    def lines_run(n_robots: int) -> int:
        env = ForageEnv(scenario("warehouse_small", n_robots=n_robots, caches="static"))
        env.reset_batch(0)
        actions = np.tile(np.array([0.5, 0.4, Grip.GRASP], np.float32), (n_robots, 1))
        for _ in range(2):  # functions are compiled when they are first needed
            env.step_batch(actions)
        count = 0

        def trace(frame, event, argument):
            nonlocal count
            count += event == "line"
            return trace

        previous = sys.gettrace()
        sys.settrace(trace)
        try:
            env.step_batch(actions)
        finally:
            sys.settrace(previous)
        return count

    assert lines_run(5) == lines_run(100)


def test_the_arena_needs_no_environment_around_it():
    arena = ForagingArena(scenario("warehouse_small", n_robots=3))
    first = arena.reset(4)
    assert first.shape == (3, arena.layout.size)
    assert arena.step(np.zeros((3, 3), np.float32)) is first, "the buffer is reused"
