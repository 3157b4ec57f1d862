"""InterfacePolicy and LearnedPolicy: any trained controller that every robot shares, as a policy."""

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env.contract.policy import Memories, SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, ObsArray
from swarm_forage_env.policies.extras import ExtraFunction, ExtraFunctionError, extra_columns
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface

Choose: TypeAlias = Callable[[ObsArray, np.random.Generator], np.ndarray]
"""A function from observations of a learner, (N, d), to its actions, one row per robot."""


class InterfacePolicy:
    """What trained policies have in common: they see and act through an interface, once per decision.

    Attributes:
        reads: Observation slices that are used, None = all.
        caches: Kind of caches that the policy was trained with; missing if that is unknown.
        interface: The interface for the swarm; set by `_bind`.
        describe_memories: See `Policy`; missing without site memory.
    """

    interface: LearnerInterface
    describe_memories: Callable[[], Memories]

    def __init__(self, interface: InterfaceConfig, *, caches: str | None) -> None:
        """Take the interface.

        Args:
            interface: What the policy saw and did in training.
            caches: Kind of caches that it was trained with; None = unknown, runs then use those of the scenario.
        """
        self.reads = interface.reads
        if caches is not None:
            self.caches = caches
        self._config = interface
        if interface.site_memory:
            self.describe_memories = self._all_sites

    def _bind(self, spec: SwarmSpec) -> None:
        """Make the interface for a swarm."""
        self.interface = LearnerInterface(self._config, spec)
        self._middle_m = np.array(spec.arena_size_m) / 2.0

    @property
    def chosen(self) -> np.ndarray:
        """Actions of the last decision as the controller gave them, one row per robot; see `LearnerInterface`."""
        raise NotImplementedError

    def _all_sites(self) -> Memories:
        """Return the sites of all robots, where they expect objects."""
        sites = self.interface.memory()
        assert sites is not None, "only policies with site memory are asked"
        robot, site = np.nonzero(sites.is_known)
        return Memories(
            robot.astype(np.int32), sites.place[robot, site] + self._middle_m, np.zeros(len(robot), np.bool_)
        )


class LearnedPolicy(InterfacePolicy):
    """A trained controller as a policy: it sees and acts through an interface, once per decision.

    An instance drives one run. The controller is asked for all rows in every decision, so one with a memory goes on
    remembering while a robot is in repair, as in training. The memory of a dead robot no longer steers anything.
    """

    def __init__(
        self,
        interface: InterfaceConfig,
        choose: Choose,
        *,
        caches: str | None = "none",
        extra_observation: ExtraFunction | None = None,
    ) -> None:
        """Take the controller.

        Args:
            interface: What it saw and did in training.
            choose: The controller.
            caches: Kind of caches that it was trained with; None = unknown, runs then use those of the scenario.
            extra_observation: The function that it was trained with, if there was one; see `policies.extras`.
        """
        super().__init__(interface, caches=caches)
        self._choose, self._extra = choose, extra_observation
        if extra_observation is not None:
            self.see_world = self._see_world

    def _see_world(self, env: Any) -> None:
        self._arena = env.arena

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Start a run.

        Raises:
            ExtraFunctionError: the policy was trained with `extra_observation`, and has none.
        """
        check_extra(self._config, self._extra)
        self._bind(spec)
        self._rng = rng
        self._view = np.empty((spec.n_robots, self.interface.layout.size), np.float32)
        self._ticks_left, self._decision = 0, 0

    @property
    def chosen(self) -> np.ndarray:
        """Actions of the last decision as the controller gave them, one row per robot; see `LearnerInterface`."""
        return self._chosen

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Choose actions; see `Policy.act`. The returned (N, A) array is reused by the next call."""
        if self._ticks_left == 0:
            extra = None if self._extra is None else extra_columns(self._extra, self._arena, self._config.extra_columns)
            view = self.interface.observe(obs, self._view, decision=self._decision, extra=extra)
            self._chosen = self._choose(view, self._rng)
            self._checked = self.interface.checked(self._chosen)
            self._ticks_left = self._config.decision_ticks
            self._decision += 1
        self._ticks_left -= 1
        return self.interface.carry_out(self._checked, obs)


def check_extra(interface: InterfaceConfig, extra: ExtraFunction | None) -> None:
    """Refuse a policy that was trained with `extra_observation` and does not have it; raises ExtraFunctionError."""
    if interface.extra_columns and extra is None:
        raise ExtraFunctionError(
            f"Expected the extra_observation of {interface.extra_columns} columns that the policy was trained with, "
            "got none; in Python, run LearnedPolicy(network.about.interface, network.choose, extra_observation=...)."
        )
