"""`swarm-forage train`, as a person uses it."""

import dataclasses
import json
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from swarm_forage_env.cli import training_report
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.curves import curves
from swarm_forage_env.training.evaluation import EvaluationPlan
from swarm_forage_env.training.plan import Stage, TrainingPlan, read_plan
from swarm_forage_env.training.recipe import recipe
from swarm_forage_env.wrappers.world import World
from tests.support.small_files import evaluated, trained

TRUSTING = ("--trust-models", "train")
SETTINGS = ("n_objects=20", "n_arenas=2", "options.n_steps=16", "options.batch_size=64", "small_start=true",
            "evaluation.every_steps=128", "evaluation.horizon_s=200")  # fmt: skip
ELSE = ("--robots", "4", *(word for setting in SETTINGS for word in ("--set", setting)))
TINY = (*ELSE, "--steps", "128")


needs_training = pytest.mark.skipif(
    find_spec("stable_baselines3") is None or find_spec("torch") is None, reason="needs the train extra"
)


@needs_training
def test_trains_shows_evaluations_and_goes_on(command, painted):
    words = ("train", *TINY, "--set", "nest_progress=0.07")
    code, _, err = command(*words)
    assert code == 0, err
    assert err.startswith("ppo: 128 decisions in 3 stages, evaluated every 128 and after each stage\n")
    assert "Evaluated in 1 run in warehouse_small, 4 robots" in err
    folder = Path("results/training/warehouse_small_ppo")
    assert "decisions  deliveries per 1,000 s     crw  interference" in err
    assert str(folder / "policy.npz") in err
    assert "Both files draw their actions by probability." in err
    if find_spec("matplotlib"):
        assert (folder / "training.png").read_bytes().startswith(b"\x89PNG")
    plan = read_plan(folder / "plan.json")
    assert plan.scenario.reward.nest_progress == 0.07
    assert plan.options["n_steps"] == 16

    code, _, err = command(*words)
    assert code == 2
    assert "resume it (--resume), or choose another folder (--out)" in err


@needs_training
def test_a_training_is_resumed_by_its_folder_alone(command):
    code, _, err = command("train", "--resume", "--out", "a")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "Expected a to hold a training to resume" in err
    assert not Path("a").exists()
    assert command("train", *TINY, "--out", "a")[0] == 0
    begun = read_plan(Path("a/plan.json"))

    assert command(*TRUSTING, "--out", "a", "--resume", "--steps", "256")[0] == 0
    assert read_plan(Path("a/plan.json")) == begun.longer(256)
    assert "256," in Path("a/evaluations.csv").read_text()
    code, _, err = command(*TRUSTING, "--out", "a", "--resume")
    assert (code, "finished: 256 of 256" in err) == (0, True)
    code, _, err = command(*TRUSTING, "--out", "a", "--resume", "--steps", "255")
    assert (code, "at least the 256 steps" in err) == (2, True)


@needs_training
def test_ctrl_c_says_how_to_go_on(command, monkeypatch):
    from swarm_forage_env.training.sb3 import training

    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "train", stop)
    code, _, err = command("train", *TINY)
    assert code == 130
    assert err.endswith("swarm-forage: Stopped before there was anything to keep; the same command starts again.\n")

    folder = Path("results/training/warehouse_small_ppo")
    trained(folder, recipe(), evaluated(64, 5.0))
    assert f"To go on: swarm-forage --trust-models train --out {folder} --resume" in command("train", *TINY)[2]
    if find_spec("matplotlib"):
        assert (folder / "training.png").read_bytes().startswith(b"\x89PNG")


def test_words_are_arguments_of_the_recipe(command, monkeypatch):
    Path("world.toml").write_text("[set]\nn_robots = 7\nnest_progress = 0.0\n[wrappers.sensor_noise]\nsigma = 0.01\n")
    words = "--scenario world.toml --horizon 400 --wrapper actuator_noise:sigma=0.1 --algo sac --steps 300 --seed 4"
    settings = (
        "n_objects=60 first_pickup=0.5 caches=static n_arenas=3 interface.observation=full samples=false hidden=128,32 "
        "interface.decision_ticks=2 evaluation.every_steps=50 evaluation.horizon_s=200 small_start=false "
        "activation=tanh options.batch_size=8 options.gamma=0.9"
    )
    each = (word for setting in settings.split() for word in ("--set", setting))
    plans = []
    monkeypatch.setattr(training_report, "run_training", lambda plan, folder, **_: plans.append(plan))
    assert command("train", *words.split(), *each)[0] == 0
    assert plans[0] == recipe(
        "warehouse_small",
        algorithm="sac",
        steps=300,
        n_arenas=3,
        seed=4,
        interface={"observation": "full", "decision_ticks": 2},
        samples=False,
        wrappers=["actuator_noise:sigma=0.1", "sensor_noise:sigma=0.01"],
        evaluation=EvaluationPlan(every_steps=50, horizon_s=200.0),
        small_start=False,
        hidden=(128, 32),
        activation="tanh",
        options={"batch_size": 8, "gamma": 0.9},
        n_objects=60,
        n_robots=7,
        caches="static",
        first_pickup=0.5,
        nest_progress=0.0,
        horizon_s=400.0,
    )


PLAN = TrainingPlan(
    world=World(scenario("warehouse_small", n_robots=2, n_objects=20, horizon_s=4.0, interval_s=2.0)),
    stages=(Stage(steps=10), Stage(steps=20)),
    evaluation=EvaluationPlan(every_steps=10, horizon_s=4.0, n_runs=2),
)


def test_trainings_are_drawn_beside_others(command, monkeypatch):
    pytest.importorskip("matplotlib")
    for name, algorithm, best in (("first", "ppo", 40.0), ("second", "a2c", 8.0)):
        world = PLAN.judging_worlds[0].name
        told = [evaluated(steps, reached, world=world) for steps, reached in ((10, 0.0), (20, best), (30, best / 2))]
        trained(Path(name), dataclasses.replace(PLAN, algorithm=algorithm), *told)
    words = ("train", "curves", "first", "second", "--policy", "random,crw")
    code, out, _ = command(*words, "--picture", "both.png")
    assert code == 0
    rows = [re.split(r" {2,}", line) for line in out.splitlines()]
    cells = {row[0]: row[1:] for row in rows}
    assert cells["first"][:3] == ["20", "40.0", "0.250"]
    assert cells["second"][:3] == ["20", "8.0", "0.250"]
    assert cells.keys() >= {"random", "crw"}
    assert Path("both.png").read_bytes().startswith(b"\x89PNG")
    code, out, _ = command(*words, "--picture", "both.png", "--json")
    assert (code, bool(json.loads(out))) == (0, True)
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, _, err = command("train", "curves", "first", "--policy", "none")
    assert code == 1
    assert "No picture without matplotlib" in err
    assert not Path("first/curves.png").exists()


def test_seeds_of_several_methods_look_alike(command, monkeypatch):
    pytest.importorskip("matplotlib")
    figures = []

    def keep(figure, path, **_):
        figures.append(figure)
        Path(path).touch()

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", keep)
    told = evaluated(10, 1.0, world=PLAN.judging_worlds[0].name), evaluated(20, 2.0, world=PLAN.judging_worlds[0].name)
    for folder, rate in (("a/s0", 0.1), ("a/s1", 0.1), ("a/s2", 0.2), ("b/s0", 0.1)):
        seed = int(folder[-1])
        trained(Path(folder), dataclasses.replace(PLAN, seed=seed, options={"learning_rate": rate}), *told)
    for folders, names, looks in (
        (("a/s0", "a/s1", "a/s2", "b/s0"), ["a", "s2", "b/s0"], 3),  # s2 learnt at another rate
        (("a/s0", "a/s1"), ["s0", "s1"], 2),
    ):
        curves(folders, beside=()).draw("all.png")
        (legend,) = figures[-1].legends
        lines = figures[-1].axes[0].lines
        assert [text.get_text() for text in legend.get_texts()] == names
        assert (len(lines), len({(line.get_color(), line.get_marker()) for line in lines})) == (len(folders), looks)
    Path("a/s1/policy.zip").touch()  # as RecurrentPPO leaves it
    found = curves(("a/s0", "a/s1"), beside=()).text()
    assert "\nmean " in found
    assert "a/s1/policy.zip --name a" in found
    assert "\nmean " not in curves(("a/s1", "b/s0"), beside=()).text(), "two methods with one plan"


@pytest.fixture
def pictures(monkeypatch):
    """Names of the trainings of each picture that is drawn."""
    found = []
    monkeypatch.setattr(
        "swarm_forage_env.rendering.plots.draw_trainings",
        lambda path, trainings, **_: found.append((str(path), [*trainings])),
    )
    return found


def test_seeds_are_trained_drawn_and_told_and_the_same_command_with_resume_does_the_rest(
    command, pictures, monkeypatch
):
    pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")
    from tests.training.test_seeds import fake

    tiny = ("train", *TINY, "--jobs", "1")
    calls = fake(monkeypatch, fails={2})
    code, out, err = command(*tiny, "--seeds", "2", "--out", "all")
    assert code == 0, err
    assert calls == [(0, False), (1, False)]
    assert pictures == [("all/curves.png", ["seed_0", "seed_1"])]
    assert re.search(r"^  seed +decisions +deliveries per 1,000 s", err, re.MULTILINE)
    assert re.search(r"^     1 +128 +5\.00 +5\.0 +0\.250$", err, re.MULTILINE)
    assert err.endswith("picture all/curves.png\n")
    assert re.search(r"^mean +4\.5 +0\.250$", out, re.MULTILINE)
    assert out.endswith("swarm-forage benchmark all/seed_0/policy.npz all/seed_1/policy.npz --name all\n")
    code, _, err = command(*tiny, "--seeds", "3", "--out", "all")
    assert (code, err.count("\n")) == (2, 1)
    assert "an unused folder, got all/seed_0 with a training run; resume it" in err
    for words in (tiny, ("train", "--jobs", "1")):  # the plan is in the folder
        code, _, err = command(*words, "--seeds", "3", "--out", "all", "--resume")
        assert (code, calls.pop()) == (1, (2, False))
        assert "Seed 2 failed: too large" in err
        assert err.endswith("swarm-forage --trust-models train --out all --seeds 3 --resume\n")
    assert "found no plan.json" in command("train", "--seeds", "3", "--out", "none", "--resume")[2]
