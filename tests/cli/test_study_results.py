"""The commands on results of studies: verdict and plot."""

import json
from pathlib import Path

import pytest

from tests.support.pictures import words_in

FILE = """
name = "S1a"
scenario = "warehouse_small"
policies = [
    { policy = "random", label = "crw" },
    { policy = "random", label = "dpo" },
    { policy = "random", label = "stochm" },
    { policy = "random", label = "stochx" },
]
rules = ["described"]

[set]
n_objects = 20

[[axis]]
criterion = "population_size"
values = [1, 2]

[budget.tiny]
seeds = 2
horizon_s = 4.0
interval_s = 2.0
"""


@pytest.fixture
def ran(command):
    """The command in a folder with a study that has been run, in `done`."""
    Path("S1a.toml").write_text(FILE)
    assert command("study", "run", "S1a.toml", "--jobs", "1", "--out", "done")[0] == 0
    return command


def test_claims_are_held_against_a_study(ran):
    code, out, err = ran("study", "verdict", "done", "--file", "there/verdict.json")
    assert code == 0
    assert "what is behind the answers" in out
    assert "wait for runs" in out
    assert "scoring S1a" in err
    assert "note: S1a: other settings than those of the paper's set with this name" in err
    document = json.loads(Path("there/verdict.json").read_text())
    assert [study["name"] for study in document["studies"]] == ["S1a"]
    answers = {(one["claim"], one["reading"]): one["answer"] for one in document["claims"]}
    assert answers["V1", "amounts"] == "supported", "a formula alone answers it"
    assert answers["E4", "amounts"] == answers["H22", "shares"] == "no runs"
    assert ran("study", "verdict", "done/S1a.parquet")[1] == out


def test_figures_for_a_paper_have_its_width_and_no_headline(ran):
    style = ("--format", "svg", "--width-in", "3.5", "--no-title")
    assert ran("study", "plot", "done", "--out", "paper", *style)[0] == 0
    endings = {path.suffix for path in Path("paper").iterdir()}
    assert endings == {".svg", ".csv"}
    for file in Path("paper").glob("*.svg"):
        assert 'width="252pt"' in file.read_text(), "72 points per inch"
    words = words_in(Path("paper/S1a_raw_performance_described.svg"))
    assert {"CRW", "robots N"} <= {*words}
    assert not any("higher is better" in line for line in words)
