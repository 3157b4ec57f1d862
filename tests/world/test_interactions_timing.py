"""Pick-ups and drops over time: cancelled, lost, contested, in repair, at death, and one after the other."""

import pytest

from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.engines import in_each_engine
from tests.support.stage import (
    CORNERS,
    NEST_CELL,
    OPEN_CELL,
    act,
    assert_conserved,
    cell_centre,
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


def test_an_object_that_is_gone_has_vanished():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    act(env, {0: Grip.GRASP})
    lay(env, 0, (70, 30))
    assert act(env, {0: Grip.GRASP})[0] == VANISHED
    assert env.swarm.pending_kind[0] == 0
    assert act(env, {0: Grip.GRASP})[0] == NOTHING_HERE


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


def test_a_dying_robot_drops_its_cargo_on_the_floor():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    load(env, 0, 3)
    kill(env, 0)
    assert env.objects.cell[3].tolist() == list(OPEN_CELL)
    assert env.swarm.carried_object[0] == -1
    assert_conserved(env)
    assert act(env, {0: Grip.GRASP}) == [NONE] * 4


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
