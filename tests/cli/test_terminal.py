"""Where commands print, and how wide."""

import sys

import pytest
from rich.console import Console

from swarm_forage_env.cli.printer import progress_bar, width_of_terminal
from swarm_forage_env.inspect.descriptions import describe, overview
from swarm_forage_env.studies.description import paper_sets


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_bar_shows_names_as_they_are_and_only_on_a_terminal(capsys, monkeypatch, is_terminal):
    monkeypatch.setattr(Console, "is_terminal", property(lambda _: is_terminal))
    with progress_bar("[red]crw.zip", 4) as advance:
        advance(1)
        advance(3, 5)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert ("[red]crw.zip" in shown.err) == is_terminal


@pytest.mark.parametrize(("is_terminal", "width"), [(True, 80), (False, None)])
def test_only_a_terminal_has_a_width(monkeypatch, is_terminal, width):
    monkeypatch.setenv("COLUMNS", "80")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: is_terminal)
    assert width_of_terminal() == width


@pytest.mark.parametrize(
    "answer",
    [lambda: overview("columns"), paper_sets, lambda: describe("search_and_rescue")],
    ids=["list columns", "study list", "info"],
)
def test_tables_fit_into_a_terminal_of_80_columns(answer):
    _title, *table = answer().text(width=80).splitlines()
    assert max(map(len, table)) <= 80
    assert max(map(len, answer().text().splitlines())) > 80
