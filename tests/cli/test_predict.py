"""The command `predict`, as a person uses it."""

import json
from functools import partial
from pathlib import Path

import numpy as np
import pytest

from metrics import SizeLaw, predict_performance
from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.runner import Outcomes, RunsInterrupted
from swarm_forage_env.runs.store import load

RUNS = ("predict", "--policy", "crw", "--fit", "1,2,3,4", "--hold", "6", "--seeds", "2", "--jobs", "1")
WORLD = ("--horizon", "4", "--set", "interval_s=2", "--objects", "20")


@pytest.fixture(autouse=True)
def few_resamples(monkeypatch):
    """How an interval is told does not need the resamples that make it exact; they take most of the time."""
    few = partial(predict_performance, n_resamples=50)
    monkeypatch.setattr("metrics.scoring.prediction.predict_performance", few)


@pytest.fixture
def curves():
    """Write curves of a known law in the current folder."""

    def write(name="curves.csv"):
        law = SizeLaw(name="contention", a=5.0, contention=0.05)
        rows = [(n, seed, law.performance(n) * (1.0 + 0.02 * seed)) for n in (1, 2, 4, 8, 16, 32) for seed in (0, 1)]
        lines = [f"{n},{seed},0,{value}" for n, seed, value in rows]
        Path(name).write_text("\n".join(["n_robots,seed,interval,performance", *lines]))
        return name

    return write


@pytest.fixture
def one_object_per_robot(monkeypatch):
    """Runs of four seconds deliver nothing; count a robot's ticks at work as its performance."""
    from metrics.scoring import prediction
    from metrics.scoring.question import run_totals

    def totals(table, condition):
        return {seed: 10.0 * condition.world.value + seed for seed in run_totals(table, condition)}

    monkeypatch.setattr(prediction, "run_totals", totals)


def test_predict_runs_all_sizes_prints_the_prediction_and_draws_it(command, one_object_per_robot, painted):
    code, out, err = command(*RUNS, *WORLD)
    assert code == 0
    assert out.splitlines()[0] == "crw in warehouse_small with 20 objects: objects in 4 s, fitted to 1, 2, 3, 4 robots"
    assert "1 of 1 held-back mean inside the interval" in out
    for word in ("law: ", "critical size: none up to 16 robots", "held back", "predicted"):
        assert word in out
    folder = Path("results/warehouse_small_4_s_33b9a3")
    assert len(load(folder)) == 10
    assert (folder / "prediction.png").is_file()
    assert "picture results/warehouse_small_4_s_33b9a3/prediction.png" in err
    code, out, _ = command(*RUNS, *WORLD, "--json")
    (table,) = json.loads(out)["tables"]
    assert [row["n_robots"] for row in table["predictions"]] == [6, 8, 16]


def test_the_same_command_again_runs_nothing(command, one_object_per_robot, monkeypatch):
    words = tuple("random" if word == "crw" else word for word in RUNS)
    _, first, _ = command(*words, *WORLD)
    monkeypatch.setattr(RandomPolicy, "reset", lambda *_: pytest.fail("a stored run was repeated"))
    code, again, _ = command(*words, *WORLD)
    assert (code, again) == (0, first)


def test_a_dry_run_shows_sizes_and_runs_nothing(command):
    code, out, _ = command(*RUNS, *WORLD, "--dry-run")
    assert code == 0
    assert out.splitlines()[0] == "10 runs, 10 to do, records go to results/warehouse_small_4_s_33b9a3"
    assert "on 1 core as fast as this one is now" in out
    assert not Path("results").exists()
    _, out, _ = command(*RUNS, *WORLD, "--dry-run", "--json")
    assert len(json.loads(out)["runs"]) == 10


def test_curves_of_others_are_predicted_and_drawn_where_a_picture_is_asked_for(command, curves, tmp_path):
    file = curves()
    code, out, err = command("predict", "--curves", file, "--hold", "32")
    assert (code, err) == (0, "")
    assert "law: contention, P(N) = 5.0" in out
    assert "1 of 1 held-back mean inside" in out
    assert not list(tmp_path.glob("*.png"))
    code, _, err = command("predict", "--curves", file, "--picture", "here/prediction.png")
    assert (code, "picture here/prediction.png" in err) == (0, True)
    assert Path("here/prediction.png").is_file()


def test_another_performance_is_predicted_from_runs_and_from_curves(command, curves):
    code, out, _ = command(*RUNS, *WORLD, "--performance", "n_active")
    assert code == 0
    assert out.startswith(
        "crw in warehouse_small with 20 objects: robots summed over intervals, fitted to 1, 2, 3, 4 robots"
    )
    assert "law: linear, P(N) = 2 N" in out  # every robot is at work in each of two intervals
    code, out, _ = command("predict", "--curves", curves(), "--performance", "1/performance")
    assert code == 0
    assert out.startswith("curves: 1/performance summed over intervals, fitted to 1, 2, 4, 8, 16, 32 robots")
    assert "note: this performance is no sum over robots" in out


def test_search_and_rescue_has_sizes_of_its_own(command):
    code, out, _ = command("predict", "--policy", "crw", "--scenario", "search_and_rescue", "--dry-run")
    assert code == 0
    sizes = [line.split()[3] for line in out.splitlines() if line.startswith("search_and_rescue")]
    assert sizes == ["12", "51", "115", "204", "320"]


def test_without_matplotlib_there_is_a_table_and_a_hint(command, curves, monkeypatch):
    monkeypatch.setitem(__import__("sys").modules, "matplotlib.figure", None)
    code, out, err = command("predict", "--curves", curves(), "--picture", "here/prediction.png", "--json")
    assert code == 0
    assert json.loads(out)["picture"] is None
    assert "No picture without matplotlib" in err


def test_ctrl_c_says_what_is_kept(command, monkeypatch):
    def interrupted(*_, **__):
        raise RunsInterrupted(Outcomes(states={}, records={}, failures={}), 10)

    monkeypatch.setattr("swarm_forage_env.runs.runner.run_specs", interrupted)
    code, out, err = command(*RUNS, *WORLD)
    assert (code, out) == (130, "")
    assert "0 of 10 runs are finished and kept. They are in results/warehouse_small_4_s_33b9a3" in err


def test_a_size_whose_runs_fail_is_left_out_and_the_command_exits_with_1(command, one_object_per_robot, monkeypatch):
    def act(self, obs, active):
        assert len(obs) != 2
        return np.zeros((len(obs), 3), np.float32)

    monkeypatch.setattr(RandomPolicy, "act", act)
    words = tuple({"crw": "random", "1,2,3,4": "1,2,3,4,5"}.get(word, word) for word in RUNS)
    code, out, _ = command(*words, *WORLD)
    assert code == 1
    assert "fitted to 1, 3, 4, 5 robots" in out
    assert out.count("failed: ") == 1
    assert "random in warehouse_small, 2 robots, seed 0, population_size = 2, and 1 more of its runs: Assert" in out


def test_runs_that_leave_nothing_to_predict_end_with_one_line(command):
    code, out, err = command(*RUNS, *WORLD)  # nobody delivers in four seconds
    assert (code, out) == (1, "")
    assert "Expected a performance above 0 at some swarm size" in err.splitlines()[-1]


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        ((), "Expected a policy, by name or file"),
        (("--policy", "crw", "--curves", "x.csv"), "Expected --curves without --policy, which are about runs"),
        (("--curves", "gone.csv"), "Cannot read gone.csv"),
        (("--curves", "x.csv", "--seeds", "3"), "Expected --curves without --seeds, which are about runs"),
        (("--policy", "crw", "--robots", "9"), "No such option: --robots; for this command it is --fit."),
        (("--policy", "crww"), "Did you mean 'crw'?"),
        (("--policy", "crw", "--fit", "1,2,4"), "4 or more different swarm sizes to fit, got 1, 2, 4"),
        (("--policy", "crw", "--fit", "1,two"), "Expected --fit as whole numbers separated by commas, such as 5,20"),
        (("--policy", "crw", "--hold", "16"), "larger swarms than the fitted 32 robots, got 16"),
        (("--policy", "crw", "--seeds", "1"), "seeds"),
        (("--policy", "crw", "--set", "n_robots=9"), "use --fit and --hold"),
        (("--policy", "crw", "--scenario", "warehouse"), "Unknown scenario 'warehouse'"),
    ],
)
def test_wrong_words_are_one_line_and_exit_2(command, words, reason):
    code, out, err = command("predict", *words)
    assert (code, out) == (2, "")
    assert reason in " ".join(err.split())
