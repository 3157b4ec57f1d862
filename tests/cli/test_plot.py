"""`swarm-forage plot`: stored runs are drawn anew."""

from pathlib import Path

import pytest

from metrics.scoring.summary import summarize_runs
from swarm_forage_env.runs.plan import read_table

RUNS = ("--robots", "3", "--set", "n_objects=20", "--set", "interval_s=2", "--horizon", "4", "--jobs", "1")


@pytest.fixture
def folder(command):
    """Runs of two policies that have different caches."""
    assert command("run", "random,stochm", *RUNS, "--seeds", "2", "--out", "here")[0] == 0
    return Path("here")


def test_stored_runs_are_the_table_that_made_them(command, folder):
    _, printed, _ = command("run", "random,stochm", *RUNS, "--seeds", "2", "--out", "here")
    again = summarize_runs(read_table(folder))
    assert sorted(str(again).splitlines()) == sorted(printed.rstrip().splitlines())


def test_a_figure_for_a_paper(command, folder, painted):
    from matplotlib import image

    words = ("--width-in", "3.5", "--no-title", "--picture", "figure.png")
    assert command("plot", "here", *words) == (0, "picture figure.png\n", "")
    assert image.imread("figure.png").shape[1] == round(3.5 * 150)


def test_what_cannot_be_drawn_is_one_line(command, folder):
    assert command("run", "random", *RUNS[:-4], "--horizon", "8", "--out", "here", "--jobs", "1")[0] == 0
    for words, complaint in (
        (("here",), "Expected runs of one length in here, got 4 s in intervals of 2 s, 8 s in intervals of 2 s"),
        (("study.parquet",), "it is 'swarm-forage study plot study.parquet'"),
        (("nowhere",), "Expected run records (*.parquet) in nowhere, found none."),
        (("here", "--picture", "figure.txt"), "Expected"),
    ):
        code, out, err = command("plot", *words)
        assert (code, out) == (2, ""), err
        assert complaint in err
        assert len(err.splitlines()) == 1
