"""The command `benchmark`, with a tiny protocol in place of the real one."""

import json
from dataclasses import replace
from functools import partial
from itertools import pairwise
from pathlib import Path

import pytest

from metrics import PAPER_POLICIES
from metrics.benchmark import Training, load_protocol
from metrics.benchmark.entry import EntryPolicy
from metrics.benchmark.page import BEGIN, END
from metrics.benchmark.running import entry_command
from tests.support.croissant import faults
from tests.support.entries import TINY, made_up_entry


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A place with the tiny protocol in two versions, and with the entries of the scripted controllers in both."""
    place = tmp_path_factory.mktemp("benchmark")
    told = TINY.read_text()
    tracks = "version = 2\ntrainings = 2\ntracks = { short = 100 }"
    for version, text in ((1, told), (2, told.replace("version = 1", tracks))):
        protocol_file = place / f"benchmark_v{version}.toml"
        protocol_file.write_text(text)
        of_version = scripted_of(place, version)
        of_version.mkdir(exist_ok=True)
        training = Training(worlds="nothing", track="open" if version == 2 else "")
        for k, name in enumerate(PAPER_POLICIES):
            entry = made_up_entry(load_protocol(protocol_file), name, lambda _, k=k: 10.0 + k, training=training)
            entry.write(of_version / f"{name}.json")
    return place


def scripted_of(place, version):
    """Where the entries of the scripted controllers in a version are."""
    return place if version == 1 else place / f"v{version}"


@pytest.fixture
def tiny(folder, monkeypatch):
    monkeypatch.setattr("metrics.benchmark.protocol.protocol_folder", lambda: folder)
    monkeypatch.setattr("metrics.benchmark.standing.scripted_folder", partial(scripted_of, folder))


@pytest.fixture
def mine(tiny, tmp_path):
    """Entries in the folder of the command; the second one has the name of a scripted controller."""
    for name in ("mine", "dpo"):
        made_up_entry(load_protocol(), name, lambda k: 30.0).write(tmp_path / f"{name}.json")


def test_a_policy_becomes_an_entry_that_can_be_shown(command, tiny):
    words = ("--policy", "crw", "--name", "again", "--trained-in", "nothing", "--jobs", "1")
    code, out, err = command("benchmark", *words)
    assert code == 0, err
    header, *rows = out.splitlines()
    assert header.split()[:2] == ["entry", "score"]
    assert {row.split()[0] for row in rows} == {*PAPER_POLICIES, "again"}
    file = Path("results/benchmark/again.json")
    content = json.loads(file.read_text())
    assert content["command"] == "swarm-forage benchmark --policy crw --name again"
    assert content["training"]["worlds"] == "nothing"
    code, shown, _ = command("benchmark", "show", str(file))
    assert (code, shown) == (0, out)
    code, told, _ = command("benchmark", "show", "results/benchmark", "--json")
    assert {standing["name"] for standing in json.loads(told)} == {*PAPER_POLICIES, "again"}


def test_an_entry_of_version_2_names_its_track_and_goes_to_the_page_of_its_version(command, tiny):
    words = ("--policy", "crw", "--policy", "random", "--name", "again", "--trained-in", "given")
    words = (*words, "--track", "short", "--version", "2", "--jobs", "1")
    code, out, err = command("benchmark", *words, "--decisions", "101")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "Expected at most 100 decisions of a training for the track short, got 101" in err
    code, out, err = command("benchmark", *words, "--decisions", "100")
    assert code == 0, err
    assert next(row for row in out.splitlines() if row.startswith("again")).split()[1] == "short"
    file = Path("results/benchmark/v2/again.json")
    assert json.loads(file.read_text())["command"].endswith(
        "--name again --version 2 --trained-in given --track short --decisions 100"
    )
    assert command("benchmark", "show", str(file))[:2] == (0, out)
    Path("docs").mkdir()
    Path("docs/benchmark_v2.md").write_text(f"{BEGIN}\n{END}\n")
    code, out, err = command("benchmark", "page", str(file))
    assert code == 0, err
    assert out.split() == ["docs/benchmark_v2.md", "docs/benchmark_v2_in_detail.md", "docs/images/benchmark_v2.png"]
    assert "| again | training worlds | 100 |" in Path("docs/benchmark_v2.md").read_text()
    assert Path("docs/benchmark_v2_in_detail.md").read_text().startswith("# Benchmark in detail, version 2\n")


def test_entries_of_two_versions_are_not_shown_together(command, folder, mine):
    code, _, err = command("benchmark", "show", "mine.json", str(folder / "v2/crw.json"))
    assert (code, len(err.splitlines())) == (2, 1)
    assert "Expected entries of one version of the benchmark, got 'crw' of version 2 beside 'mine' of version 1" in err


def test_a_quick_look_writes_no_entry(command, tiny):
    code, out, err = command("benchmark", "--policy", "random", "--quick", "--jobs", "1")
    assert code == 0, err
    assert "random" in out
    assert "no entry" in err
    assert not list(Path("results/benchmark").glob("*.json"))


def test_a_dry_run_tells_what_there_is_to_do(command, tiny):
    code, out, _ = command("benchmark", "--policy", "crw", "--policy", "dpo", "--name", "two", "--dry-run")
    assert code == 0
    assert "two in the benchmark, version 1: 9 worlds, 2 seeds, 200 s per run" in out
    assert "36 runs, 36 to do" in out
    assert not Path("results").exists()


def test_the_worlds_are_shown(command, tiny):
    code, out, _ = command("benchmark", "worlds")
    assert code == 0
    assert "seeds 1, 2, 200 s per run, 6 worlds that count" in out
    assert json.loads(command("benchmark", "worlds", "--json")[1])
    assert "room, throttle 0   " in out
    assert "reference of measures" in out


def test_a_page_is_written_with_its_figure(command, mine):
    Path("docs").mkdir()
    Path("docs/benchmark.md").write_text(f"# Benchmark\n\n{BEGIN}\n{END}\n\nend\n")
    code, out, err = command("benchmark", "page", "mine.json")
    assert code == 0, err
    assert out.split() == ["docs/benchmark.md", "docs/benchmark_in_detail.md", "docs/images/benchmark.png"]
    text = Path("docs/benchmark.md").read_text()
    assert "| mine | " in text
    assert "](images/benchmark.png)" in text
    assert "](benchmark_in_detail.md)" in text
    assert "| room, noisy wheels | " in Path("docs/benchmark_in_detail.md").read_text()
    assert text.endswith(f"{END}\n\nend\n")


def test_a_folder_of_entries_gets_its_metadata_with_the_page(command, mine):
    Path("entries").mkdir()
    Path("mine.json").rename("entries/mine.json")
    Path("page.md").write_text(f"{BEGIN}\n{END}\n")
    words = ("benchmark", "page", "entries", "--file", "page.md", "--picture", "page.png")
    code, out, err = command(*words)
    assert code == 0, err
    assert out.split()[-1] == "entries/croissant.json"
    assert faults(Path("entries")) == []
    first = Path("entries/croissant.json").read_bytes()
    assert command(*words)[0] == 0, "the metadata are no entry"
    assert Path("entries/croissant.json").read_bytes() == first
    Path("entries/mine.json").unlink()
    assert command(*words)[1].split()[-1] == "page.png"


def test_a_mixed_swarm_can_be_run_again_with_the_command_of_its_entry():
    policy = "mixed:runs/a.npz=20%,crw=rest"
    assert entry_command((policy,), "a few") == (f"swarm-forage benchmark --policy {policy} --name 'a few'")


def test_a_file_with_its_whole_path_is_told_from_the_current_folder(tmp_path, monkeypatch):
    """Another machine has other folders; a mixed swarm and words about the interface go on to fit."""
    monkeypatch.chdir(tmp_path)
    given = ("runs/a.npz", f"{tmp_path}/runs/a.npz", f"{tmp_path}/m.zip:decision_ticks=5",
             f"mixed:{tmp_path}/a.npz=20%,crw=rest", "dpo")  # fmt: skip
    words = entry_command(given, "x").split()
    told = [word for before, word in pairwise(words) if before == "--policy"]
    assert told == ["runs/a.npz", "runs/a.npz", "m.zip:decision_ticks=5", "mixed:a.npz=0.2,crw=rest", "dpo"]


def test_a_quick_look_at_a_scripted_controller_has_another_name_than_its_entry(command, tiny):
    code, out, err = command("benchmark", "--policy", "dpo", "--quick", "--jobs", "1", "--json")
    assert code == 0, err
    assert {standing["name"] for standing in json.loads(out)} == {*PAPER_POLICIES, "dpo, quick"}


def test_the_entry_of_a_scripted_controller_that_was_made_again_is_shown(command, folder, tiny, tmp_path):
    again = made_up_entry(load_protocol(), "dpo", lambda k: 40.0)
    replace(again, policies=(EntryPolicy(name="dpo"),)).write(tmp_path / "dpo.json")
    shipped = folder / "dpo.json"
    code, out, err = command("benchmark", "show", str(shipped), "dpo.json", "--json")
    assert code == 0, err
    scores = {standing["name"]: standing["score"][0] for standing in json.loads(out)}
    assert scores.keys() == set(PAPER_POLICIES)
    assert max(scores, key=scores.get) == "dpo"


def test_nothing_is_run_under_the_name_of_a_scripted_controller_or_without_their_entries(
    command, tiny, tmp_path, monkeypatch
):
    for words in (("--policy", "random", "--name", "dpo"), ("--policy", "dpo", "--name", "dpo", "--quick")):
        code, _, err = command("benchmark", *words, "--jobs", "1")
        assert (code, len(err.splitlines())) == (2, 1)
        assert "Expected another name than 'dpo'" in err
    monkeypatch.setattr("metrics.benchmark.standing.scripted_folder", lambda version: tmp_path)
    code, _, err = command("benchmark", "--policy", "random", "--jobs", "1")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "crw.json" in err
    assert not Path("results").exists()


def spoil(name, change):
    file = Path(name)
    file.write_text(change(file.read_text()))


def test_an_altered_entry_is_refused_in_one_line(command, mine):
    spoil("mine.json", lambda text: text.replace('"interference": [[0.1, 0.1]]', '"interference": [[0.0, 0.1]]', 1))
    code, out, err = command("benchmark", "show", "mine.json")
    assert (code, out) == (2, "")
    assert err.startswith("swarm-forage: Expected the numbers of mine.json as swarm-forage benchmark wrote them")
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ((), "Expected a policy, by name or file"),
        (("--policy", "crw", "--policy", "dpo"), "Expected --name"),
        (("--policy", "crw", "--quick", "--file", "x.json"), "a quick look is no entry"),
        (("--policy", "cwr"), "Unknown policy 'cwr'"),
        (("--policy", "none.npz"), "none.npz"),
        (("--policy", "crw", "--trained-in", "mars"), "got 'mars'"),
        (("--policy", "crw", "--training-seed", "1", "--training-seed", "2"), "got 2 for 1 policies"),
        (("--policy", "crw", "--version", "3"), "Expected version 1 or 2 of the benchmark, got 3"),
        (("worlds", "--version", "3"), "Expected version 1 or 2 of the benchmark, got 3"),
        (("--policy", "crw", "--track", "10M"), "got '10M'; leave out --track and --decisions"),
        (("show", "none.json"), "Cannot read none.json"),
        (("show", "mine.json", "mine.json"), "'mine' twice"),
        (("show", "dpo.json"), "another policy with the name 'dpo'"),
        (("page", "mine.json", "--file", "none.md"), "none.md"),
        (("page", "mine.json", "--file", "mine.json"), "write these two lines"),
    ],
)
def test_what_makes_no_sense_is_refused_in_one_line(words, message, command, mine):
    code, _, err = command("benchmark", *words)
    assert code in (1, 2)
    assert message in err
    assert len(err.splitlines()) == 1
