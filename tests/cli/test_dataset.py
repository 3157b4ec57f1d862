"""The command `dataset`."""

import numpy as np

from swarm_forage_env.training.datasets import Dataset

TINY = ("--robots", "3", "--set", "n_objects=20", "--horizon", "200", "--set", "physics=compiled")


def test_a_data_set_is_written_and_kept(command, tmp_path):
    words = ("dataset", "ppo_warehouse_small", "--seeds", "2", "--out", "here", *TINY)
    assert command(*words)[:2] == (0, "2 runs recorded in here, 0 there before\n")
    assert [len(run) for run in Dataset(tmp_path / "here").runs()] == [200, 200]
    assert command(*words)[1] == "0 runs recorded in here, 2 there before\n"


def test_ctrl_c_says_how_to_go_on(command, monkeypatch):
    def interrupted(file, **arrays):
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", interrupted)
    code, _, err = command("dataset", "random", "--out", "here", *TINY)
    assert code == 130
    assert "Finished runs are kept in here; the same command does the rest." in err
