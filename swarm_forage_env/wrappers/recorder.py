"""RunRecorder: turns the arena's cumulative counters into columns over recording intervals."""

from typing import ClassVar

import numpy as np

from swarm_forage_env.contract.codes import Counter, Task
from swarm_forage_env.contract.kernel_policy import KernelPolicy
from swarm_forage_env.contract.policy import refused_tasks
from swarm_forage_env.contract.types import BoolArray, CodeArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.columns import ALL_COLUMNS, INTERVAL_COLUMNS
from swarm_forage_env.scenarios.config import whole_intervals
from swarm_forage_env.scenarios.performance import performance_curve
from swarm_forage_env.world.kernels.counting import add_task_shares
from swarm_forage_env.wrappers.base import SwarmWrapper

_OTHER_NAMES = {
    Counter.INTERFERING: "interference_ticks",
    Counter.INTERFERING_NEAR_CACHES: "interference_ticks_near_caches",
    Counter.CACHES_ALIVE: "n_caches",
}


def _column_of(counter: Counter) -> str:
    """Return the column that a counter becomes: most have its name, or that after "n_"."""
    name = counter.name.lower()
    return _OTHER_NAMES.get(counter, name if name in ALL_COLUMNS else f"n_{name}")


COUNTED = {_column_of(counter): counter for counter in Counter}
"""Columns that the arena counts; see `Column.is_total`."""
TOTALS = {name: counter for name, counter in COUNTED.items() if ALL_COLUMNS[name].is_total}
"""Those of them that are totals per interval; the others are means over its ticks."""


class RunRecorder(SwarmWrapper):
    """Outermost wrapper: records a run interval by interval.

    The arena counts; the recorder only takes differences at interval ends, so a tick costs almost no time. When every
    robot is dead the record is complete: its remaining intervals stay zero, even if stepping goes on.
    """

    stack_position: ClassVar[int] = 0

    def __init__(self, env: ForageEnv | SwarmWrapper) -> None:
        """Wrap `env`; raises ConfigError unless its horizon is a whole number of recording intervals."""
        super().__init__(env)
        self._interval_ticks = self.unwrapped.scenario.interval_ticks
        self._n_intervals = whole_intervals(self.unwrapped.scenario, self.unwrapped.max_cycles)
        self._complete = False

    @property
    def complete(self) -> bool:
        """Whether the run has ended: horizon reached or every robot dead."""
        return self._complete

    def on_reset(self, seed: int) -> None:
        """Forget the last run."""
        self._complete = False
        self._interval = 0
        self._ticks_left = self._interval_ticks
        self._last_counters = self.unwrapped.events.counters.copy()
        self._last_interference = float(self.unwrapped.events.interference_sum[0])
        self._counts = np.zeros((self._n_intervals, len(Counter)), np.int64)
        self._interference = np.zeros(self._n_intervals)
        self._contributed: dict[str, np.ndarray] = {}
        self._task_sums = np.zeros(len(Task))

    def after_step(self, tasks: CodeArray | None, terminated: BoolArray, truncated: bool) -> None:
        """Count the tick; close the interval at its end and at the end of the run."""
        if self._complete:
            return
        if tasks is not None and not add_task_shares(tasks, self.unwrapped.swarm.active, self._task_sums):
            raise refused_tasks(tasks, len(self.unwrapped.active))
        self._ticks_left -= 1
        # Checking the first row alone is fast, and in almost every tick it is enough.
        self._complete = truncated or bool(terminated[0] and terminated.all())
        if self._ticks_left == 0 or self._complete:
            self._close_interval(has_tasks=tasks is not None)

    def run(self, policy: KernelPolicy, n_ticks: int) -> None:
        """Let a compiled policy drive a swarm for some ticks, at most to the end of the run.

        Wrappers inside are asked for what they do `ahead`; where one has to act, their hooks are called in that tick.

        Raises:
            RuntimeError: bodies that are not compiled, or a run that failed before.
            ActionError: as `ForagingArena.run`, and so for ValueError; no step goes on from here.
        """
        env = self.unwrapped
        arena, end = env.arena, min(env.tick + n_ticks, env.max_cycles)
        inner, kept = self._inner, False
        env.require_whole()
        env.break_off()  # a run that fails is gone on with by nobody: wrappers are ahead of it, or behind
        while env.tick < end and not self._complete:
            n_ahead, disturbances = inner.told_ahead(min(end - env.tick, self._ticks_left))
            if n_ahead == 0:  # one tick as a step of the stack does it
                arena.run(policy, 0)  # what robots want to do stands before any wrapper acts
                arena.run(policy, 1, wheel_gain=self.before(policy.actions), acts=False)
                self.after(policy.task)
                kept = False
                continue
            before = env.tick
            stop = arena.run(policy, n_ahead, disturbances=disturbances, kept=kept, task_shares=self._task_sums)
            kept = disturbances is None or len(disturbances.lanes) == 0
            n_done = stop.tick - before
            inner.pass_ticks(n_done, stop, policy.task)
            self._ticks_left -= n_done
            self._complete = env.tick >= env.max_cycles
            if self._ticks_left == 0 or self._complete:
                self._close_interval(has_tasks=policy.task is not None)
        env.make_whole()

    def columns(self) -> dict[str, np.ndarray]:
        """Return the columns of the finished run by name, (T,) each.

        After those that every record has (`INTERVAL_COLUMNS`) come those of other wrappers, of the policy's tasks, and
        of counters that are no field of a record.

        Raises:
            RuntimeError: the run has not ended yet.
        """
        if not self._complete:
            raise RuntimeError(
                "Expected a finished run, got one that has not reached its horizon; step until `complete` is true."
            )
        scenario = self.unwrapped.scenario
        interval = np.arange(self._n_intervals, dtype=np.int32)
        counted = {
            name: self._counts[:, counter] if name in TOTALS else self._counts[:, counter] / self._interval_ticks
            for name, counter in COUNTED.items()
        }
        columns: dict[str, np.ndarray] = {
            "interval": interval,
            "t_end_s": (interval + 1.0) * scenario.interval_s,
            "interference_fraction": self._interference,
            "adversity": self._adversity(),
            **{name: values for name, values in counted.items() if name in INTERVAL_COLUMNS},
            **self._contributed,
            **{name: values.astype(float) for name, values in counted.items() if name not in INTERVAL_COLUMNS},
        }
        return columns | {"performance": performance_curve(scenario.performance, columns)}

    def _adversity(self) -> np.ndarray:
        """Conditions, (T,): the throttle if there is one, else what handling takes under its cost, else zero."""
        for name in ("throttle_mean", "handling_cost_mean"):
            if name in self._contributed:
                return self._contributed[name]
        return np.zeros(self._n_intervals)

    def _close_interval(self, *, has_tasks: bool) -> None:
        row = self._interval
        counters, interference = self.unwrapped.events.counters, float(self.unwrapped.events.interference_sum[0])
        self._counts[row] = counters - self._last_counters
        self._interference[row] = (interference - self._last_interference) / self._interval_ticks
        self._last_counters[:] = counters
        self._last_interference = interference
        if has_tasks:
            for code, share in zip(Task, self._task_sums / self._interval_ticks, strict=True):
                self._contribute(f"task_share_{code.name.lower()}", share)
            self._task_sums[:] = 0.0
        for wrapper in self._inside:
            for name, value in wrapper.interval_columns().items():
                self._contribute(name, value)
        self._interval += 1
        self._ticks_left = self._interval_ticks

    def _contribute(self, name: str, value: float) -> None:
        self._contributed.setdefault(name, np.zeros(self._n_intervals))[self._interval] = value
