"""Files of every format with other bytes are read or refused in one line; CASES=1000 tries as many of each."""

import json
import os
import shutil
import traceback
from collections.abc import Callable
from pathlib import Path
from random import Random
from typing import Any

import pytest

from metrics.benchmark import load_protocol, read_entry
from metrics.checks import CurveError
from metrics.scoring.curves_file import read_curves
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.model_files import ModelError, open_network
from swarm_forage_env.policies.network import NetworkError
from swarm_forage_env.runs.record import Record, RecordError
from swarm_forage_env.runs.store import read_failure
from swarm_forage_env.studies.results import read_study
from swarm_forage_env.training.datasets import Dataset, DatasetError
from swarm_forage_env.training.evaluation import read_evaluations
from swarm_forage_env.training.plan import read_plan
from tests.support.curve_tables import CROWDING
from tests.support.entries import TINY
from tests.support.small_files import small_file

READERS: dict[str, tuple[Callable[[Path], Any], type[Exception]]] = {
    "record.parquet": (Record.read, RecordError),
    "packed.parquet": (read_study, RecordError),
    "failure.json": (read_failure, RecordError),
    "dataset": (lambda place: list(Dataset(place).runs()), DatasetError),
    "entry.json": (lambda file: read_entry(file, load_protocol(TINY)), ConfigError),
    "network.npz": (open_network, (NetworkError, ModelError)),
    "plan.json": (read_plan, ConfigError),
    "evaluations.csv": (read_evaluations, ConfigError),
    "curves.parquet": (read_curves, CurveError),
}
"""Name of a file -> what reads it, and the error that it documents."""


def changed_file(random: Random, folder: Path, name: str) -> Path:
    """Write a changed file into a folder, in place of one of that name; returns it."""
    file = folder / name
    if name == "dataset":
        shutil.rmtree(file, ignore_errors=True)
        shutil.copytree(small_file(name), file)
        chosen = random.choice(sorted(file.iterdir()))
    else:
        chosen = file
        if name == "curves.parquet":
            CROWDING.write_parquet(file)
        else:
            shutil.copy(small_file(name), file)
    content = chosen.read_bytes()
    # Other bytes in a Parquet file may end the process: polars asks for the memory that they tell of.
    chosen.write_bytes(cut_off(random, content) if chosen.suffix == ".parquet" else other_bytes(random, content))
    return file


def cut_off(random: Random, content: bytes) -> bytes:
    """Return content that is cut off, half of the time."""
    return content[: random.choice((len(content), random.randrange(len(content))))]


def other_bytes(random: Random, content: bytes) -> bytes:
    """Return content that is cut off, or some of whose bytes are others."""
    if random.random() < 0.3:
        return cut_off(random, content)
    changed = bytearray(content)
    for _ in range(random.choice((0, 1, 1, 4, 40))):
        changed[random.randrange(len(changed))] = random.randrange(256)
    return bytes(changed)


def give(random: Random, folder: Path, name: str) -> tuple[str, str]:
    """Give a changed file to its reader; returns "accepted" or "refused", and the fault or nothing."""
    file = changed_file(random, folder, name)
    read, refusals = READERS[name]
    try:
        read(file)
    except refusals as error:
        return "refused", "" if str(error) and "\n" not in str(error) else f"{error!r} is no line"
    except KeyboardInterrupt:
        raise
    except BaseException as error:  # noqa: BLE001 - whatever it is, it is a fault
        return "", "".join(traceback.format_exception(error))
    return "accepted", ""


CASES = int(os.environ.get("CASES", "24"))


@pytest.mark.filterwarnings("ignore")  # of libraries
@pytest.mark.parametrize("name", READERS)
def test_any_changed_file_is_read_or_refused_in_one_line(name, tmp_path, capfd):
    seen = set()
    for number in range(CASES):
        told, fault = give(Random(number), tmp_path, name)
        assert not fault
        seen.add(told)
    assert seen == {"accepted", "refused"}
    assert capfd.readouterr() == ("", "")
    assert [path.name for path in tmp_path.iterdir()] == [name]


def in_json(*path: str) -> Callable[[Path], None]:
    """Write an unknown field into a table of a file, found by its keys."""

    def change(file: Path) -> None:
        content = json.loads(file.read_text(encoding="utf-8"))
        table = content
        for key in path:
            table = table[key]
        table["colour"] = 1
        file.write_text(json.dumps(content), encoding="utf-8")

    return change


def other_column(file: Path) -> None:
    file.write_text(file.read_text().replace("wall_time_s", "colour"))


@pytest.mark.parametrize(
    ("name", "part", "change", "told"),
    [
        ("dataset", "dataset.json", in_json(), "'colour'"),
        ("entry.json", "", in_json(), "key .*'colour'"),
        ("plan.json", "", in_json(), "key .*'colour'"),
        ("failure.json", "", in_json("spec", "scenario"), "key .*colour"),
        ("evaluations.csv", "", other_column, r"evaluations\.csv"),
    ],
)
def test_files_of_other_fields_are_refused_and_never_guessed_at(tmp_path, name, part, change, told):
    original, file = small_file(name), tmp_path / name
    (shutil.copytree if original.is_dir() else shutil.copy)(original, file)
    change(file / part)
    read, error = READERS[name]
    with pytest.raises(error, match=told):
        read(file)
