"""Entry files: what is written is read back, and a file that is no whole entry is refused in a clear line."""

import json

import numpy as np
import pytest

from metrics.benchmark import BenchmarkError, Training, load_protocol, read_entry
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
    assert found.to_mapping() == entry.to_mapping()
    np.testing.assert_array_equal(found.performance("training: here"), [[10.0, 12.0], [11.0, 13.0]])


def test_a_file_has_one_line_per_world_so_that_changes_can_be_read(protocol, file):
    lines = file.read_text().splitlines()
    assert sum(line.startswith('  "room, ') for line in lines) == 8


def set_version(content):
    content["benchmark"]["version"] = 2


def set_identity(content):
    content["benchmark"]["identity"] = "0" * 16


def drop_world(content):
    del content["runs"]["room, 2 robots"]


def drop_seed(content):
    content["runs"]["room, 2 robots"]["performance"] = [[1.0], [1.0]]


def set_negative(content):
    content["runs"]["room, 2 robots"]["performance"][0][0] = -1.0


def set_text(content):
    content["runs"]["room, 2 robots"]["performance"] = "many"


def raise_performance(content):
    content["runs"]["room, 2 robots"]["performance"][0][0] += 1.0


def rename_measure(content):
    content["measures"][0]["label"] = "beauty"


def drop_key(content):
    del content["measures"]


def set_training(content):
    content["training"]["worlds"] = "everywhere"


def add_field(content):
    content["policies"][0]["colour"] = "red"


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (set_version, "Expected an entry of version 1 of the benchmark, got one of version 2"),
        (set_identity, "got other worlds or seeds"),
        (drop_world, "Expected performance in the world 'room, 2 robots'"),
        (drop_seed, "for each of 2 policies and 2 seeds"),
        (set_negative, "as numbers from 0 up"),
        (set_text, "as numbers from 0 up"),
        (raise_performance, "the digest does not fit"),
        (rename_measure, "the digest does not fit"),
        (drop_key, "with the keys benchmark, name"),
        (set_training, "Expected training worlds to be one of given, other"),
        (add_field, "colour"),
    ],
)
def test_a_file_that_is_no_whole_entry_is_refused(change, message, protocol, file):
    with pytest.raises(BenchmarkError, match=message) as refused:
        read_entry(altered(file, change), protocol)
    assert str(file) in str(refused.value)


def test_a_quick_look_is_no_entry(protocol, tmp_path):
    quick = load_protocol(TINY, quick=True)
    made_up_entry(quick, "one", lambda k: 1.0).write(tmp_path / "quick.json")
    with pytest.raises(BenchmarkError, match="a quick look, which is no entry"):
        read_entry(tmp_path / "quick.json", protocol)


@pytest.mark.parametrize("text", ["", "[]", "{", '{"name": 1}'])
def test_a_file_that_is_no_json_object_of_ours_is_refused(text, protocol, tmp_path):
    (tmp_path / "entry.json").write_text(text)
    with pytest.raises(BenchmarkError, match=r"entry\.json"):
        read_entry(tmp_path / "entry.json", protocol)


def test_a_missing_file_is_named(protocol, tmp_path):
    with pytest.raises(BenchmarkError, match="Cannot read the entry"):
        read_entry(tmp_path / "none.json", protocol)


def test_training_worlds_are_known_words():
    with pytest.raises(BenchmarkError, match="got 'mars'"):
        Training(worlds="mars")
