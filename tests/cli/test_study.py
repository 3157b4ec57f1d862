"""The commands of studies: what is there, run, interrupt, status."""

import json
import re
import shutil
import tomllib
from pathlib import Path

import pytest

from swarm_forage_env.policies import pretrained
from swarm_forage_env.studies.results import read_study

FILE = """
name = "mine"
title = "Two sizes"
scenario = "warehouse_small"
policies = ["random"]

[set]
n_objects = 20

[[axis]]
criterion = "population_size"
values = [2, 3]

[budget.tiny]
seeds = 2
horizon_s = 4.0
interval_s = 2.0
"""
RUN = ("study", "run", "mine.toml", "--jobs", "1")
FOLDER = Path("results/studies/mine_tiny")


@pytest.fixture
def written(command):
    """The command in a folder with a study file."""
    Path("mine.toml").write_text(FILE)
    return command


def test_shards_are_not_packed_until_all_runs_are_asked_for(written):
    code, out, err = written(*RUN, "--shard", "1/2", "--rules", "described", "--out", "here")
    assert code == 0
    assert "packed" not in err
    code, out, _ = written("study", "status", "here")
    assert code == 1
    assert out.splitlines()[0] == "mine, budget tiny: 2 of 4 runs done, 2 missing"
    assert out.splitlines()[1] == "0 of 2 conditions complete"
    assert re.search(r"^described +random +2 +1 +0 +1$", out, re.MULTILINE)
    code, out, _ = written("study", "status", "here", "--json")
    assert code == 1
    assert [place["missing"] for place in json.loads(out)["conditions"]] == [1, 1]
    code, _, err = written(*RUN, "--rules", "described", "--out", "here")
    assert code == 0
    assert "2 of 4 runs stored already" in err, "the other half alone is made"
    assert read_study("here/mine.parquet").spec.name == "mine"


def test_failures_are_told_with_the_command_that_makes_them_again(written):
    Path("mine.toml").write_text(FILE.replace('"random"', '{ policy = "random", parameters = { speed = 3 } }'))
    code, out, err = written(*RUN, "--seeds", "3")
    assert code == 1
    assert "0 of 12 runs done, 12 failed" in out
    assert "and 2 more" in out
    rerun = re.search(rf"again, alone: swarm-forage (rerun {FOLDER}/runs/failures/.*)", err)[1].split()
    code, out, _ = written("study", "status", str(FOLDER / "mine.parquet"))
    assert code == 1
    assert "random, seed 0: TypeError" in out
    code, _, err = written(*rerun)
    assert code == 1
    assert "takes no arguments" in err.splitlines()[-2]


DOCS = Path(__file__).resolve().parents[2] / "docs"
BLOCKS = re.findall(r"^```toml\n(.*?)^```", (DOCS / "studies.md").read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
(FILE,) = (block for block in BLOCKS if "scenario" in tomllib.loads(block))
SHORT = "\n[budget.short]\nseeds = 1\nhorizon_s = 2.0\ninterval_s = 1.0\n"


@pytest.mark.slow
def test_the_study_file_of_the_page_runs(command):
    """With a trained policy beside it."""
    Path("mine.toml").write_text(FILE + SHORT)
    shutil.copy(Path(next(iter(pretrained.__path__)), "ppo_warehouse_small.npz"), "my_policy.npz")
    code, _, err = command("study", "run", "mine.toml", "--budget", "short", "--jobs", "1", "--out", "done")
    assert code == 0, err
    table = read_study(Path("done"))
    places = table.places()
    assert places.select("failed", "missing").sum().row(0) == (0, 0)
    assert len(places) == 12, "every policy at every value"
