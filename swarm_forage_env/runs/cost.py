"""How long runs take: measured per policy and world, never assumed; and how many are done, on stderr.

`calibrate` measures before anything is run: each policy steps swarms of a few sizes for a moment, and the rest follows
in proportion. `MeasuredCost` learns from runs as they finish. By it `RunProgress` estimates how long the rest takes.
What comes before the first run, such as starting processes and compiling, is not in it: a few short runs would seem to
take minutes.
"""

import math
import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from types import TracebackType
from typing import Any, TypeAlias

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.run import LiveRun, build_stack, warm_up
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.quirks import Quirks

MEASURE_S = 0.25
"""Processor seconds for which each measured swarm is stepped."""
SIZES_MEASURED = 3
"""Swarm sizes that are measured of each kind of run: the smallest, the largest, and between them evenly by order."""
FIRST_TICKS = 20
"""Ticks of the first measured stretch; each further one is twice as long."""

Kind: TypeAlias = tuple[str | bool | Quirks, ...]
"""Runs of a kind have the same code in every tick: scenario with its quirks, engine, caches, whether objects walk, the
policy and wrappers."""


_PLACE_OF_POLICY = 5
"""Where the policy stands in a `Kind`."""
_ALL = ""
"""Stands for all kinds together; no policy has this name."""


@dataclass(frozen=True, eq=False)
class Cost:
    """What runs of one kind take, by swarm size."""

    n_robots: FloatArray
    """(S,) measured sizes, rising."""
    start_s: FloatArray
    """(S,) processor seconds until the first tick."""
    tick_s: FloatArray
    """(S,) processor seconds per tick."""

    def seconds(self, spec: RunSpec) -> float:
        """Return the processor seconds of a run; between measured sizes in proportion."""
        n_robots = spec.scenario.robots.n_robots
        start_s, tick_s = (float(np.interp(n_robots, self.n_robots, part)) for part in (self.start_s, self.tick_s))
        return start_s + tick_s * spec.scenario.horizon_ticks


class MeasuredCost:
    """How long runs take, from those that have finished.

    A kind of which no run has finished takes what its policy takes elsewhere, per robot-tick; a policy of which none
    has finished what all others take.
    """

    def __init__(self) -> None:
        self._seconds: defaultdict[Any, float] = defaultdict(float)
        self._robot_ticks: defaultdict[Any, int] = defaultdict(int)

    def add(self, spec: RunSpec, seconds: float) -> None:
        """Learn how long a run took."""
        for key in (kind_of(spec), spec.policy, _ALL):
            self._seconds[key] += seconds
            self._robot_ticks[key] += spec.robot_ticks

    def seconds(self, specs: Iterable[RunSpec]) -> float | None:
        """Return how long runs will take together, one after the other; None if no run has finished."""
        if not self._robot_ticks[_ALL]:
            return None
        work: Counter[Kind] = Counter()
        for spec in specs:
            work[kind_of(spec)] += spec.robot_ticks
        return sum(robot_ticks * self._per_robot_tick(kind) for kind, robot_ticks in work.items())

    def _per_robot_tick(self, kind: Kind) -> float:
        policy = kind[_PLACE_OF_POLICY]
        known = next(key for key in (kind, policy, _ALL) if self._robot_ticks[key])
        return self._seconds[known] / self._robot_ticks[known]


def calibrate(specs: Iterable[RunSpec], *, tell: Callable[[str], None] | None = None) -> Mapping[Kind, Cost]:
    """Measure each kind of run for a moment, in this process.

    Args:
        specs: What is to be run.
        tell: Gets a line about each measured swarm before it is measured.
    """
    by_kind: dict[Kind, dict[int, RunSpec]] = {}
    for spec in specs:
        by_kind.setdefault(kind_of(spec), {}).setdefault(spec.scenario.robots.n_robots, spec)
    costs: dict[Kind, Cost] = {}
    for kind, by_size in by_kind.items():
        measured: list[tuple[float, float, float]] = []
        for n_robots in _some(sorted(by_size)):
            if tell is not None:
                disturbed = "".join(f", {config.name}" for config in by_size[n_robots].wrappers)
                tell(f"measuring {by_size[n_robots].policy}, N = {n_robots}{disturbed}")
            measured.append((float(n_robots), *_measured(by_size[n_robots])))
        costs[kind] = Cost(*np.array(measured).T)
    return costs


def kind_of(spec: RunSpec) -> Kind:
    """Return the kind of a run."""
    scenario = spec.scenario
    walks = scenario.objects.walk_probability > 0.0
    world = (scenario.name, scenario.quirks, scenario.physics, scenario.caches, walks)
    return (*world, spec.policy, *(config.name for config in spec.wrappers))


def _some(sizes: Sequence[int]) -> list[int]:
    places = np.linspace(0, len(sizes) - 1, min(SIZES_MEASURED, len(sizes)))
    return [sizes[round(place)] for place in places.tolist()]


def _measured(spec: RunSpec) -> tuple[float, float]:
    """Seconds until the first tick, and seconds per tick."""
    warm_up(spec)
    started = time.process_time()
    policy = load_policy(spec.policy, spec.parameters)
    recorder = build_stack(spec.scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    live = LiveRun(recorder, policy, spec.seed)
    ready = time.process_time()
    ticks, to_tick = FIRST_TICKS, 0
    while time.process_time() - ready < MEASURE_S and not live.over:
        to_tick += ticks
        ticks *= 2
        live.advance(to_tick=to_tick)
    took = time.process_time() - ready
    recorder.close()
    return ready - started, took / max(1, live.forage_env.tick)


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
        self._cost = MeasuredCost()
        self._measured_s = 0.0
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
            self._cost.add(spec, took_s)
            self._measured_s += took_s
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
        seconds = self._cost.seconds(self._left.values())
        if seconds is None or self._first_start is None:
            return self._beginning() + failures
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
