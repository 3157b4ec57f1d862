"""The command `choose`, as a person uses it."""

import json
from pathlib import Path

import pytest

from swarm_forage_env.policies.registry import RandomPolicy
from swarm_forage_env.runs.store import load

WORLD = ("--robots", "3", "--objects", "20", "--horizon", "4", "--set", "interval_s=2", "--seeds", "2", "--jobs", "1")
CHOOSE = ("choose", "--policy", "random,crw", "--deliver", "5", *WORLD)
ADVERSE = ("--failures", "0.01", "--deaths", "1", "--noise", "0.01")


def test_choose_prints_ranking_evidence_and_reason(command):
    code, out, _ = command(*CHOOSE, *ADVERSE)
    assert code == 0
    lines = out.splitlines()
    assert lines[0] == "warehouse_small with 20 objects, 3 robots, runs of 4 s: objects"
    assert lines[1].split()[:4] == ["rank", "policy", "constraint", "demand"]
    for word in ("undisturbed", "failures 0.01", "deaths 1", "noise 0.01", "not met", "comes first: it meets 0 of 4"):
        assert word in out
    assert len(load("results/warehouse_small_3_robots_4_s_33b9a3")) == 16


def test_under_a_disturbance_a_share_of_the_demand_is_enough(command):
    """Nobody delivers in four seconds, so both demands are failed."""
    _, out, _ = command(*CHOOSE, "--noise", "0.01", "--keep", "0.5", "--json")
    answer = json.loads(out)
    assert [candidate["rank"] for candidate in answer["ranking"]] == [1, 2]
    demands = [evidence["demand"] for evidence in answer["ranking"][0]["evidence"]]
    assert demands == [5.0, 2.5]
    assert answer["ranking"][0]["not_met"] == ["undisturbed", "noise 0.01"]


def test_another_performance_is_read_from_the_same_runs(command, monkeypatch):
    command(*CHOOSE)
    monkeypatch.setattr(RandomPolicy, "reset", lambda *_: pytest.fail("a stored run was repeated"))
    code, out, _ = command(*CHOOSE, "--performance", "n_active")
    assert code == 0
    assert out.splitlines()[0] == "warehouse_small with 20 objects, 3 robots, runs of 4 s: robots summed over intervals"
    # Three robots at work in each of two intervals.
    assert " ".join(out.splitlines()[2].split()).startswith("1 random undisturbed 5 6 ")


def test_the_same_command_again_runs_nothing(command, monkeypatch):
    _, first, _ = command(*CHOOSE)
    monkeypatch.setattr(RandomPolicy, "reset", lambda *_: pytest.fail("a stored run was repeated"))
    code, again, _ = command(*CHOOSE)
    assert (code, again) == (0, first)


def test_a_dry_run_shows_conditions_and_runs_nothing(command):
    code, out, _ = command(*CHOOSE, *ADVERSE, "--dry-run")
    assert code == 0
    assert out.splitlines()[0] == "16 runs, 16 to do, records go to results/warehouse_small_3_robots_4_s_33b9a3"
    assert [line.split()[0] for line in out.splitlines()[7:]] == ["policy", "random", "crw", "all", "about"]
    assert not Path("results").exists()


def test_failed_runs_are_listed_and_exit_1(command, monkeypatch):
    monkeypatch.setattr(RandomPolicy, "act", lambda *_: 1 / 0)
    code, out, _ = command(*CHOOSE)
    assert code == 1
    assert "failed: " in out
    assert "ZeroDivisionError" in out
    assert "runs of random failed." in out


@pytest.mark.parametrize(
    ("words", "reason"),
    [
        (("--policy", "crw"), "deliver"),
        (("--policy", "crw", "--deliver", "0"), "Expected deliver as a number above 0, got 0"),
        (("--policy", "crw", "--deliver", "9", "--noise", "-1"), "Expected noise as a number above 0, got -1"),
        (("--policy", "crw", "--deliver", "9", "--deaths", "100"), "Expected at most 50 deaths"),
        (("--policy", "crw", "--deliver", "9", "--seeds", "1"), "seeds"),
        (("--policy", "crww", "--deliver", "9"), "Did you mean 'crw'?"),
        (("--policy", "crw", "--deliver", "9", "--horizon", "150"), "whole number of intervals"),
    ],
)
def test_wrong_words_are_one_line_and_exit_2(command, words, reason):
    code, out, err = command("choose", *words)
    assert (code, out) == (2, "")
    assert reason in " ".join(err.split())
