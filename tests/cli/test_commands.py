"""The console command, as a person uses it: words in, text and exit code out."""

import json
import re
import shutil
import tomllib
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.cli.options import WorldOptions
from swarm_forage_env.cli.worlds import described_world
from swarm_forage_env.inspect.descriptions import _scenario_lines
from swarm_forage_env.policies import pretrained
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.record import Record
from swarm_forage_env.runs.store import load
from swarm_forage_env.scenarios.overrides import field_sections
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.studies.ladders import BUDGETS, Budget
from swarm_forage_env.studies.results import read_study
from swarm_forage_env.training.datasets import Dataset

SHORT = ("--robots", "3", "--set", "n_objects=20", "--horizon", "4", "--set", "interval_s=2", "--jobs", "1")
RUN = ("run", "random", *SHORT, "--out", "here")


def test_any_column_is_the_performance_and_the_runs_stay(command, monkeypatch):
    command(*RUN, "--seeds", "2")
    monkeypatch.setattr(RandomPolicy, "reset", lambda *_: pytest.fail("a stored run was repeated"))
    code, out, _ = command(*RUN, "--seeds", "2", "--set", "performance=n_active")
    assert code == 0
    assert "robots at" in out
    assert "3.00 ± 0.00" in out
    _, out, _ = command(*RUN, "--seeds", "2", "--set", "performance=n_active", "--json")
    answer = json.loads(out)
    assert answer["performance"] == {"name": "n_active", "unit": "robots", "is_per_1000_s": False}
    assert (answer["scenario"], answer["out"], answer["failures"]) == ("warehouse_small", "here", [])
    assert [(run["seed"], run["performance"]) for run in answer["runs"]] == [(0, 3.0), (1, 3.0)]
    (summary,) = answer["controllers"]
    assert (summary["controller"], summary["caches"], summary["performance"]["mean"]) == ("random", "none", 3.0)
    record = Record.read(answer["runs"][0]["file"])
    assert answer["runs"][0]["first_pickups_per_1000_s"] == record.per_1000_s("first_picked")


def test_a_failed_run_is_reported_with_the_way_to_run_it_again(command, monkeypatch):
    def refuse(self, obs, active):
        raise RuntimeError("I would rather not")

    with monkeypatch.context() as patch:
        patch.setattr(RandomPolicy, "act", refuse)
        code, out, err = command(*RUN)
        assert code == 1
        assert out.count("\n") == 1
        assert "RuntimeError: I would rather not" in out
        again = err.strip().splitlines()[-1].split("again, alone: swarm-forage ")[1].split()
        code, out, err = command(*again)
        assert (code, out) == (1, "")
        assert err.startswith("Traceback")
        assert err.splitlines()[-2:] == ["RuntimeError: I would rather not", "swarm-forage: the run failed again"]
    code, out, _ = command(*again)
    assert code == 0
    assert "random in warehouse_small, 3 robots" in out


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_info_prints_each_field_as_set_takes_it(name):
    walls = ((4.0, 1.0, 4.4, 1.4), (6.0, 1.0, 6.4, 1.4))
    config = scenario(name, **({"obstacles": walls} if name == "classroom" else {}))
    told = dict(line.strip().split(maxsplit=1) for line in _scenario_lines(config, "") if len(line.split()) > 1)
    fields = [field for field in field_sections() if field in told]
    assert len(fields) > 50
    words = tuple(f"{field}={told[field]}" for field in fields)
    assert described_world(WorldOptions(scenario=name, settings=words))[0].scenario == config


CONFIG = """
scenario = "warehouse_small"

[set]
n_robots = 3
n_objects = 20
horizon_s = 4.0
interval_s = 2
physics_substeps = [0.2, 0.2, 0.2, 0.2, 0.2]

[wrappers.throttle]
waveform = "constant"
amplitude = 0.2

[wrappers.actuator_noise]
sigma = 0.1
"""


def test_a_file_gives_scenario_fields_and_wrappers_and_options_go_before_it(command):
    Path("world.toml").write_text(CONFIG)
    words = ("--set", "n_objects=9", "--wrapper", "actuator_noise:sigma=0.3", "--jobs", "1")
    assert command("run", "random", "--scenario", "world.toml", *words)[0] == 0
    (folder,) = Path("results").glob("world_*")
    (record,) = load(folder)
    spec = json.loads(json.dumps(record.spec.to_mapping()))
    world, wrappers = spec["scenario"], spec["wrappers"]
    assert (world["robots"]["n_robots"], world["objects"]["n_objects"], world["horizon_s"]) == (3, 9, 4.0)
    assert world["physics_substeps"] == [0.2] * 5
    assert [(wrapper["wrapper"], wrapper.get("sigma")) for wrapper in wrappers] == [
        ("throttle", None),
        ("actuator_noise", 0.3),
    ]


# score

WORLD = ("--robots", "3", "--set", "n_objects=20", "--jobs", "1", "--budget", "tiny")


def test_real_robots_stand_beside_policies_in_one_table_and_picture(command, painted):
    times = [(n, run, 2.0 * k + n / 8) for n in (1, 3) for run in (0, 1) for k in range(2)]
    Path("real.csv").write_text(
        "robots;run;stamp\n" + "".join(f"{n};{run};{t:g}\n".replace(".", ",") for n, run, t in times)
    )
    words = ("--columns", "n_robots=robots,seed=run,time_s=stamp", "--events", "--interval", "2", "--jobs", "1")
    asked = ("score", "random", "--curves", "real.csv", *words, "--set", "n_objects=20", "--out", "here")
    code, out, _ = command(*asked, "--dry-run")
    told = "4 runs, 0 stored, 4 to do with 160 robot-ticks; records go to here\n"
    assert (code, out, Path("here").exists()) == (0, told, False)
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
    monkeypatch.setitem(BUDGETS, "tiny", Budget(horizon_s=4.0, interval_s=2.0, n_seeds=2, n_sizes=2, n_levels=1))
    code, out, _ = command("score", "random", *WORLD, "--measures", "t_lost_fraction")
    assert code == 1
    assert "RuntimeError: no idea" in out


LEARNT = ("--robots", "3", "--set", "n_objects=20", "--horizon", "200", "--set", "physics=compiled")


def test_a_data_set_is_written_and_kept(command, tmp_path):
    words = ("dataset", "ppo_warehouse_small", "--seeds", "2", "--out", "here", *LEARNT)
    assert command(*words)[:2] == (0, "2 runs recorded in here, 0 there before\n")
    assert [len(run) for run in Dataset(tmp_path / "here").runs()] == [200, 200]
    assert command(*words)[1] == "0 runs recorded in here, 2 there before\n"


def test_ctrl_c_says_how_to_go_on(command, monkeypatch):
    def interrupted(file, **arrays):
        raise KeyboardInterrupt

    monkeypatch.setattr(np, "savez_compressed", interrupted)
    code, _, err = command("dataset", "random", "--out", "here", *LEARNT)
    assert code == 130
    assert "Finished runs are kept in here; the same command does the rest." in err


# study

STUDY = """
name = "mine"
title = "Two sizes"
scenario = "warehouse_small"
policies = ["random"]

[set]
n_objects = 20

[[axis]]
criterion = "population_size"
values = [2, 3]

[budget.tiny]
seeds = 2
horizon_s = 4.0
interval_s = 2.0
"""
STUDY_RUN = ("study", "run", "mine.toml", "--jobs", "1")
STUDIED = Path("results/studies/mine_tiny")


@pytest.fixture
def written(command):
    """The command in a folder with a study file."""
    Path("mine.toml").write_text(STUDY)
    return command


def test_shards_are_not_packed_until_all_runs_are_asked_for(written):
    code, out, err = written(*STUDY_RUN, "--shard", "1/2", "--rules", "described", "--out", "here")
    assert code == 0
    assert "packed" not in err
    code, out, _ = written("study", "status", "here")
    assert code == 1
    assert out.splitlines()[0] == "mine, budget tiny: 2 of 4 runs done, 2 missing"
    assert out.splitlines()[1] == "0 of 2 conditions complete"
    assert re.search(r"^described +random +2 +1 +0 +1$", out, re.MULTILINE)
    code, out, _ = written("study", "status", "here", "--json")
    assert code == 1
    assert [place["missing"] for place in json.loads(out)["conditions"]] == [1, 1]
    code, _, err = written(*STUDY_RUN, "--rules", "described", "--out", "here")
    assert code == 0
    assert "2 of 4 runs stored already" in err, "the other half alone is made"
    assert read_study("here/mine.parquet").spec.name == "mine"


def test_failures_are_told_with_the_command_that_makes_them_again(written):
    Path("mine.toml").write_text(STUDY.replace('"random"', '{ policy = "random", parameters = { speed = 3 } }'))
    code, out, err = written(*STUDY_RUN, "--seeds", "3")
    assert code == 1
    assert "0 of 12 runs done, 12 failed" in out
    assert "and 2 more" in out
    rerun = re.search(rf"again, alone: swarm-forage (rerun {STUDIED}/runs/failures/.*)", err)[1].split()
    code, out, _ = written("study", "status", str(STUDIED / "mine.parquet"))
    assert code == 1
    assert "random, seed 0: TypeError" in out
    code, _, err = written(*rerun)
    assert code == 1
    assert "takes no arguments" in err.splitlines()[-2]


PAGE = Path(__file__).resolve().parents[2] / "docs" / "studies.md"
BLOCKS = re.findall(r"^```toml\n(.*?)^```", PAGE.read_text(encoding="utf-8"), re.MULTILINE | re.DOTALL)
(STUDY_OF_PAGE,) = (block for block in BLOCKS if "scenario" in tomllib.loads(block))
BRIEF = "\n[budget.short]\nseeds = 1\nhorizon_s = 2.0\ninterval_s = 1.0\n"


@pytest.mark.slow
def test_the_study_file_of_the_page_runs(command):
    """With a trained policy beside it."""
    Path("mine.toml").write_text(STUDY_OF_PAGE + BRIEF)
    shutil.copy(Path(next(iter(pretrained.__path__)), "ppo_warehouse_small.npz"), "my_policy.npz")
    code, _, err = command("study", "run", "mine.toml", "--budget", "short", "--jobs", "1", "--out", "done")
    assert code == 0, err
    table = read_study(Path("done"))
    places = table.places()
    assert places.select("failed", "missing").sum().row(0) == (0, 0)
    assert len(places) == 12, "every policy at every value"
