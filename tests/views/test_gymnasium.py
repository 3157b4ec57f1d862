"""The Gymnasium environment keeps Gymnasium's contract and gives the same runs as the parallel environment."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from pettingzoo.test import parallel_api_test, parallel_seed_test

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.views.arenas import ArenaBatch
from swarm_forage_env.views.gymnasium import JointForageEnv, SwarmVectorEnv
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv, parallel_env
from swarm_forage_env.views.plans import ArenaPlan
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World


def test_is_made_by_its_id():
    for name in SCENARIO_NAMES:
        env = gymnasium.make(f"swarm_forage/{name}-v0", max_cycles=2)
        obs, info = env.reset(seed=1)
        n_robots = env.unwrapped.forage_env.scenario.robots.n_robots
        assert env.unwrapped.forage_env.scenario.name == name
        assert obs.shape == env.observation_space.shape == (n_robots, env.unwrapped.forage_env.layout.size)
        assert info["active"].shape == (n_robots,)
        assert not env.step(env.action_space.sample())[3]
        assert env.step(env.action_space.sample())[3]


INTERFACES = {
    "full": InterfaceConfig(),
    "driven": InterfaceConfig(observation="compact", automatic_gripper=True),
    "numbered": InterfaceConfig(observation="compact", actions="discrete", decision_ticks=3),
}


@pytest.mark.parametrize("interface", INTERFACES.values(), ids=INTERFACES)
def test_passes_the_checker_with_an_interface(interface):
    env = gymnasium.make("swarm_forage/warehouse_small-v0", interface=interface, n_robots=4)
    check_env(env.unwrapped, skip_render_check=True)


@pytest.mark.parametrize("interface", INTERFACES.values(), ids=INTERFACES)
def test_an_interface_shows_the_rows_of_the_vector_view_and_sums_their_rewards(interface):
    options = {"n_robots": 4, "interface": interface, "max_cycles": 20, "tick": 0.01}
    joint, rows = JointForageEnv(**options), SwarmVectorEnv(**options)
    obs, info = joint.reset(seed=5)
    expected, _ = rows.reset(seed=5)
    joint.action_space.seed(0)
    truncated, total = False, 0.0
    while not truncated:
        np.testing.assert_array_equal(obs, expected)
        mask = None
        if interface.actions == "discrete":
            np.testing.assert_array_equal(info["action_mask"], rows.action_masks())
            assert info["action_mask"].dtype == np.int8
            mask = tuple(info["action_mask"])
        action = joint.action_space.sample(mask)
        expected, rewards, *_ = rows.step(action)
        obs, reward, _, truncated, info = joint.step(action)
        assert reward == pytest.approx(rewards.sum())
        total += reward
    assert joint.forage_env.tick == 20
    assert total >= 20 * 4 * 0.01 * (1 - 1e-6), "0.01 per robot and tick, also of the decision cut short"


@pytest.mark.parametrize(("name", "interface"), list(zip(SCENARIO_NAMES, 2 * list(INTERFACES.values()), strict=True)))
def test_keeps_the_contract_of_pettingzoo(name, interface):
    options = {"n_robots": 4, "interface": interface, "max_cycles": 40}
    parallel_api_test(ParallelLearnerEnv(name, **options), num_cycles=50)
    parallel_seed_test(lambda: ParallelLearnerEnv(name, **options), num_cycles=20)


@pytest.mark.parametrize("interface", INTERFACES.values(), ids=INTERFACES)
def test_shows_the_same_as_the_rows_of_an_arena(interface):
    wrappers = (parse_wrapper("population:death_per_tick=0.02"), parse_wrapper("sensor_noise:sigma=0.02"))
    narrow = scenario("warehouse_small", n_robots=6, n_objects=40, width_m=12.0, nest_centre_m=(1.2, 8.0),
                      nest_size_m=(1.2, 12.8), tick=0.01)  # fmt: skip
    env = ParallelLearnerEnv(narrow, interface=interface, wrappers=wrappers, max_cycles=100)
    batch = ArenaBatch(ArenaPlan(world=World(narrow, wrappers), max_cycles=100, interface=interface), 1)
    observations, infos = env.reset(seed=2)
    rows, _ = batch.reset([2], [None])
    n_deaths = 0
    while env.agents:
        for agent in env.agents:
            row = int(agent.removeprefix("robot_"))
            np.testing.assert_array_equal(observations[agent], rows[row])
            if interface.actions == "discrete":
                np.testing.assert_array_equal(infos[agent]["action_mask"], batch.action_masks()[row])
        actions = {agent: env.action_space(agent).sample() for agent in env.agents}
        packed = np.zeros((6, *env.action_space("robot_0").shape), env.action_space("robot_0").dtype)
        for agent, action in actions.items():
            packed[int(agent.removeprefix("robot_"))] = action
        step = batch.step(packed)
        rows = step.obs
        observations, rewards, terminations, truncations, infos = env.step(actions)
        for agent in actions:
            row = int(agent.removeprefix("robot_"))
            assert rewards[agent] == pytest.approx(step.rewards[row])
            assert terminations[agent] == step.terminated[row]
            n_deaths += terminations[agent]
        assert all(truncations.values()) == bool(step.truncated.any())
    assert n_deaths > 0


@pytest.mark.parametrize("interface", [None, INTERFACES["numbered"]])
def test_wrappers_of_others_find_a_generator_that_follows_the_seed(interface):
    env = parallel_env("warehouse_small", n_robots=3, interface=interface)
    drawn = []
    for seed in (1, 1, 2):
        env.reset(seed=seed)
        drawn.append(env.np_random.random())
    assert drawn[0] == drawn[1] != drawn[2]


def test_actions_that_would_have_to_be_stretched_or_cut_are_refused():
    for interface, action in (("full", 0.5), ("full", np.zeros(2)), ("numbered", 1.9), ("numbered", np.zeros(1, int))):
        env = ParallelLearnerEnv("warehouse_small", n_robots=2, interface=INTERFACES[interface])
        env.reset(seed=0)
        with pytest.raises(ValueError, match=r"Expected each action as .* of shape"):
            env.step(dict.fromkeys(env.agents, action))


def test_terminates_only_when_every_robot_is_dead():
    env = JointForageEnv("warehouse_small", n_robots=3)
    env.reset(seed=0)
    idle = np.zeros((3, 3), np.float32)
    alive = np.array([False, False, True])
    env.forage_env.set_population(active=alive, present=alive, terminated=~alive)
    assert not env.step(idle)[2]
    nobody = np.zeros(3, np.bool_)
    env.forage_env.set_population(active=nobody, present=nobody, terminated=~nobody)
    assert env.step(idle)[2]
