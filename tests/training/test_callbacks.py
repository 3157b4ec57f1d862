"""Callbacks by name: where their modules are found."""

import sys

import pytest

pytest.importorskip("stable_baselines3", reason="needs the train extra: stable-baselines3 and torch")

from swarm_forage_env import ConfigError
from swarm_forage_env.training.sb3.callbacks import named_callbacks


def test_a_file_in_the_current_folder_hides_nothing_that_is_installed(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.delitem(sys.modules, "colorsys", raising=False)
    (tmp_path / "colorsys.py").write_text("Mine = dict\n")
    searched = [*sys.path]
    with pytest.raises(ConfigError, match=r"module 'colorsys' has no attribute 'Mine'"):
        named_callbacks(["colorsys:Mine"])
    assert sys.path == searched
