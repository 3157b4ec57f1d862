"""Policies by name, and functions as policies."""

import numpy as np
import pytest

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.registry import from_callable
from swarm_forage_env.scenarios.presets import scenario

SPEC = SwarmSpec.of(scenario("warehouse_small", n_robots=4))


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.full((4, 3), 0.5 + 1j), "'mine' to return real numbers, .*complex128"),
        ([["a", "b", "c"]] * 4, "'mine' to return real numbers, .*<U1"),
        ([[0.0, 0.0, 0.0], [0.0]], "'mine' to return real numbers, .*inhomogeneous"),
        (np.zeros((4, 2)), r"'mine' to return actions with shape \(n_robots, 3\) = \(4, 3\), got \(4, 2\)"),
    ],
)
def test_what_a_function_must_not_return(actions, message):
    policy = from_callable(lambda obs: actions, name="mine")
    policy.reset(SPEC, np.random.default_rng(0))
    with pytest.raises(ValueError, match=message):
        policy.act(np.zeros((4, 9), np.float32), np.ones(4, bool))


@pytest.mark.parametrize("given", [np.ones((4, 3), np.float64), np.ones((4, 3), np.int8), [[True] * 3] * 4])
def test_any_real_numbers_will_do(given):
    policy = from_callable(lambda obs: given)
    policy.reset(SPEC, np.random.default_rng(0))
    actions = policy.act(np.zeros((4, 9), np.float32), np.ones(4, bool))
    assert actions.dtype == np.float32
    np.testing.assert_array_equal(actions, np.ones((4, 3)))
