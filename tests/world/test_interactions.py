"""Pick-ups and drops, rule by rule: what each gripper band does where, when it takes effect, who comes first."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_OBJECT, Counter, Event, Grip, ObjectStatus
from swarm_forage_env.world.kernels.interact import CREATE_CACHE, DELIVER_ONLY, GRASP, RELEASE, SITE, band_of
from tests.support.stage import (
    BASE_CELL,
    CORNER_CACHE,
    CORNERS,
    NEST_CELL,
    OPEN_CELL,
    WALL_CELL,
    act,
    assert_conserved,
    build_cache,
    cell_centre,
    count,
    events_of,
    kill,
    lay,
    load,
    put,
    repair,
    stand,
    tidy_world,
)

NONE, PICKED_UP, PICKED_FROM_CACHE = Event.NONE, Event.PICKED_UP, Event.PICKED_FROM_CACHE
DELIVERED, DROPPED, ELSEWHERE, JOINED = Event.DELIVERED, Event.DROPPED, Event.DROPPED_ELSEWHERE, Event.JOINED_CACHE
NOTHING_HERE, VANISHED, TOO_NEAR = Event.NOTHING_HERE, Event.VANISHED, Event.CACHE_TOO_NEAR
ANY_RELEASE = (0.0, Grip.RELEASE, Grip.DELIVER, Grip.SITE, Grip.CREATE_CACHE)


@pytest.mark.parametrize(
    ("band", "grips"),
    [
        (GRASP, (7.0, 1.0, 1e-6)),
        (RELEASE, (0.0, -0.125, -0.2499)),
        (DELIVER_ONLY, (-0.25, -0.375, -0.4999)),
        (SITE, (-0.5, -0.625, -0.7499)),
        (CREATE_CACHE, (-0.75, -1.0, -7.0)),
    ],
)
def test_bands(band, grips):
    assert {band_of(np.float32(grip)) for grip in grips} == {band}


# Empty robots


def test_grasping_over_an_object_picks_it_up_one_tick_later():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 5, OPEN_CELL)
    assert act(env, {0: Grip.GRASP}) == [NONE] * 4
    assert env.swarm.carried_object[0] == -1, "no effect yet"
    assert env.objects.status[5] == ObjectStatus.FREE
    assert act(env, {0: Grip.GRASP}) == [PICKED_UP, NONE, NONE, NONE]
    assert env.events.event_object[0] == 5
    assert env.events.event_cache[0].tolist() == [0, 0, 0, 0]
    assert env.swarm.carried_object[0] == 5
    assert not env.swarm.cargo_from_cache[0]
    assert env.objects.status[5] == ObjectStatus.CARRIED
    assert env.objects.floor[OPEN_CELL[::-1]] == CELL_EMPTY
    assert events_of(env, Grip.GRASP, 3) == [NONE, NONE, NONE], "a carrying robot that grasps holds"
    assert count(env, Counter.FREE_PICKUPS) == 1
    assert_conserved(env)


@pytest.mark.parametrize("cell", [OPEN_CELL, NEST_CELL, WALL_CELL])
def test_grasping_over_nothing_is_refused_at_once_and_every_time(cell):
    env = tidy_world()
    stand(env, 0, cell)
    assert events_of(env, Grip.GRASP, 3) == [NOTHING_HERE] * 3
    assert env.events.event_object[0] == -1


# Carrying robots


@pytest.mark.parametrize("grip", ANY_RELEASE)
def test_any_release_in_the_nest_delivers_one_tick_later(grip):
    env = tidy_world(caches="dynamic")
    stand(env, 0, NEST_CELL)
    load(env, 0, 2)
    assert act(env, {0: grip})[0] == NONE
    assert env.swarm.carried_object[0] == 2, "no effect yet"
    assert act(env, {0: grip})[0] == DELIVERED
    assert env.events.event_object[0] == 2
    assert env.swarm.carried_object[0] == -1
    assert count(env, Counter.COLLECTED) == 1
    # Re-placed in the same tick, in the source, as new.
    assert env.objects.status[2] == ObjectStatus.FREE
    x, y = env.objects.cell[2].tolist()
    assert 120 <= x < 136
    assert 12 <= y < 68
    assert env.objects.carriers[2] == 0
    assert_conserved(env)


@pytest.mark.parametrize("grip", ANY_RELEASE)
def test_any_release_in_a_cache_joins_it_one_tick_later(grip):
    env = tidy_world(caches="dynamic")
    slot = build_cache(env, [0, 1], BASE_CELL)
    stand(env, 0, (BASE_CELL[0] - 15, BASE_CELL[1] + 15))
    load(env, 0, 2)
    assert events_of(env, grip, 2) == [NONE, JOINED]
    assert env.events.event_object[0] == 2
    assert env.events.event_cache[0].tolist() == [env.caches.serial[slot], *BASE_CELL, 3]
    assert env.objects.cache_slot[2] == slot
    assert count(env, Counter.CACHE_DROPS) == 1
    assert_conserved(env)


@pytest.mark.parametrize("grip", [Grip.SITE, Grip.CREATE_CACHE])
def test_site_and_found_are_refused_near_a_cache(grip):
    env = tidy_world(caches="dynamic")
    near, far = build_cache(env, [0, 1], CORNER_CACHE), build_cache(env, [2, 3], (40, 60))
    # Proximity distance: twice the nominal side, 12.8 m, to the centre of the nearer cache.
    x, y = cell_centre(CORNER_CACHE)
    put(env, 0, x + 12.79, y)
    load(env, 0, 4)
    assert events_of(env, grip, 2) == [TOO_NEAR] * 2
    assert env.events.event_cache[0].tolist() == [env.caches.serial[near], *CORNER_CACHE, 2]
    assert env.events.event_cache[0, 0] != env.caches.serial[far]
    put(env, 0, x + 12.81, y)
    assert events_of(env, grip, 2) == [NONE, DROPPED]


@pytest.mark.parametrize(
    ("place", "why"),
    [(OPEN_CELL, "another object lies there"), (WALL_CELL, "no object may lie there")],
)
@pytest.mark.parametrize(("grip", "ticks"), [(Grip.RELEASE, 1), (Grip.SITE, 2), (Grip.CREATE_CACHE, 2)])
def test_drops_without_a_free_cell_are_placed_elsewhere(grip, ticks, place, why):
    env = tidy_world(caches="dynamic")
    if place == OPEN_CELL:
        lay(env, 7, place)
    stand(env, 0, place)
    load(env, 0, 4)
    assert events_of(env, grip, ticks)[-1] == ELSEWHERE, why
    assert env.events.event_object[0] == 4
    assert env.objects.status[4] == ObjectStatus.FREE
    assert 120 <= env.objects.cell[4, 0] < 136, "in the source"
    assert env.objects.carriers[4] == 0, "placed anew"
    assert count(env, Counter.FLOOR_DROPS) == count(env, Counter.DISPLACED_DROPS) == 1
    assert_conserved(env)


# Caches in use


def test_the_last_pair_dissolves_the_cache_and_the_orphan_lies_on_the_centre():
    env = tidy_world(caches="static")
    slot = build_cache(env, [0, 1], BASE_CELL)
    stand(env, 0, (BASE_CELL[0] + 10, BASE_CELL[1] + 10))
    assert events_of(env, Grip.GRASP, 2)[-1] == PICKED_FROM_CACHE
    taken = int(env.swarm.carried_object[0])
    orphan = 1 - taken
    assert env.events.event_cache[0].tolist() == [env.caches.serial[slot], *BASE_CELL, 1]
    assert not env.caches.alive[slot]
    assert env.objects.status[orphan] == ObjectStatus.FREE
    assert env.objects.cell[orphan].tolist() == list(BASE_CELL)
    assert env.objects.floor[BASE_CELL[::-1]] == CELL_OBJECT + orphan
    assert count(env, Counter.CACHES_DEPLETED) == 1
    assert_conserved(env)


# First pick-ups


def test_a_first_pick_up_is_one_since_the_object_was_placed():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 5, OPEN_CELL)
    events_of(env, Grip.GRASP, 2)
    assert env.events.first_picked.tolist() == [True, False, False, False]
    act(env, {0: Grip.RELEASE})
    events_of(env, Grip.GRASP, 2)
    assert env.swarm.carried_object[0] == 5
    assert not env.events.first_picked.any(), "the second carrier since placement"
    assert env.objects.carriers[5] == 2
    assert (count(env, Counter.FREE_PICKUPS), count(env, Counter.FIRST_PICKED)) == (2, 1)
    stand(env, 0, NEST_CELL)
    events_of(env, Grip.DELIVER, 2)
    stand(env, 0, tuple(env.objects.cell[5].tolist()))
    assert events_of(env, Grip.GRASP, 2)[-1] == PICKED_UP
    assert count(env, Counter.FIRST_PICKED) == 2, "delivered and placed anew"


# Timing


def test_another_band_cancels_silently_and_a_lost_condition_is_told():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    act(env, {0: Grip.GRASP})
    assert act(env, {0: Grip.RELEASE})[0] == NONE
    assert env.swarm.pending_kind[0] == 0
    act(env, {0: Grip.GRASP})
    lay(env, 0, (70, 30))
    assert events_of(env, Grip.GRASP, 2) == [VANISHED, NOTHING_HERE]
    lay(env, 0, OPEN_CELL)
    assert events_of(env, Grip.GRASP, 3) == [NONE, PICKED_UP, NONE], "an event lasts one tick"
    assert not env.events.first_picked.any()


def test_pick_ups_and_drops_of_several_ticks():
    env = tidy_world(pickup_ticks=3, drop_ticks=2)
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    actions = np.zeros((4, 3), np.float32)
    actions[0] = 0.5, 0.5, Grip.GRASP
    shown, speeds = [], []
    for _ in range(5):
        obs = env.step_batch(actions)[0]
        shown.append(int(obs[0, env.layout["interacting"]][0]))
        speeds.append(round(100 * float(env.swarm.wheel_speed[0, 0]), 6))
    assert env.swarm.carried_object[0] == 0
    assert shown == [1, 1, 1, 0, 0]
    assert speeds == [10.0, 0.0, 0.0, 0.0, 10.0]
    stand(env, 0, NEST_CELL)
    assert events_of(env, Grip.DELIVER, 3) == [NONE, NONE, DELIVERED]
    with pytest.raises(ConfigError, match="pickup, in ticks, to be a whole number"):
        env.set_handling_ticks(pickup=1.5, drop=1)


@pytest.mark.parametrize(("rows", "tick"), [((0, 3), 0), ((1, 2), 3), ((3, 1), 5)])
def test_the_turn_goes_round(rows, tick):
    env = tidy_world(n_robots=5)
    lay(env, 0, OPEN_CELL)
    x, y = cell_centre(OPEN_CELL)
    for robot, (dx, dy) in zip(rows, CORNERS, strict=True):
        put(env, robot, x + dx, y + dy)
    env.arena.tick = 100 + tick
    act(env, dict.fromkeys(rows, Grip.GRASP))
    events = act(env, dict.fromkeys(rows, Grip.GRASP))
    first, second = sorted(rows, key=lambda robot: (robot - env.tick) % 5)
    assert (events[first], events[second]) == (PICKED_UP, VANISHED)


# Robots in repair, robots that die


@pytest.mark.parametrize("grip", [Grip.RELEASE, Grip.GRASP])
def test_a_robot_in_repair_completes_what_is_running(grip):
    env = tidy_world()
    stand(env, 0, NEST_CELL)
    load(env, 0, 2)
    act(env, {0: Grip.DELIVER})
    repair(env, 0)
    assert act(env, {0: grip})[0] == DELIVERED
    assert env.swarm.carried_object[0] == -1


def test_a_robot_in_repair_starts_nothing_and_keeps_its_cargo():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    stand(env, 1, NEST_CELL)
    load(env, 1, 1)
    repair(env, 0, 1)
    for _ in range(3):
        assert act(env, {0: Grip.GRASP, 1: Grip.RELEASE}) == [NONE] * 4
    assert env.swarm.carried_object.tolist() == [-1, 1, -1, -1]


def test_a_dying_robot_drops_its_cargo_on_the_floor_or_into_the_cache():
    env = tidy_world(caches="dynamic")
    slot = build_cache(env, [6, 7], CORNER_CACHE)
    for robot, cell in enumerate((OPEN_CELL, CORNER_CACHE)):
        stand(env, robot, cell)
        load(env, robot, 3 + robot)
        kill(env, robot)
    assert env.objects.cache_slot[4] == slot
    assert env.objects.cell[3].tolist() == list(OPEN_CELL)
    assert env.swarm.carried_object[0] == -1
    assert_conserved(env)
    assert act(env, {0: Grip.GRASP}) == [NONE] * 4
