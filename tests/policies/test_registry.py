"""Policies by name, and functions as policies."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.registry import file_of, from_callable, policy_file, policy_label
from swarm_forage_env.scenarios.presets import scenario

SPEC = SwarmSpec.of(scenario("warehouse_small", n_robots=4))


@pytest.mark.parametrize("word", ["crw", "crw.pyc", "mine:Ahead", "crw:decision_ticks=2", "a.zip:Ahead", "a/.zip"])
def test_what_is_no_file(word):
    assert policy_file(word) is None
    assert policy_label(word) == file_of(word) == word


@pytest.mark.parametrize(
    ("word", "path", "label", "interface"),
    [
        ("b.npz", "b.npz", "b", {}),
        ("a/b.ZIP", "a/b.ZIP", "b", {}),
        ("lr=0.1/a.zip", "lr=0.1/a.zip", "a", {}),
        ("b:a=1/a.zip:decision_ticks=2", "b:a=1/a.zip", "a", {"decision_ticks": 2}),
        ("a.zip:observation=full, site_memory=True", "a.zip", "a", {"observation": "full", "site_memory": True}),
        ("a.zip:neighbour_range_m=1.5", "a.zip", "a", {"neighbour_range_m": 1.5}),
        ("a/mine.py", "a/mine.py", "mine", {}),
        ("a/mine.py:Ahead", "a/mine.py", "Ahead", {}),
    ],
)
def test_what_the_word_for_a_file_says(word, path, label, interface):
    found = policy_file(word)
    assert found is not None
    assert (file_of(word), policy_label(word), found.interface()) == (path, label, interface)
    with pytest.raises(ConfigError, match=r"interface of a\.zip as field=value, got 'x'"):
        policy_file("a.zip:decision_ticks=2,x").interface()


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
