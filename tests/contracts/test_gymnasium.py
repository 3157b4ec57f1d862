"""The Gymnasium view keeps Gymnasium's contract and shows the same world as the parallel environment."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from swarm_forage_env import SCENARIO_NAMES
from swarm_forage_env.adapters import JointForageEnv
from swarm_forage_env.config import ConfigError
from swarm_forage_env.env import parallel_env


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_passes_the_checker_of_gymnasium(name):
    check_env(gymnasium.make(f"swarm_forage/{name}-v0").unwrapped, skip_render_check=True)


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_is_made_by_its_id(name):
    env = gymnasium.make(f"swarm_forage/{name}-v0", max_cycles=2)
    obs, info = env.reset(seed=1)
    n_robots = env.unwrapped.world.scenario.robots.n_robots
    assert env.unwrapped.world.scenario.name == name
    assert obs.shape == env.observation_space.shape == (n_robots, env.unwrapped.world.layout.size)
    assert info["active"].shape == (n_robots,)
    assert not env.step(env.action_space.sample())[3]
    assert env.step(env.action_space.sample())[3]


def test_shows_the_same_world_as_the_parallel_environment():
    joint = JointForageEnv("warehouse_small", n_robots=8, max_cycles=30)
    parallel = parallel_env("warehouse_small", n_robots=8, max_cycles=30)
    obs, _ = joint.reset(seed=3)
    rows, _ = parallel.reset(seed=3)
    rng = np.random.default_rng(0)
    for _ in range(30):
        np.testing.assert_array_equal(obs, np.stack(list(rows.values())))
        actions = rng.uniform(-1, 1, (8, 3)).astype(np.float32)
        obs, reward, _, truncated, _ = joint.step(actions)
        rows, rewards, _, truncations, _ = parallel.step(dict(zip(parallel.agents, actions, strict=True)))
        assert reward == pytest.approx(sum(rewards.values()))
        assert truncated == all(truncations.values())


def test_observations_of_earlier_steps_stay_valid():
    env = JointForageEnv("warehouse_small", n_robots=4)
    first, _ = env.reset(seed=0)
    kept = first.copy()
    env.step(np.ones((4, 3), np.float32))
    np.testing.assert_array_equal(first, kept)


def test_terminates_only_when_every_robot_is_dead():
    env = JointForageEnv("warehouse_small", n_robots=3)
    env.reset(seed=0)
    idle = np.zeros((3, 3), np.float32)
    alive = np.array([False, False, True])
    env.world.set_population(active=alive, present=alive, terminated=~alive)
    assert not env.step(idle)[2]
    nobody = np.zeros(3, np.bool_)
    env.world.set_population(active=nobody, present=nobody, terminated=~nobody)
    assert env.step(idle)[2]


def test_unknown_scenario_names_the_nearest():
    with pytest.raises(ConfigError, match="warehouse_small"):
        JointForageEnv("warehouse_smal")
