"""Where commands print: tables on stdout, notes on stderr.

Names of policies, files and scenarios are shown as they are: no console reads markup such as [red] in them.
"""

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Protocol

from rich.console import Console

_WIDTH_WITHOUT_TERMINAL = 140


def output() -> Console:
    """Return a console on stdout; if the width is unknown, tables are not cut."""
    console = Console(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = _WIDTH_WITHOUT_TERMINAL
    return console


def notes() -> Console:
    """Return a console on stderr, for what is not the result; it breaks no lines."""
    return Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)


class Advance(Protocol):
    """Told how much is done, and of how much in all where that was not known before."""

    def __call__(self, done: float, total: float | None = None) -> None:
        """Show it."""


@contextmanager
def progress_bar(text: str, total: float | None = None) -> Iterator[Advance]:
    """Show on stderr how much is done, and an estimate of how long the rest will take; nothing without a terminal."""
    from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

    screen = Console(stderr=True, highlight=False, markup=False, emoji=False)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
    with Progress(*columns, console=screen, transient=True, disable=not screen.is_terminal) as bar:
        task = bar.add_task(text, total=total)

        def advance(done: float, total: float | None = None) -> None:
            bar.update(task, completed=done, total=total)

        yield advance
