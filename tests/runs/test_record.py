"""RunRecord and its file."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import polars as pl
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs import record as recording
from swarm_forage_env.runs.record import RecordError, RunRecord, record_columns
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.config import whole_intervals
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World

COUNTS = [name for name, dtype in recording.COLUMN_DTYPES.items() if dtype is np.int64]
MEANS = [name for name, dtype in recording.COLUMN_DTYPES.items() if dtype is np.float64]


@pytest.fixture
def record() -> RunRecord:
    world = World(scenario("warehouse_small"), criterion="noise", value=0.1)
    spec = RunSpec(world=world, policy="crw", seed=2**40)
    rng = np.random.default_rng(1)
    columns = {name: rng.integers(0, 2**40, 3) for name in COUNTS} | {name: rng.random(3) for name in MEANS}
    return RunRecord(
        run_id=spec.run_id,
        scenario="warehouse_small",
        controller="crw",
        n_robots=50,
        criterion="noise",
        criterion_value=0.1,
        seed=2**40,
        interval=np.arange(3),
        **(columns | {"t_end_s": [200.0, 400.0, 600.0], "collected": [10, 0, 20]}),
        contributed={"throttle": rng.random(3), "queue_length": [0, 1, 2]},
        spec=spec.to_json(),
        provenance={"numpy": "2.0", "wall_time_s": "1.500", "note": "naïve — ünïcode"},
    )


@pytest.fixture
def file(record, tmp_path) -> Path:
    path = tmp_path / "record.parquet"
    record.write(path)
    return path


def test_a_file_gives_back_the_record_bit_for_bit(record, file):
    again = RunRecord.read(file)
    assert again.same_results(record)
    assert again.keys() == record.keys()
    assert again.provenance == record.provenance
    assert RunSpec.from_json(again.spec).run_id == record.run_id
    for name, column in record.columns().items():
        assert again.columns()[name].dtype == column.dtype, name
        assert again.columns()[name].tobytes() == column.tobytes(), name


def test_provenance_that_is_too_deep_is_told_as_damaged(file):
    stamp = {key: value for key, value in pl.read_parquet_metadata(file).items() if key.startswith("swarm_forage_env")}
    deep = stamp | {"swarm_forage_env.provenance": '{"a":' * 100_000 + "1" + "}" * 100_000}
    pl.read_parquet(file).write_parquet(file, metadata=deep)
    with pytest.raises(RecordError, match="its content is damaged"):
        RunRecord.read(file)


def test_the_file_is_a_plain_table_with_keys_on_each_row(record, file):
    table = pl.read_parquet(file)
    assert table.height == 3
    assert table.columns == [*record.keys(), *record.columns()]
    assert table["controller"].to_list() == ["crw"] * 3
    assert table["collected"].to_list() == [10, 0, 20]
    stamp = pl.read_parquet_metadata(file)
    assert json.loads(stamp["swarm_forage_env.spec"])["policy"] == "crw"
    assert json.loads(stamp["swarm_forage_env.provenance"])["numpy"] == "2.0"


@pytest.mark.parametrize("share", [0.0, 0.01, 0.5, 0.99])
def test_a_cut_off_file_is_damaged(file, share):
    sound = file.read_bytes()
    file.write_bytes(sound[: int(share * len(sound))])
    with pytest.raises(RecordError, match=r"record\.parquet: it is no Parquet file or a damaged one"):
        RunRecord.read(file)


def test_a_foreign_table_is_refused(tmp_path):
    path = tmp_path / "other.parquet"
    pl.DataFrame({"a": [1]}).write_parquet(path)
    with pytest.raises(RecordError, match=r"other\.parquet: it is a Parquet file, but no run record"):
        RunRecord.read(path)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(RecordError, match=r"nothing\.parquet: No such file"):
        RunRecord.read(tmp_path / "nothing.parquet")
    with pytest.raises(RecordError, match="Is a directory"):
        RunRecord.read(tmp_path)


def rewritten(file: Path, change, **stamp) -> None:
    table, old = pl.read_parquet(file), pl.read_parquet_metadata(file)
    kept = {name: value for name, value in old.items() if name.startswith("swarm_forage_env.")}
    change(table).write_parquet(
        file, metadata=kept | {f"swarm_forage_env.{key}": value for key, value in stamp.items()}
    )


def test_another_schema_version_is_refused(file):
    rewritten(file, lambda table: table, schema_version="999")
    with pytest.raises(RecordError, match=r"record\.parquet: it has schema version 999, this version .* reads 1"):
        RunRecord.read(file)


@pytest.mark.parametrize(
    "change",
    [
        lambda table: table.drop("collected"),
        lambda table: table.with_columns(collected=pl.lit("many")),
        lambda table: table.clear(),
        lambda table: table.with_columns(n_robots=pl.lit(None)),
    ],
    ids=["column missing", "wrong type", "no rows", "no key"],
)
def test_content_that_breaks_the_schema_is_refused(file, change):
    rewritten(file, change)
    with pytest.raises(RecordError, match=r"record\.parquet: its content is damaged"):
        RunRecord.read(file)


def test_a_failed_write_leaves_the_old_file_and_no_litter(record, file, monkeypatch):
    def full_disk(*args, **kwargs):
        raise OSError("No space left on device")

    monkeypatch.setattr(pl.DataFrame, "write_parquet", full_disk)
    with pytest.raises(OSError, match="No space left"):
        record.write(file)
    assert list(file.parent.iterdir()) == [file]
    assert RunRecord.read(file).same_results(record)


@pytest.mark.parametrize("column", ["collected", "performance"])
@pytest.mark.parametrize("values", [[1.0, 2.0], [1.0, 2.0, np.nan], [1.0, 2.0, np.inf]], ids=["short", "nan", "inf"])
def test_impossible_columns_are_refused(record, column, values):
    with pytest.raises(RecordError, match=f"column {column}"), np.errstate(invalid="ignore"):
        replace(record, **{column: values})


def test_fractions_are_no_counts(record):
    with pytest.raises(RecordError, match="collected to hold finite int64 values"):
        replace(record, collected=[0.5, 1.0, 2.0])


def test_contributed_columns_have_names_of_their_own(record):
    with pytest.raises(RecordError, match="names of their own, got collected"):
        replace(record, contributed={"collected": [1.0, 2.0, 3.0]})


def test_columns_cannot_be_changed(record):
    with pytest.raises(ValueError, match="read-only"):
        record.collected[0] = 1


def test_one_different_bit_is_another_result(record):
    nudged = record.performance.copy()
    nudged[1] = np.nextafter(nudged[1], 2.0)
    assert record.same_results(replace(record, provenance={}))
    assert not record.same_results(replace(record, performance=nudged))
    assert not record.same_results(replace(record, seed=1))
    assert not record.same_results(replace(record, contributed={}))


def test_a_run_is_read_with_another_performance(record, tmp_path):
    again = record.read_as("n_caches")
    np.testing.assert_array_equal(again.performance, record.n_caches)
    assert (again.run_id, RunSpec.from_json(again.spec).run_id) == (record.run_id, record.run_id)
    assert RunSpec.from_json(again.spec).scenario.performance == "n_caches"
    np.testing.assert_array_equal(again.read_as("throttle").performance, record.contributed["throttle"])
    again.write(tmp_path / "again.parquet")
    assert RunRecord.read(tmp_path / "again.parquet").same_results(again)
    assert record.read_as("collected") is record
    with pytest.raises(ConfigError, match="Did you mean 'n_caches'"):
        record.read_as("n_cache")


def test_rates_and_lengths(record):
    assert (record.n_intervals, record.horizon_s, record.wall_time_s) == (3, 600.0, 1.5)
    assert record.rate_per_1000_s("collected") == pytest.approx(50.0)
    assert np.isnan(replace(record, provenance={}).wall_time_s)


def test_describe_names_the_run_and_its_numbers(record):
    text = record.describe()
    for part in (
        record.run_id,
        "crw in warehouse_small, 50 robots",
        "noise = 0.1",
        "30 (50.0 per 1,000 s)",
        "numpy 2.0",
    ):
        assert part in text


def test_the_table_of_columns_lists_every_column_once(record):
    names = [line.split()[0] for line in record_columns().text().splitlines()[2:]]
    assert names[: len(record.keys()) + len(recording.COLUMN_DTYPES)] == [*record.keys(), *recording.COLUMN_DTYPES]
    assert len(set(names)) == len(names)


def test_whole_intervals():
    config = scenario("warehouse_small")
    assert whole_intervals(config) == 50
    assert whole_intervals(config, 2000) == 2
    for ticks in (0, 999, 1001):
        with pytest.raises(ConfigError, match="whole number of intervals of 200 s"):
            whole_intervals(config, ticks)
