"""How commands ask questions and show answers: text or JSON on stdout, a picture in a file, notes on stderr.

Names of policies, files and scenarios are shown as they are: no console reads markup such as [red] in them.
"""

import json
import shutil
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

import typer
from rich.console import Console, RenderableType

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import counted, printable
from swarm_forage_env.cli.errors import resumable
from swarm_forage_env.cli.options import EXIT_FAILURE, RunOptions, complain, no_picture

if TYPE_CHECKING:
    from metrics.scoring.question import Question
    from swarm_forage_env.runs.answer import Answer, Sheet
    from swarm_forage_env.runs.store import RunStore
    from swarm_forage_env.runs.table import Table

_WIDTH_WITHOUT_TERMINAL = 140


def output() -> Console:
    """Return a console on stdout; if the width is unknown, tables are not cut."""
    console = Console(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = _WIDTH_WITHOUT_TERMINAL
    return console


def width_of_terminal() -> int | None:
    """Return how many characters a line on stdout may have; None for a file or a pipe, which get one line per row."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


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


def _boxed(sheet: "Sheet") -> RenderableType:
    """A table in a frame: numbers to the right."""
    from rich.table import Table as Framed

    table = Framed(title=sheet.title or None, caption="\n".join(sheet.notes) or None, title_justify="left")
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


FAILURES_SHOWN = 10
"""Reasons of failures for which the command that makes the first run again is told; the folder has those of all."""


@contextmanager
def refusing() -> Iterator[None]:
    """Turn what is wrong with a policy, a file or a value into an error about the words of the user.

    Raises:
        ConfigError: any ValueError within.
    """
    try:
        yield
    except ValueError as error:
        raise ConfigError(str(error)) from error


def ask_and_show(
    question: "Question[Any]",
    folder: Path,
    options: RunOptions,
    *,
    picture: Path | None = None,
) -> None:
    """Make the runs of a question and show its answer; or only its plan.

    Args:
        question: What is asked; its answer is an `Answer`.
        folder: Where records go.
        options: How runs are made, and what is printed.
        picture: File of the picture; None = the answer has none.

    Raises:
        ConfigError: a picture whose ending is none of figures.
        typer.Exit: Ctrl-C; runs have failed, or too many for an answer.
    """
    from metrics.checks import CurveError
    from swarm_forage_env.rendering.figures import picture_ending
    from swarm_forage_env.runs.plan_summary import summarize_plan
    from swarm_forage_env.runs.store import RunStore

    if picture is not None:
        picture_ending(picture)  # before the work; a place that cannot be written to is told of beside the answer
    if options.dry_run:
        show(summarize_plan(question.plan, out=folder), as_json=options.as_json)
        return
    store = RunStore(folder)
    with resumable(folder):
        table = question.make_runs(store=store, jobs=options.jobs, progress=True)
    try:
        answer: Answer = question.answer(table)
    except CurveError as error:  # what is left is too little
        raise typer.Exit(complain(str(error), EXIT_FAILURE)) from None
    show(answer, picture, as_json=options.as_json)
    _tell_of_records(table, store)
    if table.failures:
        raise typer.Exit(EXIT_FAILURE)


def show(answer: "Answer", picture: Path | None = None, *, as_json: bool = False) -> None:
    """Print an answer, and draw it.

    Args:
        answer: What was found.
        picture: File for the picture; a picture that cannot be made is told of, because the answer is worth more.
        as_json: Print JSON; it names the picture.
    """
    drawn = None if picture is None else _drawn(answer, picture)
    if as_json:
        may_be_drawn = picture is not None or answer.has_picture
        told = {"picture": None if drawn is None else str(drawn)} if may_be_drawn else {}
        typer.echo(json.dumps({**answer.to_mapping(), **told}, indent=1))
    else:
        typer.echo(printable(answer.text(width=width_of_terminal()).rstrip("\n")))
    if drawn is not None:
        typer.echo(f"picture {drawn}", err=True)


def _drawn(answer: "Answer", picture: Path) -> Path | None:
    """Draw an answer; None if it has no picture, or there can be none."""
    if not answer.has_picture:
        return None
    try:
        answer.draw(picture)
    except ImportError as error:
        typer.echo(error, err=True)
    except OSError as error:
        typer.echo(no_picture(picture, error), err=True)
    else:
        return picture
    return None


def _tell_of_records(table: "Table", store: "RunStore") -> None:
    """Say on stderr where the records are, and how a failed run is made again, one for each policy and reason."""
    from swarm_forage_env.runs.store import failed_alike

    if table.records:
        typer.echo(f"{counted(len(table.records), 'record')} in {store.folder}", err=True)
    reasons = failed_alike(table.failures.values())
    for first, *_ in reasons[:FAILURES_SHOWN]:
        typer.echo(f"again, alone: swarm-forage rerun {store.failure_path(first.run_id)}", err=True)
    if len(reasons) > FAILURES_SHOWN:
        typer.echo(f"and {len(reasons) - FAILURES_SHOWN} more reasons", err=True)
