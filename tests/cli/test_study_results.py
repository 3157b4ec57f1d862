"""The commands on results of studies: verdict, plot, maps, report."""

import json
import re
import sys
from pathlib import Path

import numpy as np
import pytest

from metrics.scoring import diff
from swarm_forage_env.studies.study import Axis
from tests.support.made_tables import made_study, made_table
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
    assert "rules described, measures sierra" in out
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
    code, out, _ = ran("study", "plot", "done", "--out", "figures", "--band", "--variant", "corrected,sierra")
    assert code == 0
    assert sorted(out.split()) == sorted(str(path) for path in Path("figures").iterdir())
    names = {path.name for path in Path("figures").iterdir()}
    assert {f"S1a_raw_performance_described{suffix}" for suffix in (".svg", ".png", ".csv")} <= names
    assert "S1a_raw_performance_described_sierra.svg" in names
    assert Path("figures/S1a_raw_performance_described.csv").read_text().startswith("rules,policy,population_size,")
    assert {f"theory_self_organisation{suffix}" for suffix in (".svg", ".png", ".csv")} <= names
    assert Path("figures/S1a_snapshot.png").read_bytes().startswith(b"\x89PNG")
    pairs = Path("figures/S1a_raw_performance_described_pairs.csv").read_text()
    assert pairs.startswith("rules,first,second,p_better,")
    places = Path("figures/S1a_conditions.csv").read_text()
    assert places.startswith("rules,policy,population_size,n_runs,mean,lowest,highest,interquartile_mean,")
    assert len(places.splitlines()) == 1 + 8, "four policies of two sizes"


def test_figures_for_a_paper_have_its_width_and_no_headline(ran):
    style = ("--format", "svg", "--width", "3.5", "--font-size", "8", "--no-title")
    assert ran("study", "plot", "done", "--out", "paper", *style)[0] == 0
    endings = {path.suffix for path in Path("paper").iterdir() if "snapshot" not in path.name}
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


def test_maps_of_places_are_drawn(ran):
    words = (
        "--condition",
        "policy=crw,population_size=1",
        "--condition",
        "policy=dpo,population_size=2",
        "--seeds",
        "1",
    )
    code, out, err = ran("maps", "done", *words, "--square", "1", "--per-robot", "--picture", "maps/maps.png")
    assert (code, err) == (0, "")
    assert out == "wrote maps to maps/maps.png and .npz files beside it\n"
    one, two = "crw_population_size=1", "dpo_population_size=2"
    arrays = {f"maps.{name}.npz" for name in (one, two, f"{two}_minus_{one}")}
    assert {path.name for path in Path("maps").iterdir()} == {"maps.png", *arrays}
    with np.load(f"maps/maps.{two}.npz") as stored:
        assert stored["density"].sum() == pytest.approx(1.0), "per robot"
    code, _, err = ran("maps", "done", "--condition", "policy=crv")
    assert code == 2
    assert "Expected policy to be one of crw, dpo, stochm, stochx in study S1a, got 'crv'" in err


def test_a_report_is_written(ran):
    code, _, err = ran("study", "report", "done", "--file", "pages/report.html")
    assert code == 0
    assert "written pages/report.html" in err
    page = Path("pages/report.html").read_text()
    assert 'id="verdicts"' in page
    assert "S1a, budget tiny: 16 of 16 runs done" in page
    assert "swarm-forage study run S1a.toml --budget tiny --seeds 2 --rules described" in page
    assert ran("study", "report", "done/S1a.parquet", "--file", "again.html")[0] == 0
    again = Path("again.html").read_text()
    last_cells = re.compile(r'<td class="number" data-value="[^"]*">[^<]*</td></tr>|<td>not kept</td></tr>')
    assert last_cells.sub("", again) == last_cells.sub("", page)
    assert "<td>not kept</td>" in again, "a packed file does not say how long runs took"


def test_a_report_on_a_study_of_ones_own_has_no_claims(ran):
    Path("mine.toml").write_text(FILE.replace('"S1a"', '"mine"'))
    assert ran("study", "run", "mine.toml", "--jobs", "1", "--out", "mine")[0] == 0
    assert ran("study", "report", "mine", "--file", "mine.html")[0] == 0
    page = Path("mine.html").read_text()
    assert 'id="verdicts"' not in page
    assert "mine: raw performance" in page


def test_what_a_report_refuses(ran, monkeypatch):
    for words, message in (
        (("done", "--file", "report.htm"), "ending in .html, .md, .txt, .csv, .json, got 'report.htm'"),
        (("done", "done"), "Expected each study once under the same rules, got S1a (described)"),
    ):
        code, _, err = ran("study", "report", *words)
        assert code == 2
        assert message in err
    monkeypatch.setitem(sys.modules, "jinja2", None)
    code, _, err = ran("study", "report", "done")
    assert code == 1
    assert "No report without matplotlib and Jinja2" in err
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, _, err = ran("study", "plot", "done")
    assert code == 1
    assert "No picture without matplotlib" in err


def test_two_studies_are_held_against_each_other(ran):
    code, out, _ = ran("study", "diff", "done", "done/S1a.parquet")
    assert code == 0
    assert out == "8 conditions compared\n  8  identical to the last bit\n"
    Path("later.toml").write_text(FILE.replace("seeds = 2", "seeds = [2, 3]"))
    assert ran("study", "run", "later.toml", "--jobs", "1", "--out", "later")[0] == 0
    code, out, _ = ran("study", "diff", "done", "later", "--columns", "n_active, interference_fraction")
    assert code == 0
    assert "8  alike: other bits, no difference beyond chance" in out
    assert "all conditions of a policy together" in out
    Path("fast.toml").write_text(FILE.replace("n_objects = 20", "n_objects = 20\nmax_speed_mps = 0.9"))
    assert ran("study", "run", "fast.toml", "--jobs", "1", "--seeds", "1", "--out", "fast")[0] == 0
    code, out, _ = ran("study", "diff", "done", "fast")
    assert code == 1
    assert "not the same: settings: max_speed_mps None and 0.9" in out
    assert "8  open: other bits, and too few runs to say more" in out
    code, out, _ = ran("study", "diff", "done", "fast", "--json")
    assert code == 1
    assert json.loads(out)["conditions"][0]["state"] == "open"


def test_differences_are_listed_with_their_intervals():
    spec = made_study()
    before = made_table(spec, lambda place: 10.0 * place.values[-1])
    after = made_table(spec, lambda place: (15.0 if place.policy == "dpo" else 10.0) * place.values[-1])
    report = str(diff(before, after, ("performance",)))
    assert "9  identical to the last bit" in report
    assert "3  different" in report
    assert re.search(
        r"^described +dpo +2 +performance +19\.94 +29\.92 +9\.972 +9\.88 to 10\.06 +6 ", report, re.MULTILINE
    )
    assert re.search(r"^described +dpo +performance +40 % +39\.8 % to 40\.2 % .* \*$", report, re.MULTILINE)


def test_places_that_one_study_lacks_are_listed(command):
    whole = made_study("S1a", Axis(name="noise", values=(0.0, 0.03 / 7)))
    part = made_study("S1a", Axis(name="noise", values=(0.0,)))
    for spec, name in ((whole, "whole"), (part, "part")):
        made_table(spec, lambda place: 10.0).write(f"{name}.parquet")
    code, out, _ = command("study", "diff", "whole.parquet", "part.parquet", "--columns", "performance")
    assert code == 1
    assert out.splitlines()[:5] == [
        "4 conditions compared",
        "  4  identical to the last bit",
        "",
        "4 conditions not compared:",
        "rules      policy  noise       why",
    ]
    assert "described  crw     0.00428571  the second study does not have it" in out
    many = made_study("S1a", Axis(name="noise", values=tuple(0.01 * i for i in range(7))))
    report = str(diff(made_table(many, lambda place: 10.0), made_table(part, lambda place: 10.0), ("performance",)))
    assert "24 conditions not compared" in report
    assert "and 4 more; --json has all" in report


def test_what_a_diff_refuses(ran):
    code, _, err = ran("study", "diff", "done", "done", "--columns", "sped")
    assert code == 2
    assert "Expected columns that both studies have, got 'sped'" in err
    assert ran("study", "diff", "done", "nowhere")[0] == 2


@pytest.mark.parametrize(
    ("words", "place", "work"),
    [
        (
            ("maps", "--picture", "there/maps.png"),
            "there/maps.png",
            "swarm_forage_env.inspect.study_maps.maps_of_places",
        ),
        (("report", "--file", "page.html"), "page.html", "metrics.scoring.study_verdict.study_panels"),
        (("verdict", "--file", "all.json"), "all.json", "metrics.scoring.study_verdict.study_panels"),
    ],
    ids=lambda given: given[0] if isinstance(given, tuple) else "",
)
def test_the_place_of_results_is_looked_at_before_the_work(ran, monkeypatch, words, place, work):
    Path(place).mkdir(parents=True)
    monkeypatch.setattr(work, lambda *_, **__: pytest.fail("work was done"))
    name, *options = words
    told = f"swarm-forage: Expected a file to write, got a folder: {place}\n"
    of_study = () if name == "maps" else ("study",)
    assert ran(*of_study, name, "done", *options) == (1, "", told)


@pytest.mark.parametrize("words", [("report", "--file", "page.html"), ("verdict", "--file", "page.md")])
def test_a_disk_that_fills_up_leaves_no_half_page(ran, monkeypatch, words):
    def half(self, text, **_):
        self.write_bytes(text.encode()[: len(text) // 2])
        raise OSError(28, "No space left on device", str(self))

    if words[0] == "report":
        pytest.importorskip("jinja2")
    page = Path(words[-1])
    page.write_text("an earlier one")
    before = set(Path().iterdir())
    monkeypatch.setattr(Path, "write_text", half)
    name, *options = words
    code, _, err = ran("study", name, "done", *options)
    assert (code, err.splitlines()[-1]) == (1, f"swarm-forage: No space left on device: {page}")
    assert page.read_text() == "an earlier one"
    assert set(Path().iterdir()) == before
