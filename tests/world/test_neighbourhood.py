"""Neighbours and messages: what robots perceive of each other."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from swarm_forage_env import ConfigError, ForageEnv, parallel_env, scenario
from swarm_forage_env.contract.policy import ActionError, SwarmSpec
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from tests.reference import sensing

N_ROBOTS = 12
SMALL: dict[str, Any] = {
    "n_robots": N_ROBOTS,
    "n_objects": 60,
    "width_m": 8.0,
    "height_m": 6.0,
    "nest_centre_m": (1.0, 3.0),
    "nest_size_m": (0.8, 2.0),
    "start_margin_m": 0.6,
    "physics": "compiled",
}
BOTH: dict[str, Any] = {"neighbours_seen": 3, "neighbour_range_m": 1.3, "message_size": 2, "message_range_m": 1.7}


def made(**fields: Any) -> ForageEnv:
    return ForageEnv(scenario("warehouse_small", **(SMALL | fields)))


def drawn(ticks: int, size: int = 5) -> np.ndarray:
    """Actions with which robots drive on, grasp and say something, some of it out of range."""
    actions = np.random.default_rng(0).uniform(-1.2, 1.2, (ticks, N_ROBOTS, size)).astype(np.float32)
    actions[..., :3] = np.abs(actions[..., :3])
    return actions


def part(env: ForageEnv, name: str) -> np.ndarray:
    return env.last_obs[:, env.layout[name]]


@pytest.mark.parametrize("physics", ["chipmunk", "compiled"])
def test_they_are_those_of_the_twins_and_change_nothing_else(physics):
    plain, env = made(physics=physics), made(physics=physics, **BOTH)
    assert env.layout.names == (*plain.layout.names, "neighbours", "messages")
    plain.reset_batch(seed=1)
    env.reset_batch(seed=1)
    assert not part(env, "messages").any(), "nobody has said anything yet"
    rng, met = np.random.default_rng(1), set[float]()
    for tick, actions in enumerate(drawn(40)):
        if tick % 10 == 5:  # some are away, some in repair
            present = rng.random(N_ROBOTS) < 0.8
            active = present & (rng.random(N_ROBOTS) < 0.8)
            for each in (plain, env):
                each.set_population(active=active, present=present)
        plain.step_batch(np.ascontiguousarray(actions[:, :3]))
        env.step_batch(actions)
        np.testing.assert_array_equal(env.last_obs[:, : plain.layout.size], plain.last_obs)
        seen = [sensing.neighbours(env, robot) for robot in range(N_ROBOTS)]
        heard = [sensing.heard(env, robot, actions[:, 3:]) for robot in range(N_ROBOTS)]
        np.testing.assert_allclose(part(env, "neighbours"), seen, atol=1e-6)
        np.testing.assert_allclose(part(env, "messages"), heard, atol=1e-6)
        met.update(part(env, "neighbours")[:, 3::4].sum(axis=1).tolist())
    assert met == {0.0, 1.0, 2.0, 3.0}


def test_cargo_is_seen_and_the_nearest_comes_first():
    env = made(**BOTH)
    env.reset_batch(seed=1)
    env.swarm.position[:] = np.column_stack([np.full(N_ROBOTS, 7.0), 0.4 + 0.4 * np.arange(N_ROBOTS)])
    env.swarm.position[:3] = (3.0, 3.0), (3.5, 3.0), (3.0, 3.4)
    env.swarm.facing[0] = 0.0, 1.0
    env.swarm.carried_object[1] = 5
    env.arena.observe()
    forward, left = 0.4 / 1.3, -0.5 / 1.3
    expected = [forward, 0.0, 0.0, 1.0, 0.0, left, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(part(env, "neighbours")[0], expected, atol=1e-6)


def test_of_equally_near_robots_the_lower_row_comes_first():
    env = made(neighbours_seen=2)
    env.reset_batch(seed=1)
    env.swarm.position[:] = np.column_stack([np.full(N_ROBOTS, 7.0), 0.4 + 0.4 * np.arange(N_ROBOTS)])
    env.swarm.position[:4] = (3.0, 3.0), (3.5, 3.0), (2.5, 3.0), (3.0, 3.5)
    env.swarm.facing[0] = 1.0, 0.0
    env.arena.observe()
    np.testing.assert_allclose(part(env, "neighbours")[0, [0, 1, 4, 5]], [0.25, 0.0, -0.25, 0.0], atol=1e-6)


def test_a_message_that_is_not_finite_is_refused():
    env = made(**BOTH)
    env.reset_batch(seed=1)
    actions = np.zeros((N_ROBOTS, 5), np.float32)
    actions[4, 3] = np.nan
    with pytest.raises(ActionError, match="robot_4; the world was not stepped"):
        env.step_batch(actions)
    with pytest.raises(ActionError, match=r"\(n_robots, 3 \+ message_size\) = \(12, 5\), got \(12, 4\)"):
        env.step_batch(np.zeros((N_ROBOTS, 4), np.float32))
    assert env.tick == 0


@pytest.mark.parametrize("observation", ["full", "compact"])
def test_learners_see_and_say_them_through_every_view(observation):
    fields: dict[str, Any] = {**SMALL, **BOTH, "interface": {"observation": observation}}
    dicts = parallel_env("warehouse_small", **fields)
    rows = gymnasium.make_vec("swarm_forage/warehouse_small-v0", **fields)
    joint = gymnasium.make("swarm_forage/warehouse_small-v0", **fields)
    size = {"full": 111, "compact": 23}[observation] + 12 + 3
    assert dicts.action_space("robot_0").shape == rows.single_action_space.shape == (5,)
    assert joint.action_space.shape == (N_ROBOTS, 5)
    first = [np.stack(list(dicts.reset(seed=3)[0].values())), rows.reset(seed=3)[0], joint.reset(seed=3)[0]]
    actions = np.clip(drawn(1)[0], -1.0, 1.0)
    stepped = [
        np.stack(list(dicts.step(dict(zip(dicts.possible_agents, actions, strict=True)))[0].values())),
        rows.step(actions)[0],
        joint.step(actions)[0],
    ]
    for seen in (first, stepped):
        assert seen[0].shape == (N_ROBOTS, size)
        np.testing.assert_array_equal(seen[0], seen[1])
        np.testing.assert_array_equal(seen[0], seen[2])
    assert stepped[0][:, -1].any()
    assert (stepped[0][:, -3:-1] != 0.0).any(), "what is heard are not only zeros"


def test_a_policy_says_what_it_needs():
    shown = InterfaceConfig(observation="compact").for_scenario(scenario("warehouse_small", **BOTH))
    assert (shown.neighbours_seen, shown.neighbour_range_m, shown.message_size) == (3, 1.3, 2)
    for fields, words in (
        ({}, r"got none; give the scenario neighbours_seen=3 and neighbour_range_m=1\.3"),
        ({**BOTH, "neighbour_range_m": 2.0}, r"forward, left / 2 m.*neighbour_range_m=1\.3"),
        ({**BOTH, "message_size": 1}, r"messages of 2 numbers, .* got 1; give the scenario message_size=2"),
    ):
        with pytest.raises(ConfigError, match=words):
            LearnerInterface(shown, SwarmSpec.of(scenario("warehouse_small", **fields)))
    with pytest.raises(ConfigError, match=r"a scenario with neighbours, because the policy reads .* neighbours_seen"):
        ForageEnv(scenario("warehouse_small"), reads=shown.reads)
    blind = InterfaceConfig(neighbours_seen=0, message_size=0).for_scenario(scenario("warehouse_small", **BOTH))
    assert blind.sensors == ()


def test_numbered_actions_carry_no_message():
    with pytest.raises(ConfigError, match=r"'continuous' for messages of 2 numbers, got 'discrete'.*message_size=0"):
        parallel_env("warehouse_small", **BOTH, interface={"actions": "discrete"})
    interface = {"actions": "discrete", "message_size": 0}
    env = parallel_env("warehouse_small", **SMALL, **BOTH, interface=interface)
    assert "messages" not in env.interface.layout.names
    env.reset(seed=1)
    env.step(dict.fromkeys(env.agents, 1))


def test_a_reset_keeps_the_spaces():
    env = parallel_env("warehouse_small", **SMALL, **BOTH, interface={})
    env.reset(options={"scenario": {"neighbour_range_m": 1.3, "message_range_m": 3.0}})
    with pytest.raises(ConfigError, match="message_size to stay 2, as spaces promise, got 3"):
        env.reset(options={"scenario": {"message_size": 3}})
    with pytest.raises(ConfigError, match=r"neighbour_range_m to stay 1\.3, .* got 4;"):
        env.reset(options={"scenario": {"neighbour_range_m": 4.0}})
    env.reset()
    assert env.forage_env.scenario.robots.neighbour_range_m == 1.3
    alone = parallel_env("warehouse_small", **SMALL, interface={})
    alone.reset(options={"scenario": {"neighbour_range_m": 4.0}})  # no column depends on it
