"""Running a study: its folder, shards, restarts, damaged files."""

import json
import os
import random
import signal
import subprocess
import sys
import time
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from dataclasses import replace

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.runs.store import MISSING
from swarm_forage_env.studies.study_folder import (
    StudyFolder,
    parse_shard,
    run_study,
    shard,
)
from swarm_forage_env.studies.study_table import gather_study
from tests.support.tiny_study import NOBODY, RANDOM, tiny_study

STUDY = tiny_study()


class Counting(Executor):
    """Runs at once, and counts the runs."""

    n_runs = 0

    def submit(self, fn, /, *args, **kwargs):
        self.n_runs += 1
        future = Future()
        future.set_result(fn(*args, **kwargs))
        return future


def stored(folder):
    """The files of records."""
    return sorted(folder.runs.glob("*.parquet"))


def test_a_study_runs_once(tmp_path):
    folder = StudyFolder(tmp_path)
    state = run_study(STUDY, folder, jobs=1)
    assert (state.n_done, state.failures) == (16, {})
    assert state.records == {}, "they are in the folder alone"
    assert folder.study().to_mapping() == STUDY.to_mapping()
    assert all(place.is_complete for place in folder.place_states())
    counting = Counting()
    assert run_study(STUDY, folder, executor=counting).n_done == 16
    assert counting.n_runs == 0


@pytest.mark.parametrize("count", [1, 2, 3, 5, 40])
def test_shards_are_disjoint_complete_and_equal(count):
    specs = STUDY.plan.specs
    parts = [shard(specs, index, count) for index in range(1, count + 1)]
    ids = [run.run_id for part in parts for run in part]
    assert len(ids) == len(set(ids)) == len(specs)
    assert set(ids) == {run.run_id for run in specs}
    assert max(map(len, parts)) - min(map(len, parts)) <= 1


def test_shards_fill_one_folder(tmp_path):
    folder = StudyFolder(tmp_path)
    assert run_study(STUDY, folder, part=(1, 2), jobs=1).n_done == 8
    assert sum(place.n_runs[MISSING] for place in folder.place_states()) == 8
    run_study(STUDY, folder, part=(2, 2), jobs=1)
    assert all(place.is_complete for place in folder.place_states())


@pytest.mark.parametrize("word", ["2", "a/b", "0/2", "3/2", "1/0", "1/2/3"])
def test_a_shard_that_cannot_be(word):
    with pytest.raises(ConfigError, match="shard"):
        parse_shard(word)
    assert parse_shard("2/8") == (2, 8)


def test_more_seeds_and_readings_are_added(tmp_path):
    folder = StudyFolder(tmp_path)
    run_study(replace(STUDY, seeds=(0,)), folder, jobs=1)
    counting = Counting()
    run_study(replace(STUDY, seeds=(1,)), folder, executor=counting)
    assert counting.n_runs == 8
    run_study(replace(STUDY, seeds=(0,), rules=("program",)), folder, jobs=1)
    study = folder.study()
    assert (study.seeds, study.rules) == ((0, 1), ("described", "program"))
    assert sum(place.n_runs[MISSING] for place in folder.place_states()) == 8, "the other seed of the second rules"


def test_another_study_in_the_folder_is_refused(tmp_path):
    folder = StudyFolder(tmp_path)
    folder.take(STUDY)
    with pytest.raises(RecordError, match=r"other horizon_s\. Give another folder, or remove study\.json"):
        run_study(replace(STUDY, horizon_s=8.0), folder, jobs=1)


def test_failures_are_kept_and_tried_again(tmp_path):
    folder = StudyFolder(tmp_path)
    study = replace(STUDY, policies=(RANDOM, NOBODY))
    state = run_study(study, folder, jobs=1)
    assert (state.n_done, len(state.failures)) == (8, 8)
    counting = Counting()
    assert len(run_study(study, folder, executor=counting).failures) == 8
    assert counting.n_runs == 8


@pytest.mark.parametrize("damage", ["truncated", "renamed", "empty"])
def test_a_damaged_file_is_found_told_and_run_again(tmp_path, capsys, damage):
    folder = StudyFolder(tmp_path)
    run_study(STUDY, folder, jobs=1)
    before = gather_study(folder)
    one, other = stored(folder)[:2]
    content = one.read_bytes()
    changed = {
        "truncated": content[: len(content) // 2],
        "renamed": other.read_bytes(),
        "empty": b"",
    }
    assert changed[damage] != content
    one.write_bytes(changed[damage])
    assert sum(place.n_runs[MISSING] for place in folder.place_states()) == 1
    (line,) = gather_study(folder).damaged_lines
    assert line.startswith("Counts as missing, until 'study run' makes it again: ")
    assert str(one) in line
    assert run_study(STUDY, folder, jobs=1, progress=True).n_done == 16
    told = capsys.readouterr().err
    assert "15 of 16 runs are stored already." in told
    assert f"{'Expected' if damage == 'renamed' else 'Cannot read'} {one}" in told
    assert gather_study(folder).frame.equals(before.frame)


def test_a_folder_without_a_study_is_refused(tmp_path):
    with pytest.raises(RecordError, match=r"without study\.json"):
        StudyFolder(tmp_path).study()
    (tmp_path / "study.json").write_text("{}")
    with pytest.raises(RecordError, match=r"study\.json: Missing key 'name'"):
        StudyFolder(tmp_path).study()
    with pytest.raises(NotADirectoryError, match="got a file"):
        StudyFolder(tmp_path / "study.json")


KILLED_RUN = """
import sys, time
sys.path.insert(0, sys.argv[2])
from swarm_forage_env.cli import hear
from swarm_forage_env.studies.study_folder import StudyFolder, run_study
from swarm_forage_env.runs import runner
from tests.support.tiny_study import tiny_study

study, store = tiny_study(seeds=tuple(range(6))), runner.store

def never_all(folder, record):
    if len(list(folder.glob("*.parquet"))) == study.n_runs - 1:  # on a busy machine the signal may come late
        time.sleep(600)
    store(folder, record)

if __name__ == "__main__":
    runner.store = never_all
    hear()  # as commands do: where kernels are compiled Ctrl-C alone can be lost
    run_study(study, StudyFolder(sys.argv[1]), jobs=1)
"""


@pytest.mark.parametrize("sent", [signal.SIGKILL, signal.SIGINT])
def test_a_kill_at_a_random_moment_changes_nothing(tmp_path, sent, request):
    """However often and whenever a study is ended, the rest is done at restart, and the table is the same."""
    study = tiny_study(seeds=tuple(range(6)))
    straight = StudyFolder(tmp_path / "straight")
    run_study(study, straight, jobs=1)
    broken = StudyFolder(tmp_path / "broken")
    started = subprocess.Popen([sys.executable, "-c", KILLED_RUN, str(broken.folder), str(request.config.rootpath)],
                               stderr=subprocess.DEVNULL)  # fmt: skip
    try:
        while not stored(broken):
            assert started.poll() is None, "it ended before it was killed"
            time.sleep(0.01)
        time.sleep(random.Random().uniform(0.0, 0.2))
        os.kill(started.pid, sent)
        started.wait(60)
    finally:
        started.kill()
        started.wait()
    n_kept = len(stored(broken))
    assert 0 < n_kept < study.n_runs
    with ThreadPoolExecutor(3) as executor:
        run_study(study, broken, executor=executor)
    for folder in (straight, broken):
        gather_study(folder).write(folder.folder / "table.parquet")
    tables = [(folder.folder / "table.parquet").read_bytes() for folder in (straight, broken)]
    assert tables[0] == tables[1]


def test_the_study_file_of_a_folder_is_readable(tmp_path):
    folder = StudyFolder(tmp_path)
    folder.take(STUDY)
    assert json.loads((tmp_path / "study.json").read_text())["seeds"] == [0, 1]
