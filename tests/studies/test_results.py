"""The runs of a study: its folder, shards, restarts, the packed file."""

import os
import random
import signal
import subprocess
import sys
import time

import numpy as np
import polars as pl
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.runs.runner import run_all
from swarm_forage_env.runs.store import record_file
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS
from swarm_forage_env.studies.results import pack_study, read_study, run_study, shard, study_in, take
from swarm_forage_env.studies.study import Place
from swarm_forage_env.studies.study_file import Axis
from tests.support.tiny_study import BROKEN, RANDOM, tiny_study

STUDY = tiny_study()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("study")
    run_study(STUDY, made, jobs=1)
    return made


@pytest.fixture
def file(folder, tmp_path):
    return pack_study(folder, tmp_path / "tiny.parquet")[0]


def n_missing(folder):
    return int(read_study(folder).places()["missing"].sum())


@pytest.mark.parametrize("count", [1, 2, 3, 5, 40])
def test_shards_are_disjoint_complete_and_equal(count):
    specs = STUDY.plan.specs
    parts = [shard(specs, f"{index}/{count}") for index in range(1, count + 1)]
    ids = [run.run_id for part in parts for run in part]
    assert len(ids) == len(set(ids)) == len(specs)
    assert set(ids) == {run.run_id for run in specs}
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


@pytest.mark.parametrize("word", ["2", "a/b", "0/2", "3/2", "1/0", "1/2/3"])
def test_a_shard_that_cannot_be(word):
    with pytest.raises(ConfigError, match="shard"):
        shard(STUDY.plan.specs, word)


def test_shards_fill_one_folder_and_nothing_runs_twice(tmp_path):
    assert run_study(STUDY, tmp_path, part="1/2", jobs=1).n_done == 8
    assert n_missing(tmp_path) == 8
    found = run_study(STUDY, tmp_path, jobs=1)
    assert (found.n_done, found.n_stored, dict(found.records)) == (16, 8, {}), "records are in the folder alone"
    assert n_missing(tmp_path) == 0
    assert study_in(tmp_path) == STUDY


def test_more_seeds_and_rules_are_added(tmp_path):
    both = tiny_study(rules=("described", "program"))
    one = both.with_run(rules=("described",), seeds=(0,))
    run_study(one, tmp_path, jobs=1)
    assert run_study(one.with_run(seeds=(1,)), tmp_path, jobs=1).n_stored == 0
    run_study(one.with_run(rules=("program",)), tmp_path, jobs=1)
    study = study_in(tmp_path)
    assert (study.seeds, study.rules) == ((0, 1), ("described", "program"))
    assert n_missing(tmp_path) == 8, "the other seed of the second rules"


@pytest.mark.parametrize(
    ("changes", "what"),
    [({"horizon_s": 8.0}, "worlds"), ({"policies": (RANDOM,)}, "policies"), ({"name": "b"}, "name")],
)
def test_another_study_in_the_folder_is_refused(tmp_path, changes, what):
    take(STUDY, tmp_path)
    with pytest.raises(RecordError, match=rf"one of other {what}\. Give another folder, or remove study\.toml"):
        run_study(tiny_study(**changes), tmp_path, jobs=1)


@pytest.mark.parametrize("damage", ["truncated", "renamed", "empty"])
def test_a_damaged_file_is_told_and_its_run_made_again(tmp_path, damage):
    run_study(STUDY, tmp_path, jobs=1)
    before = read_study(tmp_path)
    one, other = (record_file(tmp_path / "runs", run.run_id) for run in STUDY.plan.specs[:2])
    content = one.read_bytes()
    one.write_bytes({"truncated": content[: len(content) // 2], "renamed": other.read_bytes(), "empty": b""}[damage])
    table = read_study(tmp_path)
    assert str(one) in table.damaged_lines[0]
    assert int(table.places()["missing"].sum()) == 1
    run_study(STUDY, tmp_path, jobs=1)
    assert read_study(tmp_path).frame.equals(before.frame)


def test_the_file_alone_gives_everything_back(folder, file):
    table, gathered = read_study(file), read_study(folder)
    assert table.frame.equals(gathered.frame)
    assert table.frame.schema == gathered.frame.schema
    assert table.spec == STUDY
    assert table.versions == gathered.versions
    assert len(table.versions) == 1


def test_every_interval_is_a_row_with_its_place(file):
    frame = read_study(file).frame
    assert frame.columns[:6] == ["study", "condition", "rules", "policy", "axis_population_size", "axis_noise"]
    assert frame.columns[-1] == "error"
    assert {*INTERVAL_COLUMNS} <= {*frame.columns}
    assert len(frame) == 16 * 2
    last = frame.row(-1, named=True)
    place = ("tiny", 7, "described", "twin", 3.0, 0.02, 3, 1, 1)
    columns = ("study", "condition", "rules", "policy", "axis_population_size", "axis_noise", "n_robots", "seed",
               "interval")  # fmt: skip
    assert tuple(last[name] for name in columns) == place


def test_a_place_gives_the_curves_of_its_runs_and_of_its_reference(file):
    table = read_study(file)
    place = Place("described", "twin", (3, 0.02))
    for one in (place, table.spec.reference_of(place)):
        seeds, curves = table.curves(one, "collected", "interference_fraction", "believed_interference_fraction")
        assert seeds == (0, 1)
        records = run_all(STUDY.specs_of(one), jobs=1, progress=False).records.values()
        for name, values in curves.items():
            np.testing.assert_array_equal(values, [record[name] for record in records])
        assert ("believed_interference_fraction" in curves) == (one == place), "only noisy runs have that column"
    with pytest.raises(KeyError):
        table.curves(Place("described", "nobody", (3, 0.02)), "collected")


def test_places_say_what_is_done_failed_and_missing(tmp_path):
    study = tiny_study(policies=(RANDOM, BROKEN))
    run_study(study, tmp_path, jobs=1)
    record_file(tmp_path / "runs", study.specs_of(study.places[0])[1].run_id).unlink()
    file, _ = pack_study(tmp_path)
    table = read_study(file)
    places = table.places()
    assert places.select("done", "failed", "missing").rows() == [(1, 0, 1), *[(2, 0, 0)] * 3, *[(0, 2, 0)] * 4]
    assert places.filter("is_reference")["axis_noise"].to_list() == [0.0] * 4
    assert places["n_robots"].to_list() == [2, 2, 3, 3] * 2
    (failed, _) = table.rows(study.places[-1]).to_dicts()
    assert (failed["seed"], failed["interval"], "no arguments" in failed["error"]) == (0, None, True)
    assert table.curves(study.places[-1], "collected") == ((), {})
    assert table.curves(study.places[0], "collected")[0] == (0,)
    assert len(run_study(study, tmp_path, jobs=1).failures) == 8, "failed runs are tried again"


def test_a_study_without_any_run_has_a_table_too(tmp_path):
    take(STUDY, tmp_path)
    table = read_study(tmp_path)
    assert (len(table.frame), table.places()["missing"].to_list()) == (0, [2] * 8)
    table.write(tmp_path / "tiny.parquet")
    assert read_study(tmp_path / "tiny.parquet").frame.equals(table.frame)


def test_the_order_of_the_runs_does_not_change_a_byte(file, tmp_path):
    for part in ("2/2", "1/2"):
        run_study(STUDY, tmp_path / "other", part=part, jobs=1)
    assert pack_study(tmp_path / "other")[0].read_bytes() == file.read_bytes()


def test_what_performance_is_may_be_an_axis(tmp_path):
    """Its conditions share the stored runs, and read them in different ways."""
    study = tiny_study(
        Axis(name="performance", values=("collected", "n_active")),
        policies=(RANDOM,),
        set={"n_robots": 3, "n_objects": 20},
    )
    run_study(study, tmp_path, jobs=1)
    assert len(list((tmp_path / "runs").glob("*.parquet"))) == 2
    table = read_study(tmp_path)
    assert [table.curves(place, "performance")[1]["performance"].mean() for place in study.places] == [0.0, 3.0]


def test_files_that_are_no_study_are_refused(file, tmp_path, folder):
    content = file.read_bytes()
    for name, damaged, message in (
        ("half", content[: len(content) // 2], "no Parquet file or a damaged one"),
        ("altered", content.replace(b"warehouse_small", b"WAREHOUSE_SMALL"), "Unknown scenario 'WAREHOUSE_SMALL'"),
    ):
        path = tmp_path / f"{name}.parquet"
        path.write_bytes(damaged)
        with pytest.raises(RecordError, match=message):
            read_study(path)
    with pytest.raises(RecordError, match="but no study"):
        read_study(record_file(folder / "runs", STUDY.plan.specs[0].run_id))
    with pytest.raises(RecordError, match="No such file"):
        read_study(tmp_path / "nothing.parquet")
    pl.read_parquet(file).drop("seed").write_parquet(
        tmp_path / "less.parquet", metadata={k: v for k, v in pl.read_parquet_metadata(file).items() if "swarm" in k}
    )
    with pytest.raises(RecordError, match="it has no column seed"):
        read_study(tmp_path / "less.parquet")


KILLED_RUN = """
import sys, time
sys.path.insert(0, sys.argv[2])
from swarm_forage_env.cli import hear
from swarm_forage_env.runs import runner
from swarm_forage_env.studies.results import run_study
from tests.support.tiny_study import tiny_study

study, store = tiny_study(seeds=tuple(range(6))), runner.store

def never_all(folder, record):
    if len(list(folder.glob("*.parquet"))) == len(study.plan.specs) - 1:  # on a busy machine the signal may come late
        time.sleep(600)
    store(folder, record)

if __name__ == "__main__":
    runner.store = never_all
    hear()  # as commands do: where kernels are compiled Ctrl-C alone can be lost
    run_study(study, sys.argv[1], jobs=1)
"""


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGINT])
def test_a_kill_at_a_random_moment_changes_nothing(tmp_path, sent, request):
    """However often and whenever a study is ended, the rest is done at restart, and the table is the same."""
    study = tiny_study(seeds=tuple(range(6)))
    straight, broken = tmp_path / "straight", tmp_path / "broken"
    run_study(study, straight, jobs=1)
    started = subprocess.Popen([sys.executable, "-c", KILLED_RUN, str(broken), str(request.config.rootpath)],
                               stderr=subprocess.DEVNULL)  # fmt: skip
    try:
        while not list(broken.glob("runs/*.parquet")):
            assert started.poll() is None, "it ended before it was killed"
            time.sleep(0.01)
        time.sleep(random.Random().uniform(0.0, 0.2))
        os.kill(started.pid, sent)
        started.wait(60)
    finally:
        started.kill()
        started.wait()
    n_kept = len(list(broken.glob("runs/*.parquet")))
    assert 0 < n_kept < len(study.plan.specs)
    assert run_study(study, broken, jobs=1).n_stored == n_kept
    assert pack_study(straight)[0].read_bytes() == pack_study(broken)[0].read_bytes()
