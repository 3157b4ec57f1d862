"""What commands that store runs do when they are interrupted."""

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import typer

from swarm_forage_env.cli.options import EXIT_INTERRUPTED, complain
from swarm_forage_env.study.runner import StudyInterrupted


@contextmanager
def resumable(folder: Path) -> Iterator[None]:
    """Turn Ctrl-C in a study into one line that says where its runs are, and the exit code of an interrupt."""
    try:
        yield
    except StudyInterrupted as interrupt:
        complain(f"{interrupt} They are in {folder}; the same command does the rest.", EXIT_INTERRUPTED)
        raise typer.Exit(EXIT_INTERRUPTED) from None
