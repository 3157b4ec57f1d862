"""Static and dynamic caches: what they hold, where they stand, when they come and go."""

import math

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY, Counter, Event, Grip, ObjectStatus, Task
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.floor import overlap_cells, square_box
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import Quirks
from swarm_forage_env.world.caches import (
    cache_members,
    clear_centre,
    count_cache_users,
    create_static_caches,
    n_cache_slots,
    restoration_probability,
    restore_static_caches,
)
from swarm_forage_env.world.placement import static_cache_centres
from swarm_forage_env.world.state import Source, listed, make_list
from tests.support.stage import act, assert_conserved, clear, lay, load, stand, tidy_world

STATIC_CENTRE = (72, 40)
"""Centre cell of the static cache of the small warehouse."""


def reset(name: str, seed: int = 0, **overrides) -> ForageEnv:
    env = ForageEnv(scenario(name, n_robots=4, **overrides))
    env.reset_batch(seed)
    return env


def contents(env: ForageEnv, slot: int) -> list[int]:
    return np.flatnonzero(env.objects.cache_slot == slot).tolist()


# Creation


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


# Dynamic caches: which objects a CREATE_CACHE drop gathers, where the cache is placed, when none is created


MIDDLE = (70, 40)
"""A cell around which a square of 31 cells is clear of nest, source and border."""
STRIP_CELL = (125, 60)


def found_at(env: ForageEnv, cell: tuple[int, int], row: int = 0, grip: float = Grip.CREATE_CACHE) -> list[int]:
    """Robot 0 creates a cache with an object at a cell; returns the slots of the caches that stand afterwards."""
    stand(env, 0, cell)
    load(env, 0, row)
    act(env, {0: grip})
    assert act(env, {0: grip})[0] == Event.DROPPED
    assert_conserved(env)
    return np.flatnonzero(env.caches.alive).tolist()


def test_a_cache_forms_from_the_objects_around_at_their_mean():
    env = tidy_world(caches="dynamic")
    for row, cell in enumerate([(60, 40), (64, 40), (69, 44)], start=1):
        lay(env, row, cell)
    (slot,) = found_at(env, (62, 38))
    assert contents(env, slot) == [0, 1, 2, 3]
    # Mean of the centres: (60 + 64 + 69 + 62) / 4 + 0.5 = 64.25, (40 + 40 + 44 + 38) / 4 + 0.5 = 41.0
    assert env.caches.cell[slot].tolist() == [64, 41]
    assert env.caches.serial[slot] == 1
    assert env.events.counters[Counter.CACHES_CREATED] == 1
    assert np.all(env.objects.cell[:4] == (64, 41))


@pytest.mark.parametrize(
    ("offset", "joins"),
    [((16, 0), True), ((0, -16), True), ((17, 0), False), ((11, 11), True), ((12, 11), False)],
)
def test_members_lie_within_min_dist_of_the_dropped_object(offset, joins):
    env = tidy_world(caches="dynamic")
    assert env.scenario.min_dist_m == pytest.approx(3.2)  # 16 cells
    lay(env, 1, (MIDDLE[0] + offset[0], MIDDLE[1] + offset[1]))
    slots = found_at(env, MIDDLE)
    assert bool(slots) == joins


def test_a_site_drop_and_the_source_strip_create_nothing():
    for cell, grip in ((MIDDLE, Grip.SITE), (STRIP_CELL, Grip.CREATE_CACHE)):
        env = tidy_world(caches="dynamic")
        lay(env, 1, (cell[0] - 1, cell[1]))
        assert found_at(env, cell, grip=grip) == []
        assert env.objects.status[0] == ObjectStatus.FREE


def test_distances_are_compared_in_whole_cells():
    # 48 and 64 cells make exactly min_dist = 16 m; the same sum in metres exceeds it by rounding.
    config = scenario("search_and_rescue", side_m=80.0, caches="dynamic", n_robots=1)
    env = ForageEnv(config)
    env.reset_batch(0)
    clear(env)
    for row, cell in ((0, (100, 100)), (1, (148, 164)), (2, (149, 164))):
        lay(env, row, cell)
    assert cache_members(0, config, env.objects, []).tolist() == [0, 1]


def test_objects_on_the_square_join_although_they_are_far_or_alone():
    env = tidy_world(caches="dynamic")
    lay(env, 1, (MIDDLE[0] + 2, MIDDLE[1]))
    lay(env, 2, (MIDDLE[0] - 14, MIDDLE[1] + 14))  # farther than min_dist, on the square
    lay(env, 3, (MIDDLE[0] + 17, MIDDLE[1]))  # neither
    (slot,) = found_at(env, MIDDLE)
    assert contents(env, slot) == [0, 1, 2]
    assert env.objects.status[3] == ObjectStatus.FREE


def test_a_second_cache_stands_clear_of_the_first():
    # Caches this close are refused to robots; two CREATE_CACHE drops that finish in the same tick can still come close.
    env = tidy_world(n_robots=2, caches="dynamic")
    for row, cell in ((0, (52, 40)), (1, (51, 44)), (2, (80, 40)), (3, (81, 44))):
        if row % 2:
            lay(env, row, cell)
        else:
            stand(env, row // 2, cell)
            load(env, row // 2, row)
    for _ in range(2):
        act(env, {0: Grip.CREATE_CACHE, 1: Grip.CREATE_CACHE})
    assert env.caches.alive.sum() == 2
    assert_conserved(env)  # no two squares overlap


# Pushing a centre clear


boxes = st.tuples(st.integers(0, 140), st.integers(0, 70), st.integers(1, 20), st.integers(1, 10)).map(
    lambda box: (box[0], box[1], box[0] + box[2], box[1] + box[3])
)


@settings(max_examples=40)
@given(
    centre=st.tuples(st.integers(0, 159), st.integers(0, 79)),
    obstacles=st.lists(boxes, max_size=6),
    seed=st.integers(0, 99),
)
def test_an_accepted_centre_is_clear_and_a_place_for_an_object(centre, obstacles, seed):
    config = scenario("warehouse_small", caches="dynamic", side_share=0.05)
    accepted = clear_centre(centre, config, obstacles, np.random.default_rng(seed))
    # Objects may lie in the cells 24 .. 136 and 12 .. 68; with D = 1.6 m = 8 cells the border is farther away.
    clamped = min(max(centre[0], 24), 136), min(max(centre[1], 12), 68)
    untouched = all(
        overlap_cells(square_box(clamped, config.cache_side_cells), obstacle) == 0 for obstacle in obstacles
    )
    if untouched:
        assert accepted == clamped
    if accepted is not None:
        box = square_box(accepted, config.cache_side_cells)
        assert all(overlap_cells(box, obstacle) == 0 for obstacle in obstacles)
        assert 24 <= accepted[0] <= 136
        assert 12 <= accepted[1] <= 68


def test_objects_stay_when_no_cache_finds_room():
    # The nest in the middle leaves less than a square on every side.
    env = ForageEnv(
        scenario(
            "warehouse_medium",
            n_robots=1,
            n_objects=2,
            caches="dynamic",
            nest_size_m=(20.0, 20.0),
        )
    )
    env.reset_batch(0)
    clear(env)
    lay(env, 1, (60, 120))
    assert found_at(env, (62, 120)) == []
    assert env.objects.status.tolist() == [ObjectStatus.FREE, ObjectStatus.FREE]


# Among power-law clusters


EVERYWHERE = [(x, y, x + 8, y + 6) for x in range(40, 200, 36) for y in range(44, 200, 36)]
"""Clusters 36 cells apart, of which a square of 47 cells overlaps some wherever it stands."""


def clustered_world(clusters=EVERYWHERE, *, n_objects: int = 4, **overrides) -> ForageEnv:
    """Search and rescue on 48 m, 240 x 240 cells, with hand-made clusters of 16 objects and nothing on the floor.

    Nest: the cells 96 .. 143 of both axes. Objects may lie in the cells 36 .. 204.
    """
    env = ForageEnv(
        scenario(
            "search_and_rescue",
            side_m=48.0,
            n_robots=2,
            n_objects=n_objects,
            walk_probability=0.0,
            caches="dynamic",
            **overrides,
        )
    )
    env.reset_batch(0)
    clear(env)
    n_clusters = len(clusters)
    source = Source(
        np.array(clusters, np.int32), np.full(n_clusters, 16, np.int32), np.array([0, n_clusters], np.int32)
    )
    env.arena._arrays = env.arena._arrays._replace(source=source)
    return env


def test_a_cache_stands_on_clusters_that_leave_it_no_room():
    env = clustered_world()
    lay(env, 1, (64, 60))
    lay(env, 2, (41, 45))  # in a cluster, on the square
    lay(env, 3, (41, 84))  # in a cluster, within min_dist = 48 cells of the dropped object, off the square
    (slot,) = found_at(env, (60, 60))
    # Mean of the two that found it; the square covers the cells 39 .. 85, 37 .. 83.
    assert env.caches.cell[slot].tolist() == [62, 60]
    assert contents(env, slot) == [0, 1, 2]


# As the authors' program does it (quirk)


def test_quirk_founds_no_cache_where_clusters_leave_no_room():
    env = clustered_world(quirks=Quirks(dynamic_cache_avoids_clusters=True))
    lay(env, 1, (64, 60))
    lay(env, 2, (41, 45))
    lay(env, 3, (41, 84))
    assert found_at(env, (60, 60)) == []
    assert np.all(env.objects.status == ObjectStatus.FREE)


def test_quirk_merges_all_usable_objects_wherever_they_lie():
    env = tidy_world(caches="dynamic", quirks=Quirks(dynamic_cache_merges_all=True))
    for row, cell in ((1, (30, 60)), (2, (110, 20)), (3, (60, 66))):
        lay(env, row, cell)
    (slot,) = found_at(env, MIDDLE)
    assert contents(env, slot) == [0, 1, 2, 3]


# Room in every arena


NARROW = {"width_m": 32.0, "nest_size_m": (3.2, 3.2), "start_margin_m": 0.5, "n_objects": 9}


@pytest.mark.parametrize(("height_m", "fitting_share"), [(9.4, 0.193), (6.0, 0.125)])
def test_arenas_too_narrow_for_dynamic_caches_are_refused_with_a_side_that_fits(height_m, fitting_share):
    arena = {**NARROW, "height_m": height_m, "nest_centre_m": (3.2, height_m / 2), "caches": "dynamic"}
    with pytest.raises(ConfigError, match=f"lower side_share to {fitting_share}, or"):
        scenario("warehouse_small", **arena)
    assert scenario("warehouse_small", **arena, side_share=fitting_share).cache_side_cells > 1
    assert scenario("warehouse_small", **{**arena, "caches": "none"}).arena.height_m == height_m


@settings(max_examples=100)
@given(
    nx=st.integers(10, 200),
    ny=st.integers(10, 200),
    share=st.floats(0.02, 0.5),
    at=st.tuples(st.integers(0, 200), st.integers(0, 200)),
)
def test_squares_of_dynamic_caches_are_inside_every_arena_that_is_accepted(nx, ny, share, at):
    size = {"width_m": nx / 5, "height_m": ny / 5, "nest_centre_m": (0.5, 0.5), "nest_size_m": (0.2, 0.2)}
    few = {"n_robots": 1, "n_objects": 1, "start_margin_m": 0.5, "placement": "random"}
    try:
        config = scenario("warehouse_small", **size, **few, side_share=share, caches="dynamic")
    except ConfigError as error:
        assert "cache" in str(error)  # noqa: PT017 - only some are refused
        return
    centre = clear_centre(at, config, [], np.random.default_rng(0))
    assert centre is not None
    x_low, y_low, x_high, y_high = square_box(centre, config.cache_side_cells)
    assert 0 <= x_low < x_high <= nx
    assert 0 <= y_low < y_high <= ny
    area = config.arena.distributable_cells
    assert area[0] <= centre[0] < area[2]
    assert area[1] <= centre[1] < area[3]
    assert n_cache_slots(config) >= 1
