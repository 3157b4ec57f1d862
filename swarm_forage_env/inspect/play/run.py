"""A run that a person looks at and disturbs while it goes on, and that can be saved as a replay at any time.

Looking changes nothing: until a level is changed or a robot killed by hand, the run is the one that `run_one` makes.
"""

import time
from typing import Any

from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.policy import RememberedPlaces
from swarm_forage_env.inspect.play.levels import Levels, with_idle
from swarm_forage_env.inspect.replay.capture import Capture, ticks_between_frames
from swarm_forage_env.inspect.replay.frames import Replay
from swarm_forage_env.policies.registry import load_policy, policy_label
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import RunSpec

SPEEDS = (0.2, 1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0)
"""Simulated seconds per second; our choice."""
LONGEST_S = 0.1
"""Ticks of one frame take at most this long, so that the viewer gets an answer even if the run is slower than its
speed."""


class RunByHand:
    """A run, what somebody does to it, and its frames.

    Attributes:
        spec: The run, as it was started.
        policy: The policy; only read it.
        name: Name of the policy, for people.
        scenario: The scenario of the run.
        run: The run; it goes on by `advance` and `step` only.
        world: Its environment; only read it.
        levels: What can be changed by hand.
        capture: Its frames.
        paused: Whether the clock stands still.
        speed: Simulated seconds per second.
    """

    def __init__(self, spec: RunSpec) -> None:
        """Start a run.

        Raises:
            ValueError: unknown policy name, or a policy file that cannot be opened or does not fit the scenario.
        """
        self.spec, self.name, self.scenario = spec, policy_label(spec.policy), spec.scenario
        here = self.scenario
        policy = load_policy(spec.policy, spec.parameters)
        self.policy: Any = policy
        stack = build_env(here, with_idle(spec.wrappers), reads=getattr(policy, "reads", None))
        self.levels = Levels(stack)
        self.run = LiveRun(stack, policy, spec.seed)
        self.world = self.run.forage_env
        self.speed, self.paused = 10.0, False
        self._owed_ticks = 0.0
        end = here.horizon_ticks
        self.capture = Capture(
            self.run,
            policy,
            end_tick=end,
            frame_ticks=ticks_between_frames(here, end),
            disturbances=lambda: self.levels.all_configs,
        )

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

    def remembered_places(self, robot: int) -> RememberedPlaces | None:
        """Return where a robot remembers things, None where the policy does not tell."""
        return self.policy.describe_memories().of_robot(robot) if hasattr(self.policy, "describe_memories") else None

    def summary(self) -> str:
        """Return one line about the run so far."""
        delivered = self.world.events.counters[Counter.COLLECTED]
        changes = f"; changed by hand: {self.levels.changes_in_words}" if self.levels.changes else ""
        return f"{self.name}: {self.world.tick * self.scenario.dt_s:,.0f} s, {delivered:,} delivered{changes}"

    def replay(self) -> Replay:
        """Return the run up to its last frame; its label says what was changed by hand.

        Raises:
            ConfigError: the run has not gone on for one frame.
        """
        changes = f", changed by hand: {self.levels.changes_in_words}" if self.levels.changes else ""
        return self.capture.replay(self.spec, label=f"{self.name}{changes}")
