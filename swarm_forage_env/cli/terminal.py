"""Where commands print: tables on stdout, notes on stderr.

Names of policies, files and scenarios are shown as they are: no console reads markup such as [red] in them.
"""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Protocol

from rich.console import Console

if TYPE_CHECKING:
    from rich.table import Table

    from swarm_forage_env.runs.answer import Answer, Sheet

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


def show_boxed(answer: "Answer") -> None:
    """Print the tables of an answer on stdout in frames, in which long texts are wrapped."""
    console = output()
    for sheet in answer.sheets():
        console.print(_boxed(sheet) if sheet.rows else sheet.text(), soft_wrap=not sheet.rows)


def _boxed(sheet: "Sheet") -> "Table":
    """A table in a frame: numbers to the right."""
    from rich.table import Table

    table = Table(title=sheet.title or None, caption="\n".join(sheet.notes) or None, title_justify="left")
    for name, *column in zip(sheet.header, *sheet.rows, strict=True):
        table.add_column(name, justify="right" if _are_numbers(column) else "left")
    for row in sheet.rows:
        table.add_row(*row)
    return table


def _are_numbers(column: Sequence[str]) -> bool:
    """Whether texts are numbers and shares, apart from gaps."""
    given = [text.removesuffix(" %").replace(",", "") for text in column if text]
    try:
        return bool([float(text) for text in given if text != "-"] or given)
    except ValueError:
        return False
