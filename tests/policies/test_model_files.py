"""Trained policies in files: found by their suffix, opened with care, applied as they were trained."""

import copy
import sys
import warnings
import zipfile
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from metrics import score
from metrics.scoring import score_question
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies import model_files
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.learned import LearnedPolicy
from swarm_forage_env.policies.model_files import (
    MODEL_NOTE,
    InterfaceGuessWarning,
    ModelError,
    ModelPolicy,
    file_digest,
)
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.policies.registry import (
    is_policy_file,
    load_policy,
    local_policy,
    policy_class,
    split_interface,
)
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import RunSpec, pin_policy, plan_run
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies.ladders import Budget
from swarm_forage_env.views.pettingzoo import parallel_env
from tests.support.branches import pickled

pytestmark = pytest.mark.filterwarnings(f"ignore::{InterfaceGuessWarning.__module__}.{InterfaceGuessWarning.__name__}")
"""Most models here are saved without a note; one test is about that."""
TINY = Budget(horizon_s=4.0, interval_s=2.0, n_seeds=1, n_sizes=2, n_levels=1)
ENV = parallel_env("warehouse_small", n_robots=4, n_objects=20)
OBS = np.random.default_rng(1).uniform(-1.0, 1.0, (4, ENV.layout.size)).astype(np.float32)
ACTIVE = np.ones(4, bool)
SIZE = ENV.layout.size


class Stage(gymnasium.Env):
    """Spaces without an environment behind them, to build models from."""

    def __init__(self, seen, done):
        self.observation_space, self.action_space = seen, done


def box(*shape):
    return spaces.Box(-1.0, 1.0, shape, np.float32)


def model(algorithm, path: Path, *, seen=None, done=None, **options):
    """Save an untrained model; returns it and its file."""
    library = pytest.importorskip("stable_baselines3")
    stage = Stage(seen or box(SIZE), done or box(3))
    made = getattr(library, algorithm)("MlpPolicy", stage, device="cpu", seed=1, **options)
    made.save(path / "model.zip")
    return made, path / "model.zip"


def started(path, **parameters) -> ModelPolicy:
    policy = load_policy(str(path), parameters)
    policy.reset(ENV.swarm_spec, np.random.default_rng(0))
    return policy


@pytest.mark.parametrize(
    ("algorithm", "options"),
    [
        ("PPO", {}),
        ("PPO", {"use_sde": True, "policy_kwargs": {"net_arch": [16]}}),
        ("A2C", {}),
        ("SAC", {"buffer_size": 10}),
        ("SAC", {"buffer_size": 10, "use_sde": True}),
        ("TD3", {"buffer_size": 10}),
        ("DDPG", {"buffer_size": 10}),
    ],
)
def test_actions_are_those_of_the_algorithm_itself(tmp_path, algorithm, options):
    made, path = model(algorithm, tmp_path, **options)
    policy = started(path)
    expected, _ = made.predict(OBS, deterministic=True)
    actions = policy.act(OBS, ACTIVE)
    np.testing.assert_array_equal(actions, expected)
    assert (actions.shape, actions.dtype) == ((4, 3), np.float32)


@pytest.mark.parametrize("copied", [copy.deepcopy, pickled])
@pytest.mark.parametrize("algorithm", ["PPO", "SAC"])
def test_a_copy_acts_as_the_original_does(tmp_path, algorithm, copied):
    _, path = model(algorithm, tmp_path)
    policy = started(path, interface={"decision_ticks": 2})
    policy.act(OBS, ACTIVE)
    twin = copied(policy)
    for obs in (OBS, -OBS, OBS / 2):
        np.testing.assert_array_equal(twin.act(obs, ACTIVE), policy.act(obs, ACTIVE))


@pytest.mark.parametrize(
    ("algorithm", "choices"),
    [
        ("PPO", {"observation": "compact", "actions": "discrete", "automatic_gripper": True}),
        ("DQN", {"observation": "full", "actions": "discrete"}),
        ("PPO", {"observation": "compact", "automatic_gripper": True}),
    ],
)
def test_the_interface_of_a_model_is_told_by_a_parameter(tmp_path, algorithm, choices):
    interface = LearnerInterface(InterfaceConfig(**choices), ENV.swarm_spec)
    options = {"buffer_size": 10} if algorithm == "DQN" else {}
    made, path = model(algorithm, tmp_path, seen=interface.observation_space, done=interface.action_space, **options)
    choice, _ = made.predict(interface.observe(OBS), deterministic=True)
    policy = started(path, interface=choices)
    np.testing.assert_array_equal(policy.act(OBS, ACTIVE), interface.command(choice, OBS))
    assert policy.reads == interface.config.reads


@pytest.mark.parametrize(
    "choices",
    [
        {"observation": "compact", "actions": "discrete", "automatic_gripper": True},
        {"actions": "discrete"},
        {"automatic_gripper": True},
    ],
)
def test_a_model_that_does_not_tell_its_interface_is_refused_until_somebody_does(tmp_path, choices):
    interface = LearnerInterface(InterfaceConfig(**choices), ENV.swarm_spec)
    _, path = model("A2C", tmp_path, seen=interface.observation_space, done=interface.action_space)
    with pytest.raises(ModelError, match=r"model\.zip to tell .* has no note, .*\{\"interface\": .*note_interface"):
        started(path)
    other = {"observation": "compact", "actions": "continuous"}
    with pytest.raises(ModelError, match=r"to Box\(3\), as the parameter interface says; model\.zip goes"):
        started(path, interface=other)
    started(path, interface=choices)


def test_a_planned_run_carries_the_interface_as_plain_values(tmp_path):
    interface = InterfaceConfig(observation="compact", automatic_gripper=True, decision_ticks=2)
    bound = LearnerInterface(interface, ENV.swarm_spec)
    _, path = model("A2C", tmp_path, seen=bound.observation_space, done=bound.action_space)
    world = scenario("warehouse_small", n_robots=4, n_objects=20, horizon_s=4.0, interval_s=2.0)
    parameters = {"interface": {"observation": "compact", "automatic_gripper": True, "decision_ticks": 2}}
    spec = plan_run(world, str(path), parameters=parameters)
    assert RunSpec.from_json(spec.to_json()) == spec
    policy = load_policy(spec.policy, spec.parameters)
    policy.reset(ENV.swarm_spec, np.random.default_rng(0))
    assert policy.interface.config == interface
    assert run_one(spec).spec.scenario.name == "warehouse_small"


def test_an_interface_that_is_guessed_is_said_once_and_on_one_line(tmp_path):
    _, path = model("A2C", tmp_path)
    with pytest.warns(InterfaceGuessWarning, match=r"one decision per tick.* model\.zip:decision_ticks=5") as told:
        spec = plan_run(scenario("warehouse_small", n_robots=4), str(path))
    assert len(told) == 1
    assert "\n" not in str(told[0].message)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        load_policy(spec.policy, spec.parameters)  # as every run of the plan does
        plan_run(scenario("warehouse_small", n_robots=4), f"{path}:decision_ticks=1")
        _, noted, _ = noted_model(tmp_path, NOTED)
        load_policy(str(noted))


def test_an_interface_is_said_with_the_file(tmp_path):
    _, path, _ = noted_model(tmp_path, NOTED)
    world = scenario("warehouse_small", n_robots=4)
    said = plan_run(world, f"{path}:decision_ticks=2,automatic_gripper=true", caches="static")
    given = {"interface": {"decision_ticks": 2, "automatic_gripper": True}}
    assert said == plan_run(world, str(path), parameters=given, caches="static")
    assert load_policy(f"{path}:decision_ticks=7")._config.decision_ticks == 7
    assert score_question([f"{path}:decision_ticks=7"], world, budget=TINY).plan.policies[0].label == "model"
    with pytest.raises(ConfigError, match="Did you mean 'decision_ticks'"):
        load_policy(f"{path}:decision_tick=7")
    with pytest.raises(ConfigError, match="once, got it with the file and as a parameter"):
        plan_run(world, f"{path}:decision_ticks=2", parameters=given)


@pytest.mark.parametrize(
    ("policy", "expected"),
    [
        ("crw", ("crw", {})),
        ("crw:decision_ticks=2", ("crw:decision_ticks=2", {})),
        ("lr=0.1/a.zip", ("lr=0.1/a.zip", {})),
        ("b:a=1/a.zip:decision_ticks=2", ("b:a=1/a.zip", {"decision_ticks": 2})),
        ("a.zip:observation=full, actions=discrete", ("a.zip", {"observation": "full", "actions": "discrete"})),
    ],
)
def test_what_is_an_interface_and_what_is_a_path(policy, expected):
    assert split_interface(policy) == expected
    with pytest.raises(ConfigError, match=r"interface of a\.zip as field=value, got 'x'"):
        split_interface("a.zip:decision_ticks=2,x")


@pytest.mark.parametrize("given", [load_policy, pin_policy])
def test_an_interface_is_given_once(given, tmp_path):
    words = f"{tmp_path / 'model.zip'}:decision_ticks=5"
    with pytest.raises(ConfigError, match="once, got it with the file and as a parameter"):
        given(words, {"interface": {"observation": "compact"}})


def test_a_model_of_the_whole_swarm_sees_all_rows_at_once(tmp_path):
    made, path = model("A2C", tmp_path, seen=box(4, SIZE), done=box(4, 3))
    np.testing.assert_array_equal(started(path).act(OBS, ACTIVE), made.predict(OBS, deterministic=True)[0])
    other = parallel_env("warehouse_small", n_robots=5, n_objects=20)
    with pytest.raises(ModelError, match="these 5 robots together"):
        load_policy(str(path)).reset(other.swarm_spec, np.random.default_rng(0))
    with pytest.raises(ModelError, match=r"from Box\(23\) to Box\(3\), as the parameter interface says"):
        started(path, interface={"observation": "compact"})


def test_actions_are_kept_for_the_ticks_of_a_decision(tmp_path):
    _, path = model("A2C", tmp_path)
    policy = started(path, interface={"decision_ticks": 2})
    first, second, third = (policy.act(sign * OBS, ACTIVE).copy() for sign in (1.0, -1.0, -1.0))
    np.testing.assert_array_equal(first, second)
    assert np.any(third != second)
    for wrong in ({"decision_ticks": 0}, {"decision_tick": 2}, 2):
        with pytest.raises(ConfigError, match=r"decision_ticks|InterfaceConfig or its fields"):
            load_policy(str(path), {"interface": wrong})


class Counting:
    """Stands in for the network of a recurrent model: it turns faster in every decision of a run."""

    observation_space, action_space = box(SIZE), box(3)

    def predict(self, rows, state=None, *, deterministic):
        assert deterministic
        decisions = np.zeros((len(rows), 1)) if state is None else state[0]
        assert decisions.shape == (len(rows), 1)
        return np.repeat(0.1 * decisions, 3, axis=1).astype(np.float32), (decisions + 1,)


def test_a_recurrent_model_remembers_within_a_run(monkeypatch, tmp_path):
    path = tmp_path / "model.zip"
    path.write_bytes(b"recurrent")
    monkeypatch.setattr(model_files, "_open_model", lambda path, digest: (Counting(), None))
    policy = started(path, interface={"decision_ticks": 2})
    wheels = [policy.act(OBS, ACTIVE)[:, 0].copy() for _ in range(5)]
    np.testing.assert_allclose(wheels, np.repeat([[0.0], [0.0], [0.1], [0.1], [0.2]], 4, axis=1))
    twin = copy.deepcopy(policy)
    for _ in range(2):
        np.testing.assert_array_equal(twin.act(OBS, ACTIVE), policy.act(OBS, ACTIVE))
    policy.reset(ENV.swarm_spec, np.random.default_rng(0))
    np.testing.assert_array_equal(policy.act(OBS, ACTIVE), 0.0)


def test_a_controller_is_given_with_memory_or_without():
    for wrong in ({}, {"choose": len, "remember": len}):
        with pytest.raises(TypeError, match="either choose or remember"):
            LearnedPolicy(InterfaceConfig(), **wrong)


NOTED = {
    "interface": {"observation": "compact", "actions": "discrete", "automatic_gripper": True, "decision_ticks": 3},
    "caches": "static",
}


def noted_model(folder: Path, note):
    """Save an untrained model that carries a note; returns it, its file, and the interface of NOTED."""
    interface = LearnerInterface(InterfaceConfig(**NOTED["interface"]), ENV.swarm_spec)
    made, path = model("A2C", folder, seen=interface.observation_space, done=interface.action_space)
    setattr(made, MODEL_NOTE, note)
    made.save(path)
    return made, path, interface


def test_a_model_with_a_note_runs_as_it_was_trained(tmp_path):
    made, path, interface = noted_model(tmp_path, NOTED)
    policy = started(path)
    assert policy.caches == "static"
    assert policy.reads == interface.config.reads
    assert policy.reads
    wheels = [policy.act(sign * OBS, ACTIVE)[:, :2].copy() for sign in (1.0, -1.0, -1.0, -1.0)]
    expected, _ = made.predict(interface.observe(OBS), deterministic=True)
    np.testing.assert_array_equal(wheels[0], interface.command(expected, OBS)[:, :2])
    np.testing.assert_array_equal(wheels[:3], [wheels[0]] * 3)
    assert np.any(wheels[3] != wheels[2])
    policy = started(path, interface={"decision_ticks": 1})  # the rest is as noted
    first, second = (policy.act(sign * OBS, ACTIVE)[:, :2].copy() for sign in (1.0, -1.0))
    assert np.any(first != second)


def test_a_model_without_a_note_does_not_tell_its_caches(tmp_path):
    _, path = model("A2C", tmp_path)
    policy = load_policy(str(path))
    assert not hasattr(policy, "caches")
    assert policy.reads is None


@pytest.mark.parametrize(
    ("note", "reason"),
    [
        ([1], r"note in .*model\.zip to be a table with interface and caches, got \[1\]"),
        (NOTED | {"interface": {"observation": "compct"}}, r"note in .*model\.zip: .*Did you mean 'compact'"),
        (NOTED | {"interface": {"decision_tick": 2}}, "Did you mean 'decision_ticks'"),
        ({"interface": NOTED["interface"]}, "to be one of none, static, dynamic, got None"),
        (
            NOTED | {"interface": {"observation": "full"}},
            r"from Box\(\d+\) to Box\(3\), as the note in model\.zip says",
        ),
    ],
)
def test_wrong_notes_are_refused(tmp_path, note, reason):
    _, path, _ = noted_model(tmp_path, note)
    with pytest.raises(ModelError, match=reason):
        started(path)


def test_a_model_that_sees_something_else_is_refused(tmp_path):
    _, path = model("A2C", tmp_path, seen=box(7))
    with pytest.raises(ModelError, match=r"its spaces, Box\(7\) to Box\(3\), are neither"):
        started(path)


def test_a_changed_file_is_refused(tmp_path):
    _, path = model("A2C", tmp_path)
    digest = file_digest(path)
    load_policy(str(path), {"digest": digest})
    model("A2C", tmp_path, policy_kwargs={"net_arch": [5]})
    with pytest.raises(ModelError, match=f"digest {digest}.* changed since .*plan the run again"):
        load_policy(str(path), {"digest": digest})


def test_without_the_library_it_says_what_to_install(tmp_path, monkeypatch):
    path = tmp_path / "unopened.zip"
    path.write_bytes(b"x")
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.policies", None)
    with pytest.raises(ImportError, match=r"needs stable-baselines3: pip install .*train"):
        load_policy(str(path))


@pytest.mark.parametrize("content", ["text", "empty zip", "other zip"])
def test_files_that_are_no_models_are_refused(tmp_path, content):
    pytest.importorskip("stable_baselines3")
    path = tmp_path / "bad.zip"
    if content == "text":
        path.write_text("hello")
    else:
        with zipfile.ZipFile(path, "w") as archive:
            if content == "other zip":
                archive.writestr("data", "{}")
    with pytest.raises(ModelError, match=r"Expected .*bad\.zip to be a model saved by stable-baselines3"):
        load_policy(str(path))


@pytest.mark.parametrize("name", ["gone.zip", "gone.npz"])
def test_missing_files_are_refused(tmp_path, name):
    with pytest.raises(ModelError, match=r"Cannot read the policy file .*: No such file"):
        load_policy(str(tmp_path / name))


@pytest.fixture
def network_file(tmp_path) -> Path:
    """A network that drives straight on, made for static caches."""
    about = NetworkAbout(interface=InterfaceConfig(automatic_gripper=True), caches="static")
    straight = np.full(2, 0.5, np.float32)
    path = tmp_path / "straight.npz"
    Network((np.zeros((SIZE, 2), np.float32),), (straight,), about).save(path)
    return path


def test_networks_are_policies_by_their_path(network_file):
    policy = load_policy(str(network_file), {"digest": file_digest(network_file)})
    policy.reset(ENV.swarm_spec, np.random.default_rng(0))
    np.testing.assert_array_equal(policy.act(OBS, ACTIVE)[:, :2], 0.5)
    with pytest.raises(ModelError, match="changed since"):
        load_policy(str(network_file), {"digest": "0"})
    with pytest.raises(ModelError, match="a network file holds its own"):
        load_policy(f"{network_file}:decision_ticks=2")


def test_files_are_scored_under_the_name_of_the_file_in_the_world_they_are_made_for(network_file, tmp_path):
    world = scenario("warehouse_small", n_robots=3, n_objects=20)
    plan = score_question([network_file], world, budget=TINY, measures=["efficiency"]).plan
    assert plan.policies[0].label == "straight"
    assert {spec.scenario.caches for spec in plan.specs} == {"static"}
    assert all(spec.parameters == {"digest": file_digest(network_file)} for spec in plan.specs)
    assert all(RunSpec.from_json(spec.to_json()) == spec for spec in plan.specs)
    found = score(
        str(network_file), world, budget=TINY, measures=["efficiency"], out=tmp_path / "runs", jobs=1, progress=False
    )
    assert (found.policies, found.failures) == (("straight",), {})


@pytest.mark.parametrize(("folders", "labels"), [(("a", "b"), "short"), (("a/same", "b/same"), "whole")])
def test_files_of_equal_names_go_by_their_folders_or_paths(network_file, tmp_path, folders, labels):
    files = [tmp_path / folder / network_file.name for folder in folders]
    for file in files:
        file.parent.mkdir(parents=True)
        file.write_bytes(network_file.read_bytes())
    plan = score_question(files, scenario("warehouse_small", n_robots=3), budget=TINY).plan
    expected = {"short": ["a/straight.npz", "b/straight.npz"], "whole": [str(file) for file in files]}
    assert [policy.label for policy in plan.policies] == expected[labels]


def test_names_are_no_files():
    assert is_policy_file("a/b.ZIP")
    assert is_policy_file("b.npz")
    assert not is_policy_file("crw")
    assert not is_policy_file("crw.pyc")


def test_a_local_name_holds_for_a_while():
    with local_policy("mine", lambda: "policy"):
        assert policy_class("mine")() == "policy"
        with pytest.raises(ValueError, match="name of its own"), local_policy("mine", list):
            pass
    with pytest.raises(ValueError, match="Unknown policy 'mine'"):
        policy_class("mine")


@pytest.mark.parametrize("name", ["crw", "model.zip"])
def test_a_local_name_does_not_hide_another_policy(name):
    with pytest.raises(ValueError, match="name of its own"), local_policy(name, list):
        pass


def test_an_unknown_policy_is_told_how_one_becomes_known():
    with pytest.raises(ValueError, match=r"by its file: policy\.npz, model\.zip, my_module\.py:MyPolicy"):
        load_policy("my_module:StraightHome")
