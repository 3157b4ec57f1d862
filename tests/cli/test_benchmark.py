"""The command `benchmark`, with a tiny protocol in place of the real one."""

from pathlib import Path

import numpy as np
import pytest

from metrics import PAPER_POLICIES
from metrics.benchmark import load_protocol
from swarm_forage_env.training.datasets import Dataset
from tests.support.entries import TINY, made_up_entry


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A place with the tiny protocol and the entries of the scripted controllers in it."""
    place = tmp_path_factory.mktemp("benchmark")
    (place / "benchmark.toml").write_text(TINY.read_text())
    (place / "scripted").mkdir()
    for k, name in enumerate(PAPER_POLICIES):
        made_up_entry(load_protocol(TINY), name, lambda _, k=k: 10.0 + k).write(place / "scripted" / f"{name}.json")
    return place


@pytest.fixture
def tiny(folder, monkeypatch):
    monkeypatch.setattr("metrics.benchmark.protocol.FOLDER", folder)


def test_a_quick_look_writes_no_entry(command, tiny):
    code, out, err = command("benchmark", "random", "--quick", "--jobs", "1")
    assert code == 0, err
    assert "random" in out
    assert "no entry" in err
    assert not list(Path("results/benchmark").glob("*.json"))


SHORT = ("--robots", "3", "--set", "n_objects=20", "--horizon", "200", "--set", "physics=compiled")


def test_a_data_set_is_written_and_kept(command, tmp_path):
    words = ("dataset", "ppo_warehouse_small", "--seeds", "2", "--out", "here", *SHORT)
    assert command(*words)[:2] == (0, "2 runs recorded in here, 0 there before\n")
    assert [len(run) for run in Dataset(tmp_path / "here").runs()] == [200, 200]
    assert command(*words)[1] == "0 runs recorded in here, 2 there before\n"


def test_ctrl_c_says_how_to_go_on(command, monkeypatch):
    def interrupted(file, **arrays):
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", interrupted)
    code, _, err = command("dataset", "random", "--out", "here", *SHORT)
    assert code == 130
    assert "Finished runs are kept in here; the same command does the rest." in err
