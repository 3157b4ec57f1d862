"""A run by hand of which every frame is kept, so that it can be saved as a replay at any time."""

import numpy as np

from swarm_forage_env.inspect.replay.capture import Capture, ticks_between_frames
from swarm_forage_env.inspect.replay.frames import Replay, position_step_m
from swarm_forage_env.inspect.run_by_hand import RunByHand
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.wrappers.handling import IDEAL_COST, HandlingCostConfig
from swarm_forage_env.wrappers.throttle import ThrottleConfig

_IDLE = {ThrottleConfig.name: 0.0, HandlingCostConfig.name: IDEAL_COST}
"""Wrapper -> what its waveform is while it changes nothing."""


class CapturedRun(RunByHand):
    """A run by hand, and its frames.

    Attributes:
        spec: The run, as it was started.
        capture: Its frames.
        step_m: Metres per step of places in the frames.
    """

    def __init__(self, spec: RunSpec) -> None:
        """Start a run; errors are those of `RunByHand`."""
        here = spec.scenario
        super().__init__(
            here, spec.policy, seed=spec.seed, caches=here.caches, parameters=spec.parameters, wrappers=spec.wrappers
        )
        self.spec = spec
        end = here.horizon_ticks
        self.capture = Capture(self.run, self.policy, end_tick=end, frame_ticks=ticks_between_frames(here, end))
        self.step_m = position_step_m(here)
        self._signals = [self.levels.signals(0)]

    def step(self) -> None:
        """Let the run go on for one tick, if it is not over."""
        self.capture.advance()
        if len(self.capture.ticks) > len(self._signals):
            self._signals.append(self.levels.signals(self.world.tick))

    def replay(self) -> Replay:
        """Return the run up to its last frame; its label says what was changed by hand.

        Raises:
            ReplayError: the run has not gone on for one frame.
        """
        waves = {name: np.array([one[name] for one in self._signals], np.float32) for name in _IDLE}
        signals = {name: values for name, values in waves.items() if (values > _IDLE[name]).any()}
        return self.capture.replay(
            self.spec, signals=signals, label=f"{self.name}{self.changes_in_words(', changed by hand: ')}"
        )
