"""From policies to an entry, in a tiny protocol."""

import math
from dataclasses import replace

import numpy as np
import pytest

from metrics.benchmark import BenchmarkError, Training, load_protocol, read_entry, run_benchmark
from metrics.benchmark.entry import entry_command
from swarm_forage_env import plan_run, run_one
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs import runner
from tests.support.entries import TINY, made_up_entry


@pytest.fixture(scope="module")
def protocol():
    return load_protocol(TINY)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    return tmp_path_factory.mktemp("records")


@pytest.fixture(scope="module")
def entry(protocol, folder):
    policies = ("crw", "ppo_warehouse_small")
    training = Training(worlds="given", command="a command")
    return run_benchmark(
        policies, name="both", protocol=protocol, training=training, out=folder, jobs=1, progress=False
    )


def test_an_entry_has_the_runs_of_all_policies(entry, protocol):
    world = next(each.world for each in protocol.worlds if each.name == "room, 2 robots")
    record = run_one(plan_run(world, "crw", seed=2))
    row = entry.performance("room, 2 robots")[0]
    assert row[1] == pytest.approx(record["performance"].sum() / 0.2)  # per 1,000 s, of 200 s
    assert entry.interference("room, 2 robots")[0, 1] == pytest.approx(record["interference_fraction"].mean(), rel=1e-5)
    assert entry.performance("room, noisy wheels").shape == (2, 2)


def test_an_entry_tells_how_it_was_made(entry):
    crw, ppo = entry.policies
    assert (crw.name, crw.digest, crw.training_seed) == ("crw", "", None)
    assert (ppo.name, len(ppo.digest), ppo.training_seed) == ("ppo_warehouse_small", 16, 0)
    assert entry.training.command == "a command"
    assert entry.core_hours >= 0.0
    assert not math.isnan(entry.core_hours)
    assert entry.versions["swarm-forage-env"]


def test_stored_runs_give_the_same_entry(entry, protocol, folder, tmp_path):
    again = run_benchmark(
        ["crw", "ppo_warehouse_small"],
        name="both",
        protocol=protocol,
        training=entry.training,
        out=folder,
        jobs=1,
        progress=False,
    )
    assert again.runs == entry.runs
    again.write(tmp_path / "entry.json")
    assert read_entry(tmp_path / "entry.json", protocol).runs == entry.runs


def test_an_unknown_policy_is_refused(protocol):
    with pytest.raises(ValueError, match="Unknown policy 'cwr'"):
        run_benchmark(["cwr"], name="one", protocol=protocol)


def test_asked_again_the_stored_runs_answer(entry, protocol, folder, monkeypatch):
    monkeypatch.setattr(runner, "run_one", lambda spec: pytest.fail("a stored run was repeated"))
    again = run_benchmark(
        ["crw", "ppo_warehouse_small"], name="both", protocol=protocol, out=folder, jobs=1, progress=False
    )
    assert again.runs == entry.runs


def test_no_entry_is_made_of_failed_runs(tmp_path, monkeypatch):
    def act(self, obs, active):
        assert len(obs) != 2, "no pairs"
        return np.zeros((len(obs), 3), np.float32)

    monkeypatch.setattr(RandomPolicy, "act", act)
    quick = load_protocol(TINY, quick=True)
    n_runs = len(quick.worlds)
    told = rf"all {n_runs} runs to finish, 1 failed; the first, .*random in .*, 2 robots, seed 1: .*no pairs"
    with pytest.raises(BenchmarkError, match=told):
        run_benchmark(["random"], name="broken", protocol=quick, out=tmp_path, jobs=1, progress=False)
    # The others are kept.
    assert len(list(tmp_path.glob("*.parquet"))) == n_runs - 1


def test_an_entry_names_its_track(entry, protocol):
    assert entry.training.track == "open"
    in_short = Training(worlds="given", track="short", decisions=100)
    with pytest.raises(BenchmarkError, match="Expected 2 trainings"):
        run_benchmark(["crw"], name="one", protocol=protocol, training=in_short)
    assert entry_command(["crw", "dpo"], "two", training=in_short) == (
        "swarm-forage benchmark crw dpo --name two --trained-in given --track short --decisions 100"
    )


def test_a_file_with_its_whole_path_is_told_from_the_current_folder(tmp_path, monkeypatch):
    """Another machine has other folders; words about the interface go on to fit."""
    monkeypatch.chdir(tmp_path)
    given = ("runs/a.npz", f"{tmp_path}/runs/a.npz", f"{tmp_path}/m.zip:decision_ticks=5", "dpo")
    told = "runs/a.npz runs/a.npz m.zip:decision_ticks=5 dpo"
    assert entry_command(given, "x") == f"swarm-forage benchmark {told} --name x"


def test_one_network_in_two_files_is_no_two_trainings(protocol, tmp_path):
    in_short = Training(worlds="given", track="short", decisions=100)
    entry = made_up_entry(protocol, "copies", lambda k: 10.0, n_policies=2, training=in_short)
    for digests in ("ab", "aa"):
        policies = tuple(replace(one, digest=mark) for one, mark in zip(entry.policies, digests, strict=True))
        replace(entry, policies=policies).write(tmp_path / f"{digests}.json")
    assert read_entry(tmp_path / "ab.json", protocol).name == "copies"
    with pytest.raises(BenchmarkError, match=r"Expected different trainings in .*aa\.json, got one file twice"):
        read_entry(tmp_path / "aa.json", protocol)
