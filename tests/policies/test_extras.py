"""Rewards and observations of users: where they arrive, and what is refused."""

from typing import Any

import gymnasium
import numpy as np
import pytest

from swarm_forage_env import ConfigError, ExtraFunctionError, SwarmSpec, parallel_env, plan_run, run_policy, scenario
from swarm_forage_env.contract.types import ObsArray
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.learned import LearnedPolicy
from swarm_forage_env.policies.network import Network, NetworkAbout, NetworkPolicy
from swarm_forage_env.views.gymnasium import SwarmVectorEnv

N = 6
FIELDS: dict[str, Any] = {"n_robots": N, "n_objects": 20}


def heading_and_cargo(arena: Any) -> np.ndarray:
    return np.column_stack([np.sin(arena.swarm.heading), arena.swarm.carried_object >= 0])


def row(arena: Any) -> np.ndarray:
    return np.arange(len(arena.swarm.active)) / 8.0


def test_learners_see_extra_columns_last_in_every_view():
    fields: dict[str, Any] = {**FIELDS, "interface": {"observation": "compact"}}
    plain = parallel_env("warehouse_small", **fields)
    dicts = parallel_env("warehouse_small", **fields, extra_observation=heading_and_cargo)
    rows = gymnasium.make_vec("swarm_forage/warehouse_small-v0", **fields, extra_observation=heading_and_cargo)
    assert dicts.interface.layout.names == (*plain.interface.layout.names, "extra")
    assert dicts.observation_space("robot_0").shape == rows.single_observation_space.shape
    bare, seen = (np.stack(list(env.reset(seed=3)[0].values())) for env in (plain, dicts))
    np.testing.assert_array_equal(seen, rows.reset(seed=3)[0])
    np.testing.assert_array_equal(seen[:, :-2], bare)
    np.testing.assert_array_equal(seen[:, -2:], np.float32(heading_and_cargo(dicts.forage_env.arena)))


@pytest.mark.parametrize("n_arenas", [1, 2])
@pytest.mark.parametrize("ticks", [1, 5])
def test_an_extra_reward_is_added_once_per_decision_to_robots_at_work(n_arenas, ticks):
    fields: dict[str, Any] = {**FIELDS, "delivery": 0.0, "n_arenas": n_arenas, "interface": {"decision_ticks": ticks}}
    env = SwarmVectorEnv("warehouse_small", **fields, extra_reward=row)
    env.reset(seed=1)
    for forage_env in env.unwrapped._arenas.arenas:
        at_work = np.arange(N) != 5
        forage_env.forage_env.set_population(active=at_work, present=np.ones(N, bool))
    rewards = env.step(np.zeros((n_arenas * N, 3), np.float32))[1]
    np.testing.assert_array_equal(rewards, np.tile([0.0, 0.125, 0.25, 0.375, 0.5, 0.0], n_arenas))


def test_a_team_shares_extra_rewards_and_robots_that_are_away_see_nothing():
    env = parallel_env("warehouse_small", **FIELDS, team=True, extra_reward=row, extra_observation=heading_and_cargo)
    env.reset(seed=1)
    present = np.arange(N) != 2
    env.forage_env.set_population(active=present, present=present)
    observations, rewards, *_ = env.step({agent: np.zeros(3, np.float32) for agent in env.agents})
    mean = (0 + 1 + 3 + 4 + 5) / 8.0 / 5
    assert rewards == pytest.approx({agent: mean * (agent != "robot_2") for agent in env.agents})
    assert not observations["robot_2"][-2:].any()


@pytest.mark.parametrize(
    ("role", "function", "message"),
    [
        ("extra_observation", lambda arena: np.zeros((N, 0)), r"shape \(6, K\), one row per robot, got \(6, 0\)"),
        ("extra_observation", lambda arena: np.full((N, 1), np.nan), r"numbers in \[-1, 1\], got nan; divide"),
        (
            "extra_observation",
            lambda arena: arena.nothing,
            "extra_observation <lambda> failed with AttributeError: .*line",
        ),
        ("extra_reward", lambda arena: np.full(N, 1.5), r"numbers in \[-1, 1\], got 1\.5"),
    ],
)
def test_what_no_observation_or_reward_can_be_is_refused(role, function, message):
    def run() -> None:
        env = SwarmVectorEnv("warehouse_small", **FIELDS, n_arenas=2, **{role: function})
        env.reset(seed=1)
        env.step(np.zeros((2 * N, 3), np.float32))

    with pytest.raises(ExtraFunctionError, match=message):
        run()


def test_other_columns_than_the_interface_says_are_refused():
    with pytest.raises(ConfigError, match="3 columns, as the interface says, got 2"):
        parallel_env("warehouse_small", **FIELDS, interface={"extra_columns": 3}, extra_observation=heading_and_cargo)
    with pytest.raises(ConfigError, match=r"extra_observation of the 3 columns .* got none"):
        parallel_env("warehouse_small", **FIELDS, interface={"extra_columns": 3})
    with pytest.raises(ConfigError, match=r"frame_decisions of 0 beside extra_observation, .* got 10; give interface"):
        InterfaceConfig(extra_columns=1, frame_decisions=10)
    bound = LearnerInterface(InterfaceConfig(extra_columns=1), SwarmSpec.of(scenario("warehouse_small", **FIELDS)))
    rows = np.zeros((N, bound.layout.size - 1), np.float32)
    for extra, n_columns in ((None, 0), (np.zeros((N, 2)), 2)):
        with pytest.raises(ValueError, match=rf"1 columns of extra_observation, .* got {n_columns}"):
            bound.observe(rows, extra=extra)


def test_a_policy_that_was_trained_with_them_needs_the_function_again():
    world = scenario("warehouse_small", **FIELDS, horizon_s=20.0, interval_s=20.0)
    interface = InterfaceConfig(observation="compact", actions="discrete", extra_columns=2)
    spec = SwarmSpec.of(world)
    layout, (columns, n_actions) = LearnerInterface(interface, spec).layout, LearnerInterface(interface, spec).widths
    weights = np.zeros((columns, n_actions), np.float32)
    weights[layout["extra"].start, 1] = 1.0  # who looks north drives; all others stand
    about = NetworkAbout(interface=interface, activation="tanh", samples=False)
    network = Network((weights,), (np.zeros(n_actions, np.float32),), about)
    with pytest.raises(ExtraFunctionError, match=r"extra_observation of 2 columns that the policy was trained with"):
        NetworkPolicy(network).reset(spec, np.random.default_rng())

    seen: list[ObsArray] = []

    def choose(rows: ObsArray, rng: np.random.Generator) -> np.ndarray:
        seen.append(rows.copy())
        return network.choose(rows, rng)

    policy = LearnedPolicy(interface, choose, extra_observation=heading_and_cargo)
    run_policy(policy, plan_run(world, "crw", seed=1))
    without = LearnedPolicy(InterfaceConfig(actions="discrete"), choose, extra_observation=heading_and_cargo)
    with pytest.raises(ExtraFunctionError, match=r"shape \(6, 0\), one row per robot, got \(6, 2\)"):
        run_policy(without, plan_run(world, "crw", seed=1))
    looks_north = seen[0][:, -2] > 0.0
    assert 0 < looks_north.sum() < N
    np.testing.assert_array_equal(network.choose(seen[0], np.random.default_rng()), looks_north.astype(int))
