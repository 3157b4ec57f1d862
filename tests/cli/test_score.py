"""The command `score`, as a person uses them: words in, tables and exit code out."""

import json
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.store import load
from swarm_forage_env.studies.ladders import BUDGETS, Budget
from swarm_forage_env.training.datasets import Dataset

WORLD = ("--robots", "3", "--set", "n_objects=20", "--jobs", "1", "--budget", "tiny")
SCORE = ("score", "random", *WORLD)
COMPARE = ("score", "random,crw", *WORLD)
FEW = ("--measures", "t_lost_fraction,adaptability")


@pytest.fixture(autouse=True)
def tiny_budget(monkeypatch):
    """Offer a budget called tiny."""
    tiny = Budget(horizon_s=4.0, interval_s=2.0, n_seeds=2, n_sizes=2, n_levels=1)
    monkeypatch.setitem(BUDGETS, "tiny", tiny)


def test_real_robots_stand_beside_policies_in_one_table_and_picture(command, painted):
    times = [(n, run, 2.0 * k + n / 8) for n in (1, 3) for run in (0, 1) for k in range(2)]
    Path("real.csv").write_text(
        "robots;run;stamp\n" + "".join(f"{n};{run};{t:g}\n".replace(".", ",") for n, run, t in times)
    )
    words = ("--columns", "n_robots=robots,seed=run,time_s=stamp", "--events", "--interval", "2", "--jobs", "1")
    asked = ("score", "random", "--curves", "real.csv", *words, "--set", "n_objects=20", "--out", "here")
    code, out, _ = command(*asked, "--dry-run")
    assert (code, out[:27], Path("here").exists()) == (0, "4 runs, 0 stored, 4 to do w", False)
    _, out, _ = command("score", "stochm", *asked[2:], "--set", "caches=none", "--dry-run", "--json")
    assert {run["scenario"]["caches"] for run in json.loads(out)} == {"none"}
    code, out, err = command(*asked)
    assert code == 0
    assert out.splitlines()[0] == "random, real in warehouse_small with 20 objects and from real.csv, 2 seeds, 4 s"
    header, first = [line.split() for line in out.splitlines() if line.startswith(("measure ", "raw performance  "))]
    assert header == ["measure", "at", "better", "random", "real"]
    assert first[-3:] == ["2", "±", "0"]
    assert "real.csv: deliveries are counted in 2 intervals of 2 s" in out
    assert {(record.spec.world.n_robots, record.seed, record.horizon_s) for record in load(Path("here"))} == {
        (n, run, 4.0) for n in (1, 3) for run in (0, 1)
    }
    assert "picture real_scores.png" in err
    assert Path("real_scores.png").exists()


def test_failed_runs_are_told_and_the_exit_code_says_so(command, monkeypatch):
    act = RandomPolicy.act

    def failing(self, obs, active):
        if len(obs) == 3:
            raise RuntimeError("no idea")
        return act(self, obs, active)

    monkeypatch.setattr(RandomPolicy, "act", failing)
    code, out, _ = command(*SCORE, "--measures", "t_lost_fraction")
    assert code == 1
    assert "RuntimeError: no idea" in out


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
