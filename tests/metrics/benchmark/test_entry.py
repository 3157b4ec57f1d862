"""Entry files: what is written is read back, and a file that is no whole entry is refused in a clear line."""

import json

import numpy as np
import pytest

from metrics.benchmark import BenchmarkError, Training, load_protocol, read_entry, run_benchmark
from swarm_forage_env._internal.fields import ConfigError
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


def altered(file, change):
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))
    return file


def test_what_is_written_is_read_back(protocol, file):
    entry = made_up_entry(protocol, "one", lambda k: 10.0 + k, n_policies=2)
    found = read_entry(file, protocol)
    assert found == entry
    np.testing.assert_array_equal(found.performance("training: here"), [[10.0, 12.0], [11.0, 13.0]])


def test_a_file_has_one_line_per_world_so_that_changes_can_be_read(protocol, file):
    lines = file.read_text().splitlines()
    assert sum(line.startswith('  "room, ') for line in lines) == 6


def put(*path_and_value):
    *path, last, value = path_and_value

    def change(content):
        for key in path:
            content = content[key]
        content[last] = value

    return change


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (put("protocol", "0" * 16), "got one of other worlds or seeds"),
        (put("name", 5), "Expected name to be a non-empty text"),
        (put("name", "\x1b[31m"), "Expected name to be a non-empty text without control characters"),
        (put("core_hours", -1), "Expected core_hours to be a finite number >= 0"),
        (put("runs", "x"), "Expected runs to be a table"),
        (put("runs", "room, 2 robots", "performance", 0, 0, -1.0), r"performance\[0\]\[0\] to be a finite number >= 0"),
        (put("runs", "room, 2 robots", "performance", [[1.0], [1.0]]), "for each of 2 policies and 2 seeds"),
        (put("runs", "room, 2 robots", "beauty", [[1.0, 1.0]] * 2), "Unknown key .*beauty"),
        (put("runs", "mars", {"performance": [[1.0, 1.0]] * 2, "interference": [[0.1, 0.1]] * 2}), "see 'mars'"),
        (put("runs", "room, 2 robots", "interference", 0, 0, 1.5), r"interference.* to be a number from 0 to 1"),
        (put("policies", []), "Expected policies to have at least 1"),
        (put("policies", 0, "colour", "red"), "colour"),
        (put("training", "worlds", "everywhere"), "Expected training worlds to be one of given, other"),
        (put("versions", {"numpy": 2}), "versions.numpy to be a text"),
    ],
)
def test_an_entry_from_a_stranger_is_refused_by_the_name_of_the_field(change, message, protocol, file):
    content = json.loads(file.read_text())
    change(content)
    del content["digest"]
    file.write_text(json.dumps(content | {"digest": identity_of(content)}))
    with pytest.raises(BenchmarkError, match=message) as refused:
        read_entry(file, protocol)
    assert str(file) in str(refused.value)


def test_a_quick_look_is_no_entry(protocol, tmp_path):
    quick = load_protocol(TINY, quick=True)
    made_up_entry(quick, "one", lambda k: 1.0).write(tmp_path / "quick.json")
    with pytest.raises(BenchmarkError, match="got one of other worlds or seeds"):
        read_entry(tmp_path / "quick.json", protocol)


def test_altered_numbers_and_missing_worlds_are_found(protocol, file):
    with pytest.raises(BenchmarkError, match="the digest does not fit"):
        read_entry(altered(file, put("runs", "room, 2 robots", "performance", 0, 0, 77.0)), protocol)
    with pytest.raises(BenchmarkError, match="see 'room, 2 robots'"):
        read_entry(altered(file, lambda content: content["runs"].pop("room, 2 robots")), protocol)


@pytest.mark.parametrize("text", ["", "[]", "{", '{"name": 1}'])
def test_a_file_that_is_no_json_object_of_ours_is_refused(text, protocol, tmp_path):
    (tmp_path / "entry.json").write_text(text)
    with pytest.raises(BenchmarkError, match=r"entry\.json"):
        read_entry(tmp_path / "entry.json", protocol)


def test_a_missing_file_is_named(protocol, tmp_path):
    with pytest.raises(BenchmarkError, match=r"Cannot read .*none\.json: No such file"):
        read_entry(tmp_path / "none.json", protocol)


def test_what_no_file_may_say_is_refused_before_any_run():
    with pytest.raises(BenchmarkError, match="got 'mars'"):
        Training(worlds="mars")
    with pytest.raises(ConfigError, match="Expected the name of an entry to be a non-empty text"):
        run_benchmark(["crw"], name="\x1b[31m")
