"""What files promise: those of another version or with unknown fields are refused, never guessed at."""

import json
import shutil

import numpy as np
import pytest

from metrics.benchmark import BenchmarkError, load_protocol, read_entry
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.inspect.replay.files import FORMAT_VERSION, read_replays
from swarm_forage_env.policies.network import Network, NetworkError
from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.runs.store import read_failure
from swarm_forage_env.training.datasets import Dataset, DatasetError
from swarm_forage_env.training.evaluation import read_evaluations
from swarm_forage_env.training.plan import read_plan
from tests.support.entries import TINY
from tests.support.small_files import small_file


def test_a_replay_of_another_version_is_refused(tmp_path):
    page = small_file("replay.html").read_text(encoding="utf-8")
    told = f'"version": {FORMAT_VERSION},'
    assert page.count(told) == 1
    (tmp_path / "a.html").write_text(page.replace(told, '"version": 99,'), encoding="utf-8")
    with pytest.raises(ConfigError, match=f"version 99 of the format, this version .* reads {FORMAT_VERSION}; "):
        read_replays(tmp_path / "a.html")


def test_a_data_set_with_an_unknown_field_is_refused(tmp_path):
    shutil.copytree(small_file("dataset"), tmp_path / "other")
    card = tmp_path / "other/dataset.json"
    card.write_text(json.dumps(json.loads(card.read_text(encoding="utf-8")) | {"colour": 1}), encoding="utf-8")
    with pytest.raises(DatasetError, match="'colour'"):
        Dataset(tmp_path / "other")


def test_a_network_with_unknown_fields_is_refused(tmp_path):
    with np.load(small_file("network.npz")) as stored:
        parts = dict(stored)
    for changed, reason in (
        ({"gates": 1}, "Unknown key about a network 'gates'"),
        ({"interface": {"colour": 1}}, "Unknown"),
    ):
        about = np.array(json.dumps(json.loads(str(parts["about"])) | changed))
        np.savez(tmp_path / "a.npz", **(parts | {"about": about}))
        with pytest.raises(NetworkError, match=reason):
            Network.load(tmp_path / "a.npz")


@pytest.mark.parametrize(
    ("name", "read", "error"),
    [
        ("entry.json", lambda file: read_entry(file, load_protocol(TINY)), BenchmarkError),
        ("plan.json", read_plan, ConfigError),
    ],
)
def test_an_unknown_field_is_refused(tmp_path, name, read, error):
    content = json.loads(small_file(name).read_text(encoding="utf-8"))
    (tmp_path / name).write_text(json.dumps(content | {"colour": 1}), encoding="utf-8")
    with pytest.raises(error, match=r"Unknown key .*'colour'"):
        read(tmp_path / name)


def test_a_failure_in_an_unknown_world_is_refused(tmp_path):
    content = json.loads(small_file("failure.json").read_text(encoding="utf-8"))
    content["spec"]["scenario"]["gravity"] = 1.0
    (tmp_path / "a.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(RecordError, match=r"Unknown key .*gravity"):
        read_failure(tmp_path / "a.json")


def test_evaluations_with_an_unknown_column_are_refused(tmp_path):
    first, *rows = small_file("evaluations.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "evaluations.csv").write_text("\n".join([f"{first},loss", *(f"{row},1" for row in rows)]))
    with pytest.raises(ConfigError, match=r"evaluations\.csv"):
        read_evaluations(tmp_path / "evaluations.csv")
