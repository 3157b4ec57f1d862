"""What files promise: those of another version or with unknown fields are refused, never guessed at."""

import json
import shutil

import pytest

from metrics.benchmark import load_protocol, read_entry
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.runs.store import read_failure
from swarm_forage_env.training.datasets import Dataset, DatasetError
from swarm_forage_env.training.evaluation import read_evaluations
from swarm_forage_env.training.plan import read_plan
from tests.support.entries import TINY
from tests.support.small_files import small_file


def in_json(*path):
    """Write an unknown field into a table of a file, found by its keys."""

    def change(file):
        content = json.loads(file.read_text(encoding="utf-8"))
        table = content
        for key in path:
            table = table[key]
        table["colour"] = 1
        file.write_text(json.dumps(content), encoding="utf-8")

    return change


def other_column(file):
    file.write_text(file.read_text().replace("wall_time_s", "colour"))


OTHER = [
    ("dataset", "dataset.json", in_json(), Dataset, DatasetError, "'colour'"),
    ("entry.json", "", in_json(), lambda file: read_entry(file, load_protocol(TINY)), ConfigError, "key .*'colour'"),
    ("plan.json", "", in_json(), read_plan, ConfigError, "key .*'colour'"),
    ("failure.json", "", in_json("spec", "scenario"), read_failure, RecordError, "key .*colour"),
    ("evaluations.csv", "", other_column, read_evaluations, ConfigError, r"evaluations\.csv"),
]


@pytest.mark.parametrize(("name", "part", "change", "read", "error", "told"), OTHER)
def test_files_that_are_not_as_this_version_writes_them_are_refused(tmp_path, name, part, change, read, error, told):
    original, file = small_file(name), tmp_path / name
    (shutil.copytree if original.is_dir() else shutil.copy)(original, file)
    change(file / part if part else file)
    with pytest.raises(error, match=told):
        read(file)
