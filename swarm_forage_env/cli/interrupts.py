"""What commands that store runs do when they are interrupted, by Ctrl-C or by SIGTERM."""

import signal
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from swarm_forage_env.cli.options import EXIT_INTERRUPTED, complain
from swarm_forage_env.study.runner import StudyInterrupted


class Terminated(KeyboardInterrupt):
    """SIGTERM, which batch systems and containers send: to be handled as Ctrl-C is."""


@contextmanager
def terminated_as_interrupted() -> Iterator[list[int]]:
    """Let SIGTERM raise `Terminated`, so that what keeps finished runs at Ctrl-C keeps them then, too.

    Yields:
        A list that is empty until SIGTERM came, because on its way up the error may become an exit code.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():  # handlers are set in the main thread only
        yield came
        return

    def stop(number: int, _frame: object) -> None:
        came.append(number)
        raise Terminated

    before = signal.signal(signal.SIGTERM, stop)
    try:
        yield came
    finally:
        signal.signal(signal.SIGTERM, before)


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Turn Ctrl-C in a study into one line that says where its runs are, and the exit code of an interrupt."""
    try:
        yield
    except StudyInterrupted as interrupt:
        complain(f"{interrupt} They are in {folder}; the same command does the rest.", EXIT_INTERRUPTED)
        raise typer.Exit(EXIT_INTERRUPTED) from None
