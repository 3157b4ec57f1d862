"""Progress of many runs, where there is no terminal."""

import pytest

from swarm_forage_env.study import progress
from swarm_forage_env.study.progress import DAMAGED_SHOWN, RunProgress


@pytest.fixture
def clock(monkeypatch):
    """Seconds that pass as the test says."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_the_estimate_goes_by_work_where_runs_differ(clock, capsys):
    with RunProgress(total=5, done=2, work=1000.0) as shown:
        clock[0] = 90.0
        shown.advance(failed=False, work=900.0)
        clock[0] = 105.0
        shown.advance(failed=True, work=75.0)
    lines = capsys.readouterr().err.splitlines()
    assert lines[0] == "2 of 5 runs are stored already."
    assert lines[2] == "3/5 runs, about 10 s left", "two runs, but a ninth of the work"
    assert lines[3] == "4/5 runs, about 3 s left, 1 failed"


def test_without_work_all_runs_count_as_equal(clock, capsys):
    with RunProgress(total=3) as shown:
        clock[0] = 60.0
        shown.advance(failed=False)
    assert "1/3 runs, about 2 min left" in capsys.readouterr().err


def test_damaged_files_are_named_up_to_a_few(capsys):
    damaged = [f"Cannot read {number}." for number in range(DAMAGED_SHOWN + 2)]
    with RunProgress(total=1, damaged=damaged):
        pass
    told = capsys.readouterr().err
    assert told.count("Run again: Cannot read") == DAMAGED_SHOWN
    assert "Run again: 2 more files like these." in told
