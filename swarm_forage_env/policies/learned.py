"""LearnedPolicy: any trained controller that every robot shares, as a policy."""

from collections.abc import Callable
from typing import TypeAlias

import numpy as np

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface

Choose: TypeAlias = Callable[[ObsArray, np.random.Generator], np.ndarray]
"""A function from observations of a learner, (N, d), to its actions, one row per robot."""


class LearnedPolicy:
    """A trained controller as a policy: it sees and acts through an interface, once per decision.

    An instance drives one run.

    Attributes:
        reads: Observation slices that are used, None = all.
        caches: Kind of caches that the controller was trained with; missing if that is unknown.
        interface: The interface for the swarm; set by `reset`.
    """

    interface: LearnerInterface

    def __init__(self, interface: InterfaceConfig, choose: Choose, *, caches: str | None = "none") -> None:
        """Take the controller.

        Args:
            interface: What it saw and did in training.
            choose: The controller.
            caches: Kind of caches that it was trained with; None = unknown, runs then use those of the scenario.
        """
        self.reads = interface.reads
        if caches is not None:
            self.caches = caches
        self._config = interface
        self._choose = choose

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run."""
        self._rng = rng
        self.interface = LearnerInterface(self._config, spec)
        self._view = np.empty((spec.n_robots, self.interface.layout.size), np.float32)
        self._ticks_left = 0

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Choose actions; see `Policy.act`. The returned (N, 3) array is reused by the next call."""
        if self._ticks_left == 0:
            self._chosen = self._choose(self.interface.observe(obs, self._view), self._rng)
            self._ticks_left = self._config.decision_ticks
        self._ticks_left -= 1
        return self.interface.command(self._chosen, obs)
