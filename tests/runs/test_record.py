"""Record and its file."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.record import Record, RecordError
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS
from swarm_forage_env.scenarios.config import whole_intervals
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


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.99])
def test_a_cut_off_file_is_damaged(file, share):
    sound = file.read_bytes()
    file.write_bytes(sound[: int(share * len(sound))])
    with pytest.raises(RecordError, match=r"record\.parquet: it is no Parquet file or a damaged one"):
        Record.read(file)


def test_what_is_no_record_is_refused(tmp_path):
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


def test_a_failed_write_leaves_the_old_file_and_no_litter(record, file, monkeypatch):
    def full_disk(*args, **kwargs):
        raise OSError("No space left on device")

    monkeypatch.setattr(pl.DataFrame, "write_parquet", full_disk)
    with pytest.raises(OSError, match="No space left"):
        record.write(file)
    assert list(file.parent.iterdir()) == [file]
    assert Record.read(file).equals(record)


@pytest.mark.parametrize("values", [[1.0, 2.0], [1.0, 2.0, np.nan], [1.0, 2.0, np.inf]], ids=["short", "nan", "inf"])
def test_impossible_columns_are_refused(record, values):
    with pytest.raises(RecordError, match="column performance"):
        replace(record, columns={**record.columns, "performance": np.array(values)})


def test_columns_cannot_be_changed(record):
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


def test_rates_and_lengths(record):
    assert (record.horizon_s, record.wall_time_s) == (600.0, 1.5)
    assert record.per_1000_s("collected") == pytest.approx(50.0)
    assert np.isnan(replace(record, made_with={}).wall_time_s)
    told = record.describe()
    assert all(part in told for part in (record.run_id, "noise = 0.1", "600 s, delivered 30 (50.0 per 1,000 s)"))


def test_whole_intervals():
    config = scenario("warehouse_small")
    assert whole_intervals(config) == 50
    assert whole_intervals(config, 2000) == 2
    for ticks in (0, 999, 1001):
        with pytest.raises(ConfigError, match="whole number of intervals of 200 s"):
            whole_intervals(config, ticks)
