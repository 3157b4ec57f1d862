"""Changed files of every format are read or refused in one line; `scripts/fuzz files` gives many more."""

import json
import os
import warnings
from dataclasses import replace
from pathlib import Path
from random import Random

import pytest

from metrics.benchmark import BenchmarkError
from tests.support import changed_files
from tests.support.changed_files import FORMATS, give, given_to_a_command
from tests.support.malformed import outcome


@pytest.fixture(autouse=True)
def place(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)


@pytest.mark.filterwarnings("default")  # what a library warns of is no error of a command
@pytest.mark.parametrize("kind", FORMATS)
def test_any_changed_file_is_read_or_refused_in_one_line(kind, tmp_path, capfd):
    seen = set()
    for number in range(16):
        told, fault = give(Random(number), tmp_path, kind, to_a_command=number in (0, 5, 10))
        assert not fault
        seen.add(told)
    assert (
        {"accepted", "refused"}
        <= seen
        <= {"accepted", "refused", *(f"ended with exit code {code}" for code in range(3))}
    )


def nothing(file: Path) -> None:
    """A reader without faults."""


def panic(file: Path) -> None:
    raise BaseException("a panic")


def say_nothing(file: Path) -> None:
    raise BenchmarkError


FAULTS = {
    "ValueError": lambda file: int("x"),
    "a panic": panic,
    "says nothing": say_nothing,
    "on stderr": lambda file: os.write(2, b"on stderr"),
    "wrote into the current folder": lambda file: Path("left").touch(),
    "wrote left": lambda file: Path("../left").touch(),
    "of a library": lambda file: warnings.warn("of a library", RuntimeWarning, stacklevel=1),
    "bytes of memory": lambda file: bytearray(b"x") * 2**27,
}
"""What a fault says -> a reader that has it."""


@pytest.mark.parametrize("told", FAULTS)
def test_a_fault_of_a_reader_is_told(told, tmp_path, monkeypatch, capfd):
    reader = FORMATS["entry"]
    monkeypatch.setattr(changed_files, "MOST_GROWN", 2**26)
    monkeypatch.setitem(FORMATS, "entry", replace(reader, read=nothing))
    assert give(Random(1), tmp_path, "entry", to_a_command=False) == ("accepted", "")
    monkeypatch.setitem(FORMATS, "entry", replace(reader, read=FAULTS[told]))
    assert told in give(Random(1), tmp_path, "entry", to_a_command=False)[1]


@pytest.mark.skipif(not changed_files.PEAK.exists(), reason="tells no peak of a case alone: not Linux")
def test_a_case_that_takes_much_memory_is_told_after_one_that_took_more(tmp_path, monkeypatch):
    reader = FORMATS["entry"]
    monkeypatch.setattr(changed_files, "MOST_GROWN", 2**26)
    for size in (2**28, 2**27):
        monkeypatch.setitem(FORMATS, "entry", replace(reader, read=lambda file, size=size: bytearray(b"x") * size))
        assert "bytes of memory" in give(Random(1), tmp_path, "entry", to_a_command=False)[1]


def test_what_a_reader_documents_is_no_fault(tmp_path, monkeypatch):
    reader = FORMATS["entry"]

    def refuse(file):
        raise BenchmarkError("not this one")

    monkeypatch.setitem(FORMATS, "entry", replace(reader, read=refuse))
    assert give(Random(1), tmp_path, "entry", to_a_command=False) == ("refused", "")


@pytest.mark.parametrize(
    ("changed", "code", "told"),
    [
        ({"policy": "../../x"}, 2, "Cannot run failure.json again: Unknown policy '../../x'."),
        ({"parameters": {"speed": 1}}, 1, "the run failed again"),
    ],
)
def test_a_failure_fails_again_only_if_its_policy_is_here(changed, code, told, tmp_path):
    content = json.loads((changed_files.FILES / "failure.json").read_text())
    content["spec"] |= changed
    Path("failure.json").write_text(json.dumps(content))
    ended = outcome(("rerun", "failure.json"))
    assert ended.code == code
    assert told in ended.errors.splitlines()[-1]
    assert ("Traceback" in ended.errors) == (code == 1)
    assert given_to_a_command(("rerun", "failure.json")) == (code, "")
