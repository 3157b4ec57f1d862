"""KernelPolicy: a policy whose tick is one kernel, called by Python or by the compiled tick of the world."""

from collections.abc import Callable
from typing import Any, ClassVar, NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import Callback, Calls
from swarm_forage_env._internal.held import hold
from swarm_forage_env._internal.rng import TickDraws
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, ObsArray


class ObservationError(ValueError):
    """Observations that are not those of the swarm that the policy was reset for."""


def require_inputs(obs: ObsArray, active: BoolArray, spec: SwarmSpec | None) -> None:
    """Refuse arrays of another shape than the swarm; compiled kernels would read and write beyond their ends.

    Args:
        obs: Observations.
        active: Which robots act.
        spec: The specification given to `reset`; None = there was no reset.

    Raises:
        ObservationError: `obs` is not (n_robots, layout.size), `active` not (n_robots,), or there was no reset.
    """
    if spec is None:
        raise ObservationError("Expected reset before act; call reset with the spec of the environment first.")
    expected = (spec.n_robots, spec.layout.size)
    if obs.shape != expected:
        raise ObservationError(
            f"Expected observations with shape (n_robots, columns) = {expected}, got {obs.shape}; "
            "call reset with the spec of this environment."
        )
    if active.shape != expected[:1]:
        raise ObservationError(
            f"Expected active with shape (n_robots,) = {expected[:1]}, got {active.shape}; pass `active` of the "
            "environment."
        )


NO_DRAWS = np.zeros((1, 1, 1))
"""Draws of a driver that reads none."""


class Drive(NamedTuple):
    """A driver for compiled code."""

    state: tuple[Any, ...]
    """What the kernel reads and edits; the last are the actions, (N, A) float32, that it writes."""
    act: Callable[..., None]
    """The kernel: (obs, active, draws, state, tick)."""


class Driver:
    """What drives robots in the compiled loop of the world: a kernel and its state.

    Attributes:
        held: State and kernel as compiled code takes them. The kernel must not raise: an exception inside of it is
            printed, but does not stop the run.
        actions: (N, A) float32 that the kernel writes, the last of the state.
        task: (N,) `Task` codes that the kernel keeps up to date, None for a driver without tasks.
        decision_ticks: See `KernelPolicy`.
        calls: Calls of the loop, whose types depend on the state: without disturbances, and with.
    """

    def __init__(
        self,
        kernel: Callable[..., None],
        state: tuple[Any, ...],
        *,
        task: CodeArray | None = None,
        decision_ticks: int = 1,
    ) -> None:
        """Take the kernel as one that other kernels call; it is compiled when it is used. See `KernelPolicy._start`."""
        self._callback = Callback(kernel, *example_of(state))
        self.actions: ActionArray = state[-1]
        self.go_on_with(state)
        self.task = task
        self.decision_ticks = decision_ticks
        self.calls = Calls(), Calls()

    def go_on_with(self, state: tuple[Any, ...]) -> None:
        """Take a state of other arrays, of the same types; the actions stay where they are."""
        self.held = hold(Drive(state, self._callback))

    def next_ticks(self) -> tuple[int, FloatArray]:
        """Return the number of the next tick, and the draws (ticks, N, draws) of it and of some that follow."""
        return 1, NO_DRAWS

    def count_ticks(self, n_ticks: int) -> None:
        """Note that the kernel has done so many ticks."""


class CompiledPolicy(Driver):
    """A policy that was reset, for a run without Python between ticks. Policies offer it by a method `compiled`."""

    def __init__(self, policy: "KernelPolicy", state: tuple[Any, ...], chance: TickDraws) -> None:
        """Take kernel and tasks of the policy."""
        task, decision_ticks = getattr(policy, "task", None), policy.decision_ticks
        super().__init__(policy._kernel, state, task=task, decision_ticks=decision_ticks)
        self._policy = policy
        self._chance = chance

    def next_ticks(self) -> tuple[int, FloatArray]:
        """Count on from the ticks that the policy has done."""
        tick = self._policy.n_ticks + 1
        return tick, self._chance.rows(tick)

    def count_ticks(self, n_ticks: int) -> None:
        """Note the ticks, and see `KernelPolicy.after_ticks`."""
        self._policy.n_ticks += n_ticks
        self._policy.after_ticks()


def example_of(state: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return arguments of the types that a kernel with this state takes."""
    return np.empty((1, 1), np.float32), np.empty(1, np.bool_), np.empty((1, 1)), state, 0


class KernelPolicy:
    """Every robot decides in one kernel, from what it sees and remembers. An instance drives one run.

    A subclass names its kernel and calls `_start` at the end of its `reset`.

    Attributes:
        n_ticks: Ticks since reset.
        decision_ticks: It looks at light in the first tick only, and in every so-many-th from then on.
    """

    decision_ticks = 1

    _kernel: ClassVar[Callable[..., None]]
    """One tick of all robots: (obs, active, draws, state, now). A static method of the class: a pickle would take a
    copy of it along, which another process had to compile anew."""
    _spec: SwarmSpec | None = None
    _shapes: tuple[tuple[int, ...], tuple[int, ...]] | None = None
    _compiled: CompiledPolicy | None = None

    def _start(self, spec: SwarmSpec, rng: np.random.Generator, n_draws: int, *state: Any) -> None:
        """Start a run.

        Args:
            spec: The swarm.
            rng: Generator of the policy's stream.
            n_draws: Draws per robot and tick.
            state: What the kernel reads and edits; the last are the actions that it writes, (N, A) float32.
        """
        self._spec = spec
        self._shapes = ((spec.n_robots, spec.layout.size), (spec.n_robots,))
        self._chance = TickDraws(rng, spec.n_robots, n_draws)
        self._actions: ActionArray = state[-1]
        self.n_ticks = 0
        self._compiled = None
        self._go_on_with(*state)
        self._call = Calls()

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Choose actions; see `Policy.act`. The returned (N, A) array is reused by the next call."""
        if (obs.shape, active.shape) != self._shapes:
            require_inputs(obs, active, self._spec)
        # The compiled version takes contiguous arrays of these types only. Most often nothing is copied here.
        obs, active = np.ascontiguousarray(obs, np.float32), np.ascontiguousarray(active, np.bool_)
        self.n_ticks += 1
        self._draws = self._chance.row(self.n_ticks)
        self._call(self._kernel, obs, active, self._draws, self._given, self.n_ticks)
        self.after_ticks()
        return self._actions

    def after_ticks(self) -> None:
        """Do what is to be done before the kernel is called again, and raise what has gone wrong; here nothing."""

    def _go_on_with(self, *state: Any) -> None:
        """Take a state of other arrays, of the same types; the actions stay where they are."""
        self._state = state
        self._given = tuple(hold(part) if hasattr(part, "_fields") else part for part in state)
        if self._compiled is not None:
            self._compiled.go_on_with(self._given)

    def compiled(self) -> CompiledPolicy | None:
        """The policy for runs without Python between ticks.

        None where somebody has put another `act` in its place, or tells tasks by an array that is made when it is
        asked for: no kernel keeps that up to date.
        """
        is_own = type(self).act is KernelPolicy.act and "act" not in vars(self)
        is_own = is_own and getattr(self, "task", None) is getattr(self, "task", None)
        if is_own and self._compiled is None:  # kept, because its types take milliseconds to find out
            self._compiled = CompiledPolicy(self, self._given, self._chance)
        return self._compiled if is_own else None

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies are made of: everything but the compiled version, which cannot be stored."""
        return {name: value for name, value in self.__dict__.items() if name != "_compiled"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)
