"""The study files of docs/studies.md, carried out as a new user would: as they stand, in shorter runs."""

import re
import shutil
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from swarm_forage_env.policies import pretrained
from swarm_forage_env.studies.study_table import read_study

DOCS = Path(__file__).resolve().parents[2] / "docs"
BLOCKS = re.findall(r"^```toml\n(.*?)^```", (DOCS / "studies.md").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
FILES = {tomllib.loads(block)["name"]: block for block in BLOCKS if "scenario" in tomllib.loads(block)}
SHORT = "\n[budget.short]\nseeds = 1\nhorizon_s = 2.0\ninterval_s = 1.0\n"


def test_the_page_has_examples():
    assert [*FILES] == ["speed", "densities", "share"]


@pytest.mark.compiled
@pytest.mark.parametrize("name", FILES)
def test_a_study_file_of_the_page_runs(command, name):
    """With the trained policy beside it, where the page says that one is there."""
    Path("mine.toml").write_text(FILES[name] + SHORT)
    network = Path(next(iter(pretrained.__path__)), "ppo_warehouse_small.npz")
    if "my_policy.npz" in FILES[name]:
        shutil.copy(network, "my_policy.npz")
    code, _, err = command("study", "run", "mine.toml", "--budget", "short", "--jobs", "1", "--out", "done")
    assert code == 0, err
    table = read_study(Path("done"))
    assert all(state.is_complete for state in table.place_states())
    assert len(table.place_states()) == {"speed": 12, "densities": 9, "share": 5}[name], "every policy at every value"


@pytest.mark.compiled
def test_a_policy_of_ones_own_runs_in_a_study_by_its_name(tmp_path):
    """The class of one page and the entry point of another, as an installed package offers them."""
    (metadata,) = (tomllib.loads(block) for block in BLOCKS if "[project]" in block)
    project = metadata["project"]
    first = (DOCS / "policies.md").read_text(encoding="utf-8").split("## A first one")[1]
    (code, *_) = re.findall(r"^```python\n(.*?)^policy = ", first, re.MULTILINE | re.DOTALL)
    (module,) = metadata["tool"]["setuptools"]["py-modules"]
    (tmp_path / f"{module}.py").write_text(code)
    installed = tmp_path / f"{project['name']}-{project['version']}.dist-info"
    installed.mkdir()
    (installed / "METADATA").write_text(f"Name: {project['name']}\nVersion: {project['version']}\n")
    ((group, names),) = project["entry-points"].items()
    lines = (f"{name} = {target}" for name, target in names.items())
    (installed / "entry_points.txt").write_text("\n".join([f"[{group}]", *lines, ""]))
    (tmp_path / "mine.toml").write_text(
        'name = "mine"\nscenario = "warehouse_small"\npolicies = ["crw", "my_policy"]\nrules = ["described"]\n'
        '[[axis]]\nfield = "max_speed_mps"\nvalues = [0.05, 0.1]\n' + SHORT
    )
    words = ("-m", "swarm_forage_env.cli", "study", "run", "mine.toml", "--jobs", "1", "--out", "done")
    done = subprocess.run([sys.executable, *words], cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert done.returncode == 0, done.stderr
    assert "4 of 4 runs done" in done.stdout
