"""The commands `score` and `compare`, as a person uses them: words in, tables and exit code out."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from contextlib import suppress
from pathlib import Path

import pytest

from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import RunStore, load
from swarm_forage_env.studies.ladders import BUDGETS, Budget

WORLD = ("--robots", "3", "--objects", "20", "--jobs", "1", "--budget", "tiny")
SCORE = ("score", "--policy", "random", *WORLD)
COMPARE = ("compare", "--policy", "random,crw", *WORLD)
FEW = ("--measures", "t_lost_fraction,adaptability")
CURVES = "n_robots,seed,interval,performance\n2,0,0,3\n4,0,0,5\n"


@pytest.fixture(autouse=True)
def tiny_budget(monkeypatch):
    """Offer a budget called tiny."""
    tiny = Budget(horizon_s=4.0, interval_s=2.0, n_seeds=2, n_sizes=2, n_levels=1)
    monkeypatch.setitem(BUDGETS, "tiny", tiny)


def test_score_shows_every_measure_keeps_records_and_draws_a_picture(command, painted):
    code, out, err = command(*SCORE)
    assert code == 0
    assert out.splitlines()[0] == "random in warehouse_small with 20 objects, budget tiny, 2 seeds, 4 s"
    for word in ("95 % interval", "noise floor", "reactivity", "objects in 4 s", "higher"):
        assert word in out
    folder = Path("results/warehouse_small_3_robots_bcf754")
    assert len(load(folder)) == 14
    assert (folder / "scores.png").read_bytes().startswith(b"\x89PNG")
    assert "picture results/warehouse_small_3_robots_bcf754/scores.png" in err


def test_compare_shows_values_differences_and_the_test(command):
    code, out, _ = command(*COMPARE, *FEW, "--out", "here")
    assert code == 0
    assert out.splitlines()[0] == "random, crw in warehouse_small with 20 objects, budget tiny, 2 seeds, 4 s"
    assert out.splitlines()[1].split() == ["measure", "at", "better", "random", "crw"]
    for word in ("random - crw", "paired t test", "Holm", "adaptability, relative", "throttle 0.4"):
        assert word in out
    assert Path("here/comparison.png").is_file()


def test_flexibility_is_scored_under_a_handling_cost_if_asked(command):
    code, out, _ = command(*SCORE, "--measures", "reactivity,adaptability", "--disturbance", "handling_cost")
    assert code == 0
    assert out.count("handling cost 800") >= 2
    assert "throttle" not in out
    columns = [record.columns() for record in load(Path("results/warehouse_small_3_robots_bcf754"))]
    # A cycle is as long as an interval here: half of it at 1,601 ticks, half at one.
    assert {float(values["adversity"].max()) for values in columns} == {1.0, 801.0}


def test_sizes_keep_a_density_if_asked(command):
    words = ("--robots", "20", "--density", "5%", "--measures", "raw_performance")
    code, _, _ = command("score", "--policy", "random", "--jobs", "1", "--budget", "tiny", *words)
    assert code == 0
    arenas = {
        (record.n_robots, RunSpec.from_json(record.spec).scenario.arena.width_m)
        for record in load(Path("results/warehouse_small_20_robots_9db01d"))
    }
    assert arenas == {(1, 28.4), (20, 28.4)}


def test_variants_forms_and_bands_can_be_chosen(command):
    words = ("--measures", "spatial_emergence,scalability", "--variant", "corrected,paper")
    code, out, _ = command(*SCORE, *words, "--form", "marginal,interactive", "--band")
    assert code == 0
    for word in ("mean ± 2 sd", "spatial_emergence, interactive, paper", "scalability, interactive", "N = 1 to 3"):
        assert word in out
    _, out, _ = command(*COMPARE, *words, "--json")
    answer = json.loads(out)
    labels = {"spatial_emergence", "spatial_emergence, paper", "scalability", "scalability, paper"}
    assert {difference["label"] for difference in answer["differences"]} == labels
    assert {score["variant"] for score in answer["tables"][0]["scores"]} == {"corrected", "paper"}
    _, out, _ = command(*COMPARE, *words, "--band")
    assert "In square brackets: mean minus and plus two standard deviations" in out


def test_json_is_the_only_thing_on_stdout(command):
    _, out, _ = command(*SCORE, *FEW, "--json")
    (table,) = json.loads(out)["tables"]
    assert table["policy"] == "random"
    assert table["settings"]["seeds"] == [0, 1]
    score = next(score for score in table["scores"] if score["measure"] == "adaptability")
    assert score["per_seed"].keys() == {"0", "1"}
    assert (score["higher_is_better"], score["n_robots"], score["unit"]) == (False, [3], "objects (DTW)")
    _, out, _ = command(*COMPARE, *FEW, "--json")
    answer = json.loads(out)
    assert [table["policy"] for table in answer["tables"]] == ["random", "crw"]
    assert {difference["first"] for difference in answer["differences"]} == {"random"}
    assert answer["picture"].endswith("comparison.png")


def test_the_same_command_again_runs_nothing(command, monkeypatch):
    _, first, _ = command(*SCORE, *FEW)
    monkeypatch.setattr(RandomPolicy, "reset", lambda *_: pytest.fail("a stored run was repeated"))
    code, again, _ = command(*SCORE, *FEW)
    assert (code, again) == (0, first)


def test_another_performance_reads_the_same_runs(command, monkeypatch):
    command(*SCORE, *FEW)
    monkeypatch.setattr(RandomPolicy, "reset", lambda *_: pytest.fail("a stored run was repeated"))
    code, out, _ = command(*SCORE, *FEW, "--performance", "1/interference_fraction")
    assert code == 0
    assert out.startswith("random in warehouse_small with 20 objects, performance 1/interference_fraction, budget tiny")
    assert "1/interference_fraction (DTW)" in out


def test_a_dry_run_shows_the_experiments_and_runs_nothing(command):
    code, out, _ = command(*COMPARE, "--dry-run")
    assert code == 0
    assert out.startswith("28 runs, 0 stored, 28 to do with ")
    assert out.endswith("; records go to results/warehouse_small_3_robots_bcf754\n")
    assert not Path("results").exists()
    command(*SCORE, *FEW)
    _, out, _ = command(*COMPARE, *FEW, "--dry-run")
    assert "16 runs, 8 stored, 8 to do" in out
    _, out, _ = command(*COMPARE, *FEW, "--dry-run", "--json")
    answer = json.loads(out)
    assert answer["policies"] == ["random", "crw"]
    assert sum(run["stored"] for run in answer["runs"]) == 8


def test_swarms_too_small_for_a_kind_are_named(command):
    kinds = ("--set", "robot_kinds=scout:share=0.2+hauler:speed=0.5")
    _, _, err = command(*SCORE, *kinds, "--dry-run")
    assert "small swarms lack some: no scout with 1" in err
    _, _, err = command(*SCORE, "--set", "robot_kinds=only", "--dry-run")
    assert "small swarms" not in err


def test_a_plan_counts_in_words(command):
    one = (*SCORE, "--measures", "availability", "--seeds", "1")
    _, out, _ = command(*one, "--dry-run")
    assert out.startswith("2 runs, 0 stored, 2 to do with")
    command(*one)
    _, out, _ = command(*one, "--dry-run")
    assert out.startswith("2 runs, 2 stored, 0 to do with 0 robot-ticks")


def test_seeds_length_and_world_can_be_chosen(command):
    command(*SCORE, *FEW, "--seeds", "1", "--horizon", "2", "--set", "walk_probability=0.1", "--set", "caches=static")
    records = load("results/warehouse_small_3_robots_ba6106")
    assert {(record.seed, record.horizon_s) for record in records} == {(0, 2.0)}
    assert all('"caches": "static"' in record.spec and '"walk_probability": 0.1' in record.spec for record in records)


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("score",), "Expected a policy, by name or file"),
        (("score", "crw", "--curves", "x.csv"), "Expected --curves without POLICY, which are about runs"),
        (
            ("score", "--curves", "x.csv", "--seeds", "3", "--dry-run"),
            "Expected --curves without --dry-run, --seeds, which are about runs",
        ),
        (("score", "--policy", "crww"), "Unknown policy 'crww'. Did you mean 'crw'?"),
        (("score", "--policy", "gone.zip"), "Cannot read the policy file"),
        (("score", "--policy", "bad.npz"), "Expected"),
        (("score", "--policy", "crw", "--scenario", "warehouse"), "Unknown scenario 'warehouse'"),
        (("score", "--policy", "crw", "--measures", "reactivty"), "Did you mean 'reactivity'?"),
        (("score", "--policy", "crw", "--measures", ","), "Expected one or more names"),
        (("score", "--policy", "crw", "--disturbance", "noise"), "one of throttle, handling_cost, got 'noise'"),
        (("score", "--policy", "crw", "--variant", "papr"), "Unknown variant 'papr'. Did you mean 'paper'?"),
        (("compare", "--policy", "crw,dpo", "--form", "single"), "Unknown form 'single'"),
        (("score", "--curves", "curves.csv", "--form", "single"), "Unknown form 'single'"),
        (("score", "--policy", "crw", "--budget", "huge"), "Unknown budget 'huge'"),
        (("score", "--policy", "crw", "--performance", "n_carying"), "Did you mean 'n_carrying'?"),
        (("compare", "--policy", "crw,dpo", "--set", "performance=colected"), "Did you mean 'collected'?"),
        (
            ("score", "--curves", "curves.csv", "--performance", "x"),
            "Expected a column x for performance in curves.csv",
        ),
        (("score", "--policy", "crw", "--seeds", "0"), "seeds"),
        (("score", "--policy", "crw", "--horizon", "150"), "whole number of intervals"),
        (("score", "--policy", "crw", "--robots", "1"), "at least 2 robots"),
        (("score", "--policy", "crw", "--set", "interval_s=2"), "which the budget sets"),
        (("compare", "--policy", "crw,dpoo"), "Unknown policy 'dpoo'"),
        (("compare",), "Expected a policy, by name or file"),
        (("score", "--curves", "gone.csv"), "Cannot read gone.csv: No such file"),
        (("score", "--curves", "curves.csv", "--measures", "scalability"), "Expected the columns seed, interval"),
    ],
)
def test_what_a_person_gets_wrong_is_one_line(command, words, reason):
    Path("bad.npz").write_bytes(b"no network")
    Path("curves.csv").write_text("n_robots,performance\n1,2\n")
    code, out, err = command(*words)
    assert (code, out) == (2, "")
    assert len(err.splitlines()) == 1
    assert err.startswith("swarm-forage: ")
    assert reason in err


def test_curves_from_elsewhere_are_scored(command):
    Path("curves.csv").write_text(CURVES)
    code, out, _ = command("score", "--curves", "curves.csv")
    assert code == 0
    assert "task_emergence" in out
    assert "reactivity is not computed: there are no runs with criterion throttle" in out
    assert not Path("results").exists()
    code, out, _ = command("score", "--curves", "curves.csv", "--variant", "paper", "--band")
    assert "scalability, paper" in out
    assert "mean ± 2 sd" in out
    code, out, err = command("score", "--curves", "curves.csv", "--measures", "reactivity")
    assert (code, out) == (2, "")
    assert "Cannot compute reactivity for curves" in err


def test_curves_of_several_policies_are_compared(command):
    lines = CURVES.splitlines()
    rows = [f"{name},{line}" for name in ("mine", "theirs") for line in lines[1:]]
    Path("curves.csv").write_text("\n".join([f"controller,{lines[0]}", *rows]))
    code, out, _ = command("score", "--curves", "curves.csv")
    assert code == 0
    assert "mine - theirs" in out


def test_failed_runs_are_told_and_the_exit_code_says_so(command, monkeypatch):
    act = RandomPolicy.act

    def failing(self, obs, active):
        if len(obs) == 3:
            raise RuntimeError("no idea")
        return act(self, obs, active)

    monkeypatch.setattr(RandomPolicy, "act", failing)
    code, out, _ = command(*SCORE, "--measures", "t_lost_fraction")
    assert code == 1
    assert "2 of 2 runs failed" in out
    assert "RuntimeError: no idea" in out


def test_ctrl_c_says_what_is_kept_and_how_to_go_on(command, monkeypatch):
    def interrupt(self, task, rng):
        raise KeyboardInterrupt

    command(*SCORE, *FEW, "--seeds", "1")
    monkeypatch.setattr(RandomPolicy, "reset", interrupt)
    code, out, err = command(*SCORE, *FEW)
    assert (code, out) == (130, "")
    folder = "results/warehouse_small_3_robots_bcf754"
    expected = f"swarm-forage: Interrupted: 4 of 8 runs are finished and kept. They are in {folder}; "
    assert err.splitlines()[-1] == expected + "the same command does the rest."


def test_without_matplotlib_it_says_how_to_get_the_picture(command, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, out, err = command(*SCORE, *FEW)
    assert code == 0
    assert "adaptability" in out
    assert 'pip install ".[plots]"' in err
    assert not Path("results/warehouse_small_3_robots_bcf754/scores.png").exists()


@pytest.mark.slow
def test_ctrl_c_with_worker_processes_and_going_on(tmp_path):
    program = [sys.executable, "-m", "swarm_forage_env.cli", "score", "--policy", "random", "--budget", "quick"]
    program += ["--measures", "noise_robustness", "--jobs", "2", "--out", str(tmp_path), "--horizon", "2000"]
    pipe = subprocess.PIPE
    with subprocess.Popen(program, stdout=pipe, stderr=pipe, text=True, start_new_session=True) as process:
        try:
            while not list(tmp_path.glob("*.parquet")) and process.poll() is None:
                time.sleep(0.1)
            os.killpg(process.pid, signal.SIGINT)
            _, err = process.communicate(timeout=10)
        finally:  # whatever went wrong, nothing stays behind
            with suppress(ProcessLookupError):
                os.killpg(process.pid, signal.SIGKILL)
    assert process.returncode == 130
    assert "the same command does the rest" in err
    kept = set(RunStore(tmp_path).run_ids())
    assert 1 <= len(kept) < 12
    again = subprocess.run(program, capture_output=True, text=True, check=True)
    assert re.match(rf"{len(kept)} of 12 runs (is|are) stored already\.", again.stderr)
    assert "noise_robustness" in again.stdout
    assert kept < set(RunStore(tmp_path).run_ids())
