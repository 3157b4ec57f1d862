"""Arenas whose worlds are drawn: rows to spare are absent all through, the others are those of the world alone."""

import gymnasium
import numpy as np
import pytest
from pettingzoo.test import parallel_api_test

from swarm_forage_env import parallel_env
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.views.arenas import ArenaBatch
from swarm_forage_env.views.gymnasium import JointForageEnv, SwarmVectorEnv
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv
from swarm_forage_env.views.plans import plan_arena
from swarm_forage_env.views.sampler import ScenarioSampler
from tests.support.sampled import sampler

WORLDS = sampler()
COMPACT = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5)
PLAN = plan_arena(sampler=WORLDS, interface=COMPACT, max_cycles=20)
SEEDS = (3, 5, 8)


def numbers(n_rows, rng):
    return rng.integers(0, 6, n_rows)


def drawn(seeds=SEEDS):
    """The worlds that the arenas of a batch draw with these seeds."""
    return [WORLDS.world_of(seed, share) for seed, share in zip(seeds, WORLDS.shares(len(seeds)), strict=True)]


def sizes(seeds=SEEDS):
    return [world.n_robots for world in drawn(seeds)]


def worlds_of(**fields):
    """A sampler of one small world."""
    world = {"preset": "warehouse_small", "n_robots": 2, "n_objects": 10, "physics": "compiled", **fields}
    return ScenarioSampler({"worlds": [{"scenario": world}]})


def test_the_seeds_of_these_tests_leave_rows_to_spare():
    assert min(sizes()) < WORLDS.n_robots == 6
    assert len(set(sizes())) > 1


def test_each_arena_is_bit_for_bit_that_of_its_world_alone():
    batch = ArenaBatch(PLAN, len(SEEDS))
    obs, _ = batch.reset(SEEDS, [None] * len(SEEDS))
    rng = np.random.default_rng(0)
    alone = [
        ArenaBatch(plan_arena(world.scenario, wrappers=world.wrappers, interface=COMPACT, max_cycles=20), 1)
        for world in drawn()
    ]
    first = [one.reset([seed], [None])[0] for one, seed in zip(alone, SEEDS, strict=True)]
    for arena, own in enumerate(first):
        np.testing.assert_array_equal(obs.reshape(3, 6, -1)[arena, : len(own)], own)
    for _ in range(3):
        actions = numbers(batch.n_rows, rng).reshape(3, 6)
        step = batch.step(actions.ravel())
        for arena, one in enumerate(alone):
            n_robots = one.n_robots
            own = one.step(actions[arena, :n_robots])
            np.testing.assert_array_equal(step.obs.reshape(3, 6, -1)[arena, :n_robots], own.obs)
            np.testing.assert_array_equal(step.rewards.reshape(3, 6)[arena, :n_robots], own.rewards)
            np.testing.assert_array_equal(step.active.reshape(3, 6)[arena, :n_robots], own.active)


def test_rows_to_spare_are_absent_from_the_first_step_to_the_last():
    batch = ArenaBatch(PLAN, len(SEEDS))
    obs, active = batch.reset(SEEDS, [None] * len(SEEDS))
    spare = np.arange(6) >= np.array(sizes())[:, None]
    masks = batch.action_masks().reshape(3, 6, -1)
    assert masks[spare].sum(axis=1).tolist() == [1] * spare.sum()
    assert masks[spare][:, 0].all()  # stand
    for tick in range(4):
        assert not obs.reshape(3, 6, -1)[spare].any()
        assert not active.reshape(3, 6)[spare].any()
        assert obs.reshape(3, 6, -1)[~spare].any(axis=1).all()
        step = batch.step(np.zeros(batch.n_rows, np.int64))
        obs, active = step.obs, step.active
        assert not step.rewards.reshape(3, 6)[spare].any()
        if tick < 3:
            assert not step.terminated.any()
            assert len(step.ended) == 0
    # The horizon: all rows are done, because the next run may have robots there, but nobody's episode ends in them.
    assert step.ended.tolist() == list(range(18))
    np.testing.assert_array_equal(step.is_episode, ~spare.ravel())
    np.testing.assert_array_equal(step.terminated, spare.ravel())
    np.testing.assert_array_equal(step.truncated, ~spare.ravel())
    assert not step.final_obs[spare.ravel()].any()
    assert [outcome.n_robots for outcome in step.outcomes] == sizes()
    # Other worlds follow, of other sizes.
    present = obs.reshape(3, 6, -1).any(axis=2).sum(axis=1).tolist()
    assert present == [arena.n_robots for arena in batch.arenas]
    assert present != sizes()


def test_fields_of_a_reset_hold_in_every_world():
    batch = ArenaBatch(PLAN, 2)
    batch.reset([3, 5], [{"scenario": {"delivery": 7.0}}] * 2)
    assert batch.envs[0].unwrapped.scenario.reward.delivery == 7.0
    batch.reset([8, 9], [None] * 2)
    assert {env.unwrapped.scenario.reward.delivery for env in batch.envs} == {7.0}


# PettingZoo's test wonders about possible agents that a run does not have; that is what a drawn size means.
@pytest.mark.filterwarnings("ignore:No agents present but not all possible_agents:UserWarning")
def test_a_parallel_environment_has_the_agents_of_the_run():
    env = parallel_env(sampler=WORLDS, max_cycles=30)
    assert isinstance(env, ParallelLearnerEnv)
    assert len(env.possible_agents) == 6
    for seed in SEEDS:
        observations, _ = env.reset(seed=seed)
        assert list(observations) == env.agents == env.possible_agents[: sizes([seed])[0]]
        assert env.state_space.contains(env.state())
    parallel_api_test(env, num_cycles=60)


def test_the_global_state_has_robots_and_objects_in_their_places():
    env = ParallelLearnerEnv(sampler=WORLDS)
    env.reset(seed=3)
    n_robots, n_objects = sizes([3])[0], env.forage_env.scenario.objects.n_objects
    state, own = env.state(), env.forage_env.state()
    np.testing.assert_array_equal(state[: 6 * n_robots], own[: 6 * n_robots])
    np.testing.assert_array_equal(state[36 : 36 + 3 * n_objects], own[6 * n_robots :])
    assert not state[6 * n_robots : 36].any()
    assert not state[36 + 3 * n_objects :].any()


def test_the_central_view_is_padded():
    env = gymnasium.make("swarm_forage/sampled-v0", sampler=WORLDS, interface=COMPACT).unwrapped
    assert isinstance(env, JointForageEnv)
    obs, info = env.reset(seed=3)
    n_robots = sizes([3])[0]
    assert env.observation_space.contains(obs)
    assert obs.any(axis=1).tolist() == info["active"].tolist() == [row < n_robots for row in range(6)]
    obs, _, _, _, info = env.step(env.action_space.sample(mask=tuple(info["action_mask"])))
    assert not obs[n_robots:].any()
    with pytest.raises(ActionError, match="6 rows"):
        env.step(np.zeros(n_robots, np.int64))


def test_vector_environments_of_gymnasium_have_spare_rows():
    envs = gymnasium.make_vec("swarm_forage/sampled-v0", num_envs=12, sampler=WORLDS, interface=COMPACT)
    assert isinstance(envs, SwarmVectorEnv)
    obs, infos = envs.reset(seed=[3, 5])
    expected = np.arange(6) < np.array(sizes([3, 5]))[:, None]
    np.testing.assert_array_equal(infos["active"], expected.ravel())
    np.testing.assert_array_equal(obs.any(axis=1), expected.ravel())
