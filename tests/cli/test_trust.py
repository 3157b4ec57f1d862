"""Models run code when they are opened: only those that somebody typed are."""

import base64
import json
import pickle
import zipfile
from pathlib import Path

import pytest

from swarm_forage_env.cli.worlds import split_names
from swarm_forage_env.policies import trust
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import RunFailure, failure_file, store
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World

TINY = ("--robots", "2", "--set", "n_objects=10", "--horizon", "200")
NOTE = {"interface": {"observation": "compact"}, "caches": "static"}


class Evil:
    """What a pickle can hold: opening it writes a file."""

    def __reduce__(self):
        return Path.touch, (Path("owned"),)


def evil_model(path: Path, **more: object) -> Path:
    """A file like a model of stable-baselines3, of which one part writes the file `owned` when it is opened."""
    payload = base64.b64encode(pickle.dumps(Evil())).decode()
    about = {"policy_class": {":type:": "x", ":serialized:": payload}, **more}
    with zipfile.ZipFile(path, "w") as archive:
        archive.writestr("data", json.dumps(about))
    return path


@pytest.fixture
def model(tmp_path):
    return evil_model(tmp_path / "evil.zip", swarm_forage_note=NOTE)


def test_a_typed_model_is_opened(command, model):
    pytest.importorskip("stable_baselines3")
    assert command("run", f"crw,{model.name}", *TINY)[0] == 2
    assert Path("owned").exists()


def test_a_failure_that_names_a_model_is_refused(command, model, tmp_path):
    spec = RunSpec(world=World(scenario("warehouse_small", n_robots=2, n_objects=10)), policy=str(model))
    store(tmp_path / "store", RunFailure(spec=spec, error="e", traceback="t"))
    code, _, err = command("rerun", str(failure_file(tmp_path / "store", spec.run_id)))
    assert code == 2
    assert "which you did not name yourself" in err
    assert "swarm-forage --trust-models and the same words again" in err
    assert not Path("owned").exists()


@pytest.mark.parametrize("suffix", ["zip", "ZIP"])
def test_a_plan_that_names_a_model_is_refused_before_anything_starts(command, tmp_path, suffix):
    pytest.importorskip("stable_baselines3")  # without it, nothing trains at all
    evil_model(tmp_path / f"evil.{suffix}")
    (tmp_path / "plan.toml").write_text(
        f'[scenario]\npreset = "warehouse_small"\n[evaluation]\nbaseline = "evil.{suffix}"\n', encoding="utf-8"
    )
    code, _, err = command("train", "--plan", "plan.toml", "--out", "training")
    assert (code, Path("owned").exists()) == (2, False)
    assert "which you did not name yourself" in err


def test_networks_need_no_trust(tmp_path):
    with trust.only_typed(()):
        load_policy("ppo_warehouse_small")
        trust.check(tmp_path / "some.npz")
        with pytest.raises(trust.UntrustedModelError):
            trust.check(tmp_path / "some.zip")
    trust.check(tmp_path / "some.zip")  # a Python program decides for itself


OWNING = """
from pathlib import Path
import numpy as np

class Mine:
    caches = "static"
    def reset(self, spec, rng): ...
    def act(self, obs, active): return np.zeros((len(obs), 3), np.float32)

Path("owned").touch()
"""


def test_a_typed_python_file_is_run_and_one_in_a_study_only_on_trust(command):
    Path("mine.py").write_text(OWNING)
    Path("study.toml").write_text(
        'name = "s"\nscenario = "warehouse_small"\npolicies = ["mine.py:Mine", "random"]\nset = { n_objects = 20 }\n'
        "budget.s = { seeds = 1, horizon_s = 2.0, interval_s = 1.0 }\n"
    )
    code, _, err = command("study", "run", "study.toml")
    assert (code, Path("owned").exists()) == (2, False)
    assert "which you did not name yourself" in err
    code, out, err = command("info", "mine.py")
    assert (code, Path("owned").exists()) == (0, False), "info only reads it"
    assert "classes  Mine" in out
    code, _, err = command("--trust-models", "study", "run", "study.toml", "--dry-run")
    assert (code, Path("owned").exists()) == (0, True), err
    assert command("--trust-models", "study", "run", "study.toml", "--out", "s", "--jobs", "1")[0] == 0
    Path("mine.py").unlink()
    Path("owned").unlink()
    for place in ("s", "s/s.parquet"):
        code, out, err = command("study", "status", place)
        assert (code, Path("owned").exists()) == (0, False), err
        assert "4 of 4 runs done" in out, "to read a study opens no policy"
    code, _, err = command("study", "run", "s/study.toml", "--out", "again", "--jobs", "1")
    assert (code, "which you did not name yourself" in err) == (2, True)


WORLD = ("--robots", "3", "--set", "n_objects=20", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1", "--json")


def test_a_model_without_a_note_is_run_with_the_length_of_its_decisions(command):
    library = pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")
    from swarm_forage_env.training.sb3 import SwarmVecEnv

    env = SwarmVecEnv("warehouse_small", n_robots=3, n_objects=20)
    library.A2C("MlpPolicy", env, device="cpu", seed=1).save("model.zip")
    code, _, err = command("run", "model.zip", *WORLD)
    assert (code, len(err.splitlines())) == (2, 1)
    assert "say model.zip:decision_ticks=1" in err
    code, out, err = command("run", "random,model.zip:decision_ticks=5", *WORLD)
    assert code == 0, err
    assert len(json.loads(out)["runs"]) == 2
    code, _, err = command("run", "model.zip:decision_tick=5", *WORLD)
    assert (code, len(err.splitlines())) == (2, 1)
    assert "Did you mean 'interface.decision_ticks'" in err


def test_words_about_a_file_stay_with_it():
    text = "crw, a.zip:observation=compact,decision_ticks=5,lr=0.1/b.npz,random"
    assert split_names(text) == ("crw", "a.zip:observation=compact,decision_ticks=5", "lr=0.1/b.npz", "random")
