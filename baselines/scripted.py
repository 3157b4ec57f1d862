"""What the scripted controllers have in common: checked inputs, draws for every robot, one kernel for all robots."""

from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar

import numpy as np

from swarm_forage_env._internal.compiling import Callback, direct
from swarm_forage_env._internal.rng import TickDraws
from swarm_forage_env.contract.policy import RobotStates, SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, IntArray, ObsArray

from .parameters import require_inputs
from .robots import ACTIVITY_WORDS, activity_codes, describe_robot


class CompiledScript:
    """A scripted policy as `swarm_forage_env.contract.policy.CompiledPolicy`."""

    def __init__(
        self, kernel: Callable[..., None], state: tuple[Any, ...], policy: "ScriptedPolicy", chance: TickDraws
    ) -> None:
        """Compile the kernel as one that other kernels call; see `ScriptedPolicy._start`."""
        self.state = state
        self.task: CodeArray | None = getattr(policy, "task", None)
        self._policy = policy
        self._chance = chance
        self.callback = Callback(kernel, *example_of(state))

    def next_ticks(self) -> tuple[int, FloatArray]:
        """Return the number of the next tick, and the draws (ticks, N, n_draws) of it and of some that follow."""
        tick = self._policy.n_ticks + 1
        return tick, self._chance.rows(tick)

    def count_ticks(self, n_ticks: int) -> None:
        """Note that the kernel has done so many ticks."""
        self._policy.n_ticks += n_ticks


def example_of(state: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return arguments of the types that a kernel with this state takes."""
    return np.empty((1, 1), np.float32), np.empty(1, np.bool_), np.empty((1, 1)), state, 0


class ScriptedPolicy:
    """Every robot decides by the same rules, from what it sees and remembers. An instance drives one run.

    A subclass names its kernel and calls `_start` at the end of its `reset`.

    Attributes:
        n_ticks: Ticks since reset.
    """

    _kernel: ClassVar[Callable[..., None]]
    """One tick of all robots: (obs, active, draws, (constants, robots, *memory, actions), now). A static method of the
    class: a pickle would take a copy of it along, which another process had to compile anew."""
    _spec: SwarmSpec | None = None
    _shapes: tuple[tuple[int, ...], tuple[int, ...]] | None = None
    _script: CompiledScript | None = None

    def _start(
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
        self._spec = spec
        self._shapes = ((spec.n_robots, spec.layout.size), (spec.n_robots,))
        self._chance = TickDraws(rng, spec.n_robots, n_draws)
        self._constants = constants
        self._robots = robots
        robots["object_reach"] = spec.object_reach_cells
        robots["cache_reach"] = spec.cache_reach_cells
        self._actions: ActionArray = np.zeros((spec.n_robots, 3), np.float32)
        self._state = (constants, robots, *memory, self._actions)
        self.n_ticks = 0
        self._script = None
        self.__dict__.pop("_step", None)

    @cached_property
    def _step(self) -> Callable[..., None]:
        """The compiled version of the kernel, found once and not in every tick."""
        return direct(self._kernel, *example_of(self._state))

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Choose actions; see `Policy.act`. The returned (N, 3) array is reused by the next call."""
        if (obs.shape, active.shape) != self._shapes:
            require_inputs(obs, active, self._spec)
        # The compiled version takes contiguous arrays of these types only. Most often nothing is copied here.
        obs, active = np.ascontiguousarray(obs, np.float32), np.ascontiguousarray(active, np.bool_)
        self.n_ticks += 1
        self._draws = self._chance.row(self.n_ticks)
        self._step(obs, active, self._draws, self._state, self.n_ticks)
        return self._actions

    def compiled(self) -> "CompiledScript | None":
        """The policy for runs without Python between ticks; None where somebody has put another `act` in its place."""
        is_own = type(self).act is ScriptedPolicy.act and "act" not in vars(self)
        if is_own and self._script is None:  # kept, because its types take milliseconds to find out
            self._script = CompiledScript(self._kernel, self._state, self, self._chance)
        return self._script if is_own else None

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies are made of: everything but the compiled version, which cannot be stored."""
        return {name: value for name, value in self.__dict__.items() if name not in ("_step", "_script")}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
        self._script = None

    @property
    def activity(self) -> CodeArray:
        """(N,) `robots.Activity` codes, a copy."""
        return self._robots["activity"].copy()

    def describe_robot(self, row: int) -> str:
        """Return what one robot is up to, in one line for people."""
        return describe_robot(self._robots[row])

    @property
    def n_remembered(self) -> IntArray | None:
        """(N,) number of things that each robot remembers; None for a policy without memory."""
        return None

    def describe_robots(self) -> RobotStates:
        """Return what all robots are up to, as arrays."""
        return RobotStates(activity_codes(self._robots), ACTIVITY_WORDS, self.n_remembered)
