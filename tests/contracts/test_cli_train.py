"""`swarm-forage train`, as a person uses it."""

import builtins
import json
import subprocess
import sys
from importlib.util import find_spec
from pathlib import Path

import pytest

from swarm_forage_env import cli
from swarm_forage_env.cli.plan import WorldOptions
from swarm_forage_env.cli.train import TrainOptions, build_plan, small_arena
from swarm_forage_env.config import ConfigError, with_overrides
from swarm_forage_env.learning.interface import InterfaceConfig
from swarm_forage_env.learning.plan import read_plan
from swarm_forage_env.scenarios import scenario

TINY = ("--robots", "4", "--objects", "20", "--steps", "128", "--arenas", "2", "--arg", "n_steps=16", "--arg",
        "batch_size=64", "--evaluate-every", "128")  # fmt: skip


@pytest.fixture
def command(tmp_path, monkeypatch, capsys):
    """Run swarm-forage in an empty folder; returns exit code, stdout, stderr."""
    monkeypatch.chdir(tmp_path)

    def call(*words):
        monkeypatch.setattr(sys, "argv", ["swarm-forage", *words])
        with pytest.raises(SystemExit) as end:
            cli.main()
        shown = capsys.readouterr()
        return end.value.code or 0, shown.out, shown.err

    return call


def test_trains_shows_evaluations_and_goes_on(command):
    pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")
    code, _, err = command("train", *TINY, "--small-start", "--set", "nest_progress=0.05")
    assert code == 0, err
    folder = Path("results/training/warehouse_small_ppo")
    assert "decisions  per 1,000 s" in err
    assert str(folder / "policy.npz") in err
    if find_spec("matplotlib"):
        assert (folder / "training.png").read_bytes().startswith(b"\x89PNG")
    plan = read_plan(folder / "plan.json")
    assert plan.scenario.reward.nest_progress == 0.05
    assert [stage.steps for stage in plan.stages] == [42, 86]
    assert plan.options["n_steps"] == 16

    words = ("train", *TINY, "--small-start", "--set", "nest_progress=0.05")
    code, _, err = command(*words)
    assert code == 2
    assert "resume it or go elsewhere" in err
    assert command(*words, "--resume")[0] == 0

    code, out, _ = command("run", "--policy", str(folder / "policy.npz"), "--robots", "3", "--objects", "20",
                           "--horizon", "4", "--set", "interval_s=2", "--jobs", "1", "--json")  # fmt: skip
    assert code == 0
    assert json.loads(out)


def test_without_the_training_library_the_message_says_what_to_install(command, monkeypatch):
    real = builtins.__import__

    def without(name, *rest, **named):
        if name.split(".")[0] == "stable_baselines3":
            raise ModuleNotFoundError("No module named 'stable_baselines3'", name="stable_baselines3")
        return real(name, *rest, **named)

    for name in [name for name in sys.modules if name.startswith("swarm_forage_env.learning.sb3")]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setattr(builtins, "__import__", without)
    code, _, err = command("train", *TINY)
    assert code == 1
    assert "'swarm-forage-env[train]' 'torch==2.13.0'" in err


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--algo", "ppp"), "Did you mean 'ppo'"),
        (("--algo", "dqn", "--actions", "continuous"), "dqn can choose"),
        (("--arg", "gamma=much"), "key=number"),
        (("--arg", "gama=0.9"), "Did you mean 'gamma'"),
        (("--horizon", "0"), "horizon_s"),
        (("--scenario", "warehouse_smal"), "Did you mean 'warehouse_small'"),
        (("--wrapper", "throtle:amplitude=0.1"), "Did you mean 'throttle'"),
        (("--plan", "nothing.toml"), "Cannot read the plan nothing.toml"),
        (("--plan", "ppo_warehouse_small", "--steps", "5"), "write them into its file"),
        (("--plan", "ppo_warehouse_small", "--scenario", "warehouse_small"), "write them into its file"),
    ],
)
def test_wrong_words_are_one_line_of_complaint(command, words, reason):
    code, _, err = command("train", *words)
    assert code == 2
    assert reason in err
    assert len(err.splitlines()) == 1


@pytest.mark.parametrize("missing", ["stable_baselines3", "torch"])
def test_the_message_is_the_same_from_python(missing):
    code = f"import sys; sys.modules[{missing!r}] = None; import swarm_forage_env.learning.sb3"
    result = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False)
    assert "pip install 'swarm-forage-env[train]' 'torch==2.13.0'" in result.stderr.splitlines()[-1]


def test_ctrl_c_says_how_to_go_on(command, monkeypatch):
    training = pytest.importorskip("swarm_forage_env.learning.sb3.training", reason="needs the train extra")

    def stop(*_, **__):
        raise KeyboardInterrupt

    monkeypatch.setattr(training, "train", stop)
    code, _, err = command("train", *TINY)
    assert code == 130
    assert "--resume goes on" in err


def test_defaults_are_what_a_driver_needs():
    plan = build_plan(WorldOptions(scenario="warehouse_small"), TrainOptions())
    assert plan.interface == InterfaceConfig(
        observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5
    )
    assert plan.options["gamma"] == 0.99
    assert len(plan.stages) == 1
    sac = build_plan(
        WorldOptions(scenario="warehouse_small"), TrainOptions(algorithm="sac", automatic_gripper=False)
    ).interface
    assert sac.actions == "continuous"
    assert not sac.automatic_gripper


def test_the_files_of_a_world_reach_the_plan(tmp_path):
    path = tmp_path / "world.toml"
    path.write_text("[scenario]\nn_robots = 7\n[actuator_noise]\nsigma = 0.1\n")
    world = WorldOptions(scenario="warehouse_small", config_file=path, wrappers=("sensor_noise:sigma=0.02",))
    plan = build_plan(world, TrainOptions(seed=3))
    assert plan.scenario.robots.n_robots == 7
    assert sorted(config.name for config in plan.wrappers) == ["actuator_noise", "sensor_noise"]
    assert plan.seed == 3


@pytest.mark.parametrize(
    ("name", "expected"),
    [
        ("warehouse_small", (12.8, 16.0, (1.28, 8.0), (1.28, 12.8))),
        ("warehouse_medium", (19.2, 19.2, (9.6, 9.6), (3.84, 3.84))),
    ],
)
def test_a_small_start_keeps_proportions(name, expected):
    config = scenario(name)
    small = with_overrides(config, **small_arena(config)).arena
    width, height, centre, size = expected
    assert (small.width_m, small.height_m) == pytest.approx((width, height))
    assert small.nest_centre_m == pytest.approx(centre)
    assert small.nest_size_m == pytest.approx(size)


def test_a_small_start_that_cannot_hold_the_objects_is_refused():
    with pytest.raises(ConfigError, match="objects for placement"):
        build_plan(WorldOptions(scenario="warehouse_small", objects=800), TrainOptions(small_start=True))
