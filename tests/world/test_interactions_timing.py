"""Pick-ups and drops over time: cancelled, lost, contested, in repair, at death, and one after the other."""

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Counter, Event, Grip, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.engines import in_each_engine
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
    depot,
    events_of,
    kill,
    lay,
    load,
    put,
    repair,
    stand,
    tidy_world,
)

pytestmark = in_each_engine

NONE, PICKED_UP, PICKED_FROM_CACHE = Event.NONE, Event.PICKED_UP, Event.PICKED_FROM_CACHE
DELIVERED, DROPPED, ELSEWHERE, JOINED = Event.DELIVERED, Event.DROPPED, Event.DROPPED_ELSEWHERE, Event.JOINED_CACHE
NOTHING_HERE, VANISHED, TOO_NEAR = Event.NOTHING_HERE, Event.VANISHED, Event.CACHE_TOO_NEAR
FAR_CELL = (110, 60)


# Timing


def test_another_band_cancels_silently():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    act(env, {0: Grip.GRASP})
    assert act(env, {0: Grip.RELEASE})[0] == NONE
    assert env.swarm.pending_kind[0] == 0
    assert env.swarm.carried_object[0] == -1
    assert events_of(env, Grip.GRASP, 2) == [NONE, PICKED_UP], "starts anew"


def test_holding_cancels_a_delivery():
    env = tidy_world()
    stand(env, 0, NEST_CELL)
    load(env, 0, 0)
    act(env, {0: Grip.DELIVER})
    assert act(env, {0: Grip.GRASP})[0] == NONE
    assert env.swarm.carried_object[0] == 0
    assert env.swarm.pending_kind[0] == 0


def test_changing_the_release_band_starts_anew():
    env = tidy_world()
    stand(env, 0, NEST_CELL)
    load(env, 0, 0)
    bands = [Grip.DELIVER, Grip.RELEASE, Grip.SITE, Grip.SITE]
    assert [act(env, {0: band})[0] for band in bands] == [NONE, NONE, NONE, DELIVERED]


def test_a_value_within_the_same_band_does_not_cancel():
    env = tidy_world()
    stand(env, 0, NEST_CELL)
    load(env, 0, 0)
    assert [act(env, {0: grip})[0] for grip in (-0.26, -0.49)] == [NONE, DELIVERED]


def test_an_object_that_is_gone_has_vanished():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    act(env, {0: Grip.GRASP})
    lay(env, 0, (70, 30))
    assert act(env, {0: Grip.GRASP})[0] == VANISHED
    assert env.swarm.pending_kind[0] == 0
    assert act(env, {0: Grip.GRASP})[0] == NOTHING_HERE


def test_an_object_that_was_swapped_has_vanished():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    act(env, {0: Grip.GRASP})
    lay(env, 0, (70, 30))
    lay(env, 1, OPEN_CELL)
    assert events_of(env, Grip.GRASP, 3) == [VANISHED, NONE, PICKED_UP]


@pytest.mark.parametrize("carrying", [False, True])
def test_a_cache_that_is_gone_has_vanished(carrying):
    env = tidy_world(caches="static")
    slot = build_cache(env, [0, 1], BASE_CELL)
    stand(env, 0, BASE_CELL)
    grip = Grip.GRASP
    if carrying:
        load(env, 0, 2)
        grip = Grip.DELIVER
    act(env, {0: grip})
    env.caches.serial[slot] += 1  # another cache on the same spot
    assert act(env, {0: grip})[0] == VANISHED
    assert env.caches.count[slot] == 2


def test_a_robot_pushed_out_of_the_nest_has_lost_it():
    env = tidy_world()
    stand(env, 0, NEST_CELL)
    load(env, 0, 0)
    act(env, {0: Grip.DELIVER})
    stand(env, 0, OPEN_CELL)
    assert events_of(env, Grip.DELIVER, 2) == [VANISHED, NOTHING_HERE]
    assert env.swarm.carried_object[0] == 0


def test_a_site_drop_is_lost_when_a_cache_appears_nearby_and_refused_when_asked_again():
    env = tidy_world(caches="dynamic")
    stand(env, 0, OPEN_CELL)
    load(env, 0, 4)
    act(env, {0: Grip.SITE})
    build_cache(env, [0, 1], CORNER_CACHE)
    assert events_of(env, Grip.SITE, 2) == [VANISHED, TOO_NEAR]
    assert env.swarm.carried_object[0] == 4


def test_events_last_one_tick():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 5, OPEN_CELL)
    assert events_of(env, Grip.GRASP, 3) == [NONE, PICKED_UP, NONE]
    assert act(env, {0: Grip.RELEASE})[0] == DROPPED
    assert act(env, {}) == [NONE] * 4
    assert not env.events.first_picked.any()


# Who comes first


@pytest.mark.parametrize("tick", range(6))
@pytest.mark.parametrize("rows", [(0, 3), (1, 2), (3, 1)])
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


@pytest.mark.parametrize("tick", range(4))
def test_the_last_pair_of_a_cache_serves_one_of_two(tick):
    env = tidy_world(caches="static")
    slot = build_cache(env, [0, 1], BASE_CELL)
    stand(env, 0, (BASE_CELL[0] - 5, BASE_CELL[1]))
    stand(env, 2, (BASE_CELL[0] + 5, BASE_CELL[1]))
    env.arena.tick = tick
    act(env, {0: Grip.GRASP, 2: Grip.GRASP})
    events = act(env, {0: Grip.GRASP, 2: Grip.GRASP})
    first, second = sorted((0, 2), key=lambda robot: (robot - env.tick) % 4)
    assert (events[first], events[second]) == (PICKED_FROM_CACHE, VANISHED)
    assert not env.caches.alive[slot]
    assert_conserved(env)


def test_drops_come_before_pick_ups():
    """A cache of two survives when one robot adds to it in the tick in which another takes from it."""
    for tick in range(4):
        env = tidy_world(caches="static")
        slot = build_cache(env, [0, 1], BASE_CELL)
        stand(env, 0, (BASE_CELL[0] - 5, BASE_CELL[1]))
        stand(env, 1, (BASE_CELL[0] + 5, BASE_CELL[1]))
        load(env, 1, 2)
        env.arena.tick = tick
        grips = {0: Grip.GRASP, 1: Grip.DELIVER}
        act(env, grips)
        assert act(env, grips)[:2] == [PICKED_FROM_CACHE, JOINED]
        assert env.caches.count[slot] == 2


@pytest.mark.parametrize("tick", range(2))
def test_a_grasp_sees_what_was_laid_down_in_the_same_tick(tick):
    env = tidy_world(n_robots=2)
    x, y = cell_centre(OPEN_CELL)
    for robot, (dx, dy) in enumerate(CORNERS):
        put(env, robot, x + dx, y + dy)
    load(env, 1, 0)
    env.arena.tick = tick
    assert act(env, {0: Grip.GRASP, 1: Grip.RELEASE}) == [NONE, DROPPED]
    assert env.swarm.pending_kind[0] != 0


def test_floor_drops_on_one_cell():
    env = tidy_world(n_robots=2)
    x, y = cell_centre(OPEN_CELL)
    for robot, (dx, dy) in enumerate(CORNERS):
        put(env, robot, x + dx, y + dy)
        load(env, robot, robot)
    assert sorted(act(env, {0: Grip.RELEASE, 1: Grip.RELEASE})) == [DROPPED, ELSEWHERE]
    assert_conserved(env)


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


def test_a_robot_in_repair_can_find_its_object_gone():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    act(env, {0: Grip.GRASP})
    repair(env, 0)
    lay(env, 0, (70, 30))
    assert act(env, {0: Grip.GRASP})[0] == VANISHED


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


def test_a_dying_robot_drops_its_cargo_on_the_floor():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    load(env, 0, 3)
    kill(env, 0)
    assert env.objects.cell[3].tolist() == list(OPEN_CELL)
    assert env.swarm.carried_object[0] == -1
    assert_conserved(env)
    assert act(env, {0: Grip.GRASP}) == [NONE] * 4


def test_a_dying_robot_drops_its_cargo_into_the_cache_it_stands_in():
    env = tidy_world(caches="static")
    slot = build_cache(env, [0, 1], BASE_CELL)
    stand(env, 0, BASE_CELL)
    load(env, 0, 3)
    kill(env, 0)
    assert env.caches.count[slot] == 3
    assert_conserved(env)


@pytest.mark.parametrize("cell", [NEST_CELL, WALL_CELL, depot(0)])
def test_cargo_of_a_dying_robot_is_placed_elsewhere_when_it_cannot_lie(cell):
    env = tidy_world()
    stand(env, 0, cell)
    load(env, 0, 3)
    kill(env, 0)
    assert 120 <= env.objects.cell[3, 0] < 136
    assert count(env, Counter.COLLECTED) == 0, "a death in the nest is no delivery"
    assert_conserved(env)


def test_cargo_does_not_lie_in_a_nest_amid_the_objects():
    # In the medium warehouse the nest stands inside of the box where objects may lie.
    env = ForageEnv(scenario("warehouse_medium", n_robots=1, n_objects=5))
    env.reset_batch(0)
    stand(env, 0, (120, 120))
    load(env, 0, 3)
    kill(env, 0)
    assert env.objects.status[3] == ObjectStatus.FREE
    assert_conserved(env)


def test_two_robots_that_die_together_lose_both_cargoes():
    env = tidy_world()
    for robot in (0, 1):
        stand(env, robot, NEST_CELL)
        load(env, robot, robot)
    env.set_population(active=np.array([False, False, True, True]), present=np.array([False, False, True, True]))
    assert np.all(env.objects.status[:2] == ObjectStatus.FREE)
    assert_conserved(env)


def test_a_dying_robot_forgets_what_was_running():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    act(env, {0: Grip.GRASP})
    kill(env, 0)
    assert env.swarm.pending_kind[0] == 0
    for _ in range(2):
        act(env, {0: Grip.GRASP})
    assert env.objects.status[0] == ObjectStatus.FREE


# One finish per handler and tick (quirk)


def locked_world(**options) -> ForageEnv:
    return tidy_world(quirks=Quirks(serialized_interactions=True), **options)


def test_without_the_quirk_robots_deliver_together():
    env = tidy_world()
    for robot in range(3):
        stand(env, robot, (16, 20 + 10 * robot))
        load(env, robot, robot)
    grips = dict.fromkeys(range(3), Grip.DELIVER)
    act(env, grips)
    assert act(env, grips)[:3] == [DELIVERED] * 3


def test_serialized_deliveries_finish_one_per_tick():
    env = locked_world()
    for robot in range(3):
        stand(env, robot, (16, 20 + 10 * robot))
        load(env, robot, robot)
    grips = dict.fromkeys(range(3), Grip.DELIVER)
    act(env, grips)
    delivered = []
    for _ in range(3):
        waiting = {robot: Grip.DELIVER for robot in range(3) if env.swarm.carried_object[robot] >= 0}
        delivered.append([robot for robot, event in enumerate(act(env, waiting)) if event == DELIVERED])
    assert [len(robots) for robots in delivered] == [1, 1, 1]
    assert sorted(robot for robots in delivered for robot in robots) == [0, 1, 2]


def test_serialized_handlers_do_not_wait_for_each_other():
    env = locked_world(caches="static", n_robots=3)
    build_cache(env, [4, 5, 6], BASE_CELL)
    stand(env, 0, NEST_CELL)
    load(env, 0, 0)
    stand(env, 1, FAR_CELL)
    lay(env, 1, FAR_CELL)
    stand(env, 2, BASE_CELL)
    grips = {0: Grip.DELIVER, 1: Grip.GRASP, 2: Grip.GRASP}
    act(env, grips)
    assert act(env, grips) == [DELIVERED, PICKED_UP, PICKED_FROM_CACHE]


def test_pick_ups_and_drops_of_caches_share_a_handler():
    env = locked_world(caches="static")
    build_cache(env, [4, 5, 6], BASE_CELL)
    stand(env, 0, (BASE_CELL[0] - 5, BASE_CELL[1]))
    stand(env, 1, (BASE_CELL[0] + 5, BASE_CELL[1]))
    load(env, 1, 0)
    grips = {0: Grip.GRASP, 1: Grip.DELIVER}
    act(env, grips)
    assert act(env, grips)[:2] == [NONE, JOINED]
    assert act(env, {0: Grip.GRASP})[0] == PICKED_FROM_CACHE


def test_letting_go_over_open_floor_is_not_serialized():
    env = locked_world()
    for robot in range(3):
        stand(env, robot, (60 + 4 * robot, 40))
        load(env, robot, robot)
    assert act(env, dict.fromkeys(range(3), Grip.RELEASE))[:3] == [DROPPED] * 3
