"""What all scripted controllers share: copies in the middle of a run, arrays of any layout."""

import copy
import pickle
from itertools import pairwise

import numpy as np
import pytest

from baselines.cpfa import CPFAPolicy
from baselines.crw import CRWPolicy
from baselines.dpo import DPOPolicy
from baselines.stochm import STOCHMPolicy
from baselines.stochx import STOCHXPolicy
from tests.support.observations import Observations, make_spec
from tests.support.stage import OPEN_CELL, load, stand, tidy_world

N_ROBOTS = 5
TICKS = 40
POLICIES = [CRWPolicy, DPOPolicy, CPFAPolicy, STOCHMPolicy, STOCHXPolicy]


def started(policy_class):
    """A policy in the middle of a run, and observations in which robots carry, avoid and remember."""
    spec = make_spec(N_ROBOTS, caches="dynamic")
    seen = Observations(spec)
    seen.obstacle(0.5, 1)
    seen.carry(3, 2)
    seen.window({(1, 1): 7}, 3)
    policy = policy_class()
    policy.reset(spec, np.random.default_rng(1))
    for _ in range(TICKS):
        policy.act(seen.array, np.ones(N_ROBOTS, np.bool_))
    return policy, seen.array


@pytest.mark.parametrize("copied", [copy.deepcopy, lambda policy: pickle.loads(pickle.dumps(policy))])  # noqa: S301 - made here
@pytest.mark.parametrize("policy_class", POLICIES)
def test_a_copy_continues_as_the_original_does(policy_class, copied):
    policy, obs = started(policy_class)
    twin = copied(policy)
    active = np.ones(N_ROBOTS, np.bool_)
    of_twin = [twin.act(obs, active).copy() for _ in range(2 * TICKS)]
    of_policy = [policy.act(obs, active).copy() for _ in range(2 * TICKS)]
    np.testing.assert_array_equal(of_twin, of_policy)
    np.testing.assert_array_equal(twin.activity, policy.activity)
    changes = [not np.array_equal(before, after) for before, after in pairwise(of_policy)]
    # CPFA drives straight for a while; the others turn at once.
    assert any(changes) if policy_class is CPFAPolicy else changes[0], "they do something"


@pytest.mark.parametrize("policy_class", POLICIES)
def test_a_pickle_takes_no_compiled_function_along(policy_class):
    """Another process would have to compile a copy of it anew, which takes a minute."""
    policy, _ = started(policy_class)
    assert b"numba" not in pickle.dumps(policy)


@pytest.mark.parametrize("policy_class", POLICIES)
def test_the_layout_of_observations_in_memory_does_not_matter(policy_class):
    policy, obs = started(policy_class)
    twin = copy.deepcopy(policy)
    wide = np.full((2 * N_ROBOTS, 2 * obs.shape[1]), np.nan, np.float32)
    wide[::2, ::2] = obs
    active = np.array([True, False, True, True, True])
    there = np.repeat(active, 2)
    there[1::2] = True
    for other in (wide[::2, ::2], np.asfortranarray(obs), obs.astype(np.float64)):
        np.testing.assert_array_equal(twin.act(other, there[::2]), policy.act(obs, active))


@pytest.mark.parametrize("policy_class", POLICIES)
def test_a_robot_keeps_its_cargo_when_it_comes_back_to_work(policy_class):
    """It does so in a step that policies do not foresee: for them the robot is still in repair."""
    env = tidy_world(caches=policy_class.caches)
    policy, at_work = policy_class(), np.ones(4, np.bool_)
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    for robot in range(3):
        load(env, robot, robot)
        stand(env, robot, (OPEN_CELL[0] + 4 * robot, OPEN_CELL[1]))
    actions = policy.act(env.arena.observe(), at_work & False)
    env.step_batch(actions)
    assert env.swarm.carried_object.tolist() == [0, 1, 2, -1]
    assert not env.swarm.wheel_speed.any()
