"""Record and its file."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.record import Record, RecordError
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import RunFailure, failure_lines, is_stored, load, record_file, store
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World


@pytest.fixture
def record() -> Record:
    world = World(scenario("warehouse_small"), criterion="noise", value=0.1)
    rng = np.random.default_rng(1)
    columns = {name: rng.random(3) for name in ("throttle", "queue_length", *INTERVAL_COLUMNS)}
    columns |= {
        "t_end_s": np.array([200.0, 400.0, 600.0]),
        "collected": np.array([10, 0, 20]),
        "interval": np.arange(3),
    }
    made_with = {"numpy": "2.0", "wall_time_s": "1.500", "note": "naïve — ünïcode"}
    return Record(spec=RunSpec(world=world, policy="crw", seed=2**40), columns=columns, made_with=made_with)


@pytest.fixture
def file(record, tmp_path) -> Path:
    path = tmp_path / "record.parquet"
    record.write(path)
    return path


def test_a_file_gives_back_the_record_bit_for_bit(record, file):
    again = Record.read(file)
    assert again.equals(record)
    assert (again.spec, again.made_with) == (record.spec, record.made_with)
    for name, column in record.columns.items():
        assert again[name].dtype == column.dtype, name
        assert again[name].tobytes() == column.tobytes(), name


def test_the_file_is_a_plain_table_with_keys_on_each_row(record, file):
    table = pl.read_parquet(file)
    assert table.columns == [*record.keys, *INTERVAL_COLUMNS, "queue_length", "throttle"]
    assert table["controller"].to_list() == ["crw"] * 3
    assert table["collected"].to_list() == [10, 0, 20]
    assert json.loads(pl.read_parquet_metadata(file)["swarm_forage_env.spec"])["policy"] == "crw"


def test_what_is_no_record_is_refused(file, tmp_path):
    file.write_bytes(file.read_bytes()[:-9])
    with pytest.raises(RecordError, match=r"record\.parquet: it is no Parquet file or a damaged one"):
        Record.read(file)
    path = tmp_path / "other.parquet"
    pl.DataFrame({"a": [1]}).write_parquet(path)
    with pytest.raises(RecordError, match=r"other\.parquet: it is a Parquet file, but no run record"):
        Record.read(path)
    with pytest.raises(RecordError, match=r"nothing\.parquet: No such file"):
        Record.read(tmp_path / "nothing.parquet")
    with pytest.raises(RecordError, match="Is a directory"):
        Record.read(tmp_path)


@pytest.mark.parametrize(
    ("change", "metadata", "told"),
    [
        (lambda table: table.drop("collected"), {}, "a record with the column collected"),
        (lambda table: table.with_columns(collected=pl.lit("many")), {}, "column collected to hold finite numbers"),
        (lambda table: table.clear(), {}, "column interval to hold finite numbers"),
        (lambda table: table, {"made_with": '{"a":' * 100_000 + "1" + "}" * 100_000}, "nested"),
        (lambda table: table, {"spec": "{}"}, "Missing key 'scenario'"),
    ],
    ids=["column missing", "wrong type", "no rows", "too deep", "no specification"],
)
def test_a_table_that_is_no_run_is_refused(file, change, metadata, told):
    kept = {key: text for key, text in pl.read_parquet_metadata(file).items() if key.startswith("swarm_forage_env.")}
    changed = {f"swarm_forage_env.{key}": text for key, text in metadata.items()}
    change(pl.read_parquet(file)).write_parquet(file, metadata=kept | changed)
    with pytest.raises(RecordError, match=rf"record\.parquet: .*{told}"):
        Record.read(file)


def test_columns_are_finite_of_one_length_and_cannot_be_changed(record):
    for values in ([1.0, 2.0], [1.0, 2.0, np.inf]):
        with pytest.raises(RecordError, match="column performance"):
            replace(record, columns={**record.columns, "performance": np.array(values)})
    with pytest.raises(ValueError, match="read-only"):
        record["collected"][0] = 1


def test_one_different_bit_is_another_result(record):
    nudged = record["performance"].copy()
    nudged[1] = np.nextafter(nudged[1], 2.0)
    assert record.equals(replace(record, made_with={}))
    assert not record.equals(replace(record, columns={**record.columns, "performance": nudged}))
    assert not record.equals(replace(record, columns={name: record[name] for name in INTERVAL_COLUMNS}))


def test_a_run_is_read_with_another_performance(record, tmp_path):
    again = record.read_as("n_caches")
    np.testing.assert_array_equal(again["performance"], record["n_caches"])
    assert again.run_id == record.run_id
    assert again.spec.scenario.performance == "n_caches"
    np.testing.assert_array_equal(again.read_as("throttle")["performance"], record["throttle"])
    assert record.read_as("collected") is record
    with pytest.raises(ConfigError, match="Did you mean 'n_caches'"):
        record.read_as("n_cache")


SPEC = RunSpec(world=World(scenario("warehouse_small", n_robots=2, horizon_s=2.0, interval_s=1.0)), policy="random")


@pytest.fixture
def folder(tmp_path) -> Path:
    """A folder with two runs."""
    for seed in range(2):
        store(tmp_path / "new", run_one(replace(SPEC, seed=seed)))
    return tmp_path / "new"


def test_what_is_written_is_loaded_and_nothing_else(folder):
    (folder / "performance.png").write_bytes(b"x")
    (folder / ".abc.parquet").write_bytes(b"x")
    found = load(folder)
    assert sorted(record.seed for record in found) == [0, 1]
    assert all(record.equals(run_one(record.spec)) for record in found)
    for empty in (folder.parent, folder / "missing"):
        with pytest.raises(RecordError, match="found none"):
            load(empty)


def test_a_run_is_stored_unless_it_is_missing_failed_or_damaged(folder):
    failed = replace(SPEC, seed=3)
    store(folder, RunFailure(spec=failed, error="ValueError: no", traceback="line 1"))
    record_file(folder, replace(SPEC, seed=1).run_id).write_bytes(b"damaged")
    assert [is_stored(folder, replace(SPEC, seed=seed)) for seed in range(4)] == [True, False, False, False]


def test_runs_of_a_policy_that_failed_for_one_reason_share_a_line():
    runs = [replace(SPEC, seed=seed) for seed in range(3)]
    other = replace(SPEC, policy="crw")
    told = [(runs[0], "no room"), (runs[1], "killed"), (runs[2], "no room"), (other, "no room")]
    failures = [RunFailure(spec=spec, error=error, traceback="") for spec, error in told]
    assert failure_lines(failures) == (
        f"{runs[0].describe()}, and 1 more of its runs: no room",
        f"{runs[1].describe()}: killed",
        f"{other.describe()}: no room",
    )
