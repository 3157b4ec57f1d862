"""How a command ends that fails: an error becomes one line on stderr and an exit code.

An error that nobody foresaw is a fault of ours, or of a file of the user, such as a callback. Its traceback is shown,
and the line below says whose fault it is.
"""

import os
import sys
import traceback
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import typer

from swarm_forage_env._internal.faults import PACKAGES, place_in_code_of_user
from swarm_forage_env.cli.options import EXIT_FAILURE, EXIT_UNFORESEEN, EXIT_USAGE, complain
from swarm_forage_env.cli.signals import EXIT_INTERRUPTED

_WANTED = {
    "Input should be a valid integer": "a whole number",
    "Input should be a valid number": "a number",
    "Input should be greater than or equal to": "a number >=",
    "Input should be less than or equal to": "a number <=",
}
"""What pydantic says of values, by which typer checks them -> how we say it."""


def end(error: BaseException) -> int:
    """Say in one line on stderr why the command ends, below a traceback if nobody foresaw it; returns the exit code."""
    from swarm_forage_env.runs.workers import WorkerError  # late: only a command that fails needs it

    if hasattr(error, "format_message"):  # typer's complaints about words; their common class has no public name
        return complain(_about_words(error), EXIT_USAGE)
    if isinstance(error, ValueError) and type(error).__module__.partition(".")[0] in PACKAGES:
        return complain(str(error), EXIT_USAGE)
    if isinstance(error, SystemExit):
        return error.code if isinstance(error.code, int) else 0
    if isinstance(error, BrokenPipeError):  # whoever read our output has enough, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or the last flush fails again
        return EXIT_FAILURE
    if isinstance(error, OSError):
        named = f"{error.strerror}: {error.filename}" if error.strerror and error.filename else str(error)
        return complain(named, EXIT_FAILURE)
    if isinstance(error, ImportError | WorkerError):
        return complain(str(error), EXIT_FAILURE)
    if isinstance(error, MemoryError):
        return complain(
            f"Not enough memory{f': {error}' if str(error) else ''}; ask for fewer robots, objects, runs or processes.",
            EXIT_FAILURE,
        )
    traceback.print_exception(error)
    if place := place_in_code_of_user(error):
        return complain(f"Your code failed in {place}.", EXIT_FAILURE)
    return complain("An error that should not happen; please send us the lines above.", EXIT_UNFORESEEN)


def _about_words(error: Any) -> str:
    """Return what is wrong with the words of a command, for typer, in the style of our other errors."""
    said = next((theirs for theirs in _WANTED if error.message.startswith(theirs)), None)
    if said is None:
        help_text = getattr(getattr(error, "param", None), "help", "") if not error.message else ""  # a missing option
        complaint = error.format_message().removeprefix("Invalid value: ")
        return f"{complaint} It is: {help_text}" if help_text else complaint
    wanted = _WANTED[said] + error.message.removeprefix(said).partition(",")[0]
    got = error.__cause__.errors()[0]["input"]
    return f"Expected {error.param.opts[0]} to be {wanted}, got {got!r}. It is: {error.param.help}"


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Turn Ctrl-C in a study into one line that says where its runs are, and the exit code of an interrupt."""
    from swarm_forage_env.runs.runner import RunsInterrupted

    try:
        yield
    except RunsInterrupted as interrupt:
        complain(f"{interrupt} They are in {folder}; the same command does the rest.", EXIT_INTERRUPTED)
        raise typer.Exit(EXIT_INTERRUPTED) from None
