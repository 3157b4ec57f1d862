"""Policies by name, functions as policies, and the policies that come with the package."""

import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies import pretrained
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.registry import file_of, from_callable, load_policy, policy_file, policy_label
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.plan import TrainingPlan, read_plan
from tests.support.stage import OPEN_CELL, load, stand, tidy_world

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


FOLDER = Path(pretrained.__file__).parent
SHIPPED = sorted(path.stem for path in FOLDER.glob("*.npz"))


@pytest.mark.parametrize("name", SHIPPED)
def test_a_shipped_policy_has_a_card_a_plan_and_a_small_file(name):
    network = Network.load(FOLDER / f"{name}.npz")
    assert TrainingPlan.from_mapping(network.about.card["plan"]) == read_plan(FOLDER / f"{name}.toml")
    card = (FOLDER / f"{name}.md").read_text()
    for word in (f"swarm-forage train --plan {name}", *network.about.card["versions"].values()):
        assert word in card
    assert (FOLDER / f"{name}.npz").stat().st_size < 100_000


def test_shipped_policies_run_by_name_without_torch():
    code = (
        "import sys; sys.modules['torch'] = sys.modules['stable_baselines3'] = None\n"
        "from swarm_forage_env.scenarios.presets import warehouse_small\n"
        "from swarm_forage_env.runs.run import run_one\n"
        "from swarm_forage_env.runs.spec import plan_run\n"
        "world = warehouse_small(n_robots=5, horizon_s=20.0, interval_s=20.0)\n"
        f"print(*(run_one(plan_run(world, name, seed=1)).spec.policy for name in {(*SHIPPED,)}))"
    )
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert result.stdout.split() == [*SHIPPED], result.stderr


@pytest.mark.parametrize("name", SHIPPED)
def test_a_robot_keeps_its_cargo_when_it_comes_back_to_work(name):
    """It does so in a step that policies do not foresee: for them the robot is still in repair."""
    env, policy = tidy_world(), load_policy(name)
    policy.reset(env.swarm_spec, np.random.default_rng(0))
    load(env, 0, 0)
    stand(env, 0, OPEN_CELL)
    env.step_batch(policy.act(env.arena.observe(), np.zeros(4, np.bool_)))
    assert env.swarm.carried_object.tolist() == [0, -1, -1, -1]
