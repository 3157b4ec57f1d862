"""`swarm-forage train --seeds`, as a person uses it."""

import json
import re
import sys
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path

import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

from swarm_forage_env.cli import training_report
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
from tests.support.pictures import PNG

TINY = ("train", "--robots", "4", "--objects", "20", "--steps", "128", "--evaluation-horizon", "200", "--jobs", "1")
OUT = ("--out", "all")
TINY_PLAN = Path(__file__).parents[1] / "support" / "tiny_plan.toml"


@pytest.fixture
def calls(monkeypatch):
    """Trainings are made in no time; returns their seeds, and whether they were resumed. Seed 3 fails."""
    found = []

    def train(plan, folder, *, resume, report, callbacks):
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


def test_seeds_are_trained_drawn_and_told(command, calls, pictures, monkeypatch):
    monkeypatch.setattr(training_report, "LINE_EVERY_S", 0.0)
    code, out, err = command(*TINY, "--seeds", "2", *OUT)
    assert code == 0, err
    assert calls == [(0, False), (1, False)]
    assert pictures == [
        ("all/curves.png", ["seed_0"]),
        ("all/seed_0/training.png", ["trained policy"]),
        ("all/curves.png", ["seed_0", "seed_1"]),
        ("all/seed_1/training.png", ["trained policy"]),
        ("all/curves.png", ["seed_0", "seed_1"]),
    ]
    assert err.startswith("At least 256 decisions; a line about every minute says how many are done.\n")
    assert "64 of 256 decisions, mean return 2.00, about 3 s left" in err
    assert "192 of 256 decisions, mean return 2.50" in err
    assert re.search(r"^  seed +decisions +per 1,000 s", err, re.MULTILINE)
    assert re.search(r"^     1 +140 +5\.0 +10\.0 +0\.100$", err, re.MULTILINE)
    assert err.endswith("picture all/curves.png\n")
    assert re.search(r"^mean +4\.5 +0\.45 +0\.100$", out, re.MULTILINE)
    policies = "--policy all/seed_0/policy.npz --policy all/seed_1/policy.npz"
    assert out.endswith(f"swarm-forage benchmark {policies} --name all\n")


def test_a_plan_names_the_folder_and_the_first_seed(command, calls, pictures):
    replace(read_plan(TINY_PLAN), seed=7).write(Path("mine.json"))
    code, out, err = command("train", "--plan", "mine.json", "--seeds", "2", "--jobs", "1", "--json")
    assert code == 0, err
    assert calls == [(7, False), (8, False)]
    answer = json.loads(out)
    assert [one["policy"] for one in answer["trainings"]] == [
        f"results/training/mine_seeds/seed_{seed}/policy.npz" for seed in (7, 8)
    ]
    assert answer["means"]["ratio"]["mean"] == pytest.approx(1.15)
    assert answer["picture"] == "results/training/mine_seeds/curves.png"


def test_the_same_command_with_resume_does_the_rest(command, calls, pictures):
    command(*TINY, "--seeds", "2", *OUT)
    code, _, err = command(*TINY, "--seeds", "3", *OUT)
    assert (code, err.count("\n")) == (2, 1)
    assert "an unused folder, got all/seed_0 with a training run; resume it" in err
    calls.clear()
    code, out, err = command(*TINY, "--seeds", "3", *OUT, "--resume", "--picture", "figure.svg")
    assert (code, calls) == (0, [(2, False)]), err
    assert {path for path, _ in pictures[-3:]} == {"figure.svg", "all/seed_2/training.png"}
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


def test_a_training_that_fails_is_told_and_the_others_go_on(command, calls, pictures):
    code, out, err = command(*TINY, "--seeds", "5", *OUT)
    assert code == 1
    assert [seed for seed, _ in calls] == [0, 1, 2, 3, 4]
    assert f"Seed 3 failed: RuntimeError: the disk is gone ({__file__}, line " in err
    assert "Seed 3 failed and is not in the mean: RuntimeError: the disk is gone" in out
    again = "train --plan all/plan.json --seed 3 --out all/seed_3 --resume"
    assert err.endswith(f"again, alone: swarm-forage --trust-models {again}\n")


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


@pytest.mark.skipif(find_spec("matplotlib") is None, reason="needs the plots extra")
def test_the_picture_is_there_while_others_train(command, calls, monkeypatch):
    trained, seen = module.train, []

    def looked_at(plan, folder, **others):
        seen.append(Path("all/curves.png").exists() and Path("all/curves.png").read_bytes()[:4])
        trained(plan, folder, **others)

    monkeypatch.setattr(module, "train", looked_at)
    command(*TINY, "--seeds", "2", *OUT)
    assert seen == [False, PNG]


def test_without_matplotlib_it_says_so_once_and_trains(command, calls, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, out, err = command(*TINY, "--seeds", "3", *OUT, "--json")
    assert code == 0
    assert err.count("No picture without matplotlib") == 1
    assert json.loads(out)["picture"] is None


def test_a_picture_that_cannot_be_written_ends_no_training(command, calls, monkeypatch):
    def full(*_, **__):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("swarm_forage_env.rendering.plots.draw_trainings", full)
    code, out, err = command(*TINY, "--seeds", "2", *OUT)
    assert (code, len(calls)) == (0, 2)
    assert err.count("No picture all/curves.png: No space left on device.") == 3
    assert "mean" in out


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--seed", "1", "--seeds", "2"), "Expected --seed for one training or --seeds for several, got both."),
        (("--seeds", "0"), "Expected --seeds to be a number >= 1"),
        (("--seeds", "1000000000"), "--seeds to be a whole number from 1 to"),
        (("--seeds", "2", "--picture", "x.gif"), "Expected a picture file that ends in"),
        (("--json",), "Expected one training without --json, which go with --seeds."),
        (("--picture", "x.png"), "Expected one training without --picture, which go with --seeds."),
        (("--seeds", "2", "--arg", "gama=0.9"), "Did you mean 'gamma'"),
        (("--seeds", "2", "--callback", "nothing:Mine"), "No module named 'nothing'"),
    ],
)
def test_wrong_words_are_one_line_of_complaint(command, calls, words, reason):
    code, _, err = command(*TINY, *words)
    assert (code, len(err.splitlines())) == (2, 1)
    assert reason in err
    assert not calls
    assert not list(Path().iterdir())


def test_before_an_episode_has_ended_a_training_has_no_mean_return():
    at_first = TrainingStatus(steps=64, wall_time_s=1.0, episode_return=float("nan"))
    line = training_report.progress_line(128, at_first, None)
    assert line.startswith("64 of 128 decisions, no episode has ended, about ")
    assert "mean return 2.00" in training_report.progress_line(128, replace(at_first, episode_return=2.0), None)
