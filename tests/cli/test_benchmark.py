"""The command `benchmark`, with a tiny protocol in place of the real one."""

import json
from pathlib import Path

import pytest

from metrics import PAPER_POLICIES
from metrics.benchmark import load_protocol
from tests.support.entries import TINY, made_up_entry


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A place with the tiny protocol and the entries of the scripted controllers in it."""
    place = tmp_path_factory.mktemp("benchmark")
    (place / "benchmark.toml").write_text(TINY.read_text())
    (place / "scripted").mkdir()
    for k, name in enumerate(PAPER_POLICIES):
        made_up_entry(load_protocol(TINY), name, lambda _, k=k: 10.0 + k).write(place / "scripted" / f"{name}.json")
    return place


@pytest.fixture
def tiny(folder, monkeypatch):
    monkeypatch.setattr("metrics.benchmark.protocol.FOLDER", folder)


@pytest.fixture
def mine(tiny, tmp_path):
    """Entries in the folder of the command; the second one has the name of a scripted controller."""
    for name in ("mine", "dpo"):
        made_up_entry(load_protocol(), name, lambda k: 30.0).write(tmp_path / f"{name}.json")


def test_a_policy_becomes_an_entry_that_can_be_shown(command, tiny):
    words = ("crw", "--name", "again", "--trained-in", "nothing", "--jobs", "1")
    code, out, err = command("benchmark", *words)
    assert code == 0, err
    header, *rows = out.splitlines()
    assert header.split()[:3] == ["entry", "track", "score"]
    assert {row.split()[0] for row in rows} == {*PAPER_POLICIES, "again"}
    file = Path("results/benchmark/again.json")
    content = json.loads(file.read_text())
    assert content["command"] == "swarm-forage benchmark crw --name again"
    assert content["training"]["worlds"] == "nothing"
    code, shown, _ = command("benchmark", "show", str(file))
    assert (code, shown) == (0, out)


def test_a_quick_look_writes_no_entry(command, tiny):
    code, out, err = command("benchmark", "random", "--quick", "--jobs", "1")
    assert code == 0, err
    assert "random" in out
    assert "no entry" in err
    assert not list(Path("results/benchmark").glob("*.json"))


def spoil(name, change):
    file = Path(name)
    file.write_text(change(file.read_text()))


def test_an_altered_entry_is_refused_in_one_line(command, mine):
    spoil("mine.json", lambda text: text.replace('"interference": [[0.1, 0.1]]', '"interference": [[0.0, 0.1]]', 1))
    code, out, err = command("benchmark", "show", "mine.json")
    assert (code, out) == (2, "")
    assert err.startswith("swarm-forage: Expected the numbers of mine.json as swarm-forage benchmark wrote them")
    assert len(err.splitlines()) == 1
