"""The command `dataset`."""

import numpy as np

from swarm_forage_env.training.datasets.reading import TrajectoryDataset

TINY = ("--robots", "3", "--objects", "20", "--horizon", "200", "--set", "physics=compiled")


def test_a_data_set_is_told_written_and_kept(command, tmp_path):
    words = ("dataset", "--policy", "ppo_warehouse_small", "--seeds", "2", *TINY)
    code, out, err = command(*words, "--dry-run")
    assert (code, err) == (0, "")
    assert "runs          2, of which 2 to do; 200 decisions of 3 robots each" in out
    assert list(tmp_path.iterdir()) == []
    code, out, _ = command(*words, "--compress")
    folder = tmp_path / "results/datasets/warehouse_small_3_robots_200_s_bcf754_ppo_warehouse_small"
    assert code == 0
    assert "400 decisions" in out
    assert [len(TrajectoryDataset(folder).steps(seed)) for seed in (0, 1)] == [200, 200]
    assert "2, of which 0 to do" in command(*words, "--dry-run")[1]


def test_site_memory_is_eight_columns_more(command):
    words = ("dataset", "--policy", "random", "--observation", "compact", "--dry-run", *TINY)
    for option, columns in (("--site-memory", 31), ("--no-site-memory", 23)):
        assert f"compact, {columns} columns" in command(*words, option)[1]


def test_what_is_wrong_is_told_in_one_line(command, tmp_path):
    for words in (("--observation", "half"), ("--policy", "crv"), ("--policy", "mixed:crw=1,dpo=1")):
        code, _, err = command("dataset", *TINY, *words)
        assert (code, err.count("\n")) == (2, 1)
    assert command("dataset", "--policy", "random", "--out", "here", *TINY)[0] == 0
    code, _, err = command("dataset", "--policy", "crw", "--out", "here", *TINY)
    assert (code, err.count("\n")) == (2, 1)
    assert "another run" in err


def test_ctrl_c_says_how_to_go_on(command, monkeypatch):
    def interrupted(file, **arrays):
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez", interrupted)
    code, _, err = command("dataset", "--policy", "random", "--out", "here", *TINY)
    assert code == 130
    assert "Finished runs are kept in here; the same command does the rest." in err
