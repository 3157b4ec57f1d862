"""Reward terms, their weights, and which robots receive them."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import RewardConfig
from tests.support.stage import NEST_CELL, OPEN_CELL, act, lay, load, put, stand, tidy_world

NOTHING = RewardConfig(delivery=0.0, first_pickup=0.0)


def rewards_of(env: ForageEnv, grips: dict[int, float], wheels: tuple[float, float] = (0.0, 0.0)) -> list[float]:
    actions = np.zeros((len(env.active), 3), np.float32)
    actions[:, :2] = wheels
    actions[:, 2] = np.where(env.swarm.carried_object >= 0, Grip.GRASP, Grip.RELEASE)
    for robot, grip in grips.items():
        actions[robot, 2] = grip
    return env.step_batch(actions)[1].tolist()


def delivering_world(**options) -> ForageEnv:
    """Robot 0 delivers and robot 1 picks up for the first time in the next step."""
    env = tidy_world(**options)
    stand(env, 0, NEST_CELL)
    load(env, 0, 0)
    stand(env, 1, OPEN_CELL)
    lay(env, 1, OPEN_CELL)
    act(env, {0: Grip.DELIVER, 1: Grip.GRASP})
    return env


NEXT = {0: Grip.DELIVER, 1: Grip.GRASP}


def test_warehouse_defaults():
    assert rewards_of(delivering_world(), NEXT) == pytest.approx([1.0, 0.1, 0.0, 0.0])


def test_only_first_pick_ups_count():
    env = delivering_world()
    rewards_of(env, NEXT)
    rewards_of(env, {1: Grip.RELEASE})
    rewards_of(env, {1: Grip.GRASP})
    assert rewards_of(env, {1: Grip.GRASP}) == [0.0] * 4
    assert env.swarm.carried_object[1] == 1


def test_weights_multiply_and_add():
    env = delivering_world(reward=RewardConfig(delivery=3.0, first_pickup=-2.0, tick=0.5))
    assert rewards_of(env, NEXT) == pytest.approx([3.5, -1.5, 0.5, 0.5])


def test_team_reward_is_the_mean_over_active_robots():
    env = delivering_world(reward=RewardConfig(team=True))
    env.set_population(active=np.array([True, True, True, False]), present=np.ones(4, np.bool_))
    assert rewards_of(env, NEXT) == pytest.approx([1.1 / 3] * 3 + [0.0])


def test_nest_progress_pays_carrying_robots_by_the_metre():
    env = tidy_world(reward=replace(NOTHING, nest_progress=10.0))
    put(env, 0, 16.0, 8.0, np.pi)  # towards the nest centre at (3.2, 8)
    load(env, 0, 0)
    put(env, 1, 16.0, 5.0, np.pi)
    assert rewards_of(env, {}, wheels=(0.5, 0.5)) == pytest.approx([10 * 0.02, 0.0, 0.0, 0.0])
    assert rewards_of(env, {}, wheels=(-0.5, -0.5)) == pytest.approx([-10 * 0.02, 0.0, 0.0, 0.0])


def test_nest_progress_is_towards_the_nearest_of_several_nests():
    env = tidy_world(reward=replace(NOTHING, nest_progress=10.0), further_nests=((28.0, 7.0, 30.0, 9.0),))
    put(env, 0, 20.0, 8.0, np.pi)  # 16.8 m from (3.2, 8), 9 m from (29, 8)
    put(env, 1, 16.0, 8.0, np.pi)  # 12.8 and 13 m
    load(env, 0, 0)
    load(env, 1, 1)
    assert rewards_of(env, {}, wheels=(0.5, 0.5)) == pytest.approx([-10 * 0.02, 10 * 0.02, 0.0, 0.0])


def test_interference_can_be_penalised():
    env = tidy_world(reward=replace(NOTHING, interference=-0.25))
    put(env, 0, 16.0, 8.0)
    put(env, 1, 16.25, 8.0, np.pi)
    assert rewards_of(env, {}) == [-0.25, -0.25, 0.0, 0.0]
