"""A run that a person looks at and disturbs while it goes on, and that can be saved as a replay at any time.

Looking changes nothing: until a level is changed or a robot killed by hand, the run is the one that `run_one` makes.
"""

import time
from collections.abc import Callable

import numpy as np

from swarm_forage_env.contract.codes import Counter, Task
from swarm_forage_env.contract.policy import Memories, RememberedPlaces
from swarm_forage_env.inspect.film import cast_policy
from swarm_forage_env.inspect.play.levels import STILL, Levels, with_idle
from swarm_forage_env.inspect.replay.capture import Capture, ticks_between_frames
from swarm_forage_env.inspect.replay.frames import Replay, position_step_m
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import RunSpec

SPEEDS = (0.2, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
"""Simulated seconds per second; our choice."""
LONGEST_S = 0.1
"""Ticks of one frame take at most this long, so that the viewer gets an answer even if the run is slower than its
speed."""
SHOWN_SLICES = ("proximity", "los_cell", "los_object", "los_cache")
"""What pictures show of an observation, whether the policy reads it or not."""


class RunByHand:
    """A run, what somebody does to it, and its frames.

    Attributes:
        spec: The run, as it was started.
        policy: The policy; only read it.
        name: Name of the policy, for people.
        scenario: The scenario, with the caches that the policy asks for.
        run: The run; it goes on by `advance` and `step` only.
        world: Its environment; only read it.
        levels: What can be changed by hand.
        capture: Its frames.
        step_m: Metres per step of places in the frames.
        paused: Whether the clock stands still.
        speed: Simulated seconds per second.
    """

    def __init__(self, spec: RunSpec) -> None:
        """Start a run.

        Raises:
            ValueError: unknown policy name, or a policy file that cannot be opened or does not fit the scenario.
        """
        self.spec, here = spec, spec.scenario
        self.policy, self.name, self.scenario = cast_policy(spec.policy, here, here.caches, spec.parameters)
        reads = getattr(self.policy, "reads", None)
        stack = build_env(
            self.scenario, with_idle(spec.wrappers), reads=None if reads is None else tuple({*reads, *SHOWN_SLICES})
        )
        self.levels = Levels(stack)
        self.run = LiveRun(stack, self.policy, spec.seed)
        self.world = self.run.forage_env
        self.speed, self.paused = 10.0, False
        self._owed_ticks = 0.0
        end = here.horizon_ticks
        self.capture = Capture(self.run, self.policy, end_tick=end, frame_ticks=ticks_between_frames(here, end))
        self.step_m = position_step_m(here)
        self._signals = [self.levels.signals(0)]

    def advance(self, seconds: float) -> None:
        """Let the run go on for what is due after `seconds` of the viewer's time; less if it takes too long."""
        if self.paused:
            return
        self._owed_ticks += seconds * self.speed / self.scenario.dt_s
        until = time.perf_counter() + LONGEST_S
        while self._owed_ticks >= 1.0 and not self.run.over:
            self._owed_ticks -= 1.0
            self.step()
            if time.perf_counter() > until:
                self._owed_ticks %= 1.0

    def step(self) -> None:
        """Let the run go on for one tick, if it is not over."""
        self.capture.advance()
        if len(self.capture.ticks) > len(self._signals):
            self._signals.append(self.levels.signals(self.world.tick))

    def remembered_places(self, robot: int) -> RememberedPlaces | None:
        """Return where a robot remembers things, None where the policy does not tell."""
        tell: Callable[[], Memories] | None = getattr(self.policy, "describe_memories", None)
        return None if tell is None else tell().of_robot(robot)

    def told_of(self, robot: int) -> list[tuple[str, str]]:
        """Return what the policy tells of a robot, as names and texts: task, what it does."""
        policy, told = self.policy, list[tuple[str, str]]()
        if hasattr(policy, "task"):
            told.append(("task", Task(int(policy.task[robot])).name.lower().replace("_", " ")))  # type: ignore[attr-defined] - optional, see Policy
        if hasattr(policy, "describe_robot"):
            told.append(("does", policy.describe_robot(robot)))  # type: ignore[attr-defined] - optional, see Policy
        return told

    def summary(self) -> str:
        """Return one line about the run so far."""
        delivered = self.world.events.counters[Counter.COLLECTED]
        told = f"{self.world.tick * self.scenario.dt_s:,.0f} s, {delivered:,} delivered"
        return f"{told}{self.changes_in_words('; changed by hand: ')}"

    def changes_in_words(self, before: str) -> str:
        """Return what was changed by hand behind some words, or nothing where nothing was."""
        return f"{before}{self.levels.changes_in_words}" if self.levels.changes else ""

    def replay(self) -> Replay:
        """Return the run up to its last frame; its label says what was changed by hand.

        Raises:
            ReplayError: the run has not gone on for one frame.
        """
        waves = {name: np.array([one[name] for one in self._signals], np.float32) for name in self._signals[0]}
        signals = {name: values for name, values in waves.items() if (values > STILL[name]).any()}
        return self.capture.replay(
            self.spec, signals=signals, label=f"{self.name}{self.changes_in_words(', changed by hand: ')}"
        )
