"""Progress where there is no terminal."""

import pytest

from swarm_forage_env.runs import progress
from swarm_forage_env.runs.progress import duration, progress_bar


def test_an_estimate_goes_by_work_and_leaves_out_the_start(monkeypatch, capsys):
    """Four minutes of start, then parts of ten per second."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with progress_bar("0/4 runs", 1200.0) as tell:
        bar_clock = [(240.0, 300.0), (270.0, 600.0), (275.0, 700.0), (300.0, 900.0)]
        for place, (now[0], done) in enumerate(bar_clock, start=1):
            tell(done, text=f"{place}/4 runs")
    assert capsys.readouterr().err.splitlines() == [
        "1/4 runs",
        "2/4 runs, about 60 s left",
        "4/4 runs, about 30 s left",
    ]


def test_nothing_is_shown_where_nobody_asks(capsys, monkeypatch):
    monkeypatch.setattr(progress, "LINE_EVERY_S", 0.0)
    with progress_bar("runs", shown=False) as tell:
        tell(1, 2)
    assert capsys.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("seconds", "told"), [(0.2, "1 s"), (89, "89 s"), (90, "2 min"), (5399, "90 min"), (5400, "1.5 h")]
)
def test_times_are_told_in_the_unit_that_people_use(seconds, told):
    assert duration(seconds) == told
