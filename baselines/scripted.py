"""What the scripted controllers have in common: records of robots, one kernel for all of them, and words for people."""

from typing import Any, ClassVar, cast

import numpy as np

from swarm_forage_env.contract.kernel_policy import KernelPolicy
from swarm_forage_env.contract.policy import RobotStates, SwarmSpec
from swarm_forage_env.contract.types import CodeArray

from .parameters import ControllerParameters, chosen_parameters
from .robots import ACTIVITY_WORDS, activity_codes

_CALLS_AHEAD = 10
"""For how many of the longest calls of a kernel there is room in the memory when it was made."""


class ScriptedPolicy(KernelPolicy):
    """Every robot decides by the same rules, from what it sees and remembers. An instance drives one run.

    A subclass names its kernel and calls `_start_script` at the end of its `reset`. The state of the kernel is
    (constants, robots, *memory, actions).

    Args:
        parameters: All numbers of the controller; default those of `default_parameters`.
        overrides: Single fields of them by name.

    Raises:
        ParameterError: parameters of another controller, an unknown name, or a value that makes no sense.
    """

    default_parameters: ClassVar[Any]
    """Of the class of parameters that the controller takes."""

    def __init__(self, parameters: ControllerParameters | None = None, **overrides: float) -> None:
        self.parameters: Any = chosen_parameters(self.default_parameters, parameters, overrides)

    def _start_script(
        self,
        spec: SwarmSpec,
        rng: np.random.Generator,
        n_draws: int,
        constants: np.ndarray,
        robots: np.ndarray,
        *memory: Any,
    ) -> None:
        """Start a run.

        Args:
            spec: The swarm.
            rng: Generator of the policy's stream.
            n_draws: Draws per robot and tick.
            constants: (1,) record of `parameters.kernel_constants`.
            robots: (N,) records of the robots.
            memory: What else the robots remember.
        """
        self._constants = constants
        self._robots = robots
        actions = np.zeros((spec.n_robots, spec.action_size), np.float32)
        self._start(spec, rng, n_draws, constants, robots, *memory, actions)
        self._room_until = 0
        self.after_ticks()

    @property
    def _memory(self) -> Any:
        """What the robots remember, for controllers that have a memory: the third part of the state."""
        return self._state[2]

    def _with_room(self, memory: Any, n_ticks: int, spec: SwarmSpec) -> Any:
        """Return the memory itself, or a longer one, with room for what robots may see in so many ticks."""
        return memory

    def after_ticks(self) -> None:
        """Make room in the memory for the ticks until the next call, and for some more: it takes microseconds."""
        if self.n_ticks + self._chance.n_ticks <= self._room_until:
            return
        self._room_until = self.n_ticks + _CALLS_AHEAD * self._chance.n_ticks
        constants, robots, memory, *others = self._state
        wider = self._with_room(memory, self._room_until - self.n_ticks, cast(SwarmSpec, self._spec))
        if wider is not memory:
            self._take(constants, robots, wider, *others)

    @property
    def activity(self) -> CodeArray:
        """(N,) `robots.Activity` codes, a copy."""
        return self._robots["activity"].copy()

    def describe_robots(self) -> RobotStates:
        """Return what all robots are up to, as arrays."""
        return RobotStates(activity_codes(self._robots), ACTIVITY_WORDS)
