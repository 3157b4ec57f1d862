"""`swarm-forage train`, as a person uses it."""

import builtins
import json
import re
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from swarm_forage_env._internal.wording import install_command
from swarm_forage_env.cli import training_report
from swarm_forage_env.cli.options import WorldOptions
from swarm_forage_env.cli.train import RecipeOptions
from swarm_forage_env.training.evaluation_plan import EvaluationPlan
from swarm_forage_env.training.evaluations import Evaluation, write_evaluations
from swarm_forage_env.training.plan import read_plan
from swarm_forage_env.training.recipe import recipe

TRUSTING = ("--trust-models", "train")
TINY = ("--robots", "4", "--objects", "20", "--steps", "128", "--arenas", "2", "--arg", "n_steps=16", "--arg",
        "batch_size=64", "--small-start", "--evaluate-every", "128", "--evaluation-horizon", "200")  # fmt: skip


needs_training = pytest.mark.skipif(
    find_spec("stable_baselines3") is None or find_spec("torch") is None, reason="needs the train extra"
)


@needs_training
def test_trains_shows_evaluations_and_goes_on(command, painted, monkeypatch):
    monkeypatch.setattr(training_report, "LINE_EVERY_S", 0.0)
    words = ("train", *TINY, "--set", "nest_progress=0.07")
    code, _, err = command(*words)
    assert code == 0, err
    assert "Evaluated in 1 run of 200 s:" in err
    assert err.count("At least 128 decisions; a line about every minute says how many are done.") == 1
    assert re.search(r"^128 of 128 decisions, no episode has ended, about \d+ s left$", err, re.MULTILINE)
    folder = Path("results/training/warehouse_small_ppo")
    assert "decisions  per 1,000 s" in err
    assert str(folder / "policy.npz") in err
    if find_spec("matplotlib"):
        assert (folder / "training.png").read_bytes().startswith(b"\x89PNG")
    plan = read_plan(folder / "plan.json")
    assert plan.scenario.reward.nest_progress == 0.07
    assert [stage.steps for stage in plan.stages] == [42, 44, 42]
    assert plan.options["n_steps"] == 16

    code, _, err = command(*words)
    assert code == 2
    assert "resume it (--resume), or choose another folder (--out)" in err
    code, _, err = command("--trust-models", *words, "--resume")
    assert code == 0
    assert "This training was finished: 128 of 128 decisions" in err

    both = f"{folder / 'policy.npz'},{folder / 'model.zip'}"
    code, out, _ = command("run", "--policy", both, "--robots", "3", "--objects", "20", "--horizon", "4", "--set",
                           "interval_s=2", "--jobs", "1", "--json")  # fmt: skip
    assert code == 0
    assert len(json.loads(out)["runs"]) == 2


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

    # The same options divide 384 steps into other stages; those that began stay.
    assert command(*TRUSTING, *TINY, "--steps", "384", "--out", "a", "--resume")[0] == 0
    assert read_plan(Path("a/plan.json")) == begun.longer(384)
    code, _, err = command(*TRUSTING, *TINY, "--steps", "400", "--seed", "3", "--out", "a", "--resume")
    assert (code, len(err.splitlines())) == (2, 1)
    assert "got others: seed: 0 before, 3 now. Without options" in err


def test_without_the_training_library_the_message_says_what_to_install(command, monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **named):
        if name.split(".")[0] == "stable_baselines3":
            raise ModuleNotFoundError("No module named 'stable_baselines3'", name="stable_baselines3")
        return real(name, *rest, **named)

    for name in [name for name in sys.modules if name.startswith("swarm_forage_env.training.sb3")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(builtins, "__import__", without)
    code, _, err = command("train", *TINY)
    assert code == 1
    assert install_command("train") in err


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
    folder.mkdir(parents=True)
    (folder / "model.zip").touch()
    done = Evaluation(
        steps=64, wall_time_s=1.0, cpu_time_s=1.0, performance=5.0, baseline=4.0, interference_fraction=0.1
    )
    write_evaluations(folder / "evaluations.csv", [done])
    assert f"To go on: swarm-forage --trust-models train --out {folder} --resume" in command("train", *TINY)[2]
    if find_spec("matplotlib"):
        assert (folder / "training.png").read_bytes().startswith(b"\x89PNG")


CALLBACK = """
from stable_baselines3.common.callbacks import BaseCallback

class Stop(BaseCallback):
    def _on_step(self):
        print("seen", self.num_timesteps)
        return self.num_timesteps < 64
"""


@needs_training
def test_a_callback_of_the_user_runs_beside_the_training_and_can_end_it(command):
    Path("my_callbacks.py").write_text(CALLBACK)
    code, out, err = command("train", *TINY, "--callback", "my_callbacks:Stop", "--out", "stopped")
    assert code == 0, err
    assert [line.split()[0] for line in out.splitlines()] == ["seen"] * 8  # 8 robots decide in each step
    assert out.splitlines()[-1] == "seen 64"
    assert re.search(r"^\s+64 ", err, re.MULTILINE), err  # the last evaluation took place
    assert Path("stopped/policy.npz").is_file()
    assert "allback" not in Path("stopped/plan.json").read_text()  # a plan from elsewhere can name no code


def test_words_are_arguments_of_the_recipe(tmp_path):
    path = tmp_path / "world.toml"
    path.write_text("[set]\nn_robots = 7\nnest_progress = 0.0\n[wrappers.sensor_noise]\nsigma = 0.01\n")
    words = WorldOptions(
        scenario=str(path),
        objects=60,
        horizon=400.0,
        settings=("first_pickup=0.5", "caches=static"),
        wrappers=("actuator_noise:sigma=0.1",),
    )
    options = {
        "algorithm": "sac",
        "steps": 300,
        "arenas": 3,
        "seed": 4,
        "observation": "full",
        "automatic_gripper": False,
        "decision_ticks": 2,
        "site_memory": False,
        "frame_decisions": 30,
        "samples": False,
        "evaluate_every": 50,
        "evaluation_horizon": 200.0,
        "small_start": False,
        "hidden": "128,32",
        "activation": "tanh",
        "arguments": ("batch_size=8", "gamma=0.9"),
    }
    assert RecipeOptions(**options).plan(words) == recipe(
        "warehouse_small",
        algorithm="sac",
        steps=300,
        n_arenas=3,
        seed=4,
        interface={
            "observation": "full",
            "automatic_gripper": False,
            "decision_ticks": 2,
            "site_memory": False,
            "frame_decisions": 30,
        },
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
