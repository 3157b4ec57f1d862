"""Entry files: what is written is read back, and a file that is no whole entry is refused in a clear line."""

import json
from dataclasses import replace

import numpy as np
import pytest

from metrics.benchmark import BenchmarkError, Training, load_protocol, read_entry
from metrics.benchmark.entry import entry_command
from swarm_forage_env.runs.spec import identity_of
from tests.support.entries import TINY, made_up_entry


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(TINY)


@pytest.fixture
def file(protocol, tmp_path):
    path = tmp_path / "entry.json"
    made_up_entry(protocol, "one", lambda k: 10.0 + k, n_policies=2).write(path)
    return path


def test_what_is_written_is_read_back(protocol, file):
    entry = made_up_entry(protocol, "one", lambda k: 10.0 + k, n_policies=2)
    found = read_entry(file, protocol)
    assert found == entry
    np.testing.assert_array_equal(found.performance("training: here"), [[10.0, 12.0], [11.0, 13.0]])
    assert sum(line.startswith('  "room, ') for line in file.read_text().splitlines()) == 6, "a line per world"


def put(*path_and_value):
    *path, last, value = path_and_value

    def change(content):
        for key in path:
            content = content[key]
        content[last] = value

    return change


ROOM = ("runs", "room, 2 robots")
ODD = {
    "protocol": (put("protocol", "0" * 16), "got one of other worlds or seeds"),
    "name": (put("name", "\x1b[31m"), "Expected name to be a non-empty text without control characters"),
    "amount": (put(*ROOM, "performance", 0, 0, -1.0), r"performance\[0\]\[0\] to be a finite number >= 0"),
    "share": (put(*ROOM, "interference", 0, 0, 1.5), r"interference.* to be a number from 0 to 1"),
    "number of runs": (put(*ROOM, "performance", [[1.0], [1.0]]), "for each of 2 policies and 2 seeds"),
    "unknown key": (put(*ROOM, "beauty", [[1.0, 1.0]] * 2), "Unknown key .*beauty"),
    "unknown world": (put("runs", "mars", {"performance": [], "interference": []}), "see 'mars'"),
    "missing world": (lambda content: content["runs"].pop("room, 2 robots"), "see 'room, 2 robots'"),
    "no policies": (put("policies", []), "Expected policies to have at least 1"),
    "training": (put("training", "worlds", "everywhere"), "worlds to be one of"),
}


@pytest.mark.parametrize(("change", "message"), ODD.values(), ids=ODD)
def test_an_entry_from_a_stranger_is_refused_by_the_name_of_the_field(change, message, protocol, file):
    content = json.loads(file.read_text())
    change(content)
    del content["digest"]
    file.write_text(json.dumps(content | {"digest": identity_of(content)}))
    with pytest.raises(BenchmarkError, match=message) as refused:
        read_entry(file, protocol)
    assert str(file) in str(refused.value)


def test_altered_numbers_are_found(protocol, file):
    content = json.loads(file.read_text())
    put(*ROOM, "performance", 0, 0, 77.0)(content)
    file.write_text(json.dumps(content))
    with pytest.raises(BenchmarkError, match="the digest does not fit"):
        read_entry(file, protocol)


@pytest.mark.parametrize("text", ["", "[]", '{"name": 1}', None])
def test_a_file_that_is_none_of_ours_is_named(text, protocol, tmp_path):
    if text is not None:
        (tmp_path / "entry.json").write_text(text)
    with pytest.raises(BenchmarkError, match=r"entry\.json"):
        read_entry(tmp_path / "entry.json", protocol)


def test_one_network_in_two_files_is_no_two_trainings(protocol, tmp_path):
    in_short = Training(worlds="given", track="short", decisions=100)
    entry = made_up_entry(protocol, "copies", lambda k: 10.0, n_policies=2, training=in_short)
    for digests in ("ab", "aa"):
        policies = tuple(replace(one, digest=mark) for one, mark in zip(entry.policies, digests, strict=True))
        replace(entry, policies=policies).write(tmp_path / f"{digests}.json")
    assert read_entry(tmp_path / "ab.json", protocol).name == "copies"
    with pytest.raises(BenchmarkError, match=r"Expected different trainings in .*aa\.json, got one file twice"):
        read_entry(tmp_path / "aa.json", protocol)


def test_a_command_names_files_from_here_and_the_track_of_a_training(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    given = [str(tmp_path / "deep" / "a.npz"), "b.npz", str(tmp_path / "a.py") + ":Mine", "crw"]
    words = "swarm-forage benchmark deep/a.npz b.npz a.py:Mine crw --name x"
    assert entry_command(given, "x", training=Training(worlds="given", decisions=5)) == words
    in_short = Training(worlds="given", track="short", decisions=100)
    assert entry_command(given, "x", training=in_short) == f"{words} --trained-in given --track short --decisions 100"
