"""Two commands at once: one is refused or waits, or both leave what one leaves; docs/promises.md has the table."""

import json
import subprocess
import sys
from contextlib import suppress
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from threading import Barrier, BrokenBarrierError, Thread

import numpy as np
import pytest

from metrics.benchmark import load_protocol, read_entry
from swarm_forage_env._internal.files import alone_in
from swarm_forage_env.inspect.maps import floor_maps
from swarm_forage_env.inspect.replay.files import read_replays, write_replays
from swarm_forage_env.runs.runner import run_specs
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.runs.store import RunStore, load
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.studies import study_table
from swarm_forage_env.studies.study_folder import StudyFolder, run_study
from swarm_forage_env.studies.study_table import pack_study, read_study
from tests.support.console import answer
from tests.support.entries import TINY
from tests.support.small_files import small_file
from tests.support.tiny_study import RANDOM, tiny_study

SMALL = ("--robots", "2", "--objects", "10", "--horizon", "4", "--set", "interval_s=2")
SPEC = plan_run(scenario("warehouse_small", n_robots=2, n_objects=10, horizon_s=4.0, interval_s=2.0), "random")
STUDY = tiny_study(policies=(RANDOM,), axes=(), reference=None)


@pytest.mark.parametrize("command", ["train --steps 128 --arenas 1", "dataset --policy random"])
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


def test_two_runs_into_one_folder_leave_what_one_leaves(tmp_path):
    words = [sys.executable, "-m", "swarm_forage_env.cli", "run", "--policy", "random", *SMALL, "--seeds", "3"]
    both = [
        subprocess.Popen([*words, "--jobs", "1", "--out", tmp_path / "both"], cwd=tmp_path, stdout=subprocess.DEVNULL)
        for _ in range(2)
    ]
    assert [process.wait(timeout=300) for process in both] == [0, 0]
    found = load(tmp_path / "both")
    made = run_specs([replace(SPEC, seed=seed) for seed in range(3)], jobs=1).records
    assert {record.run_id for record in found} == set(made)
    assert all(record.same_results(made[record.run_id]) for record in found)
    assert not list((tmp_path / "both").glob(".*"))


def test_two_commands_may_put_the_same_damaged_file_aside(tmp_path):
    store = RunStore(tmp_path)
    store.path("a").write_bytes(b"damaged")
    store.put_aside("a")
    store.put_aside("a")
    assert [file.name for file in tmp_path.iterdir()] == ["a.parquet.damaged"]


def test_two_shards_that_add_seeds_at_once_both_keep_theirs(tmp_path, monkeypatch):
    pytest.importorskip("fcntl")
    folder = StudyFolder(tmp_path / "study")
    folder.take(STUDY)
    both, read = Barrier(2), StudyFolder.study

    def study(self):
        found = read(self)
        with suppress(BrokenBarrierError):
            both.wait(0.3)  # both have read, and neither has written
        return found

    monkeypatch.setattr(StudyFolder, "study", study)
    shards = [Thread(target=folder.take, args=(replace(STUDY, seeds=(0, seed)),)) for seed in (5, 6)]
    for shard in shards:
        shard.start()
    for shard in shards:
        shard.join()
    assert read(folder).seeds == (0, 1, 5, 6)


def test_shards_run_beside_each_other(tmp_path):
    """One is under way while the other one begins and ends."""
    folder = StudyFolder(tmp_path / "study")
    folder.take(STUDY)
    with alone_in(folder.store.folder):  # a third one packs
        outcomes = [run_study(STUDY, folder, part=(part, 2), jobs=1) for part in (1, 2)]
    assert [outcome.count("done") for outcome in outcomes] == [1, 1]


def test_the_file_of_a_study_has_the_runs_of_whoever_packs_last(tmp_path, monkeypatch):
    pytest.importorskip("fcntl")
    folder = StudyFolder(tmp_path / "study")
    run_study(STUDY, folder, part=(1, 2), jobs=1)
    gather, others = study_table.gather_study, list[Thread]()

    def gather_slowly(*given):
        table = gather(*given)
        if not others:  # the first one; the second begins and has all the time to end before the first has written
            run_study(STUDY, folder, part=(2, 2), jobs=1)
            others.append(Thread(target=pack_study, args=(folder,)))
            others[0].start()
            others[0].join(1.0)
        return table

    monkeypatch.setattr(study_table, "gather_study", gather_slowly)
    file = pack_study(folder)
    others[0].join()
    assert read_study(file).frame["state"].unique().to_list() == ["done"]


def replays(file: Path, label: str) -> None:
    (replay,) = read_replays(small_file("replay.html"))
    write_replays(file, replace(replay, label=label))


def maps(file: Path, label: str) -> None:
    (replay,) = read_replays(small_file("replay.html"))
    replace(floor_maps(replay), n_robots=len(label)).write(file)


def entry(file: Path, label: str) -> None:
    replace(read_entry(small_file("entry.json"), load_protocol(TINY)), name=label).write(file)


WRITERS = {
    "page.html": (replays, lambda file: read_replays(file)[0].label),
    "maps.npz": (maps, lambda file: "a" * int(np.load(file)["n_robots"])),
    "entry.json": (entry, lambda file: json.loads(file.read_text())["name"]),
}
"""Name of a file -> what writes it under a label, and what reads the label."""


@pytest.mark.parametrize("name", WRITERS)
def test_of_two_commands_that_write_one_file_one_stands_whole(name, tmp_path):
    write, read = WRITERS[name]
    labels = ["a" * 40, "a" * 400]
    writers = [Thread(target=lambda label=label: [write(tmp_path / name, label) for _ in range(3)]) for label in labels]
    for writer in writers:
        writer.start()
    for writer in writers:
        writer.join()
    assert read(tmp_path / name) in labels
    assert [file.name for file in tmp_path.iterdir()] == [name], "drafts"
