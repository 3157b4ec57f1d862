"""The command `score`, as a person uses them: words in, tables and exit code out."""

import json
from pathlib import Path

import pytest

from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.store import load
from swarm_forage_env.studies.ladders import BUDGETS, Budget

WORLD = ("--robots", "3", "--set", "n_objects=20", "--jobs", "1", "--budget", "tiny")
SCORE = ("score", "random", *WORLD)
COMPARE = ("score", "random,crw", *WORLD)
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
    for word in ("reactivity", "throttle 0.4", "higher", "95% t interval over 2 seeds, wide"):
        assert word in out
    folder = Path("results/warehouse_small_3_robots_bcf754")
    assert len(load(folder)) == 14
    assert (folder / f"{folder.name}_random_scores.png").read_bytes().startswith(b"\x89PNG")
    assert f"picture {folder}/{folder.name}_random_scores.png" in err


def test_compare_shows_values_differences_and_the_test(command):
    code, out, _ = command(*COMPARE, *FEW, "--out", "here")
    assert code == 0
    assert out.splitlines()[0] == "random, crw in warehouse_small with 20 objects, budget tiny, 2 seeds, 4 s"
    assert "No certain difference: " in out
    assert ["measure", "at", "better", "random", "crw"] in [line.split() for line in out.splitlines()]
    _, out, _ = command(*COMPARE, *FEW, "--out", "here", "--all", "--against", "crw")
    for word in ("95 % interval", "noise floor", "objects (DTW)", "random - crw", "paired t test", "Holm"):
        assert word in out
    rows = [line for line in out.splitlines() if line.startswith(("at ", "N = ", "throttle ", "sigma "))]
    assert max(map(len, rows)) <= 100
    assert list(Path("here").glob("*_random_crw_scores.png"))


def test_sizes_keep_a_density_if_asked(command):
    words = ("--robots", "20", "--set", "density=0.05", "--measures", "raw_performance")
    code, _, _ = command("score", "random", "--jobs", "1", "--budget", "tiny", *words)
    assert code == 0
    arenas = {
        (record.spec.world.n_robots, record.spec.scenario.arena.width_m)
        for record in load(Path("results/warehouse_small_20_robots_9db01d"))
    }
    assert arenas == {(1, 28.4), (20, 28.4)}


def test_json_is_the_only_thing_on_stdout(command):
    _, out, _ = command(*SCORE, *FEW, "--json")
    told = json.loads(out)
    assert told["policies"] == ["random"]
    assert told["settings"]["seeds"] == [0, 1]
    score = next(score for score in told["scores"] if score["measure"] == "adaptability")
    assert score["per_seed"].keys() == {"0", "1"}
    assert (score["higher_is_better"], score["n_robots"], score["unit"]) == (False, 3, "objects (DTW)")
    _, out, _ = command(*COMPARE, *FEW, "--json")
    answer = json.loads(out)
    assert answer["policies"] == ["random", "crw"]
    assert {difference["first"] for difference in answer["differences"]} == {"random"}
    assert answer["picture"].endswith("_random_crw_scores.png")


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
    assert {run["policy"] for run in json.loads(out)} == {"random", "crw"}


def test_curves_from_elsewhere_are_scored(command):
    Path("curves.csv").write_text(CURVES)
    code, out, _ = command("score", "--curves", "curves.csv")
    assert code == 0
    assert out.startswith("curves from curves.csv, ")
    assert "task emergence" in out
    assert "not computed: reactivity, adaptability: there are no runs with criterion throttle" in out
    assert not Path("results").exists()
    code, out, _ = command("score", "--curves", "curves.csv", "--variant", "paper", "--all")
    assert "scalability, paper" in out
    code, out, err = command("score", "--curves", "curves.csv", "--measures", "reactivity")
    assert (code, out) == (2, "")
    assert "Cannot compute reactivity for curves" in err


def test_real_robots_stand_beside_policies_in_one_table_and_picture(command, painted):
    times = [(n, run, 2.0 * k + n / 8) for n in (1, 3) for run in (0, 1) for k in range(2)]
    Path("real.csv").write_text(
        "robots;run;stamp\n" + "".join(f"{n};{run};{t:g}\n".replace(".", ",") for n, run, t in times)
    )
    words = ("--columns", "n_robots=robots,seed=run,time_s=stamp", "--events", "--interval", "2", "--jobs", "1")
    asked = ("score", "random", "--curves", "real.csv", *words, "--set", "n_objects=20", "--out", "here")
    code, out, _ = command(*asked, "--dry-run")
    assert (code, out[:27], Path("here").exists()) == (0, "4 runs, 0 stored, 4 to do w", False)
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
