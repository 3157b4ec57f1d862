"""Progress of many runs, where there is no terminal."""

import pytest

from swarm_forage_env.runs import progress
from swarm_forage_env.runs.progress import DAMAGED_SHOWN, RunProgress


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass as the test says."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_the_estimate_goes_by_work_where_runs_differ(clock, capsys):
    with RunProgress(total=5, done=2, work=1000.0, n_processes=1) as shown:
        clock[0] = 90.0
        shown.advance(failed=False, work=900.0, took_s=90.0)
        clock[0] = 105.0
        shown.advance(failed=True, work=75.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "2 of 5 runs are stored already."
    assert lines[1] == "2/5 runs, an estimate follows when the first run ends"
    assert lines[2] == "3/5 runs, about 10 s left", "two runs, but a ninth of the work"
    assert lines[3] == "4/5 runs, about 2 s left, 1 failed", "the time of a failure tells nothing"


def test_without_work_all_runs_count_as_equal(clock, capsys):
    with RunProgress(total=3, n_processes=1) as shown:
        clock[0] = 60.0
        shown.advance(failed=False, took_s=60.0)
    assert "1/3 runs, about 2 min left" in capsys.readouterr().err


def test_starting_and_compiling_are_not_in_the_estimate(clock, capsys):
    """Four minutes of start, then runs of four seconds on two processes."""
    with RunProgress(total=21, n_processes=2) as shown:
        clock[0] = 244.0
        shown.advance(failed=False, took_s=4.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "0/21 runs, 2 processes are starting; an estimate follows when the first run ends"
    assert lines[1] == "1/21 runs, about 40 s left"


def test_no_more_processes_work_than_there_are_runs(clock, capsys):
    with RunProgress(total=2, n_processes=2) as shown:
        clock[0] = 30.0
        shown.advance(failed=False, took_s=20.0)
    assert "1/2 runs, about 20 s left" in capsys.readouterr().err


def test_of_workers_elsewhere_the_number_is_seen_from_what_they_do(clock, capsys):
    """Three runs of 20 seconds within 40 seconds, the start of the workers left out: one and a half at a time."""
    with RunProgress(total=12) as shown:
        clock[0] = 120.0
        shown.advance(failed=False, took_s=20.0)
        shown.advance(failed=False, took_s=20.0)
        clock[0] = 140.0
        shown.advance(failed=False, took_s=20.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "0/12 runs, workers are starting; an estimate follows when the first run ends"
    assert lines[-1] == "3/12 runs, about 2 min left"


def test_damaged_files_are_named_up_to_a_few(capsys):
    damaged = [f"Cannot read {number}." for number in range(DAMAGED_SHOWN + 2)]
    with RunProgress(total=1, damaged=damaged):
        pass
    told = capsys.readouterr().err
    assert told.count("Run again: Cannot read") == DAMAGED_SHOWN
    assert "Run again: 2 more files like these." in told
