"""The commands on results of studies: verdict, plot."""

import json
from pathlib import Path

import pytest

FILE = """
name = "S1a"
scenario = "warehouse_small"
policies = [
    { policy = "random", label = "crw" },
    { policy = "random", label = "dpo" },
    { policy = "random", label = "stochm" },
    { policy = "random", label = "stochx" },
]
readings = ["described"]

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
    assert command("study", "run", "S1a.toml", "--workers", "1", "--out", "done")[0] == 0
    return command


def test_claims_are_held_against_a_study(ran):
    code, out, err = ran("study", "verdict", "done", "--json", "there/verdict.json")
    assert code == 0
    assert "from formulas alone" in out
    assert "reading described, measures sierra" in out
    assert "E4, E5, E6, C1, C2, C3, P1, X3: for S1b" in out
    assert "scoring S1a" in err
    document = json.loads(Path("there/verdict.json").read_text())
    assert [study["name"] for study in document["studies"]] == ["S1a"]
    answers = {(one["claim"], one["variant"]): one["answer"] for one in document["verdicts"]}
    assert answers["P2", "corrected"] == "undecided", "two runs decide nothing"
    assert answers["V1", "corrected"] == "supported"
    assert {one["claim"] for one in document["waiting"]} >= {"E4", "X1"}
    assert ran("study", "verdict", "done/S1a.parquet")[1] == out


def test_a_study_of_ones_own_has_no_claims(ran):
    Path("mine.toml").write_text(FILE.replace('"S1a"', '"mine"'))
    assert ran("study", "run", "mine.toml", "--workers", "1", "--out", "mine")[0] == 0
    code, _, err = ran("study", "verdict", "mine")
    assert code == 2
    assert "Expected studies of the paper's sets" in err


def test_figures_are_drawn_with_their_numbers(ran):
    code, out, _ = ran("study", "plot", "done", "--out", "figures", "--band", "sd", "--variant", "corrected,sierra")
    assert code == 0
    assert sorted(out.split()) == sorted(str(path) for path in Path("figures").iterdir())
    names = {path.name for path in Path("figures").iterdir()}
    assert {f"S1a_raw_performance_described{suffix}" for suffix in (".svg", ".png", ".csv")} <= names
    assert "S1a_raw_performance_described_sierra.svg" in names
    assert Path("figures/S1a_raw_performance_described.csv").read_text().startswith("reading,policy,population_size,")


def test_what_cannot_be_drawn_is_told(ran):
    code, _, err = ran("study", "plot", "done", "--band", "cd")
    assert code == 2
    assert "band 'cd'" in err
    words = FILE.replace("values = [1, 2]", 'values = ["none", "static"]').replace("criterion", "field")
    Path("words.toml").write_text(words.replace("population_size", "caches"))
    assert ran("study", "run", "words.toml", "--workers", "1", "--out", "words")[0] == 0
    code, _, err = ran("study", "plot", "words")
    assert code == 2
    assert "Expected a study with finished runs and numbers on its last axis, got S1a" in err
