"""The files in a folder of runs, and how unexpected ones are handled."""

from dataclasses import replace
from pathlib import Path

import pytest

from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import (
    RunFailure,
    failure_lines,
    is_stored,
    load,
    record_file,
    store,
)
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World

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


def test_an_empty_or_missing_folder_has_nothing_to_load(tmp_path):
    for empty in (tmp_path, tmp_path / "missing"):
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
