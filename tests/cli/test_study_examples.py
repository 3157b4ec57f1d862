"""The study files of docs/studies.md, carried out as a new user would: as they stand, in shorter runs."""

import re
import shutil
import tomllib
from pathlib import Path

import pytest

from swarm_forage_env.policies import pretrained
from swarm_forage_env.studies.results import read_study

DOCS = Path(__file__).resolve().parents[2] / "docs"
BLOCKS = re.findall(r"^```toml\n(.*?)^```", (DOCS / "studies.md").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
FILES = {tomllib.loads(block)["name"]: block for block in BLOCKS if "scenario" in tomllib.loads(block)}
SHORT = "\n[budget.short]\nseeds = 1\nhorizon_s = 2.0\ninterval_s = 1.0\n"


def test_the_page_has_examples():
    assert [*FILES] == ["speed", "densities"]


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
    places = table.places()
    assert places.select("failed", "missing").sum().row(0) == (0, 0)
    assert len(places) == {"speed": 12, "densities": 9, "share": 5}[name], "every policy at every value"
