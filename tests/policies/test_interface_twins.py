"""Commands and masks of learners against slow twins, for random readings."""

from dataclasses import replace

import numpy as np
import pytest

from swarm_forage_env.contract.layout import ObservationLayout
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.scenarios.presets import scenario
from tests.reference.commands import allowed_actions, automatic_grip, numbered_action

N_ROBOTS = 600
GREYS = [0.7, 0.4, 0.0, 1.0]
"""Floors of nest, cache and object, and open floor."""


def random_readings(layout: ObservationLayout, seed: int) -> np.ndarray:
    """Observations (N, D) in which everything that decides about a gripper occurs in every combination."""
    rng = np.random.default_rng(seed)
    obs = rng.uniform(-1.0, 1.0, (N_ROBOTS, layout.size)).astype(np.float32)
    for name in ("carrying", "interacting", "active"):
        obs[:, layout[name]] = rng.random((N_ROBOTS, 1)) < 0.7
    ground = rng.choice(GREYS, (N_ROBOTS, 1)).repeat(4, axis=1)
    other = rng.random((N_ROBOTS, 4)) < 0.15
    ground[other] = rng.choice(GREYS, np.count_nonzero(other))
    obs[:, layout["ground"]] = ground
    window = layout["los_object"]
    obs[:, window] = np.where(rng.random((N_ROBOTS, 25)) < 0.4, np.abs(obs[:, window]), 0.0)
    return obs


def learner(caches: str = "dynamic", **choices) -> tuple[LearnerInterface, ObservationLayout]:
    spec = ForageEnv(scenario("warehouse_small", n_robots=2, caches=caches)).swarm_spec
    return LearnerInterface(InterfaceConfig(**choices), replace(spec, n_robots=N_ROBOTS)), spec.layout


@pytest.mark.parametrize("seed", range(3))
def test_the_automatic_gripper_acts_like_its_twin(seed):
    interface, layout = learner(automatic_gripper=True)
    obs = random_readings(layout, seed)
    wheels = np.random.default_rng(seed).uniform(-1.0, 1.0, (N_ROBOTS, 2)).astype(np.float32)
    commands = interface.command(wheels, obs)
    expected = [automatic_grip(row, layout) for row in obs]
    assert len(set(expected)) == 3, "every answer is put to the test"
    np.testing.assert_array_equal(commands[:, :2], wheels)
    np.testing.assert_array_equal(commands[:, 2], np.array(expected, np.float32))


@pytest.mark.parametrize("seed", range(3))
def test_actions_by_number_act_like_their_twin(seed):
    interface, layout = learner(actions="discrete")
    obs = random_readings(layout, seed)
    chosen = np.random.default_rng(seed).integers(0, 11, N_ROBOTS)
    assert set(chosen.tolist()) == set(range(11))
    expected = [numbered_action(int(k), row, layout) for k, row in zip(chosen, obs, strict=True)]
    np.testing.assert_array_equal(interface.command(chosen, obs), np.array(expected, np.float32))


@pytest.mark.parametrize("automatic_gripper", [False, True])
@pytest.mark.parametrize("caches", ["none", "dynamic"])
@pytest.mark.parametrize("seed", range(3))
def test_masks_are_like_their_twin(automatic_gripper, caches, seed):
    interface, layout = learner(caches, actions="discrete", automatic_gripper=automatic_gripper)
    obs = random_readings(layout, seed)
    found = [set(np.flatnonzero(allowed).tolist()) for allowed in interface.mask(obs)]
    expected = [
        allowed_actions(row, layout, with_grips=not automatic_gripper, dynamic_caches=caches == "dynamic")
        for row in obs
    ]
    assert found == expected
    assert len({frozenset(numbers) for numbers in expected}) >= (2 if automatic_gripper else 8)
