"""Where commands print."""

import pytest
from rich.console import Console

from swarm_forage_env.cli.printer import progress_bar


@pytest.mark.parametrize("is_terminal", [True, False])
def test_a_bar_shows_names_as_they_are_and_only_on_a_terminal(capsys, monkeypatch, is_terminal):
    monkeypatch.setattr(Console, "is_terminal", property(lambda _: is_terminal))
    with progress_bar("[red]crw.zip", 4) as advance:
        advance(1)
        advance(3, 5)
    shown = capsys.readouterr()
    assert shown.out == ""
    assert ("[red]crw.zip" in shown.err) == is_terminal
