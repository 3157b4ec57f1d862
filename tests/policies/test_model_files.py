"""Trained policies in files: found by their suffix, opened with care, applied as they were trained."""

import dataclasses
import shutil
import sys
import zipfile
from pathlib import Path

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies import model_files
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface, any_swarm
from swarm_forage_env.policies.model_files import (
    MODEL_NOTE,
    ModelError,
    ModelPolicy,
    file_digest,
)
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.spec import RunSpec, plan_run, policy_spec, policy_specs
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.pettingzoo import parallel_env
from tests.support.branches import pickled
from tests.support.small_files import small_file

ENV = parallel_env("warehouse_small", n_robots=4, n_objects=20)
OBS = np.random.default_rng(1).uniform(-1.0, 1.0, (4, ENV.layout.size)).astype(np.float32)
ACTIVE = np.ones(4, bool)
SIZE = ENV.layout.size
EACH_TICK = {"interface": {"decision_ticks": 1}}
NUMBERED = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=3)


class Stage(gymnasium.Env):
    """Spaces without an environment behind them, to build models from."""

    def __init__(self, seen, done):
        self.observation_space, self.action_space = seen, done


def box(*shape):
    return spaces.Box(-1.0, 1.0, shape, np.float32)


def model(
    algorithm, path: Path, interface: InterfaceConfig | None = None, *, seen=None, done=None, note=None, **options
):
    """Save an untrained model; returns it and its file."""
    library = pytest.importorskip("stable_baselines3")
    if interface is not None:
        seen, done = any_swarm(interface).observation_space, any_swarm(interface).action_space
    stage = Stage(seen or box(SIZE), done or box(3))
    made = getattr(library, algorithm)("MlpPolicy", stage, device="cpu", seed=1, **options)
    if note is not None:
        setattr(made, MODEL_NOTE, note)
    made.save(path / "model.zip")
    return made, path / "model.zip"


def note(interface=NUMBERED, **changes) -> dict:
    return {"interface": dataclasses.asdict(interface), "caches": "static", "samples": False} | changes


def started(path, seed=0, **parameters) -> ModelPolicy:
    policy = load_policy(str(path), parameters)
    policy.reset(ENV.swarm_spec, np.random.default_rng(seed))
    return policy


@pytest.mark.parametrize(
    ("algorithm", "options"),
    [
        ("PPO", {"use_sde": True, "policy_kwargs": {"net_arch": [16]}}),
        ("SAC", {"buffer_size": 10}),
    ],
)
def test_actions_are_the_best_ones_of_the_algorithm_and_of_its_copies(tmp_path, algorithm, options):
    made, path = model(algorithm, tmp_path, **options)
    policy = started(path, interface={"decision_ticks": 2})
    actions = policy.act(OBS, ACTIVE)
    np.testing.assert_array_equal(actions, made.predict(OBS, deterministic=True)[0])
    assert (actions.shape, actions.dtype) == ((4, 3), np.float32)
    if "use_sde" in options:  # torch does not copy its noise
        return
    twin = pickled(policy)
    for obs in (OBS, -OBS, OBS / 2):
        np.testing.assert_array_equal(twin.act(obs, ACTIVE), policy.act(obs, ACTIVE))


DISCRETE = {"actions": "discrete", "automatic_gripper": True}


@pytest.mark.parametrize(
    ("algorithm", "fields", "said"),
    [
        ("DQN", {"observation": "compact", **DISCRETE}, {}),
        ("PPO", {}, {"neighbours_seen": 3, "neighbour_range_m": 1.5}),
    ],
)
def test_what_spaces_show_need_not_be_said(tmp_path, algorithm, fields, said):
    options = {"buffer_size": 10} if algorithm == "DQN" else {}
    interface = InterfaceConfig(**fields, **said)
    _, path = model(algorithm, tmp_path, interface, **options)
    assert load_policy(str(path), {"interface": {**said, "decision_ticks": 1}})._config == interface


def test_models_with_probabilities_draw_by_the_chance_of_their_run(tmp_path):
    made, path = model("PPO", tmp_path, dataclasses.replace(NUMBERED, decision_ticks=1))
    rows = np.repeat(OBS[:1], 4, axis=0)
    drawn = [[started(path, seed, **EACH_TICK).act(rows, ACTIVE).copy() for _ in range(2)] for seed in range(6)]
    assert all(np.array_equal(*pair) for pair in drawn), "the same chance, the same actions"
    assert len({pair[0].tobytes() for pair in drawn}) > 3
    _, path = model("PPO", tmp_path, NUMBERED, note=note())
    bound = LearnerInterface(NUMBERED, ENV.swarm_spec)
    best, _ = made.predict(bound.observe(rows), deterministic=True)
    np.testing.assert_array_equal(started(path).act(rows, ACTIVE), bound.command(best, rows))


def test_a_model_of_the_whole_swarm_sees_all_rows_at_once(tmp_path):
    made, path = model("A2C", tmp_path, seen=box(4, SIZE), done=box(4, 3))
    policy = started(path, **EACH_TICK)
    np.testing.assert_array_equal(policy.act(OBS, ACTIVE), made.predict(OBS, deterministic=True)[0])
    other = parallel_env("warehouse_small", n_robots=5, n_objects=20)
    with pytest.raises(ModelError, match=r"the 4 robots that .* steers, got 5"):
        load_policy(str(path), EACH_TICK).reset(other.swarm_spec, np.random.default_rng(0))


@pytest.mark.parametrize(
    ("made_with", "parameters", "reason"),
    [
        (
            {"seen": box(7)},
            EACH_TICK,
            r"goes from Box\(7\) to Box\(3\)\. Say what .*model\.zip:neighbours_seen=3.*note_interface",
        ),
        ({}, {}, r"ticks of a decision for model\.zip.* say model\.zip:decision_ticks=1"),
        ({}, {"interface": {"observation": "compact", "decision_ticks": 1}}, r"goes from Box\(\d+\) to Box\(3\)"),
        (
            {"interface": NUMBERED},
            {"interface": InterfaceConfig()},
            r"to Box\(3\), as the parameter interface says; model\.zip goes",
        ),
        ({"interface": NUMBERED, "note": note(InterfaceConfig())}, {}, r"as the note in model\.zip says"),
        (
            {"interface": NUMBERED, "note": note() | {"interface": {"decision_tick": 2}}},
            {},
            "Did you mean 'interface.decision_ticks'",
        ),
        ({"interface": NUMBERED, "note": note(samples=None)}, {}, "samples to be True or False"),
    ],
)
def test_a_model_that_does_not_do_what_an_interface_says_is_refused_when_it_is_opened(
    tmp_path, made_with, parameters, reason
):
    _, path = model("A2C", tmp_path, **made_with)
    with pytest.raises(ModelError, match=reason):
        load_policy(str(path), parameters)


def test_a_model_with_a_note_runs_as_it_was_trained(tmp_path):
    made, path = model("A2C", tmp_path, NUMBERED, note=note())
    policy, bound = started(path), LearnerInterface(NUMBERED, ENV.swarm_spec)
    assert (policy.caches, policy.reads) == ("static", NUMBERED.reads)
    wheels = [policy.act(sign * OBS, ACTIVE)[:, :2].copy() for sign in (1.0, -1.0, -1.0, -1.0)]
    expected, _ = made.predict(bound.observe(OBS), deterministic=True)
    np.testing.assert_array_equal(wheels[0], bound.command(expected, OBS)[:, :2])
    np.testing.assert_array_equal(wheels[:3], [wheels[0]] * 3)
    assert np.any(wheels[3] != wheels[2])
    policy = started(path, interface={"decision_ticks": 1})  # the rest is as noted
    first, second = (policy.act(sign * OBS, ACTIVE)[:, :2].copy() for sign in (1.0, -1.0))
    assert np.any(first != second)
    _, path = model("A2C", tmp_path)
    assert not hasattr(load_policy(str(path), EACH_TICK), "caches"), "only a note tells them"


def test_an_interface_is_said_with_the_file(tmp_path):
    _, path = model("A2C", tmp_path, NUMBERED, note=note())
    world = scenario("warehouse_small", n_robots=4)
    said = plan_run(world, f"{path}:decision_ticks=2,site_memory=false")
    given = {"interface": {"decision_ticks": 2, "site_memory": False}}
    assert said == plan_run(world, str(path), parameters=given)
    assert RunSpec.from_mapping(said.to_mapping()) == said
    assert policy_spec(f"{path}:decision_ticks=7").label == "model"
    for once in (load_policy, lambda words, given: policy_spec(words, parameters=given)):
        with pytest.raises(ConfigError, match="once, got it with the file and as a parameter"):
            once(f"{path}:decision_ticks=2", given)


class Counting:
    """Stands in for the network of a recurrent model: it turns faster in every decision of a run."""

    observation_space, action_space = box(SIZE), box(3)

    def predict(self, rows, state=None, *, deterministic):
        assert deterministic
        decisions = np.zeros((len(rows), 1)) if state is None else state[0]
        return np.repeat(0.1 * decisions, 3, axis=1).astype(np.float32), (decisions + 1,)


def test_a_recurrent_model_remembers_within_a_run(monkeypatch, tmp_path):
    pytest.importorskip("torch")
    path = tmp_path / "model.zip"
    path.write_bytes(b"recurrent")
    monkeypatch.setattr(model_files, "_open_model", lambda path, digest: (Counting(), None))
    policy = started(path, interface={"decision_ticks": 2})
    wheels = [policy.act(OBS, ACTIVE)[:, 0].copy() for _ in range(5)]
    np.testing.assert_allclose(wheels, np.repeat([[0.0], [0.0], [0.1], [0.1], [0.2]], 4, axis=1))
    policy.reset(ENV.swarm_spec, np.random.default_rng(0))
    np.testing.assert_array_equal(policy.act(OBS, ACTIVE), 0.0)


def test_files_that_are_missing_changed_or_no_models_are_refused(tmp_path, monkeypatch):
    _, path = model("A2C", tmp_path)
    digest = file_digest(path)
    load_policy(str(path), {"digest": digest, **EACH_TICK})
    model("A2C", tmp_path, policy_kwargs={"net_arch": [5]})
    with pytest.raises(ModelError, match=f"digest {digest}.* changed since .*plan the run again"):
        load_policy(str(path), {"digest": digest})
    bad = tmp_path / "bad.zip"
    bad.write_text("hello")
    with pytest.raises(ModelError, match=r"Expected .*bad\.zip to be a model saved by stable-baselines3"):
        load_policy(str(bad))
    with zipfile.ZipFile(bad, "w") as archive:
        archive.writestr("data", "{}")
    with pytest.raises(ModelError, match=r"Expected .*bad\.zip to be a model saved by stable-baselines3"):
        load_policy(str(bad))
    for name in ("gone.zip", "gone.npz"):
        with pytest.raises(ModelError, match=r"Cannot read the policy file .*: No such file"):
            load_policy(str(tmp_path / name))
    bad.write_text("not opened before")
    monkeypatch.setitem(sys.modules, "stable_baselines3.common.policies", None)
    with pytest.raises(ImportError, match=r"needs stable-baselines3: pip install .*train"):
        load_policy(str(bad))


def test_a_network_file_holds_its_own_interface_and_goes_by_its_folder_or_path_beside_others_of_its_name(tmp_path):
    files = [tmp_path / folder / "net.npz" for folder in ("a", "b", "a/same", "b/same")]
    for file in files:
        file.parent.mkdir(exist_ok=True)
        shutil.copy(small_file("network.npz"), file)
    with pytest.raises(ModelError, match="a network file holds its own"):
        load_policy(f"{files[0]}:decision_ticks=2")
    assert [spec.label for spec in policy_specs(files[:2])] == ["a/net.npz", "b/net.npz"]
    assert [spec.label for spec in policy_specs(files[2:])] == [str(file) for file in files[2:]]
    assert [spec.label for spec in policy_specs([files[0], "crw"])] == ["net", "crw"]
