"""What files promise: those of an earlier day are read, and those of another version are refused, never guessed at.

`tests/files` holds one small file of each kind, as it was written then. It is made anew only when a version is raised.
"""

import json
import shutil
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from metrics.benchmark import BenchmarkError, load_protocol, read_entry
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.inspect.replay.files import read_replays
from swarm_forage_env.inspect.replay.frames import ReplayError
from swarm_forage_env.policies.network import Network, NetworkError
from swarm_forage_env.runs.record import SCHEMA_VERSION, RecordError, RunRecord
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import read_failure
from swarm_forage_env.training.datasets.layout import DatasetError
from swarm_forage_env.training.datasets.reading import TrajectoryDataset
from swarm_forage_env.training.evaluations import read_evaluations, read_training
from swarm_forage_env.training.plan import read_plan
from tests.support.entries import TINY
from tests.support.sampled import sampler

FILES = Path(__file__).parent.parent / "files"


def test_a_record_of_an_earlier_day_is_read_as_it_was_written():
    record = RunRecord.read(FILES / "record.parquet")
    assert (record.controller, record.n_robots, record.n_intervals, record.horizon_s) == ("random", 3, 2, 4.0)
    assert record.run_id == RunSpec.from_json(record.spec).run_id
    assert record.provenance["swarm-forage-env"] == "0.1.0"


@pytest.mark.parametrize("version", [SCHEMA_VERSION - 1, SCHEMA_VERSION + 1])
def test_a_record_of_another_version_is_refused(tmp_path, version):
    kept = FILES / "record.parquet"
    stamp = {name: text for name, text in pl.read_parquet_metadata(kept).items() if name.startswith("swarm_forage")}
    stamp["swarm_forage_env.schema_version"] = str(version)
    pl.read_parquet(kept).write_parquet(tmp_path / "a.parquet", metadata=stamp)
    with pytest.raises(RecordError, match=f"it has schema version {version}, .* reads {SCHEMA_VERSION}; read it with"):
        RunRecord.read(tmp_path / "a.parquet")


def test_a_failure_of_an_earlier_day_is_read(tmp_path):
    failure = read_failure(FILES / "failure.json")
    assert (failure.error, failure.spec.policy) == ("ValueError: too warm", "random")
    content = json.loads((FILES / "failure.json").read_text(encoding="utf-8"))
    content["spec"]["scenario"]["gravity"] = 1.0
    (tmp_path / "a.json").write_text(json.dumps(content), encoding="utf-8")
    with pytest.raises(RecordError, match=r"Unknown key .*gravity"):
        read_failure(tmp_path / "a.json")


def test_a_replay_of_an_earlier_day_is_read():
    (replay,) = read_replays(FILES / "replay.html")
    assert (replay.label, replay.n_frames, replay.scenario.robots.n_robots) == ("dpo", 31, 2)
    assert replay.memory_events is None, "it is of version 2"
    assert "death_per_tick" in replay.spec.to_json()


def test_a_replay_of_version_3_has_what_robots_remember():
    (replay,) = read_replays(FILES / "replay_3.html")
    assert (replay.label, replay.scenario.robots.n_robots) == ("dpo", 2)
    assert replay.memory_events is not None
    assert len(replay.memory_events) > 0


def test_a_replay_of_another_version_is_refused(tmp_path):
    page = (FILES / "replay_3.html").read_text(encoding="utf-8")
    assert page.count('"version": 3,') == 1
    (tmp_path / "a.html").write_text(page.replace('"version": 3,', '"version": 5,'), encoding="utf-8")
    with pytest.raises(ReplayError, match="version 5"):
        read_replays(tmp_path / "a.html")


def test_a_data_set_of_an_earlier_day_is_read():
    data = TrajectoryDataset(FILES / "dataset")
    steps = data.steps(1)
    assert data.card.schema_version == 1, "it has no digests of its chunks"
    assert (steps.observations.shape, steps.actions.shape) == ((11, 2, len(data.card.columns)), (10, 2, 3))
    assert steps.truncated[-1].all()


@pytest.mark.parametrize(
    ("change", "reason"), [({"schema_version": 3}, "schema version 1 or 2 in"), ({"colour": 1}, "'colour'")]
)
def test_a_data_set_of_a_later_day_is_refused(tmp_path, change, reason):
    shutil.copytree(FILES / "dataset", tmp_path / "later")
    card = tmp_path / "later/dataset.json"
    card.write_text(json.dumps(json.loads(card.read_text(encoding="utf-8")) | change), encoding="utf-8")
    with pytest.raises(DatasetError, match=reason):
        TrajectoryDataset(tmp_path / "later")


def test_an_entry_of_an_earlier_day_is_read_and_one_of_a_later_day_refused(tmp_path):
    """It is an entry of `tests/support/tiny_benchmark.toml`; another protocol there needs a new file."""
    entry = read_entry(FILES / "entry.json", load_protocol(TINY))
    assert entry.name == "mine"
    assert entry.performance("room, 1 robot").shape == (1, 2)
    content = json.loads((FILES / "entry.json").read_text(encoding="utf-8"))
    (tmp_path / "a.json").write_text(json.dumps(content | {"colour": 1}), encoding="utf-8")
    with pytest.raises(BenchmarkError, match="Unknown key 'colour'"):
        read_entry(tmp_path / "a.json", load_protocol(TINY))


def test_a_plan_with_a_sampler_of_an_earlier_day_is_read():
    plan = read_plan(FILES / "sampled_plan.json")
    assert plan.sampler == sampler()
    assert [world.baseline for world in plan.evaluation.worlds] == ["random", "crw"]


def test_a_network_of_an_earlier_day_is_read():
    network = Network.load(FILES / "network.npz")
    rows = np.array([[1.0, 2.0, 3.0]], np.float32)
    assert network.outputs(rows).tolist() == [[1.0, 2.0]]


def parts() -> dict[str, np.ndarray]:
    with np.load(FILES / "network.npz") as stored:
        return dict(stored)


@pytest.mark.parametrize(
    ("changed", "reason"),
    [
        ({"gates": 1}, "Unknown key about a network 'gates'"),
        ({"interface": {"colour": 1}}, "Unknown"),
        ({"card": json.loads("[" * 60 + "]" * 60)}, "at most 50 nested levels"),
    ],
)
def test_a_network_of_a_later_day_is_refused(tmp_path, changed, reason):
    whole = parts()
    whole["about"] = np.array(json.dumps(json.loads(str(whole["about"])) | changed))
    np.savez(tmp_path / "a.npz", **whole)
    with pytest.raises(NetworkError, match=reason):
        Network.load(tmp_path / "a.npz")


def test_a_training_of_an_earlier_day_is_read():
    training = read_training(FILES)
    plan = training.plan
    assert (plan.algorithm, plan.n_arenas, plan.total_steps) == ("ppo", 2, 384)
    assert [(each.steps, each.wall_time_s) for each in training.evaluations] == [(384, 28.0)]


def test_a_training_of_a_later_day_is_refused(tmp_path):
    plan = json.loads((FILES / "plan.json").read_text(encoding="utf-8"))
    (tmp_path / "plan.json").write_text(json.dumps(plan | {"optimizer": "lion"}), encoding="utf-8")
    with pytest.raises(ConfigError, match=r"plan\.json: Unknown key .*'optimizer'"):
        read_plan(tmp_path / "plan.json")
    first, *rows = (FILES / "evaluations.csv").read_text(encoding="utf-8").splitlines()
    (tmp_path / "evaluations.csv").write_text("\n".join([f"{first},loss", *(f"{row},1" for row in rows)]))
    with pytest.raises(ConfigError, match=r"evaluations\.csv"):
        read_evaluations(tmp_path / "evaluations.csv")


def test_a_header_that_tells_of_more_than_there_is_takes_no_memory(tmp_path):
    np.savez(tmp_path / "a.npz", **parts())
    content = (tmp_path / "a.npz").read_bytes()
    assert content.count(b"'shape': (3, 2)") == 1
    (tmp_path / "a.npz").write_bytes(content.replace(b"'shape': (3, 2), }    ", b"'shape': (99999, 2), }"))
    with pytest.raises(NetworkError, match="'weight_0' is damaged"):
        Network.load(tmp_path / "a.npz")
