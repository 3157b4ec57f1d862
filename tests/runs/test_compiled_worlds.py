"""Compiled policies in worlds with obstacles, messages, slow hands: in pieces as tick by tick, bit for bit."""

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest
from gymnasium import spaces

from swarm_forage_env.contract.policy import Policy, SwarmSpec
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.network import Network, NetworkAbout, NetworkPolicy
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_stack
from swarm_forage_env.scenarios.config import ScenarioConfig
from tests.runs.test_compiled_disturbances import outcome, random_stack
from tests.support.drivers import tick_by_tick
from tests.support.foraging import quick_world

WORLDS: dict[str, dict[str, Any]] = {
    "obstacles": {"obstacles": ((8.0, 4.0, 8.4, 12.0),)},
    "messages": {"message_size": 2, "neighbours_seen": 2, "neighbour_range_m": 2.0},
    "slow hands": {"pickup_ticks": 3, "drop_ticks": 2, "walk_probability": 0.02},
}
"""Fields of a world by name."""


def world_with(fields: dict[str, Any], caches: str) -> ScenarioConfig:
    return quick_world("warehouse_dual", caches=caches, n_robots=12, horizon_s=60.0, interval_s=4.0, **fields)


def network_of(world: ScenarioConfig, decision_ticks: int, chance: np.random.Generator) -> Network:
    """A network with weights by chance."""
    interface = InterfaceConfig(
        observation="compact",
        actions="discrete" if decision_ticks % 2 else "continuous",
        automatic_gripper=decision_ticks != 3,
        decision_ticks=decision_ticks,
        site_memory=decision_ticks > 3,
    )
    learner = LearnerInterface(interface, SwarmSpec.of(world))
    space = learner.action_space
    n_actions = int(space.n) if isinstance(space, spaces.Discrete) else space.shape[0]
    shapes = (learner.layout.size, 7), (7, n_actions)
    weights = tuple(chance.normal(0.0, 1.0, shape).astype(np.float32) for shape in shapes)
    biases = tuple(chance.normal(0.0, 0.5, shape[1]).astype(np.float32) for shape in shapes)
    return Network(
        weights, biases, NetworkAbout(interface=interface, activation="tanh", samples=False, caches=world.caches)
    )


def assert_same_in_pieces(policy: Callable[[], Policy], world: ScenarioConfig, seed: int) -> None:
    """Hold a run in pieces, under wrappers by chance, against the same run tick by tick."""
    chance = np.random.default_rng(seed)
    wrappers = random_stack(chance)
    runs = []
    for by_ticks in (False, True):
        chosen: Any = policy()
        stack = build_stack(world, wrappers, reads=getattr(chosen, "reads", None))
        runs.append(LiveRun(stack, tick_by_tick(chosen) if by_ticks else chosen, seed))
    assert runs[0].compiled_policy is not None
    for tick in [*sorted(chance.integers(1, 300, 3).tolist()), 300]:
        for run in runs:
            run.advance(to_tick=tick)
        in_pieces, by_ticks = map(outcome, runs)
        assert in_pieces.keys() == by_ticks.keys()
        for name, values in in_pieces.items():
            np.testing.assert_array_equal(values, by_ticks[name], err_msg=f"{name} at tick {tick}")


@pytest.mark.parametrize(
    ("policy", "fields"),
    [*zip(("crw", "dpo", "cpfa", "stochx", "stochx"), [*WORLDS.values(), *WORLDS.values()], strict=False)],
)
def test_scripted_policies_do_the_same_in_pieces(policy, fields):
    world = world_with(fields, getattr(load_policy(policy), "caches", "none"))
    assert_same_in_pieces(lambda: load_policy(policy), world, seed=len(policy))


@pytest.mark.parametrize(
    ("decision_ticks", "fields"), [*zip([2, 3, 4, 5, 6], [*WORLDS.values(), *WORLDS.values()], strict=False)]
)
def test_networks_that_decide_in_some_ticks_do_the_same_in_pieces(decision_ticks, fields):
    world = world_with(fields, "none")
    network = network_of(world, decision_ticks, np.random.default_rng(decision_ticks))
    assert_same_in_pieces(lambda: NetworkPolicy(network), world, seed=decision_ticks)
