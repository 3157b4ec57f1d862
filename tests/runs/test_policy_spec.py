"""Policies as they are run: what may be given as one, and by which names they are told apart."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.model_files import file_digest
from swarm_forage_env.policies.network import Network, NetworkAbout
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.spec import PolicySpec, plan_run, policy_spec, policy_specs


class ForStatic(RandomPolicy):
    caches = "static"


def forward(obs):
    return np.ones((len(obs), 3), np.float32)


@pytest.fixture
def network_in(tmp_path):
    """Writes a network with random weights into a folder of its own."""

    def write(folder, seed=0):
        path = tmp_path / folder / "net.npz"
        path.parent.mkdir(exist_ok=True)
        weights = np.random.default_rng(seed).normal(size=(23, 6)).astype(np.float32)
        interface = InterfaceConfig(observation="compact", actions="discrete", automatic_gripper=True)
        about = NetworkAbout(interface=interface, activation="tanh", samples=False, caches="static")
        Network((weights,), (np.zeros(6, np.float32),), about).save(path)
        return path

    return write


def test_a_name_is_looked_up_with_the_caches_that_it_states():
    assert policy_spec("random") == PolicySpec(label="random", policy="random")
    assert policy_spec("stochm").caches == "static"
    chosen = policy_spec("stochm", label="mine", parameters={"wander_speed_mps": 0.05}, caches="none")
    assert (chosen.label, chosen.policy, chosen.caches) == ("mine", "stochm", "none")
    assert chosen.parameters == {"wander_speed_mps": 0.05}
    assert chosen.is_named
    assert chosen.factory is None


def test_a_file_is_pinned_by_its_digest(network_in):
    path = network_in("a")
    found = policy_spec(path)
    assert found == policy_spec(str(path))
    assert (found.label, found.policy, found.caches) == ("net", str(path), "static")
    assert found.parameters == {"digest": file_digest(path)}


def test_the_content_of_a_file_is_part_of_the_identity_of_its_runs(network_in, monkeypatch):
    path = network_in("a")
    monkeypatch.chdir(path.parent)
    first = plan_run("warehouse_small", "net.npz")
    assert first == plan_run("warehouse_small", str(path))
    assert first == plan_run("warehouse_small", path, parameters=first.parameters)
    assert first.scenario.caches == "static"
    network_in("a", seed=1)
    assert plan_run("warehouse_small", path).run_id != first.run_id
    with pytest.raises(ValueError, match="a file that has changed since"):
        plan_run("warehouse_small", path, parameters=first.parameters)


@pytest.mark.parametrize(
    ("given", "label", "caches"),
    [
        (ForStatic, "ForStatic", "static"),
        (ForStatic(), "ForStatic", "static"),
        (forward, "forward", None),
    ],
)
def test_what_only_this_process_can_build_has_a_factory(given, label, caches):
    found = policy_spec(given)
    assert (found.label, found.policy, found.caches) == (label, label, caches)
    assert not found.is_named, "nothing tells whose runs these are"
    policy = found.factory()
    assert policy is not given
    assert callable(policy.act)
    assert policy_spec(given, label="mine").is_named


def test_each_run_of_an_object_has_a_copy_of_its_own():
    given = RandomPolicy()
    first, second = (policy_spec(given).factory() for _ in range(2))
    assert first is not second


@pytest.mark.parametrize(
    ("given", "options", "error", "message"),
    [
        ("crv", {}, ConfigError, r"Unknown policy 'crv'\. Did you mean 'crw'"),
        ("gone.npz", {}, ConfigError, r"gone\.npz"),
        (7, {}, TypeError, "Expected a policy as a registered name, .* got 7"),
        (forward, {"parameters": {"a": 1}}, ValueError, "parameters with a name, a file or a class only"),
    ],
)
def test_what_is_no_policy_is_refused(given, options, error, message):
    with pytest.raises(error, match=message):
        policy_spec(given, **options)


def test_several_have_names_of_their_own():
    assert [spec.label for spec in policy_specs(["crw", "dpo"])] == ["crw", "dpo"]
    assert [spec.label for spec in policy_specs({"one": policy_spec("crw")})] == ["one"]
    named = policy_specs({"slow": "crw", "mine": forward}, caches="dynamic")
    assert [(spec.label, spec.policy) for spec in named] == [("slow", "crw"), ("mine", "mine")]
    assert {spec.caches for spec in named} == {"dynamic"}
    assert all(spec.is_named for spec in named)
    parameters = {"wander_speed_mps": 0.05}
    assert [dict(spec.parameters) for spec in policy_specs(["crw", "dpo"], parameters=parameters)] == [parameters] * 2


def test_files_of_one_name_are_told_apart_by_their_folders(network_in):
    one, other = network_in("a"), network_in("b")
    assert [spec.label for spec in policy_specs([one, other])] == ["a/net.npz", "b/net.npz"]
    assert [spec.label for spec in policy_specs([one, "crw"])] == ["net", "crw"]


@pytest.mark.parametrize("given", [["crw", "crw"], [forward, forward], ["crw", "dpo", "crw"]])
def test_equal_names_are_refused(given):
    with pytest.raises(ConfigError, match=r"policies of different names, got .*; give a mapping from names"):
        policy_specs(given)
