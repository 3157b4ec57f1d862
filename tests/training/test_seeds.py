"""Trainings of one plan with several seeds: what is trained, what goes on, what fails, and what all come to."""

import json
import signal
import time
from dataclasses import replace
from multiprocessing import Pipe
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

from metrics.statistics import aggregate
from swarm_forage_env.training.curves import beside_baseline, read_training
from swarm_forage_env.training.evaluation import Evaluation
from swarm_forage_env.training.plan import read_plan
from swarm_forage_env.training.sb3 import seeds as module
from swarm_forage_env.training.sb3.seeds import seed_folder, train_seeds
from swarm_forage_env.training.sb3.training import train
from tests.support import fake_trainings
from tests.support.fake_trainings import SHORT, STATUS
from tests.support.small_files import evaluated, trained


def fake(monkeypatch, *, fails=()) -> list[tuple[int, bool]]:
    """Trainings are made in no time, or fail, in this process; returns seeds, and whether they were resumed."""
    calls: list[tuple[int, bool]] = []

    def started(job):
        plan, folder, resume = job
        ours, theirs = Pipe()
        calls.append((plan.seed, resume))
        if plan.seed in fails:
            theirs.send("too large")
        else:
            trained(folder, plan, evaluated(plan.total_steps, 4.0 + plan.seed))
            theirs.send(evaluated(128, 4.0 + plan.seed))
        theirs.close()
        return ours, SimpleNamespace(join=lambda *_: None, terminate=list, kill=list, exitcode=0)

    monkeypatch.setattr(module, "_started", started)
    return calls


@pytest.mark.slow
def test_each_seed_is_trained_in_its_folder_as_alone(tmp_path, tmp_path_factory):
    """Real processes, so it takes seconds."""
    told = []
    found = train_seeds(SHORT, [3, 4], tmp_path, jobs=2, report=lambda seed, news: told.append((seed, type(news))))
    assert not found.failures
    assert sorted(seed for seed, kind in told if kind is Evaluation) == [3, 4]
    assert {path.name for path in tmp_path.iterdir()} == {"plan.json", "seed_3", "seed_4"}
    alone = tmp_path_factory.mktemp("alone") / "run"
    train(replace(SHORT, seed=4), alone)
    same, other = (np.load(folder / "policy.npz") for folder in (alone, tmp_path / "seed_4"))
    names = [name for name in same.files if name != "about"]  # which tells when it was trained
    assert "weight_0" in names
    assert all(np.array_equal(same[name], other[name]) for name in names)
    assert read_plan(tmp_path / "plan.json") == SHORT
    assert [(one.plan.seed, one.is_finished) for one in found.trainings] == [(3, True), (4, True)]


def test_what_is_finished_is_kept_and_the_rest_goes_on(tmp_path, monkeypatch):
    calls = fake(monkeypatch, fails={3})
    for seed, steps in enumerate((128, 64)):
        trained(seed_folder(tmp_path, seed), replace(SHORT, seed=seed), evaluated(steps, 4.0))
    told = []
    found = train_seeds(SHORT, range(4), tmp_path, resume=True, report=lambda *news: told.append(news))
    assert calls == [(1, True), (2, False), (3, False)]
    assert ([one.label for one in found.trainings], found.failures) == (
        ["seed_0", "seed_1", "seed_2"],
        {"seed_3": "too large"},
    )
    assert (3, "too large") in told
    longer = SHORT.longer(256)
    train_seeds(longer, range(1), tmp_path, resume=True)
    assert calls[3:] == [(0, True)]
    assert read_plan(tmp_path / "plan.json") == longer


@pytest.mark.slow
def test_a_process_that_is_killed_ends_no_other_training(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_train_here", fake_trainings.one_is_killed)
    told = []
    found = train_seeds(SHORT, range(3), tmp_path, jobs=2, report=lambda *news: told.append(news))
    assert sorted(seed for seed, news in told if news == STATUS) == [0, 1, 2]
    assert [*found.failures] == ["seed_1"]
    assert "its process was killed, most likely because memory ran out" in found.failures["seed_1"]
    assert not found.has_picture
    assert found.text().endswith(found.failures["seed_1"])
    assert module._how_it_ended(3).startswith("its process ended with exit code 3;")
    assert module._how_it_ended(-signal.SIGSEGV).startswith("its process ended with signal 11;")


@pytest.mark.slow
def test_an_interrupt_lets_processes_keep_what_they_have(tmp_path, monkeypatch):
    monkeypatch.setattr(module, "_train_here", fake_trainings.last_for_ever_apart)
    begun = {}

    def report(seed, news):
        begun[seed] = time.monotonic()
        if len(begun) == 2:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train_seeds(SHORT, range(2), tmp_path, jobs=2, report=report)
    assert time.monotonic() - max(begun.values()) < module.KEEP_S
    assert all((tmp_path / f"seed_{seed}" / "kept").exists() for seed in range(2))


def test_means_are_over_trainings_as_they_are_kept(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for seed, best in enumerate((10.0, 20.0, 60.0)):
        evaluations = evaluated(64, best, 0.1), evaluated(128, best / 2, 0.2)
        trained(seed_folder(tmp_path, seed), replace(SHORT, seed=seed), *evaluations)
    three = [read_training(seed_folder(tmp_path, seed)) for seed in range(3)]
    found = beside_baseline(three, {"seed_2": "diverged"})
    assert [one.kept.steps for one in found.trainings] == [64, 64, 64]
    interval = aggregate([10.0, 20.0])
    bounds = f"{interval.lower:.1f} to {interval.upper:.1f}"
    rows = {row[0]: row[1:] for row in found.sheets()[0].frame.rows()}
    assert rows["mean"] == ("", "15.0", "0.100", "")
    assert rows["95 %"] == ("", bounds, "0.100 to 0.100", "")
    assert rows["random"] == ("", "5.0", "", "")
    assert "seed_2 failed and is in no mean: diverged" in found.text()
    assert found.text().splitlines()[-1] == (
        f"swarm-forage benchmark seed_0/policy.npz seed_1/policy.npz --name {tmp_path.name}"
    )
    assert next(iter(json.loads(found.json()).values()))[0]["policy"] == "seed_0"
    one = beside_baseline(three[:1])
    assert "95 %" not in one.text()
    driven = replace(SHORT.interface, actions="continuous")
    sac = replace(SHORT, algorithm="sac", options={}, interface=driven)
    trained(tmp_path / "sac", sac, evaluated(64, 10.0), evaluated(128, 4.0))
    last = read_training(tmp_path / "sac")
    assert (Path(last.policy).name, last.kept.steps) == ("model.zip", 128), "its network is in no file"
