"""`swarm-forage train --seeds`, as a person uses it."""

import re
from dataclasses import replace
from pathlib import Path

import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

from swarm_forage_env.training.evaluations import (
    EVALUATIONS_FILE,
    MODEL_FILE,
    PLAN_FILE,
    Evaluation,
    TrainingStatus,
    write_evaluations,
)
from swarm_forage_env.training.plan import read_plan
from swarm_forage_env.training.sb3 import seeds as module

SETTINGS = ("--set", "n_objects=20", "--set", "evaluation.horizon_s=200")
TINY = ("train", "--robots", "4", "--steps", "128", *SETTINGS, "--jobs", "1")
OUT = ("--out", "all")
TINY_PLAN = Path(__file__).parents[1] / "support" / "tiny_plan.toml"


@pytest.fixture
def calls(monkeypatch):
    """Trainings are made in no time; returns their seeds, and whether they were resumed. Seed 3 fails."""
    found = []

    def train(plan, folder, *, resume, report):
        found.append((plan.seed, resume))
        report(TrainingStatus(steps=64, wall_time_s=1.0, episode_return=2.0 + plan.seed))
        folder.mkdir(parents=True, exist_ok=True)
        plan.write(folder / PLAN_FILE)
        (folder / MODEL_FILE).touch()
        if plan.seed == 3:
            raise RuntimeError("the disk\nis gone")
        made = Evaluation(
            steps=140,
            wall_time_s=2.0,
            performance=4.0 + plan.seed,
            baseline=10.0,
            interference_fraction=0.1,
            cpu_time_s=1.0,
        )
        write_evaluations(folder / EVALUATIONS_FILE, [made])
        report(made)

    monkeypatch.setattr(module, "train", train)
    return found


@pytest.fixture
def pictures(monkeypatch):
    """Names of the trainings of each picture that is drawn."""
    found = []
    monkeypatch.setattr(
        "swarm_forage_env.rendering.plots.draw_trainings",
        lambda path, trainings, **_: found.append((str(path), [*trainings])),
    )
    return found


def test_seeds_are_trained_drawn_and_told(command, calls, pictures):
    code, out, err = command(*TINY, "--seeds", "2", *OUT)
    assert code == 0, err
    assert calls == [(0, False), (1, False)]
    assert pictures == [("all/curves.png", ["seed_0", "seed_1"])]
    assert re.search(r"^  seed +decisions +deliveries per 1,000 s", err, re.MULTILINE)
    assert re.search(r"^     1 +140 +5\.00 +10\.0 +0\.100$", err, re.MULTILINE)
    assert err.endswith("picture all/curves.png\n")
    assert re.search(r"^mean +4\.5 +0\.45 +0\.100$", out, re.MULTILINE)
    policies = "all/seed_0/policy.npz all/seed_1/policy.npz"
    assert out.endswith(f"swarm-forage benchmark {policies} --name all\n")


def test_the_same_command_with_resume_does_the_rest(command, calls, pictures):
    command(*TINY, "--seeds", "2", *OUT)
    code, _, err = command(*TINY, "--seeds", "3", *OUT)
    assert (code, err.count("\n")) == (2, 1)
    assert "an unused folder, got all/seed_0 with a training run; resume it" in err
    calls.clear()
    code, out, err = command(*TINY, "--seeds", "3", *OUT, "--resume")
    assert (code, calls) == (0, [(2, False)]), err
    assert pictures[-1] == ("all/curves.png", ["seed_0", "seed_1", "seed_2"])
    assert command("train", "--seeds", "3", *OUT, "--resume", "--jobs", "1")[:2] == (
        0,
        out,
    )  # the plan is in the folder
    Path("all/seed_1", EVALUATIONS_FILE).unlink()  # killed before its first evaluation ended
    code, _, err = command("train", "--seeds", "3", *OUT, "--resume", "--jobs", "1")
    assert (code, "swarm-forage --trust-models" in err) == (2, True)
    assert command("--trust-models", "train", "--seeds", "3", *OUT, "--resume", "--jobs", "1")[1] == out
    assert calls == [(2, False), (1, True)]
    assert "found no plan.json" in command("train", "--seeds", "3", "--out", "none", "--resume")[2]


def test_ctrl_c_says_how_to_go_on(command, calls, pictures, monkeypatch):
    trained = module.train

    def stopped(plan, folder, **others):
        if plan.seed == 1:
            raise KeyboardInterrupt
        trained(plan, folder, **others)

    monkeypatch.setattr(module, "train", stopped)
    code, out, err = command(*TINY, "--seeds", "3", *OUT)
    assert (code, out) == (130, "")
    assert err.endswith(
        "swarm-forage: Interrupted: 1 of 3 trainings finished. To go on: swarm-forage --trust-models train --out all "
        "--seeds 3 --resume\n"
    )
    monkeypatch.setattr(module, "check_plan", lambda _: stopped(replace(read_plan(TINY_PLAN), seed=1), Path()))
    assert "Interrupted before there was anything to keep" in command(*TINY, "--seeds", "3", "--out", "new")[2]
