"""Static caches: which objects they hold, and when they are restored. Slots and serial numbers."""

import math

import numpy as np
import pytest

from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY, Counter, Grip, ObjectStatus, Task
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.floor import square_box
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.caches import (
    count_cache_users,
    create_static_caches,
    restoration_probability,
    restore_static_caches,
)
from swarm_forage_env.world.placement import static_cache_centres
from swarm_forage_env.world.state import listed, make_list
from tests.support.stage import act, assert_conserved, build_cache, clear, lay, load, stand, tidy_world

STATIC_CENTRE = (72, 40)
"""Centre cell of the static cache of the small warehouse."""


def reset(name: str, seed: int = 0, **overrides) -> ForageEnv:
    env = ForageEnv(scenario(name, n_robots=4, **overrides))
    env.reset_batch(seed)
    return env


def contents(env: ForageEnv, slot: int) -> list[int]:
    return np.flatnonzero(env.objects.cache_slot == slot).tolist()


# Creation


def test_single_source_starts_with_the_first_two_objects():
    env = reset("warehouse_small", caches="static")
    assert env.caches.alive.sum() == 1
    assert env.caches.cell[0].tolist() == list(STATIC_CENTRE)
    assert contents(env, 0) == [0, 1]
    assert env.events.counters[Counter.CACHES_CREATED] == 1
    assert_conserved(env)


def test_random_placement_absorbs_what_lies_on_the_squares():
    n_objects = 2048
    env = reset("warehouse_medium", n_objects=n_objects, caches="static")
    assert env.caches.alive.sum() == 4
    # The squares of 47 x 47 cells lie wholly in the source: 168 x 168 cells without the nest's 48 x 48.
    expected = n_objects * 47**2 / (168**2 - 48**2)
    assert np.all(np.abs(env.caches.count[:4] - expected) < 4 * math.sqrt(expected))
    assert_conserved(env)


def test_first_objects_in_row_order_from_outside_of_every_square():
    env = tidy_world(n_objects=8, caches="static")
    lay(env, 0, (STATIC_CENTRE[0] - 15, STATIC_CENTRE[1] - 15))  # on the square: absorbed, but not taken
    lay(env, 5, (STATIC_CENTRE[0] + 15, STATIC_CENTRE[1] + 15))
    lay(env, 6, (STATIC_CENTRE[0] + 16, STATIC_CENTRE[1]))  # beside the square
    load(env, 2, 1)
    create_static_caches(env.scenario, env.objects, env.caches, env.events)
    assert contents(env, 0) == [0, 2, 3, 5]
    assert np.all(env.objects.cell[[0, 2, 3, 5]] == STATIC_CENTRE)
    assert_conserved(env)


def test_power_law_caches_stand_before_the_clusters_are_drawn():
    for seed in range(5):
        env = reset("search_and_rescue", seed, caches="static")
        assert [contents(env, slot) for slot in range(4)] == [[0, 1], [2, 3], [4, 5], [6, 7]]
        boxes = [square_box(centre, env.scenario.cache_side_cells) for centre in static_cache_centres(env.scenario)]
        for x_low, y_low, x_high, y_high in boxes:
            inside = np.all((env.objects.cell >= (x_low, y_low)) & (env.objects.cell < (x_high, y_high)), axis=1)
            assert not np.any(inside & (env.objects.status == ObjectStatus.FREE))
        assert_conserved(env)


# Restoration


def test_restoration_probability():
    assert restoration_probability(10, 5, 0.05) == pytest.approx(0.0952, abs=5e-5)
    assert restoration_probability(10, 0, 0.05) == pytest.approx(1 - math.exp(-0.5))
    assert restoration_probability(0, 5, 0.05) == 0.0
    assert restoration_probability(0, 0, 0.05) == 0.0
    assert restoration_probability(3, 7, 0.0) == 0.0


def test_users_are_counted_by_task_or_by_where_their_cargo_came_from():
    env = tidy_world(n_robots=6, caches="static")
    tasks = np.array(
        [Task.HARVESTER, Task.HARVESTER, Task.COLLECTOR, Task.GENERALIST, Task.CACHE_COLLECTOR, Task.COLLECTOR],
        np.int8,
    )
    assert count_cache_users(env.swarm, tasks) == (2, 2)
    assert count_cache_users(env.swarm, None) == (0, 0)
    for robot in (0, 1, 2):
        load(env, robot, robot)
    env.swarm.cargo_from_cache[2] = True
    assert count_cache_users(env.swarm, None) == (2, 1)
    env.swarm.active[[0, 5]] = False
    assert count_cache_users(env.swarm, tasks) == (1, 1)
    assert count_cache_users(env.swarm, None) == (1, 1)


def missing_world(**options) -> ForageEnv:
    """A static world without its cache, in which 10 robots harvest and 5 collect."""
    return tidy_world(n_robots=15, caches="static", respawn_scale=0.05, **options)


HARVEST = np.array([Task.HARVESTER] * 10 + [Task.COLLECTOR] * 5, np.int8)


def test_missing_caches_are_restored_at_the_published_rate():
    env = missing_world()
    rng = np.random.default_rng(0)
    trials, restored = 4000, 0
    for _ in range(trials):
        restore_static_caches(env.scenario, env.swarm, env.objects, env.caches, env.events, HARVEST, rng)
        if env.caches.alive.any():
            restored += 1
            clear(env)
            for row in range(8):
                lay(env, row, (121 + 2 * row, 20))
    expected = 0.0952 * trials
    assert abs(restored - expected) < 4 * math.sqrt(expected)


def test_steps_restore_from_the_tasks_that_the_policy_tells():
    actions = np.zeros((15, 3), np.float32)
    waits = []
    for tasks in (HARVEST, None):
        env = missing_world()
        for _ in range(300):
            env.step_batch(actions, tasks=tasks)
            if env.caches.alive.any():
                break
        waits.append(env.tick)
        assert_conserved(env)
    assert waits[0] < 100
    assert waits[1] == 300, "nobody carries anything"


def test_all_missing_caches_come_back_together():
    env = reset("warehouse_medium", caches="static", respawn_scale=1e9)
    assert env.caches.alive.sum() == 4
    for slot in (1, 3):  # two caches lose all their objects
        rows = np.flatnonzero(env.objects.cache_slot == slot)
        env.objects.floor[env.objects.floor == CELL_CACHE - slot] = CELL_EMPTY
        env.objects.cache_slot[rows], env.objects.status[rows] = -1, ObjectStatus.WAITING
        env.objects.cell[rows] = -1
        make_list(env.objects.waiting, [*listed(env.objects.waiting), *rows])
        env.caches.alive[slot], env.caches.count[slot] = False, 0
    actions = np.zeros((4, 3), np.float32)
    env.step_batch(actions, tasks=np.full(4, Task.HARVESTER, np.int8))
    assert env.caches.alive.sum() == 4
    assert sorted(env.caches.serial[:4].tolist()) == [1, 3, 5, 6]
    assert_conserved(env)


# Slots


def test_a_freed_slot_is_used_again_under_a_new_serial():
    config = scenario("warehouse_small", n_robots=1, n_objects=20, caches="dynamic", respawn_scale=0.0)
    env = ForageEnv(config)
    env.reset_batch(0)
    clear(env)
    for row in range(20):
        lay(env, row, (121 + row % 10, 14 + row // 10))
    serials = []
    for turn in range(6):
        slot = build_cache(env, [turn, turn + 1], (60, 40))
        serials.append(int(env.caches.serial[slot]))
        assert slot == 0
        stand(env, 0, (60, 40))
        act(env, {0: Grip.GRASP})
        act(env, {0: Grip.GRASP})
        assert not env.caches.alive.any()
        act(env, {0: Grip.RELEASE})
        for row in (turn, turn + 1):
            lay(env, row, (121 + row % 10, 14 + row // 10))
    assert serials == [1, 2, 3, 4, 5, 6]
