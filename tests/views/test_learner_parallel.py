"""The learner's interface under the PettingZoo API: its contract, and the same runs as the rows of arenas."""

import numpy as np
import pytest
from pettingzoo.test import parallel_api_test, parallel_seed_test

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.views.arenas import ArenaBatch
from swarm_forage_env.views.gymnasium import JointForageEnv, SwarmVectorEnv
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv, parallel_env
from swarm_forage_env.views.plans import ArenaPlan
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World

INTERFACES = {
    "full": InterfaceConfig(),
    "driven": InterfaceConfig(observation="compact", automatic_gripper=True),
    "numbered": InterfaceConfig(observation="compact", actions="discrete", decision_ticks=3),
}


@pytest.mark.parametrize(("name", "interface"), list(zip(SCENARIO_NAMES, 2 * list(INTERFACES.values()), strict=True)))
def test_keeps_the_contract_of_pettingzoo(name, interface):
    options = {"n_robots": 4, "interface": interface, "max_cycles": 40}
    parallel_api_test(ParallelLearnerEnv(name, **options), num_cycles=50)
    parallel_seed_test(lambda: ParallelLearnerEnv(name, **options), num_cycles=20)


def test_keeps_it_with_deaths():
    wrappers = [parse_wrapper("population:death_per_tick=0.2")]
    env = ParallelLearnerEnv("warehouse_small", n_robots=4, wrappers=wrappers, max_cycles=60)
    parallel_api_test(env, num_cycles=80)


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


def test_all_views_are_paid_in_one_type(monkeypatch):
    """For each type the loop of the world is compiled once."""
    paid, step = [], LearnerArena.step
    monkeypatch.setattr(
        LearnerArena, "step", lambda arena, actions, to: paid.append(to.dtype) or step(arena, actions, to)
    )
    for env in (ParallelLearnerEnv(n_robots=2), JointForageEnv(n_robots=2), SwarmVectorEnv(n_robots=2)):
        env.reset(seed=0)
        idle = np.zeros((2, 3), np.float32)
        env.step(dict(zip(env.agents, idle, strict=True)) if isinstance(env, ParallelLearnerEnv) else idle)
    assert paid == [np.float32] * 3


def test_with_an_interface_an_environment_has_the_attributes_that_it_has_without():
    plain, learner = (parallel_env(n_robots=3, interface=interface) for interface in (None, INTERFACES["driven"]))
    assert learner.swarm_spec == plain.swarm_spec
    for env in (plain, learner):
        assert env.observation_space("robot_0").shape == (env.layout.size,)


def test_without_agents_and_actions_a_step_does_nothing():
    env = ParallelLearnerEnv("warehouse_small", n_robots=3, interface=INTERFACES["numbered"], max_cycles=1)
    with pytest.raises(RuntimeError, match="Call reset before step"):
        env.step({})
    env.reset(seed=0)
    env.step(dict.fromkeys(env.agents, 0))
    assert env.step({}) == ({}, {}, {}, {}, {})
    with pytest.raises(RuntimeError, match="All agents are done"):
        env.step({"robot_0": 0})


@pytest.mark.parametrize("interface", [None, INTERFACES["numbered"]])
def test_wrappers_of_others_find_a_generator_that_follows_the_seed(interface):
    env = parallel_env("warehouse_small", n_robots=3, interface=interface)
    drawn = []
    for seed in (1, 1, 2):
        env.reset(seed=seed)
        drawn.append(env.np_random.random())
    assert drawn[0] == drawn[1] != drawn[2]


@pytest.mark.parametrize(
    ("interface", "action"),
    [
        ("full", 0.5),
        ("full", np.zeros(1)),
        ("full", np.zeros(2)),
        ("numbered", 1.9),
        ("numbered", np.zeros(1, int)),
    ],
)
def test_actions_that_would_have_to_be_stretched_or_cut_are_refused(interface, action):
    env = ParallelLearnerEnv("warehouse_small", n_robots=2, interface=INTERFACES[interface])
    env.reset(seed=0)
    with pytest.raises(ValueError, match=r"Expected each action as .* of shape"):
        env.step(dict.fromkeys(env.agents, action))
