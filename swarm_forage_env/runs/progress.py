"""How far work is, on stderr: a bar on a terminal, a line now and then elsewhere."""

import time
from collections.abc import Callable, Generator
from contextlib import contextmanager

from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeRemainingColumn

LINE_EVERY_S = 20.0
"""Shortest time between two lines where stderr is no terminal; our choice."""
_DAY_S = 86_400.0
"""The speed is that of all that was done since; runs may take hours."""


@contextmanager
def progress_bar(text: str, total: float | None = None, *, shown: bool = True) -> Generator[Callable[..., None]]:
    """Show how much is done and how long the rest takes, once two parts are done.

    Starting processes and compiling come before the first part, and are no part of the estimate.

    Args:
        text: What is done.
        total: How much there is to do, in any unit.
        shown: Whether to show anything.

    Yields:
        What is told how much is done, and, where they are new, `total` and `text`.
    """
    console = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeRemainingColumn())
    has_bar = shown and console.is_terminal
    bar = Progress(
        *columns,
        console=console,
        transient=True,
        disable=not has_bar,
        speed_estimate_period=_DAY_S,
        get_time=time.monotonic,
    )
    task = bar.add_task(text, total=total)
    last_s = time.monotonic()

    def tell(done: float, total: float | None = None, *, text: str | None = None) -> None:
        nonlocal last_s
        bar.update(task, completed=done, total=total, description=text)
        if shown and not has_bar and time.monotonic() - last_s >= LINE_EVERY_S:
            last_s = time.monotonic()
            (now,) = bar.tasks
            left_s = now.time_remaining
            console.print(now.description + ("" if left_s is None else f", about {duration(left_s)} left"))

    with bar:
        yield tell


def duration(seconds: float) -> str:
    """Return a length of time for people: "45 s", "12 min", "3.5 h"."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    return f"{round(seconds / 60)} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"
