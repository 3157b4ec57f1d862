"""RunStore: the files in the folder, and how unexpected files are handled."""

import json
from dataclasses import replace
from pathlib import Path

import polars as pl
import pytest

from swarm_forage_env.runs import store as runs_store
from swarm_forage_env.runs.record import RecordError, RunRecord
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import (
    DONE,
    FAILED,
    MISSING,
    STATES,
    RunFailure,
    RunStore,
    failure_lines,
    load,
    read_failure,
)
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World

SPEC = RunSpec(world=World(scenario("warehouse_small", n_robots=2, horizon_s=2.0, interval_s=1.0)), policy="random")


@pytest.fixture(scope="module")
def records() -> list[RunRecord]:
    return sorted((run_one(replace(SPEC, seed=seed)) for seed in range(3)), key=lambda record: record.run_id)


@pytest.fixture
def store(tmp_path, records) -> RunStore:
    store = RunStore(tmp_path / "new" / "folder")
    for record in records:
        store.write(record)
    return store


def test_what_is_written_is_there(store, records):
    assert store.run_ids() == tuple(record.run_id for record in records)
    assert all(record.run_id in store for record in records)
    assert "0" * 16 not in store
    for written, read in zip(records, load(store.folder), strict=True):
        assert read.same_results(written)


def test_an_empty_or_missing_folder_has_nothing_to_load(tmp_path):
    for folder in (tmp_path, tmp_path / "missing"):
        assert RunStore(folder).run_ids() == ()
        with pytest.raises(RecordError, match="found none"):
            load(folder)


def test_a_file_is_no_folder(tmp_path):
    (tmp_path / "file").write_text("x")
    with pytest.raises(NotADirectoryError, match="got a file"):
        RunStore(tmp_path / "file")


def test_files_of_other_kinds_and_drafts_are_left_alone(store):
    (store.folder / "performance.png").write_bytes(b"x")
    (store.folder / ".draft.parquet").write_bytes(b"x")
    (store.folder / ".abc.parquet.12.tmp").write_bytes(b"x")
    assert len(load(store.folder)) == 3


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


@pytest.mark.parametrize("damage", ["foreign", "cut off", "renamed"])
def test_a_bad_file_is_named_and_nothing_is_lost(store, records, damage):
    bad = store.path("bad")
    sound = store.path(records[0].run_id).read_bytes()
    if damage == "foreign":
        pl.DataFrame({"a": [1]}).write_parquet(bad)
    else:
        bad.write_bytes(sound if damage == "renamed" else sound[:-100])
    before = sorted(store.folder.iterdir())
    with pytest.raises(RecordError, match=r"bad\.parquet.* Move the file away"):
        load(store.folder)
    assert sorted(store.folder.iterdir()) == before


def test_a_missing_record_is_not_to_be_moved_away(store):
    with pytest.raises(RecordError, match=r"absent\.parquet: No such file or directory\.$"):
        store.read("absent")


def test_a_write_that_fails_leaves_no_draft(store, records, monkeypatch):
    def full_disk(*_, **__):
        raise OSError("no space left")

    before = sorted(store.folder.rglob("*"))
    monkeypatch.setattr(pl.DataFrame, "write_parquet", full_disk)
    with pytest.raises(OSError, match="no space"):
        store.write(records[0])
    monkeypatch.setattr(Path, "replace", full_disk)
    with pytest.raises(OSError, match="no space"):
        store.write_failure(RunFailure(spec=SPEC, error="error", traceback="trace"))
    assert sorted(store.folder.rglob("*")) == sorted([*before, store.folder / "failures"])


def test_a_failure_is_kept_until_the_run_succeeds(store, records):
    spec = replace(SPEC, seed=1)
    failure = RunFailure(spec=spec, error="ValueError: no", traceback="line 1\nline 2")
    store.write_failure(failure)
    assert store.failures() == (failure,)
    content = json.loads(store.failure_path(failure.run_id).read_text())
    assert content["rerun"] == f"swarm-forage rerun {store.failure_path(failure.run_id)}"
    assert content["run"] == spec.describe()
    assert read_failure(store.failure_path(failure.run_id)).spec == spec
    store.write(next(record for record in records if record.run_id == spec.run_id))
    assert store.failures() == ()
    assert len(load(store.folder)) == 3


def test_planned_runs_are_looked_up(store, records, monkeypatch):
    """What is done, failed, missing or damaged, and read with the performance that is asked for."""
    other = replace(SPEC, world=World(replace(SPEC.scenario, performance="n_active")))
    failed, missing, damaged = (replace(SPEC, seed=seed) for seed in (3, 4, 1))
    store.write_failure(RunFailure(spec=failed, error="ValueError: no", traceback="line 1"))
    store.path(damaged.run_id).write_bytes(b"damaged")
    planned = [other, damaged, failed, missing]
    found = store.look_up(planned)
    assert found.states == dict(zip((spec.run_id for spec in planned), (DONE, MISSING, FAILED, MISSING), strict=True))
    assert set(found.states.values()) == set(STATES)
    assert list(found.records) == [other.run_id]
    assert found.records[other.run_id].performance.tolist() == [2.0, 2.0]
    assert list(found.damaged) == [damaged.run_id]
    assert found.damaged[damaged.run_id].startswith(f"Cannot read {store.path(damaged.run_id)}: it is no Parquet file")
    assert found.n_foreign == 0
    without = store.look_up(planned, keep=False)
    assert (without.records, without.states) == ({}, found.states)
    monkeypatch.setattr(runs_store, "software_versions", lambda: {"numba": "0.0"})
    assert store.look_up(planned, keep=False).n_foreign == 1, "the damaged one tells no version"


def test_a_damaged_file_that_is_put_aside_is_no_record_any_more(store, records):
    path = store.path(records[0].run_id)
    path.write_bytes(b"damaged")
    store.put_aside(records[0].run_id)
    assert path.with_name(f"{path.name}.damaged").read_bytes() == b"damaged"
    assert len(load(store.folder)) == 2


@pytest.mark.parametrize("text", ["", "{", "[]", "{}", '{"spec": {}, "error": "e", "traceback": []}'])
def test_a_file_that_is_no_failure_is_refused(tmp_path, text):
    (tmp_path / "x.json").write_text(text)
    with pytest.raises(RecordError, match=r"x\.json: it is no failure"):
        read_failure(tmp_path / "x.json")


def test_a_missing_failure_is_refused(tmp_path):
    with pytest.raises(RecordError, match="No such file"):
        read_failure(tmp_path / "x.json")
