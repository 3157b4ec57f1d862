"""The vector environment of stable-baselines3 gives the episode of `lives`, and keeps that library's contract."""

import copy
import warnings

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

from gymnasium import Wrapper
from stable_baselines3 import PPO
from stable_baselines3.common.evaluation import evaluate_policy
from stable_baselines3.common.vec_env import VecEnvWrapper, VecFrameStack, VecMonitor

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.training.sb3 import SwarmVecEnv
from swarm_forage_env.wrappers.registry import parse_wrapper
from tests.support import lives
from tests.support.branches import pickled

IDLE = np.zeros((lives.N_ROBOTS, 3), np.float32)


def test_the_story_by_hand():
    env = SwarmVecEnv(**lives.WORLD)
    env.seed(7)
    env.reset()
    steps = lives.live(lambda **change: env.env_method("set_population", **change), lambda: env.step(IDLE))
    np.testing.assert_array_equal([rewards for _, rewards, _, _ in steps], lives.REWARDS)
    np.testing.assert_array_equal([dones for _, _, dones, _ in steps], lives.TERMINATED | lives.TRUNCATED)
    for tick, (_, _, dones, infos) in enumerate(steps):
        assert len(infos) == lives.N_ROBOTS
        for robot, info in enumerate(infos):
            assert ("terminal_observation" in info) == bool(dones[robot])
            assert info.get("TimeLimit.truncated", False) == bool(lives.TRUNCATED[tick, robot])
            episode = info.get("episode")
            told = None if episode is None else (episode["r"], episode["l"])
            assert told == lives.EPISODES.get((tick, robot))
    assert not steps[2][3][1]["terminal_observation"].any()
    last = steps[4][3]
    position = env.interface.layout["position"]
    np.testing.assert_array_equal(last[0]["terminal_observation"][position], steps[0][0][0, position])
    told = {"seed": 7, "seconds": 1.0, "collected": 0, "first_picked": 0, "scenario": "warehouse_small", "n_robots": 3}
    assert last[0]["run"] == told


def test_evaluations_of_the_library_count_episodes_and_no_absences():
    wrappers = [parse_wrapper("population:death_per_tick=0.05")]
    env = SwarmVecEnv("warehouse_small", n_robots=4, max_cycles=20, delivery=0.0, first_pickup=0.0, tick=1.0,
                      wrappers=wrappers)  # fmt: skip
    model = PPO("MlpPolicy", env, n_steps=2, batch_size=8, seed=0, device="cpu")
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        returns, lengths = evaluate_policy(model, env, n_eval_episodes=12, return_episode_rewards=True)
    lost = np.array(lengths) - np.array(returns)
    assert set(lost) == {0.0, 1.0}, "whoever dies earns nothing in the last step of its episode, and in no other"


def test_works_inside_the_wrappers_of_the_library():
    with pytest.warns(UserWarning, match="already wrapped with a `Monitor`"):  # rows tell their episodes themselves
        monitored = VecMonitor(SwarmVecEnv(**lives.WORLD))
    env: VecEnvWrapper = VecFrameStack(monitored, 2)
    env.seed(1)
    obs = env.reset()
    half = obs.shape[1] // 2
    assert not obs[:, :half].any()
    for _ in range(lives.HORIZON_TICKS):
        obs, _, dones, infos = env.step(IDLE)
    assert dones.all()
    assert not obs[:, :half].any(), "stacks start anew with the arena"
    assert [info["episode"]["r"] for info in infos] == [5.0, 5.0, 5.0]


def test_attributes_and_methods_reach_the_arenas_of_rows():
    env = SwarmVecEnv(**{**lives.WORLD, "n_arenas": 3, "interface": InterfaceConfig(actions="discrete")})
    env.seed(3)
    env.reset()
    assert env.get_attr("tick", indices=[8, 0]) == [0, 0]
    assert env.get_attr("seed_value", indices=4) == [4]
    assert env.env_is_wrapped(Wrapper) == [False] * 9
    assert env.has_attr("layout")
    assert not env.has_attr("no_such_thing")
    assert env.env_method("observation_space", "robot_0", indices=[4])[0].shape == env.observation_space.shape
    env.set_attr("max_cycles", 9, indices=[3])
    assert env.get_attr("max_cycles", indices=[0, 3, 8]) == [5, 9, 5]
    with pytest.raises(ValueError, match="whole numbers from 0 to 10"):
        env.step(np.full(9, 11))
    with pytest.raises(ValueError, match="9 rows"):
        env.step(np.zeros(3, np.int64))


@pytest.mark.parametrize("copied", [copy.deepcopy, pickled])
def test_it_can_be_copied_after_a_decision(copied):
    """A decision is one call of compiled code, which no copy holds."""
    numbered = InterfaceConfig(observation="compact", actions="discrete", decision_ticks=3)
    env = SwarmVecEnv("warehouse_small", n_robots=4, n_objects=20, interface=numbered)
    env.reset()
    env.step(np.array([3, 4, 5, 6]))
    twin = copied(env)
    for _ in range(5):
        expected, found = (each.step(np.array([7, 1, 2, 3])) for each in (env, twin))
        assert [array.tobytes() for array in found[:3]] == [array.tobytes() for array in expected[:3]]
