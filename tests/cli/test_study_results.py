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
    assert "without any run" in out
    assert "measures corrected" in out
    assert "E4, E5, E6, E10, C1, C2, C3, C6, P1, H1, H3" in out, "claims and intuitions that wait for S1b"
    assert "scoring S1a" in err
    assert "note: S1a has the name of one of the paper's sets and other settings" in err
    document = json.loads(Path("there/verdict.json").read_text())
    assert [study["name"] for study in document["studies"]] == ["S1a"]
    answers = {(one["claim"], one["variant"]): one["answer"] for one in document["verdicts"]}
    assert answers["P2", "corrected"] == "undecided", "two runs decide nothing"
    assert answers["V1", "corrected"] == "supported"
    assert {one["claim"] for one in document["waiting"]} >= {"E4", "X1"}
    assert {one["claim"] for one in document["intuitions_waiting"]} >= {"H1", "H22"}
    assert ran("study", "verdict", "done/S1a.parquet")[1] == out
    code, short, _ = ran("study", "verdict", "done", "--table")
    assert (code, out.startswith(short.rstrip())) == (0, True)
    assert "all claims at a glance" in short
    assert "why" not in short


def test_a_study_of_ones_own_has_no_claims(ran):
    Path("mine.toml").write_text(FILE.replace('"S1a"', '"mine"'))
    assert ran("study", "run", "mine.toml", "--jobs", "1", "--out", "mine")[0] == 0
    code, _, err = ran("study", "verdict", "mine")
    assert code == 2
    assert "Expected studies of the paper's sets" in err


def test_figures_are_drawn_with_their_numbers(ran):
    code, out, _ = ran("study", "plot", "done", "--out", "figures", "--band", "--variant", "corrected,paper")
    assert code == 0
    assert sorted(out.split()) == sorted(str(path) for path in Path("figures").iterdir())
    names = {path.name for path in Path("figures").iterdir()}
    assert {f"S1a_raw_performance_described{suffix}" for suffix in (".svg", ".png", ".csv")} <= names
    assert any(name.endswith("_described_paper.svg") for name in names)
    assert Path("figures/S1a_raw_performance_described.csv").read_text().startswith("rules,policy,population_size,")


def test_figures_for_a_paper_have_its_width_and_no_headline(ran):
    style = ("--format", "svg", "--width", "3.5", "--font-size", "8", "--no-title")
    assert ran("study", "plot", "done", "--out", "paper", *style)[0] == 0
    endings = {path.suffix for path in Path("paper").iterdir()}
    assert endings == {".svg", ".csv"}
    for file in Path("paper").glob("*.svg"):
        assert 'width="252pt"' in file.read_text(), "72 points per inch"
    words = words_in(Path("paper/S1a_raw_performance_described.svg"))
    assert {"CRW", "robots N"} <= {*words}
    assert not any("higher is better" in line for line in words)


def test_what_cannot_be_drawn_is_told(ran):
    code, _, err = ran("study", "plot", "done", "--format", "gif")
    assert code == 2
    assert "format 'gif'" in err
    words = FILE.replace("values = [1, 2]", 'values = ["none", "static"]').replace("criterion", "field")
    Path("words.toml").write_text(words.replace("population_size", "caches"))
    assert ran("study", "run", "words.toml", "--jobs", "1", "--out", "words")[0] == 0
    code, _, err = ran("study", "plot", "words")
    assert code == 2
    assert "Expected a study with finished runs and numbers on its last axis, got S1a" in err


def test_the_place_of_results_is_looked_at_before_the_work(ran, monkeypatch):
    Path("all.json").mkdir()
    work = "metrics.scoring.study_verdict.study_panels"
    monkeypatch.setattr(work, lambda *_, **__: pytest.fail("work was done"))
    told = "swarm-forage: Expected a file to write, got a folder: all.json\n"
    assert ran("study", "verdict", "done", "--file", "all.json") == (1, "", told)


def test_a_disk_that_fills_up_leaves_no_half_page(ran, monkeypatch):
    def half(self, text, **_):
        self.write_bytes(text.encode()[: len(text) // 2])
        raise OSError(28, "No space left on device", str(self))

    page = Path("page.md")
    page.write_text("an earlier one")
    before = set(Path().iterdir())
    monkeypatch.setattr(Path, "write_text", half)
    code, _, err = ran("study", "verdict", "done", "--file", str(page))
    assert (code, err.splitlines()[-1]) == (1, f"swarm-forage: No space left on device: {page}")
    assert page.read_text() == "an earlier one"
    assert set(Path().iterdir()) == before
