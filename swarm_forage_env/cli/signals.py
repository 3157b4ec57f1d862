"""What commands that store runs do when they are interrupted, by Ctrl-C or by SIGTERM."""

import os
import signal
import sys
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from swarm_forage_env.cli.options import EXIT_INTERRUPTED, complain
from swarm_forage_env.runs.runner import RunsInterrupted

AGAIN_S = 0.2
"""When an interrupt that was lost is sent again; our choice: soon, and late enough to be elsewhere."""


class Terminated(KeyboardInterrupt):
    """SIGTERM, which batch systems and containers send: to be handled as Ctrl-C is."""


@contextmanager
def heard() -> Iterator[list[int]]:
    """Let SIGTERM raise `Terminated`, so that what keeps finished runs at Ctrl-C keeps them then, too.

    An interrupt that comes while LLVM calls Python, as it does in compiling, is lost there: it is sent again a moment
    later. Meanwhile the compiler may fail with an error of its own; the list tells then what it was.

    Yields:
        A list that is empty until Ctrl-C or SIGTERM came: their numbers.
    """
    came: list[int] = []
    if threading.current_thread() is not threading.main_thread():  # handlers are set in the main thread only
        yield came
        return

    def stop(number: int, _frame: object) -> None:
        came.append(number)
        raise Terminated if number == signal.SIGTERM else KeyboardInterrupt

    show = sys.unraisablehook
    again: list[threading.Timer] = []

    def show_others(lost: Any) -> None:
        if isinstance(lost.exc_value, KeyboardInterrupt):
            again.append(threading.Timer(AGAIN_S, os.kill, (os.getpid(), came[-1])))
            again[-1].start()
        else:
            show(lost)

    before = {number: signal.signal(number, stop) for number in (signal.SIGTERM, signal.SIGINT)}
    sys.unraisablehook = show_others
    try:
        yield came
    finally:
        sys.unraisablehook = show
        for timer in again:
            timer.cancel()
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Turn Ctrl-C in a study into one line that says where its runs are, and the exit code of an interrupt."""
    try:
        yield
    except RunsInterrupted as interrupt:
        complain(f"{interrupt} They are in {folder}; the same command does the rest.", EXIT_INTERRUPTED)
        raise typer.Exit(EXIT_INTERRUPTED) from None
