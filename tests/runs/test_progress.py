"""Progress of many runs, where there is no terminal."""

from types import SimpleNamespace

import pytest

from swarm_forage_env.runs import progress
from swarm_forage_env.runs.progress import DAMAGED_SHOWN, RunProgress, duration
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.wrappers.world import World


def runs(count, *, n_robots=2):
    """As many runs of equal work."""
    world = World(scenario("warehouse_small", n_robots=n_robots, horizon_s=200.0))
    return [RunSpec(world=world, policy="crw", seed=seed) for seed in range(count)]


def took(seconds):
    """A record of a run that took so long."""
    return SimpleNamespace(wall_time_s=seconds)


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
        shown.advance(large, took(90.0))
        clock[0] = 105.0
        shown.advance(small, None)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "2 of 5 runs are stored already."
    assert lines[1] == "2/5 runs, an estimate follows when the first run ends"
    assert lines[2] == "3/5 runs, about 10 s left", "two runs, but a ninth of the work"
    assert lines[3] == "4/5 runs, about 2 s left, 1 failed", "the time of a failure tells nothing"


def test_starting_and_compiling_are_not_in_the_estimate(clock, capsys):
    """Four minutes of start, then runs of four seconds on two processes."""
    todo = runs(21)
    with RunProgress(todo, n_processes=2) as shown:
        clock[0] = 244.0
        shown.advance(todo[0], took(4.0))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "0/21 runs, 2 processes are starting; an estimate follows when the first run ends"
    assert lines[1] == "1/21 runs, about 40 s left"


def test_no_more_processes_work_than_there_are_runs(clock, capsys):
    todo = runs(2)
    with RunProgress(todo, n_processes=2) as shown:
        clock[0] = 30.0
        shown.advance(todo[0], took(20.0))
    assert "1/2 runs, about 20 s left" in capsys.readouterr().err


def test_of_workers_elsewhere_the_number_is_seen_from_what_they_do(clock, capsys):
    """Three runs of 20 seconds within 40 seconds, the start of the workers left out: one and a half at a time."""
    todo = runs(12)
    with RunProgress(todo) as shown:
        for number, seconds in enumerate((120.0, 120.0, 140.0)):
            clock[0] = seconds
            shown.advance(todo[number], took(20.0))
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "0/12 runs, workers are starting; an estimate follows when the first run ends"
    assert lines[-1] == "3/12 runs, about 2 min left"


def test_a_record_without_a_time_tells_nothing(clock, capsys):
    todo = runs(3)
    with RunProgress(todo, n_processes=1) as shown:
        clock[0] = 60.0
        shown.advance(todo[0], took(float("nan")))
    assert "1/3 runs, an estimate follows when the first run ends" in capsys.readouterr().err


def test_where_everything_is_stored_only_that_is_said(capsys):
    with RunProgress([], n_stored=3, n_foreign=1):
        pass
    first, second = capsys.readouterr().err.splitlines()
    assert first == "3 of 3 runs are stored already."
    assert second.startswith("1 of them was made by other code or other versions of the packages; give another folder")


def test_damaged_files_are_named_up_to_a_few(capsys):
    damaged = [f"Cannot read {number}." for number in range(DAMAGED_SHOWN + 2)]
    with RunProgress(runs(1), damaged=damaged):
        pass
    told = capsys.readouterr().err
    assert told.count("Run again: Cannot read") == DAMAGED_SHOWN
    assert "Run again: 2 more files like these." in told


@pytest.mark.parametrize(
    ("seconds", "told"), [(0.2, "1 s"), (89.0, "89 s"), (720.0, "12 min"), (5399.0, "90 min"), (12_600.0, "3.5 h")]
)
def test_lengths_of_time_are_told_in_round_numbers(seconds, told):
    assert duration(seconds) == told
