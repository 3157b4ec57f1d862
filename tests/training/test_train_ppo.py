"""`scripts/train_ppo.py` is `swarm-forage train` in plain stable-baselines3."""

import importlib.util
import sys
from functools import partial
from pathlib import Path

import numpy as np
import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

from stable_baselines3 import PPO

from swarm_forage_env.policies.network import Network
from swarm_forage_env.training.recipe import recipe
from swarm_forage_env.training.sb3.training import train

SCRIPT = Path(__file__).resolve().parents[2] / "scripts" / "train_ppo.py"


def test_the_script_gives_the_weights_of_the_command(tmp_path, monkeypatch):
    tiny = partial(recipe, n_robots=4, n_objects=20, n_arenas=2, options={"n_steps": 16, "batch_size": 64})
    spec = importlib.util.spec_from_file_location("train_ppo", SCRIPT)
    assert spec is not None
    assert spec.loader is not None
    script = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(script)
    monkeypatch.setattr(script, "recipe", tiny)
    monkeypatch.setattr(sys, "argv", ["train_ppo.py", "--steps=384", f"--out={tmp_path / 'example.npz'}"])
    script.main()

    plan = tiny("warehouse_small", steps=384, evaluation={"horizon_s": 200.0, "baseline": "random"})
    assert len(plan.stages) == 3
    result = train(plan, tmp_path / "command")
    scripted = PPO.load(tmp_path / "example.zip")
    assert scripted.num_timesteps == result.model.num_timesteps == 384
    ours, theirs = (model.policy.state_dict() for model in (scripted, result.model))
    assert all(np.array_equal(ours[name].numpy(), theirs[name].numpy()) for name in theirs)
    about = Network.load(tmp_path / "example.npz").about
    assert (about.interface, about.samples) == (plan.interface, plan.samples)
