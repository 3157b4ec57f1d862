"""Entry files: what is written is read back, and a file that is no whole entry is refused in a clear line."""

import json

import numpy as np
import pytest

from metrics.benchmark import load_protocol, read_entry
from swarm_forage_env._internal.fields import ConfigError
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
    np.testing.assert_array_equal(found.performance(protocol.training), [[[10.0, 12.0]], [[11.0, 13.0]]])
    np.testing.assert_array_equal(
        found.performance(protocol.held_out)[:, :, 1], [[13, 14, 15, 16, 17], [14, *range(15, 19)]]
    )
    assert sum(line.startswith(('  "room, ', '  "worn, ')) for line in file.read_text().splitlines()) == 5, "one each"


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
    "amount": (put(*ROOM, 0, 0, -1.0), r"robots'?\]?\[0\]\[0\] to be a finite number >= 0"),
    "unknown key": (put("training", "beauty", 1), "Unknown key .*beauty"),
    "missing world": (lambda content: content["runs"].pop("room, 2 robots"), "2 policies with 2 .* 'room, 2 robots'"),
    "missing run": (put(*ROOM, 1, [1.0]), "2 policies with 2 .* 'room, 2 robots'"),
    "missing policy": (put(*ROOM, [[1.0, 1.0]]), "2 policies with 2 .* 'room, 2 robots'"),
}


@pytest.mark.parametrize(("change", "message"), ODD.values(), ids=ODD)
def test_an_entry_from_a_stranger_is_refused_by_the_name_of_the_field(change, message, protocol, file):
    content = json.loads(file.read_text())
    change(content)
    file.write_text(json.dumps(content))
    with pytest.raises(ConfigError, match=message) as refused:
        read_entry(file, protocol)
    assert str(file) in str(refused.value)
