"""Two commands at once: one is refused or waits, or both leave what one leaves; docs/promises.md has the table."""

import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from threading import Barrier, BrokenBarrierError, Thread

import pytest

from swarm_forage_env._internal.files import alone_in
from swarm_forage_env.runs.runner import run_all
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.runs.store import load
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies import results
from swarm_forage_env.studies.study_file import Axis
from tests.support.console import answer
from tests.support.tiny_study import RANDOM, tiny_study

SMALL = ("--robots", "2", "--set", "n_objects=10", "--horizon", "4", "--set", "interval_s=2")
SPEC = plan_run(scenario("warehouse_small", n_robots=2, n_objects=10, horizon_s=4.0, interval_s=2.0), "random")
STUDY = tiny_study(Axis(name="n_robots", values=(2,)), policies=(RANDOM,))


@pytest.mark.parametrize("command", ["train --steps 128 --set n_arenas=1", "dataset random"])
def test_who_needs_a_folder_alone_is_refused_in_one_line(command, tmp_path, capsys):
    pytest.importorskip("fcntl")
    if command.startswith("train") and find_spec("stable_baselines3") is None:
        pytest.skip("needs the train extra: stable-baselines3 and torch")
    with alone_in(tmp_path, ValueError):
        assert answer(*command.split(), *SMALL, "--out", str(tmp_path)) == 2
    told = [line for line in capsys.readouterr().err.splitlines() if line.startswith("swarm-forage: ")]
    assert len(told) == 1
    assert f"Expected to be the only one that writes to {tmp_path}, but another command does" in told[0]
    assert list(tmp_path.iterdir()) == []


@pytest.mark.slow
def test_two_runs_into_one_folder_leave_what_one_leaves(tmp_path):
    words = [sys.executable, "-m", "swarm_forage_env.cli", "run", "random", *SMALL, "--seeds", "3"]
    both = [
        subprocess.Popen([*words, "--jobs", "1", "--out", tmp_path / "both"], cwd=tmp_path, stdout=subprocess.DEVNULL)
        for _ in range(2)
    ]
    assert [process.wait(timeout=300) for process in both] == [0, 0]
    found = load(tmp_path / "both")
    made = run_all([replace(SPEC, seed=seed) for seed in range(3)], jobs=1).records
    assert {record.run_id for record in found} == set(made)
    assert all(record.equals(made[record.run_id]) for record in found)
    assert not list((tmp_path / "both").glob(".*"))


def test_two_shards_that_add_seeds_at_once_both_keep_theirs(tmp_path, monkeypatch):
    pytest.importorskip("fcntl")
    folder = tmp_path / "study"
    results.take(STUDY, folder)
    both, read = Barrier(2), results.study_in

    def study_in(where):
        found = read(where)
        with suppress(BrokenBarrierError):
            both.wait(0.3)  # both have read, and neither has written
        return found

    monkeypatch.setattr(results, "study_in", study_in)
    shards = [Thread(target=results.take, args=(STUDY.with_run(seeds=(0, seed)), folder)) for seed in (5, 6)]
    for shard in shards:
        shard.start()
    for shard in shards:
        shard.join()
    assert read(folder).seeds == (0, 1, 5, 6)
