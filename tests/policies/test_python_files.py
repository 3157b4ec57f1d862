"""Policies in plain Python files, `my_module.py:MyPolicy`: found, pinned, refused, and run in other processes, too."""

import sys
import textwrap
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import pytest

from swarm_forage_env.policies.model_files import ModelError
from swarm_forage_env.policies.python_files import PythonFileError, classes_of
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.runner import run_all
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario

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
        ("broken.py:Ahead", {}, r"Expected Python in .*broken\.py, got: invalid syntax"),
        ("mine.py:Deaf", {}, r"the methods reset and act, got Deaf without act\."),
        ("mine.py:Lame", {}, r"Cannot make mine\.py:Lame: RuntimeError: no legs \(line 30\)\."),
        ("mine.py:Ahead", {"spead": 1.0}, r"Expected parameters that mine\.py:Ahead takes, got \{'spead'"),
        ("mine.py:Ahead:observation=compact", {}, "without an interface"),
        ("other.py:Ahead", {}, r"Cannot read the policy file other\.py: No such file"),
    ],
)
def test_what_cannot_be_made_is_told(file, word, parameters, reason):
    file.with_name("broken.py").write_text("def (:\n")
    with pytest.raises((PythonFileError, ModelError), match=reason):
        load_policy(word, parameters)


@pytest.fixture
def two_folders(tmp_path, monkeypatch):
    """Two versions of a policy, each with its own module `nets_beside`, which one imports by way of another file."""
    monkeypatch.setattr(sys, "path", [*sys.path])
    for name in ("nets_beside", "helpers_beside"):
        monkeypatch.delitem(sys.modules, name, raising=False)
    for number in (1, 2):
        folder = tmp_path / f"v{number}"
        folder.mkdir()
        (folder / "nets_beside.py").write_text(f"NUMBER = {number}\n")
        first = "from nets_beside import NUMBER" if number == 1 else "import helpers_beside"
        (folder / "pol.py").write_text(
            f"{first}\n\n\nclass P:\n    def reset(self, spec, rng): ...\n    def act(self, obs, active): ...\n"
        )
    (tmp_path / "v2" / "helpers_beside.py").write_text(
        "def number():\n    from nets_beside import NUMBER\n    return NUMBER\n"
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
