"""Environments of Gymnasium keep its contract, and give the runs of the parallel one; a vector the story of `lives`."""

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env
from gymnasium.vector import AutoresetMode
from gymnasium.vector.utils import batch_space
from pettingzoo.test import parallel_api_test, parallel_seed_test

from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.views.arenas import ArenaBatch
from swarm_forage_env.views.gymnasium import JointForageEnv, SwarmVectorEnv
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv, parallel_env
from swarm_forage_env.views.plans import ArenaPlan
from swarm_forage_env.wrappers.registry import parse_wrapper
from swarm_forage_env.wrappers.world import World
from tests.support import lives


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
EACH = [*zip(SCENARIO_NAMES, 2 * [*INTERFACES.values()], strict=True)]
IDLE = np.zeros((lives.N_ROBOTS, 3), np.float32)


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


@pytest.mark.parametrize(("name", "interface"), EACH)
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


# Each robot as a sub-environment


@pytest.mark.parametrize(("name", "interface"), EACH)
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


def test_the_story_by_hand():
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
    twin = parallel_env("warehouse_small", **world).unwrapped
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
