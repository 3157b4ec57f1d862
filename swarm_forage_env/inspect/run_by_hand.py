"""A run that a person looks at and disturbs while it goes on; the page to play with drives it.

Looking changes nothing: until a level is changed or a robot killed by hand, the run is the one that `run_one` makes.
"""

import time
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from swarm_forage_env.contract.codes import Counter, Task
from swarm_forage_env.contract.policy import Memories, Policy, RememberedPlaces
from swarm_forage_env.inspect.film import cast_policy
from swarm_forage_env.inspect.levels_by_hand import Levels, with_idle
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.wrappers.base import WrapperConfig

SPEEDS = (0.2, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
"""Simulated seconds per second; our choice."""
LONGEST_S = 0.1
"""Ticks of one frame take at most this long, so that the viewer gets an answer even if the run is slower than its
speed."""
SHOWN_SLICES = ("proximity", "los_cell", "los_object", "los_cache")
"""What pictures show of an observation, whether the policy reads it or not."""


class RunByHand:
    """A run, and what somebody does to it.

    Attributes:
        name: Name of the policy, for people.
        scenario: The scenario, with the caches that the policy asks for.
        run: The run; it goes on by `advance` and `step` only.
        world: Its environment; only read it.
        levels: What can be changed by hand.
        paused: Whether the clock stands still.
        speed: Simulated seconds per second.
        seed: Seed of the run.
    """

    def __init__(
        self,
        scenario: ScenarioConfig,
        policy: str | Policy,
        *,
        seed: int = 0,
        speed: float = 10.0,
        caches: str | None = None,
        parameters: Mapping[str, Any] | None = None,
        wrappers: Iterable[WrapperConfig] = (),
    ) -> None:
        """Start the run.

        Args:
            scenario: The scenario.
            policy: Name of an installed policy, path of a policy file, or a fresh policy object.
            seed: Seed of the run.
            speed: Simulated seconds per second, above 0.
            caches: As in `inspect.film.record_run`.
            parameters: Keyword arguments of a policy that is given by name or path.
            wrappers: Configurations of noise, throttling and population dynamics, in any order.

        Raises:
            ConfigError: `parameters` with a policy object, or values that do not fit together.
            ValueError: unknown policy name, or a policy file that cannot be opened or does not fit the scenario.
        """
        self.policy, self.name, self.scenario = cast_policy(policy, scenario, caches, parameters)
        self.given = tuple(wrappers)
        reads = getattr(self.policy, "reads", None)
        stack = build_env(
            self.scenario, with_idle(self.given), reads=None if reads is None else tuple({*reads, *SHOWN_SLICES})
        )
        self.levels = Levels(stack)
        self.run = LiveRun(stack, self.policy, seed)
        self.world = self.run.forage_env
        self.seed, self.speed, self.paused = seed, speed, False
        self._owed_ticks = 0.0

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
        self.run.advance(to_tick=self.world.tick + 1)

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
