"""The command `availability`: its table, its picture, and what it refuses."""

import json
import re
import sys
from pathlib import Path

import pytest

from metrics import availability_curves

PNG = b"\x89PNG"
PAGE = Path(__file__).resolve().parents[2] / "docs/equations.md"

COMMAND = ("predict", "availability")


def rows(out):
    """Numbers of the printed table, one list per row."""
    return [[float(cell) for cell in line.split()] for line in out.splitlines()[2:]]


def test_the_table_has_the_papers_number_and_each_swarms_own_mean(command):
    code, out, _ = command(*COMMAND)
    assert code == 0
    assert rows(out) == [
        [50, 5, 5.0, 0.833, 0.402, 0.161, 0.026, 0.001],
        [50, 10, 9.6, 0.908, 0.618, 0.381, 0.142, 0.014],
        [50, 20, 15.4, 0.948, 0.764, 0.579, 0.320, 0.064],
        [200, 5, 5.0, 0.833, 0.402, 0.162, 0.026, 0.001],
        [200, 10, 10.0, 0.909, 0.621, 0.386, 0.149, 0.022],
        [200, 20, 20.0, 0.952, 0.784, 0.614, 0.377, 0.142],
    ]
    assert list(Path.cwd().iterdir()) == []


def test_the_page_shows_what_its_command_prints(command):
    page = PAGE.read_text()
    (words,) = re.findall(
        r"^swarm-forage (predict availability .*?) --picture docs/images/availability.png$", page, re.MULTILINE
    )
    _, out, _ = command(*words.split())
    lines = [line.rstrip() for line in out.rstrip().splitlines()]
    assert "\n".join(lines) in page


def test_sizes_teams_and_demands_are_chosen(command):
    # Two robots, M = 1: weights 1, 1/2, 1/4 of 0, 1, 2 at work, so a mean of 4/7, and 1/7 for both.
    code, out, _ = command(*COMMAND, "--robots", "2", "--teams", "1", "--needed", "0, 2,3")
    assert code == 0
    assert rows(out) == [[2, 1, 0.6, 1.0, 0.143, 0.0]]


def test_the_picture_is_written_beside_the_table(command, painted):
    code, out, err = command(
        "predict", "availability", "--robots", "4,9", "--teams", "2.5", "--picture", "some/where.png"
    )
    assert code == 0
    assert len(rows(out)) == 2
    assert err == "picture some/where.png\n"
    assert Path("some/where.png").read_bytes().startswith(PNG)


def test_json_is_the_only_thing_on_stdout(command):
    _, out, _ = command(
        "predict", "availability", "--robots", "50", "--teams", "5", "--json", "--picture", "curves.svg"
    )
    answer = json.loads(out)
    (curve,) = answer["curves"]
    assert answer["picture"] == "curves.svg"
    assert (curve["robots"], curve["team"], curve["needed"]) == (50, 5.0, [1, 5, 10, 20, 40])
    assert curve["at_work"] == pytest.approx(5.0, abs=0.01)
    assert curve["availability"] == availability_curves(50, [5], curve["needed"])[0].tolist()


def test_help_has_the_symbol_of_the_page(command):
    assert "Mean teams M" in " ".join(command(*COMMAND, "--help")[1].split())


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("--robots", "0"), "n >= 1 robot"),
        (("--robots", "1.5"), "--robots as whole numbers"),
        (("--teams", "5,x"), "--teams as numbers"),
        (("--teams", "0"), "more than 0 robots at work"),
        (("--needed", ""), "--needed as whole numbers"),
        (("--picture", "folder/curves.gif"), "'folder/curves.gif'"),
    ],
)
def test_mistakes_are_one_line_and_leave_nothing(command, words, said):
    code, out, err = command(*COMMAND, *words)
    assert (code, out) == (2, "")
    assert said in err
    assert err.count("\n") == 1
    assert list(Path.cwd().iterdir()) == []


def test_without_matplotlib_the_table_comes_and_the_picture_is_missed(command, monkeypatch):
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    code, out, err = command(*COMMAND, "--picture", "curves.png")
    assert (code, len(rows(out))) == (1, 6)
    assert "No picture without matplotlib" in err
