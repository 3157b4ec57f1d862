"""The environment keeps PettingZoo's contract, and says what is wrong when a caller breaks it."""

from itertools import cycle

import numpy as np
import pettingzoo
import pytest
from gymnasium import spaces
from pettingzoo.test import api_test, parallel_api_test, parallel_seed_test, seed_test, state_test
from pettingzoo.test.max_cycles_test import max_cycles_test
from pettingzoo.utils.env import AECEnv

from swarm_forage_env import SCENARIO_NAMES, aec_env
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.views import pettingzoo as module
from swarm_forage_env.views.pettingzoo import env, parallel_env
from swarm_forage_env.wrappers.throttle import Throttle

SMALL = {"n_robots": 5, "n_objects": 80}
WORLDS = [*zip(SCENARIO_NAMES, cycle(("none", "static", "dynamic")), strict=False)]


@pytest.mark.parametrize(("name", "caches"), WORLDS)
def test_tests_of_pettingzoo_pass(name, caches):
    options = {"caches": caches, **SMALL}
    parallel_api_test(parallel_env(name, **options), num_cycles=60)
    parallel_api_test(parallel_env(name, max_cycles=7, **options), num_cycles=20)  # beyond the horizon
    parallel_seed_test(lambda: parallel_env(name, **options), num_cycles=20)
    api_test(env(name, max_cycles=6, **options), num_cycles=40)
    seed_test(lambda: env(name, **options), num_cycles=40)
    state_test(env(name, **options), parallel_env(name, **options), num_cycles=5)


def test_max_cycles_end_both_forms():
    max_cycles_test(module)
    assert aec_env is module.env


@pytest.mark.skipif(not hasattr(pettingzoo, "make"), reason="needs PettingZoo 1.27, which has ids")
def test_environments_are_made_by_id():
    for name in SCENARIO_NAMES:
        parallel = pettingzoo.make("parallel", f"swarm_forage/{name}-v0", caches="dynamic", **SMALL)
        assert isinstance(parallel.unwrapped, ForageEnv)
        assert (parallel.unwrapped.scenario.name, parallel.unwrapped.scenario.caches) == (name, "dynamic")
        turns = pettingzoo.make("aec", f"swarm_forage/{name}-v0", **SMALL)
        assert isinstance(turns, AECEnv)
        assert turns.unwrapped.scenario.name == name
        assert len(turns.possible_agents) == 5
    throttle = "throttle:waveform=constant,amplitude=0.1"
    by_id = pettingzoo.make("parallel", "swarm_forage/warehouse_small-v0", wrappers=[throttle], **SMALL)
    assert isinstance(by_id, Throttle)


# Spaces and agents


def test_spaces_are_boxes_of_the_documented_size():
    world = parallel_env(**SMALL)
    assert world.possible_agents == [f"robot_{row}" for row in range(5)]
    for agent in world.possible_agents:
        assert world.observation_space(agent) == spaces.Box(-1.0, 1.0, (world.layout.size,), np.float32)
        assert world.action_space(agent) == spaces.Box(-1.0, 1.0, (3,), np.float32)
        assert world.observation_space(agent) is world.observation_space(agent)
        assert world.action_space(agent) is world.action_space(agent)


def idle(world: ForageEnv) -> dict[str, np.ndarray]:
    return {agent: np.zeros(3, np.float32) for agent in world.agents}


def kill(world: ForageEnv, *rows: int) -> None:
    alive = world.swarm.present.copy()
    alive[list(rows)] = False
    world.set_population(active=alive, present=alive, terminated=~alive)


def test_the_dead_leave_and_the_others_go_on():
    world = parallel_env(**SMALL)
    world.reset(seed=0)
    kill(world, 1, 3)
    obs, rewards, terminations, truncations, infos = world.step(idle(world))
    assert terminations == {agent: agent in ("robot_1", "robot_3") for agent in world.possible_agents}
    assert world.agents == ["robot_0", "robot_2", "robot_4"]
    assert not infos["robot_1"]["active"]
    assert not obs["robot_1"].any()
    obs, rewards, terminations, truncations, infos = world.step(idle(world))
    for table in (obs, rewards, terminations, truncations, infos):
        assert list(table) == ["robot_0", "robot_2", "robot_4"]
    assert not any(terminations.values())


def test_actions_of_the_living_reach_the_right_rows_after_a_death():
    world = parallel_env(**SMALL)
    world.reset(seed=0)
    kill(world, 0)
    world.step(idle(world))
    actions = idle(world)
    actions["robot_2"][:2] = 0.5
    world.step(actions)
    assert np.flatnonzero(world.swarm.wheel_speed.any(axis=1)).tolist() == [2]
    # Actions for all agents that ever were are fine too; those of the dead are ignored.
    world.step({agent: np.full(3, 0.5, np.float32) for agent in world.possible_agents})
    assert np.flatnonzero(world.swarm.wheel_speed.any(axis=1)).tolist() == [1, 2, 3, 4]


def test_the_last_death_ends_the_episode():
    world = parallel_env(**SMALL)
    world.reset(seed=0)
    kill(world, 0, 1, 2, 3, 4)
    assert all(world.step(idle(world))[2].values())
    assert world.agents == []
    world.reset(seed=0)
    assert len(world.agents) == 5


def test_robots_in_repair_stay_agents():
    world = parallel_env(**SMALL)
    world.reset(seed=0)
    world.set_population(active=np.array([True, False, True, True, True]), present=np.ones(5, np.bool_))
    obs, _, terminations, _, infos = world.step(idle(world))
    assert not any(terminations.values())
    assert len(world.agents) == 5
    assert [infos[agent]["active"] for agent in world.agents] == [True, False, True, True, True]
    assert [obs[agent][world.layout["active"]].item() for agent in world.agents] == [1, 0, 1, 1, 1]


# Errors that help


def test_steps_before_reset_and_after_the_end_are_refused():
    world = parallel_env(max_cycles=1, **SMALL)
    for step in (lambda: world.step({}), lambda: world.step_batch(np.zeros((5, 3), np.float32))):
        with pytest.raises(RuntimeError, match="Call reset before step"):
            step()
    world.reset(seed=0)
    world.step(idle(world))
    with pytest.raises(RuntimeError, match="All agents are done; call reset"):
        world.step({"robot_0": np.zeros(3, np.float32)})
    assert world.step({}) == ({}, {}, {}, {}, {})


def test_actions_that_do_not_fit_are_refused_and_nothing_moves():
    world = parallel_env(**SMALL)
    world.reset(seed=0)
    for shape in ((4, 3), (5, 2), (5,), (5, 3, 1)):
        with pytest.raises(ActionError, match=r"\(n_robots, 3\) = \(5, 3\), got"):
            world.step_batch(np.zeros(shape, np.float32))
    actions = idle(world)
    del actions["robot_3"]
    actions["robot_9"] = np.zeros(3)
    with pytest.raises(ActionError, match=r"5 agents.*missing \['robot_3'\].*not in env.agents \['robot_9'\]"):
        world.step(actions)
    with pytest.raises(ActionError, match="missing"):
        world.step({})
    with pytest.raises(ActionError, match="a dict by agent, got ndarray"):
        world.step(np.zeros((5, 3)))
    with pytest.raises(ActionError, match="robot_1"):
        world.step({**idle(world), "robot_1": np.array([0.0, np.nan, 0.0])})
    assert world.tick == 0


def test_resets_without_a_seed_continue_the_sequence_of_the_last_seed():
    one, other = parallel_env(**SMALL), parallel_env(**SMALL)
    first = [one.reset_batch(3).copy(), *(one.reset_batch().copy() for _ in range(3))]
    again = [other.reset_batch(3).copy(), *(other.reset_batch().copy() for _ in range(3))]
    np.testing.assert_array_equal(first, again)
    assert len({row.tobytes() for row in first}) == 4
    fresh = parallel_env(**SMALL)
    fresh.reset_batch()
    assert fresh.seed_value is not None


def test_earlier_observations_stay_valid():
    world = parallel_env(**SMALL)
    first, _ = world.reset(seed=0)
    kept = {agent: row.copy() for agent, row in first.items()}
    second = world.step({agent: np.ones(3, np.float32) for agent in world.agents})[0]
    shown = {agent: row.copy() for agent, row in second.items()}
    world.step(idle(world))
    for agent in kept:
        np.testing.assert_array_equal(first[agent], kept[agent])
        np.testing.assert_array_equal(second[agent], shown[agent])
