"""Pick-ups and drops that take more than one tick: when they take effect, and what ends the wait."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.engines import in_each_engine
from tests.support.stage import (
    BASE_CELL,
    CORNER_CACHE,
    CORNERS,
    NEST_CELL,
    OPEN_CELL,
    act,
    build_cache,
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
DELIVERED, DROPPED, JOINED = Event.DELIVERED, Event.DROPPED, Event.JOINED_CACHE
VANISHED, TOO_NEAR = Event.VANISHED, Event.CACHE_TOO_NEAR


def slow_world(**options) -> ForageEnv:
    return tidy_world(pickup_ticks=3, drop_ticks=2, **options)


def test_a_pick_up_takes_effect_after_its_ticks():
    env = slow_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    assert events_of(env, Grip.GRASP, 5) == [NONE, NONE, NONE, PICKED_UP, NONE]


@pytest.mark.parametrize("grip", [Grip.RELEASE, Grip.DELIVER, Grip.SITE, Grip.CREATE_CACHE])
def test_a_delivery_takes_effect_after_its_ticks(grip):
    env = slow_world()
    stand(env, 0, NEST_CELL)
    load(env, 0, 0)
    assert events_of(env, grip, 3) == [NONE, NONE, DELIVERED]


def test_caches_take_as_long_as_floor_and_nest():
    env = slow_world(caches="dynamic")
    build_cache(env, [1, 2, 3], BASE_CELL)
    stand(env, 0, BASE_CELL)
    assert events_of(env, Grip.GRASP, 4) == [NONE, NONE, NONE, PICKED_FROM_CACHE]
    assert events_of(env, Grip.DELIVER, 3) == [NONE, NONE, JOINED]


@pytest.mark.parametrize("grip", [Grip.SITE, Grip.CREATE_CACHE])
def test_a_cache_site_takes_as_long_but_its_refusal_comes_at_once(grip):
    env = slow_world(caches="dynamic")
    stand(env, 0, OPEN_CELL)
    load(env, 0, 4)
    assert events_of(env, grip, 3) == [NONE, NONE, DROPPED]
    build_cache(env, [0, 1], CORNER_CACHE)
    load(env, 0, 4)
    assert events_of(env, grip, 1) == [TOO_NEAR]


def test_letting_go_over_open_floor_never_waits():
    env = slow_world()
    stand(env, 0, OPEN_CELL)
    load(env, 0, 0)
    assert act(env, {0: Grip.RELEASE})[0] == DROPPED


def test_wheels_stand_and_the_robot_shows_it_during_the_whole_wait():
    env = slow_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    actions = np.zeros((4, 3), np.float32)
    actions[0] = 0.5, 0.5, Grip.GRASP
    shown, speeds = [], []
    for _ in range(5):
        obs = env.step_batch(actions)[0]
        shown.append(int(obs[0, env.layout["interacting"]][0]))
        speeds.append(round(100 * float(env.swarm.wheel_speed[0, 0]), 6))
    assert shown == [1, 1, 1, 0, 0]
    assert speeds == [10.0, 0.0, 0.0, 0.0, 10.0]


@pytest.mark.parametrize("waited", [1, 2, 3])
def test_another_band_cancels_silently_whenever_it_comes(waited):
    env = slow_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    assert events_of(env, Grip.GRASP, waited) == [NONE] * waited
    assert act(env, {0: Grip.RELEASE})[0] == NONE
    assert (env.swarm.pending_kind[0], env.swarm.pending_until[0]) == (0, 0)
    assert events_of(env, Grip.GRASP, 4) == [NONE, NONE, NONE, PICKED_UP], "starts anew"


@pytest.mark.parametrize("waited", [1, 2, 3])
def test_the_condition_must_hold_all_the_time(waited):
    env = slow_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    events_of(env, Grip.GRASP, waited)
    lay(env, 0, (70, 30))
    assert act(env, {0: Grip.GRASP})[0] == VANISHED
    assert env.swarm.pending_until[0] == 0
    lay(env, 0, OPEN_CELL)
    assert events_of(env, Grip.GRASP, 4) == [NONE, NONE, NONE, PICKED_UP], "what was waited is lost"


def test_who_started_first_finishes_first():
    env = slow_world(n_robots=2)
    lay(env, 0, OPEN_CELL)
    x, y = cell_centre(OPEN_CELL)
    for robot, (dx, dy) in enumerate(CORNERS):
        put(env, robot, x + dx, y + dy)
    act(env, {1: Grip.GRASP})
    both = {0: Grip.GRASP, 1: Grip.GRASP}
    events = [act(env, both) for _ in range(4)]
    assert events == [[NONE, NONE], [NONE, NONE], [NONE, PICKED_UP], [VANISHED, NONE]]


def test_a_robot_in_repair_waits_on_and_completes():
    env = slow_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    act(env, {0: Grip.GRASP})
    repair(env, 0)
    assert events_of(env, Grip.RELEASE, 3) == [NONE, NONE, PICKED_UP]


def test_a_dying_robot_leaves_no_wait_behind():
    env = slow_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    act(env, {0: Grip.GRASP})
    kill(env, 0)
    assert (env.swarm.pending_kind[0], env.swarm.pending_until[0]) == (0, 0)


def test_one_lock_per_handler_holds_after_a_long_wait_too():
    env = tidy_world(quirks=Quirks(serialized_interactions=True), drop_ticks=3)
    for robot in range(2):
        stand(env, robot, (16, 20 + 10 * robot))
        load(env, robot, robot)
    seen = []
    for _ in range(5):
        waiting = {robot: Grip.DELIVER for robot in range(2) if env.swarm.carried_object[robot] >= 0}
        seen.append(act(env, waiting)[:2].count(DELIVERED))
    assert seen == [0, 0, 0, 1, 1]


def test_ticks_set_during_a_wait_are_for_the_next_one():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    env.set_handling_ticks(pickup=2, drop=4)
    act(env, {0: Grip.GRASP})
    env.set_handling_ticks(pickup=1, drop=1)
    assert events_of(env, Grip.GRASP, 2) == [NONE, PICKED_UP]


def test_a_reset_restores_what_the_scenario_says():
    env = slow_world()
    env.set_handling_ticks(pickup=7, drop=8)
    env.reset_batch(1)
    assert env.arena._requests.handling_ticks.tolist() == [3, 2]


@pytest.mark.parametrize("ticks", [0, -1, 1.5, 2_000_000])
def test_ticks_out_of_range_are_refused(ticks):
    with pytest.raises(ConfigError, match="pickup, in ticks, to be a whole number"):
        tidy_world().set_handling_ticks(pickup=ticks, drop=1)
