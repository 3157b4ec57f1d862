"""The vector environment keeps Gymnasium's contract; a death, a repair and a time limit come as worked out by hand."""

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space

import swarm_forage_env
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.views.gymnasium import SwarmVectorEnv
from tests.support import lives

IDLE = np.zeros((lives.N_ROBOTS, 3), np.float32)
INTERFACES = (
    InterfaceConfig(),
    InterfaceConfig(observation="compact", automatic_gripper=True),
    InterfaceConfig(observation="compact", actions="discrete", decision_ticks=2),
)


@pytest.mark.parametrize(("name", "interface"), [*zip(swarm_forage_env.SCENARIO_NAMES, 2 * INTERFACES, strict=True)])
def test_make_vec_gives_one_sub_environment_per_robot(name, interface):
    env_id = f"swarm_forage/{name}-v0"
    envs = gymnasium.make_vec(env_id, num_envs=12, n_robots=6, interface=interface, max_cycles=9)
    assert envs.num_envs == 12
    assert envs.metadata["autoreset_mode"] == envs.autoreset_mode == AutoresetMode.SAME_STEP
    assert envs.observation_space == batch_space(envs.single_observation_space, 12)
    assert envs.action_space == batch_space(envs.single_action_space, 12)
    assert envs.spec.id == env_id
    envs.action_space.seed(0)
    obs, infos = envs.reset(seed=1)
    for _ in range(12):
        assert envs.observation_space.contains(obs)
        assert infos["active"].all()
        obs, rewards, terminations, truncations, infos = envs.step(envs.action_space.sample())
        assert rewards.shape == terminations.shape == truncations.shape == (12,)
        assert terminations.dtype == truncations.dtype == np.bool_
    envs.close()


def test_the_number_of_sub_environments_is_a_whole_number_of_swarms():
    env_id = "swarm_forage/warehouse_small-v0"
    assert gymnasium.make_vec(env_id).num_envs == 50
    assert gymnasium.make_vec(env_id, n_arenas=2, n_robots=4).num_envs == 8
    assert gymnasium.make_vec(env_id, num_envs=8, n_arenas=2, n_robots=4).n_arenas == 2
    for wrong in (7, 2, -4):
        with pytest.raises(ValueError, match=f"n_arenas times n_robots = 4 .* got num_envs = {wrong} "):
            gymnasium.make_vec(env_id, n_robots=4, num_envs=wrong)
    with pytest.raises(ValueError, match="got num_envs = 8 and n_arenas = 3; give one of both"):
        gymnasium.make_vec(env_id, n_robots=4, num_envs=8, n_arenas=3)


def test_infos_by_hand():
    envs = SwarmVectorEnv(**lives.WORLD)
    envs.reset(seed=7)
    (env,) = envs._arenas.envs
    steps = lives.live(env.set_population, lambda: envs.step(IDLE))
    np.testing.assert_array_equal([rewards for _, rewards, *_ in steps], lives.REWARDS)
    np.testing.assert_array_equal([infos["active"] for *_, infos in steps[:-1]], lives.ACTIVE_BEFORE[1:])
    for tick, (obs, _, terminated, truncated, infos) in enumerate(steps):
        done = terminated | truncated
        assert ("final_obs" in infos) == done.any()
        if not done.any():
            continue
        np.testing.assert_array_equal(infos["_final_obs"], done)
        assert [final is not None for final in infos["final_obs"]] == done.tolist()
        told = infos["final_info"]
        episodes = {
            (tick, robot): (told["episode"]["r"][robot], told["episode"]["l"][robot])
            for robot in np.flatnonzero(told["_episode"]).tolist()
        }
        assert episodes == {key: value for key, value in lives.EPISODES.items() if key[0] == tick}
        for robot in np.flatnonzero(truncated).tolist():
            assert not np.array_equal(infos["final_obs"][robot], obs[robot])


def test_a_central_critic_has_the_state_now_and_at_the_end_of_a_run():
    world = {"n_robots": 3, "max_cycles": 4}
    twin = swarm_forage_env.parallel_env("warehouse_small", **world).unwrapped
    envs = SwarmVectorEnv("warehouse_small", n_arenas=2, **world)
    envs.reset(seed=7)
    twin.reset(seed=8)
    actions = np.ones((6, 3), np.float32)
    for tick in range(4):
        np.testing.assert_array_equal(envs.state()[1], twin.state())
        *_, truncated, infos = envs.step(actions)
        twin.step_batch(actions[:3])
        assert ("final_info" in infos) == truncated.any() == (tick == 3)
    told = infos["final_info"]
    assert told["_state"].all()
    for row in (3, 4, 5):
        np.testing.assert_array_equal(told["state"][row], twin.state())
    assert not np.array_equal(told["state"][0], told["state"][3])
    assert not np.array_equal(envs.state()[1], twin.state())


def test_seeds_per_arena_and_their_number():
    envs = SwarmVectorEnv("warehouse_small", num_envs=6, n_robots=3)
    one, _ = envs.reset(seed=[4, 9])
    other, _ = envs.reset(seed=[9, 4])
    np.testing.assert_array_equal(one[:3], other[3:])
    again, _ = envs.reset()
    assert not np.array_equal(other, again)
    with pytest.raises(ValueError, match="one seed per arena"):
        envs.reset(seed=[1])
