"""Policies by name, functions as policies, the policies of the package, and those in plain files of Python."""

import subprocess
import sys
import textwrap
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies import pretrained
from swarm_forage_env.policies.model_files import ModelError
from swarm_forage_env.policies.network import Network
from swarm_forage_env.policies.python_files import PythonFileError, classes_of
from swarm_forage_env.policies.registry import file_of, from_callable, load_policy, policy_file, policy_label
from swarm_forage_env.runs.runner import run_all
from swarm_forage_env.runs.spec import plan_run
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
    assert (file_of(word), policy_label(word), found.interface()) == (path, label, interface)
    with pytest.raises(ConfigError, match=r"interface of a\.zip as key=value, got 'x'"):
        policy_file("a.zip:decision_ticks=2,x").interface()


@pytest.mark.parametrize(
    ("actions", "message"),
    [
        (np.full((4, 3), 0.5 + 1j), "real numbers are needed, not complex128"),
        ([["a", "b", "c"]] * 4, "real numbers are needed, not <U1"),
        ([[0.0, 0.0, 0.0], [0.0]], "inhomogeneous"),
        (np.zeros((4, 2)), r"actions with shape \(n_robots, 3\) = \(4, 3\), got \(4, 2\)"),
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


CODE = """
    from dataclasses import dataclass

    import numpy as np

    from speeds_beside import FULL


    @dataclass
    class Ahead:
        speed: float = FULL
        reads = ()
        caches = "static"

        def reset(self, spec, rng):
            if self.speed < 0.0:
                raise RuntimeError("this way round only")
            self.shape = (spec.n_robots, 3)

        def act(self, obs, active):
            return np.full(self.shape, self.speed, np.float32)


    def slow():
        return Ahead(speed=0.1)


    class Lame:
        def __init__(self):
            raise RuntimeError("no\\nlegs")


    class Deaf:
        def reset(self, spec, rng): ...
"""


@pytest.fixture
def file(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "speeds_beside", raising=False)
    (tmp_path / "speeds_beside.py").write_text("FULL = 0.5\n")
    path = tmp_path / "mine.py"
    path.write_text(textwrap.dedent(CODE))
    return path


def test_a_class_in_a_file_is_a_policy(file):
    assert load_policy("mine.py:Ahead").speed == 0.5
    assert load_policy(f"{file}:Ahead", {"speed": 0.25}).speed == 0.25
    assert load_policy("mine.py:slow").speed == 0.1, "a function that returns a policy"
    assert classes_of(file) == ("Ahead", "Lame", "Deaf")


def test_path_and_content_are_the_identity_of_its_runs(file):
    world = scenario("warehouse_small", n_robots=2, n_objects=10, horizon_s=200.0)
    spec = plan_run(world, "mine.py:Ahead")
    assert (spec.policy, spec.scenario.caches) == (f"{file}:Ahead", "static")
    file.write_text(file.read_text().replace("= FULL", "= 0.4"))
    changed = plan_run(world, "mine.py:Ahead")
    assert changed.run_id != spec.run_id
    assert load_policy(changed.policy, changed.parameters) is not None
    with pytest.raises(ModelError, match="a file that has changed since"):
        load_policy(spec.policy, spec.parameters)


def test_another_process_finds_it(file):
    world = scenario("warehouse_small", n_robots=2, n_objects=10, horizon_s=2.0, interval_s=1.0)
    specs = [plan_run(world, "mine.py:Ahead", seed=seed) for seed in (1, 2)]
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        result = run_all(specs, executor=executor)
    assert [failure.error for failure in result.failures.values()] == []
    assert [record.spec.policy for record in result.records.values()] == [f"{file}:Ahead"] * 2


@pytest.mark.parametrize(
    ("word", "parameters", "reason"),
    [
        ("mine.py", {}, r"Expected the class with its file, as mine\.py:MyPolicy.* Classes in it: Ahead, Lame, Deaf\."),
        ("mine.py:Ahaed", {}, r"to have a class Ahaed\. Did you mean 'Ahead'\?"),
        ("broken.py:Ahead", {}, r"Cannot run .*broken\.py: SyntaxError: invalid syntax \(broken\.py, line 1\)"),
        ("mine.py:Deaf", {}, r"the methods reset and act, got Deaf without act\."),
        ("mine.py:Lame", {}, r"Cannot make mine\.py:Lame: RuntimeError: no legs \(.*mine\.py, line 30\)\."),
        ("mine.py:Ahead", {"spead": 1.0}, r"Expected parameters that mine\.py:Ahead takes, got \{'spead'"),
        ("mine.py:Ahead:observation=compact", {}, r"takes, got \{'interface'"),
        ("other.py:Ahead", {}, r"Cannot read the policy file other\.py: No such file"),
    ],
)
def test_what_cannot_be_made_is_told(file, word, parameters, reason):
    file.with_name("broken.py").write_text("def (:\n")
    with pytest.raises((PythonFileError, ModelError), match=reason):
        load_policy(word, parameters)


@pytest.fixture
def two_folders(tmp_path, monkeypatch):
    """Two versions of a policy, each with its own module `nets_beside`."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    monkeypatch.delitem(sys.modules, "nets_beside", raising=False)
    for number in (1, 2):
        folder = tmp_path / f"v{number}"
        folder.mkdir()
        (folder / "nets_beside.py").write_text(f"NUMBER = {number}\n")
        (folder / "pol.py").write_text(
            "from nets_beside import NUMBER\n\n\n"
            "class P:\n    def reset(self, spec, rng): ...\n    def act(self, obs, active): ...\n"
        )
    return tmp_path


def test_a_module_of_another_folder_is_never_taken_for_the_one_beside(two_folders):
    load_policy(f"{two_folders}/v1/pol.py:P")
    with pytest.raises(
        PythonFileError, match=r"v2/pol\.py to import the module nets_beside that lies beside .* of .*/v1; rename"
    ):
        load_policy(f"{two_folders}/v2/pol.py:P")
    load_policy(f"{two_folders}/v1/pol.py:P")


def test_a_file_beside_a_policy_hides_nothing_that_is_installed(two_folders):
    (two_folders / "v1" / "numpy.py").write_text("")
    file = two_folders / "v1" / "pol.py"
    file.write_text("import numpy as np\n" + file.read_text() + "    one = np.ones(1)\n")
    assert load_policy(f"{file}:P").one == 1.0
