"""How many runs are done and how long the rest will take, on stderr."""

import time
from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

DAMAGED_SHOWN = 5
"""Damaged files that are named; more are only counted."""
PLAIN_LINE_EVERY_S = 10.0
"""Shortest time between two lines where stderr is no terminal."""


class RunProgress:
    """Context manager: a bar on a terminal, an occasional plain line elsewhere."""

    def __init__(
        self, *, total: int, done: int = 0, foreign: int = 0, damaged: Sequence[str] = (), work: float = 0.0
    ) -> None:
        """Count runs.

        Args:
            total: How many there are.
            done: How many of them are stored already.
            foreign: How many of these other versions made.
            damaged: Why files of others cannot be used; they are run again.
            work: What the rest of the runs takes in any unit, for the estimate; 0 = all runs take as long.
        """
        self._total = total
        self._damaged = damaged
        self._work = work
        self._work_done = 0.0
        self._stored = done
        self._foreign = foreign
        self._done = done
        self._failed = 0
        self._console = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)
        self._bar: Progress | None = None

    def __enter__(self) -> "RunProgress":
        """Start the clock."""
        self._started = time.monotonic()
        self._last_line = self._started
        if self._stored:
            be = "is" if self._stored == 1 else "are"
            self._console.print(f"{self._stored} of {self._total} runs {be} stored already.")
        if self._foreign:
            be = "was" if self._foreign == 1 else "were"
            self._console.print(
                f"{self._foreign} of them {be} made by another version or commit of the packages; "
                "give another folder to run them afresh."
            )
        for reason in self._damaged[:DAMAGED_SHOWN]:
            self._console.print(f"Run again: {reason}")
        if len(self._damaged) > DAMAGED_SHOWN:
            self._console.print(f"Run again: {len(self._damaged) - DAMAGED_SHOWN} more files like these.")
        if self._done == self._total:
            return self
        if not self._console.is_terminal:
            self._console.print(f"{self._done}/{self._total} runs, {self._remaining()}")
        else:
            columns = (TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
            self._bar = Progress(*columns, TextColumn("{task.description}", markup=False), console=self._console)
            self._bar.add_task(self._remaining(), total=self._total, completed=self._done)
            self._bar.start()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Remove the bar."""
        if self._bar is not None:
            self._bar.stop()

    def advance(self, *, failed: bool, work: float = 0.0) -> None:
        """Count one more run, and the work it was."""
        self._done += 1
        self._work_done += work
        self._failed += failed
        now = time.monotonic()
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=self._done, description=self._remaining())
        elif now - self._last_line >= PLAIN_LINE_EVERY_S or self._done == self._total:
            self._last_line = now
            self._console.print(f"{self._done}/{self._total} runs, {self._remaining()}")

    def _remaining(self) -> str:
        failures = f", {self._failed} failed" if self._failed else ""
        ran, left = self._done - self._stored, self._total - self._done
        if not left:
            return "all done" + failures
        if not ran:
            return "no estimate yet" + failures
        share_left = left / ran if not self._work_done else (self._work - self._work_done) / self._work_done
        seconds = (time.monotonic() - self._started) * share_left
        return f"about {duration(seconds)} left{failures}"


def duration(seconds: float) -> str:
    """Return a length of time for people: "45 s", "12 min", "3.5 h"."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    if seconds < 90 * 60:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h"
