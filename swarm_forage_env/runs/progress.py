"""How many runs are done, on stderr, and how long the rest takes.

The estimate goes by robot-ticks, from the runs that have finished. What comes before the first run, such as starting
processes and compiling, is not in it: a few short runs would seem to take minutes.
"""

import math
import time
from collections.abc import Sequence
from types import TracebackType

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.spec import RunSpec

DAMAGED_SHOWN = 5
"""Damaged files that are named; more are only counted."""
PLAIN_LINE_EVERY_S = 10.0
"""Shortest time between two lines where stderr is no terminal."""


class RunProgress:
    """Context manager: a bar on a terminal, an occasional plain line elsewhere."""

    def __init__(
        self,
        todo: Sequence[RunSpec],
        *,
        n_stored: int = 0,
        n_foreign: int = 0,
        damaged: Sequence[str] = (),
        n_processes: int | None = None,
    ) -> None:
        """Count runs.

        Args:
            todo: The runs that are to be made.
            n_stored: How many more are stored already.
            n_foreign: How many of these other versions made.
            damaged: Why files of others cannot be used; they are run again.
            n_processes: How many make runs at a time, 1 = this one; None = it is not known.
        """
        self._left = {spec.run_id: spec for spec in todo}
        self._total = n_stored + len(self._left)
        self._damaged = damaged
        self._n_processes = n_processes
        self._measured_s = 0.0
        self._measured_robot_ticks = 0
        self._first_start: float | None = None
        self._stored = n_stored
        self._foreign = n_foreign
        self._failed = 0
        self._console = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)
        self._bar: Progress | None = None

    @property
    def _done(self) -> int:
        return self._total - len(self._left)

    def __enter__(self) -> "RunProgress":
        """Start the clock."""
        self._last_line = time.monotonic()
        if self._stored:
            be = "is" if self._stored == 1 else "are"
            self._console.print(f"{self._stored} of {self._total} runs {be} stored already.")
        if self._foreign:
            be = "was" if self._foreign == 1 else "were"
            self._console.print(
                f"{self._foreign} of them {be} made by other code or other versions of the packages; "
                "give another folder to run them afresh."
            )
        for reason in self._damaged[:DAMAGED_SHOWN]:
            self._console.print(f"Run again: {reason}")
        if len(self._damaged) > DAMAGED_SHOWN:
            self._console.print(f"Run again: {len(self._damaged) - DAMAGED_SHOWN} more files like these.")
        if not self._left:
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

    def advance(self, spec: RunSpec, record: RunRecord | None) -> None:
        """Count one more run.

        Args:
            spec: The run.
            record: What it was; None = it failed, and the estimate does without it.
        """
        del self._left[spec.run_id]
        now = time.monotonic()
        if record is None:
            self._failed += 1
        elif not math.isnan(took_s := record.wall_time_s):
            self._measured_s += took_s
            self._measured_robot_ticks += spec.robot_ticks
            self._first_start = min(now - took_s, now if self._first_start is None else self._first_start)
        if self._bar is not None:
            self._bar.update(self._bar.task_ids[0], completed=self._done, description=self._remaining())
        elif now - self._last_line >= PLAIN_LINE_EVERY_S or not self._left:
            self._last_line = now
            self._console.print(f"{self._done}/{self._total} runs, {self._remaining()}")

    def _remaining(self) -> str:
        failures = f", {self._failed} failed" if self._failed else ""
        if not self._left:
            return "all done" + failures
        if self._first_start is None:
            return self._beginning() + failures
        left = sum(spec.robot_ticks for spec in self._left.values())
        seconds = self._measured_s * left / self._measured_robot_ticks
        at_a_time = self._n_processes or self._measured_s / max(time.monotonic() - self._first_start, 1e-9)
        return f"about {duration(seconds / min(at_a_time, len(self._left)))} left{failures}"

    def _beginning(self) -> str:
        """Return what happens before the first run has ended."""
        then = "an estimate follows when the first run ends"
        if self._done > self._stored or self._n_processes == 1:
            return then
        who = "workers" if self._n_processes is None else f"{self._n_processes} processes"
        return f"{who} are starting; {then}"


def duration(seconds: float) -> str:
    """Return a length of time for people: "45 s", "12 min", "3.5 h"."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    if seconds < 90 * 60:
        return f"{round(seconds / 60)} min"
    return f"{seconds / 3600:.1f} h"
