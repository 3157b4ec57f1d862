"""How many runs are done, on stderr, and how long the rest takes.

The estimate goes by robot-ticks, at the speed of each policy: one that jams may take 30 times as long as another. It
leaves out what comes before the first run, such as starting processes and compiling.
"""

import math
import time
from collections.abc import Sequence
from typing import Any

from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from swarm_forage_env.runs.spec import RunSpec

PLAIN_LINE_EVERY_S = 10.0
"""Shortest time between two lines where stderr is no terminal."""


class RunProgress:
    """Context manager: a bar on a terminal, an occasional plain line elsewhere."""

    def __init__(self, todo: Sequence[RunSpec], *, n_stored: int, n_processes: int | None, shown: bool = True) -> None:
        """Begin, with how many runs are stored already, and how many are made at a time (None: nobody knows)."""
        self._left = {spec.run_id: spec for spec in todo}
        self._total = n_stored + len(todo)
        self._n_processes = n_processes
        self._spent: dict[str, tuple[float, int]] = {}
        """Policy -> seconds and robot-ticks of its finished runs."""
        self._first_start, self._last_line, self._n_failed = math.inf, -math.inf, 0
        console = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)
        self._plain = console if todo and shown and not console.is_terminal else None
        columns = (TextColumn("runs"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn())
        told = TextColumn("{task.description}", markup=False)
        self._bar = Progress(*columns, told, console=console, disable=not (todo and shown and console.is_terminal))
        self._task = self._bar.add_task("", total=self._total)

    def __enter__(self) -> "RunProgress":
        self._bar.start()
        self._show()
        return self

    def __exit__(self, *_: Any) -> None:
        self._bar.stop()

    def advance(self, spec: RunSpec, took_s: float) -> None:
        """Count one more run, and how long it took; NaN = it failed, and the estimate does without it."""
        del self._left[spec.run_id]
        if math.isnan(took_s):
            self._n_failed += 1
        else:
            seconds, ticks = self._spent.get(spec.policy, (0.0, 0))
            self._spent[spec.policy] = seconds + took_s, ticks + spec.robot_ticks
            self._first_start = min(self._first_start, time.monotonic() - took_s)
        self._show()

    def _show(self) -> None:
        n_done, now = self._total - len(self._left), time.monotonic()
        self._bar.update(self._task, completed=n_done, description=self.told())
        if self._plain and (not self._left or now - self._last_line >= PLAIN_LINE_EVERY_S):
            self._last_line = now
            self._plain.print(f"{n_done}/{self._total} runs, {self.told()}")

    def told(self) -> str:
        """Return how long the rest takes, in words."""
        words = f"about {duration(self.remaining_s())} left" if self._spent else "an estimate follows the first run"
        return (words if self._left else "all done") + (f", {self._n_failed} failed" if self._n_failed else "")

    def remaining_s(self) -> float:
        """Return how long the runs that are left take, s. Policies without a finished run count as the mean of all."""
        seconds, ticks = (sum(column) for column in zip(*self._spent.values(), strict=True))
        speeds = {policy: took_s / n_ticks for policy, (took_s, n_ticks) in self._spent.items()}
        left_s = sum(speeds.get(spec.policy, seconds / ticks) * spec.robot_ticks for spec in self._left.values())
        at_a_time = self._n_processes or seconds / max(time.monotonic() - self._first_start, 1e-9)
        return left_s / max(1e-9, min(at_a_time, len(self._left)))


def duration(seconds: float) -> str:
    """Return a length of time for people: "45 s", "12 min", "3.5 h"."""
    if seconds < 90:
        return f"{max(1, round(seconds))} s"
    return f"{round(seconds / 60)} min" if seconds < 90 * 60 else f"{seconds / 3600:.1f} h"
