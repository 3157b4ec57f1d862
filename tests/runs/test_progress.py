"""Progress of many runs, where there is no terminal."""

import math

import pytest

from swarm_forage_env.runs import progress
from swarm_forage_env.runs.progress import RunProgress
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World


def runs(count, *, n_robots=2, policy="crw"):
    """As many runs of equal work."""
    world = World(scenario("warehouse_small", n_robots=n_robots, horizon_s=200.0))
    return [RunSpec(world=world, policy=policy, seed=seed) for seed in range(count)]


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass as the test says."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_the_estimate_goes_by_work_where_runs_differ(clock, capsys):
    (large,), (small,), (other,) = runs(1, n_robots=36), runs(1, n_robots=3), runs(1, n_robots=1)
    with RunProgress([large, small, other], n_stored=2, n_processes=1) as shown:
        clock[0] = 90.0
        shown.advance(large, 90.0)
        clock[0] = 105.0
        shown.advance(small, math.nan)
    assert capsys.readouterr().err.splitlines() == [
        "2/5 runs, an estimate follows the first run",
        "3/5 runs, about 10 s left",
        "4/5 runs, about 2 s left, 1 failed",
    ]


def test_each_policy_has_its_own_speed(clock):
    """One that jams takes thirty times as long; it is known after its first run."""
    fast, slow = runs(11, policy="crw"), runs(11, policy="dpo")
    with RunProgress([*fast, *slow], n_stored=0, n_processes=1, shown=False) as shown:
        shown.advance(fast[0], 1.0)
        assert shown.remaining_s() == pytest.approx(21.0)
        shown.advance(slow[0], 30.0)
        assert shown.remaining_s() == pytest.approx(10 * 1.0 + 10 * 30.0)


def test_starting_is_not_in_the_estimate_and_no_more_processes_work_than_there_are_runs(clock):
    """Four minutes of start, then runs of four seconds on two processes."""
    todo = runs(4)
    with RunProgress(todo, n_stored=0, n_processes=2, shown=False) as shown:
        clock[0] = 244.0
        shown.advance(todo[0], 4.0)
        assert shown.remaining_s() == pytest.approx(6.0)
        shown.advance(todo[1], 4.0)
        shown.advance(todo[2], 4.0)
        assert shown.remaining_s() == pytest.approx(4.0)
