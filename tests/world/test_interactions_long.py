"""Pick-ups and drops that take more than one tick: when they take effect, and what ends the wait."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.env import ForageEnv
from tests.support.engines import in_each_engine
from tests.support.stage import (
    NEST_CELL,
    OPEN_CELL,
    act,
    events_of,
    lay,
    load,
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


@pytest.mark.parametrize("ticks", [0, -1, 1.5, 2_000_000])
def test_ticks_out_of_range_are_refused(ticks):
    with pytest.raises(ConfigError, match="pickup, in ticks, to be a whole number"):
        tidy_world().set_handling_ticks(pickup=ticks, drop=1)
