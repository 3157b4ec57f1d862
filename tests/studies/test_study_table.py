"""All runs of a study in one table, and in one file."""

from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from swarm_forage_env.runs.plan import run_plan
from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.runner import longest_first, run_all
from swarm_forage_env.runs.store import MISSING, record_file
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS, KEY_COLUMNS
from swarm_forage_env.studies.study import Axis, Place
from swarm_forage_env.studies.study_folder import StudyFolder, run_study
from swarm_forage_env.studies.study_table import gather_study, read_study
from tests.support.tiny_study import NOBODY, RANDOM, tiny_study

STUDY = tiny_study()


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = StudyFolder(tmp_path_factory.mktemp("study"))
    run_study(STUDY, made, jobs=1)
    return made


@pytest.fixture
def file(folder, tmp_path):
    path = tmp_path / "tiny.parquet"
    gather_study(folder).write(path)
    return path


def test_the_file_alone_gives_everything_back(folder, file):
    table, gathered = read_study(file), gather_study(folder)
    assert table.frame.equals(gathered.frame)
    assert table.spec.to_mapping() == STUDY.to_mapping()
    assert table.versions == gathered.versions
    assert len(table.versions) == 1
    assert read_study(folder.folder).frame.equals(table.frame)


def test_records_of_runs_by_several_versions_say_so(file):
    table = read_study(file)
    (made,) = table.versions
    mixed = replace(table, versions=(made, {**made, "commit": "0123456789abcdef"}))
    record = next(iter(mixed.records.values()))
    assert record.made_with["commit"] == f"{made['commit']} or 0123456789abcdef"
    assert record.made_with["numpy"].startswith(made["numpy"])


def test_every_interval_is_a_row_with_its_place(file):
    frame = read_study(file).frame
    assert frame.columns[:6] == ["study", "condition", "rules", "policy", "axis_population_size", "axis_noise"]
    assert frame.columns[-4:] == ["state", "error", "traceback", "rerun"]
    assert len(frame) == 16 * 2
    assert {*KEY_COLUMNS, *INTERVAL_COLUMNS} - set(frame.columns) == {"run_id", "controller"}
    last = frame.row(-1, named=True)
    place = ("tiny", 7, "described", "twin", 3.0, 0.02, 3, 1, 1, "done")
    columns = ("study", "condition", "rules", "policy", "axis_population_size", "axis_noise", "n_robots", "seed",
               "interval", "state")  # fmt: skip
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


def test_it_is_the_table_of_a_plan(file):
    """Whatever is asked of the runs of a plan can be asked of a study, too."""
    table = read_study(file)
    fresh = run_plan(STUDY.plan, jobs=1)
    assert len(table.records) == len(fresh.records) == 16
    for condition, place in zip(table.plan.conditions, STUDY.places, strict=True):
        for mine, other in zip(table.of(condition), fresh.of(condition), strict=True):
            assert mine.equals(other)
            assert mine.spec == other.spec
            assert mine.made_by(software_versions())
        seeds, curves = table.curves(condition, "collected")
        assert (seeds, curves["collected"].tolist()) == (
            table.curves(place)[0],
            table.curves(place)[1]["collected"].tolist(),
        )
        assert table.failure_lines(condition.policy.label) == ()
    with pytest.raises(KeyError):
        table.records["beef"]


def test_one_row_per_place(file):
    places = read_study(file).places()
    assert len(places) == 8
    assert places.filter(places["is_reference"])["axis_noise"].to_list() == [0.0] * 4
    assert places["n_done"].to_list() == [2] * 8
    assert places["n_robots"].to_list() == [2, 2, 3, 3] * 2


def test_a_run_can_be_made_again_from_the_file(file):
    table, place = read_study(file), Place("described", "twin", (2, 0.02))
    rows = table.rows(place).filter(pl.col("seed") == 1)
    again = run_one(table.spec_of(STUDY.specs_of(place)[1].run_id))
    assert again["interference_ticks"].tolist() == rows["interference_ticks"].to_list()
    with pytest.raises(KeyError, match="no run 'beef'"):
        table.spec_of("beef")


def test_failed_and_missing_runs_are_rows(tmp_path):
    study = replace(STUDY, policies=(RANDOM, NOBODY))
    folder = StudyFolder(tmp_path / "mine")
    run_study(study, folder, jobs=1)
    gone = study.specs_of(study.places[0])[1]
    record_file(folder.runs, gone.run_id).unlink()
    gather_study(folder).write(tmp_path / "mine.parquet")
    table = read_study(tmp_path / "mine.parquet")
    assert [state.n_runs for state in table.place_states()] == [
        {"done": 1, "failed": 0, "missing": 1},
        *[{"done": 2, "failed": 0, "missing": 0}] * 3,
        *[{"done": 0, "failed": 2, "missing": 0}] * 4,
    ]
    (missing,) = table.rows(study.places[0]).filter(pl.col("state") == MISSING).to_dicts()
    assert (missing["seed"], missing["n_robots"], missing["interval"]) == (1, 2, None)
    failed = table.rows(study.places[-1]).row(0, named=True)
    assert "nobody" in failed["error"]
    assert "Traceback" in failed["traceback"]
    assert failed["rerun"] == f"swarm-forage rerun runs/failures/{study.specs_of(study.places[-1])[0].run_id}.json"
    assert (folder.folder / failed["rerun"].split()[-1]).is_file()
    assert table.curves(study.places[-1], "collected") == ((), {})
    assert table.curves(study.places[0], "collected")[0] == (0,)


def test_a_study_without_any_run_has_a_table_too(tmp_path):
    folder = StudyFolder(tmp_path)
    folder.take(STUDY)
    table = gather_study(folder)
    assert table.frame["state"].to_list() == [MISSING] * 16
    table.write(tmp_path / "tiny.parquet")
    assert read_study(tmp_path / "tiny.parquet").frame.equals(table.frame)


def test_the_order_of_the_runs_does_not_change_a_byte(folder, file, tmp_path):
    other = StudyFolder(tmp_path / "other")
    other.take(STUDY)
    run_all(reversed(longest_first(STUDY.plan.specs)), out=other.runs, jobs=1, progress=False)
    gather_study(other).write(tmp_path / "other.parquet")
    assert (tmp_path / "other.parquet").read_bytes() == file.read_bytes()


def test_what_performance_is_may_be_an_axis(tmp_path):
    """Its conditions share the stored runs, and read them in different ways."""
    study = tiny_study(axes=(Axis(name="performance", values=("collected", "n_active")),), policies=(RANDOM,),
                       settings={"n_robots": 3, "n_objects": 20}, reference=None)  # fmt: skip
    folder = StudyFolder(tmp_path)
    run_study(study, folder, jobs=1)
    assert len([*folder.runs.glob("*.parquet")]) == 2
    table = gather_study(folder)
    assert [table.curves(place, "performance")[1]["performance"].mean() for place in study.places] == [0.0, 3.0]
    assert table.spec.reference_of(study.places[0]) is None


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
        read_study(next(folder.runs.glob("*.parquet")))
    with pytest.raises(RecordError, match="No such file"):
        read_study(tmp_path / "nothing.parquet")


def test_a_file_of_another_layout_is_refused(file, tmp_path):
    stamp = {key: value for key, value in pl.read_parquet_metadata(file).items() if key.startswith("swarm_forage_env")}
    pl.read_parquet(file).write_parquet(
        tmp_path / "new.parquet", metadata={**stamp, "swarm_forage_env.study.table_version": "9"}
    )
    with pytest.raises(RecordError, match="it has layout 9"):
        read_study(tmp_path / "new.parquet")
