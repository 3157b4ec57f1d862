"""Policy files on the command line."""

import json

import gymnasium
import numpy as np
import pytest
from gymnasium import spaces

from swarm_forage_env.cli.worlds import split_names

WORLD = ("--robots", "3", "--set", "n_objects=20", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1", "--json")


class Stage(gymnasium.Env):
    """The spaces of the environment itself, for one robot."""

    observation_space, action_space = spaces.Box(-1.0, 1.0, (111,), np.float32), spaces.Box(-1.0, 1.0, (3,), np.float32)


def test_a_model_without_a_note_is_run_after_a_line_about_what_is_guessed(command):
    library = pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")
    library.A2C("MlpPolicy", Stage(), device="cpu", seed=1).save("model.zip")
    with pytest.warns(UserWarning, match=r"model\.zip has no note of its training"):
        assert command("run", "model.zip", *WORLD)[0] == 0
    code, out, err = command("run", "random,model.zip:decision_ticks=5", *WORLD)
    assert code == 0, err
    assert len(json.loads(out)["runs"]) == 2
    code, _, err = command("run", "model.zip:decision_tick=5", *WORLD)
    assert (code, len(err.splitlines())) == (2, 1)
    assert "Did you mean 'decision_ticks'" in err


def test_words_about_a_file_stay_with_it():
    text = "crw, a.zip:observation=compact,decision_ticks=5,lr=0.1/b.npz,random"
    assert split_names(text) == ("crw", "a.zip:observation=compact,decision_ticks=5", "lr=0.1/b.npz", "random")
