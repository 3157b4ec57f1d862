"""KernelPolicy: a policy whose tick is one kernel, called by Python or by the compiled tick of the world."""

from collections.abc import Callable
from functools import cached_property
from typing import Any, ClassVar, NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import Callback, Calls
from swarm_forage_env._internal.held import hold
from swarm_forage_env._internal.rng import TickDraws
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, ObsArray

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
        actions: (N, A) float32 that the kernel writes, the last of the state.
        task: (N,) `Task` codes that the kernel keeps up to date, None for a driver without tasks.
        decision_ticks: It looks at light in the first tick only, and in every so-many-th from then on.
        calls: Calls of the loop, whose types depend on the state: without disturbances, and with.
    """

    decision_ticks: int = 1
    task: CodeArray | None = None
    actions: ActionArray
    calls: tuple[Calls, Calls]

    _kernel: ClassVar[Callable[..., None]]
    """One tick of all robots: (obs, active, draws, state, now). A static method of the class: a pickle would take a
    copy of it along, which another process had to compile anew. It must not raise: an exception inside of it is
    printed, but does not stop the run."""
    _state: tuple[Any, ...]
    _given: tuple[Any, ...]
    """The state as kernels take it."""

    def _take(self, *state: Any) -> None:
        """Take a state; after the first one, of other arrays of the same types. The last are the actions, which stay.

        Args:
            state: What the kernel reads and edits; the last are the actions that it writes, (N, A) float32.
        """
        self._state, self.actions = state, state[-1]
        self._given = tuple(hold(part) if hasattr(part, "_fields") else part for part in state)
        self.__dict__.pop("held", None)

    @cached_property
    def held(self) -> Drive:
        """State and kernel as compiled code takes them."""
        example = np.empty((1, 1), np.float32), np.empty(1, np.bool_), np.empty((1, 1)), self._given, 0
        return hold(Drive(self._given, Callback(self._kernel, *example)))

    def next_ticks(self) -> tuple[int, FloatArray]:
        """Return the number of the next tick, and the draws (ticks, N, draws) of it and of some that follow."""
        return 1, NO_DRAWS

    def count_ticks(self, n_ticks: int) -> None:
        """Note that the kernel has done so many ticks."""

    def __getstate__(self) -> dict[str, Any]:
        """Return what copies are made of; addresses of compiled code are no others' than this one's."""
        return {name: value for name, value in self.__dict__.items() if name != "held"}

    def __setstate__(self, state: dict[str, Any]) -> None:
        self.__dict__.update(state)


class KernelPolicy(Driver):
    """Every robot decides in one kernel, from what it sees and remembers. An instance drives one run.

    A subclass names its kernel and calls `_start` at the end of its `reset`.

    Attributes:
        n_ticks: Ticks since reset.
    """

    _shapes: tuple[tuple[int, ...], tuple[int, ...]] | None = None

    def _start(self, spec: SwarmSpec, rng: np.random.Generator, n_draws: int, *state: Any) -> None:
        """Start a run.

        Args:
            spec: The swarm.
            rng: Generator of the policy's stream.
            n_draws: Draws per robot and tick.
            state: See `_take`.
        """
        self._spec = spec
        self._shapes = ((spec.n_robots, spec.layout.size), (spec.n_robots,))
        self._chance = TickDraws(rng, spec.n_robots, n_draws)
        self.n_ticks = 0
        self._take(*state)
        self._call, self.calls = Calls(), (Calls(), Calls())

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Choose actions; see `Policy.act`. The returned (N, A) array is reused by the next call.

        Raises:
            ValueError: arrays of another shape than the swarm of the last reset, or there was none.
        """
        if (obs.shape, active.shape) != self._shapes:  # kernels would read and write beyond their ends
            raise ValueError(
                f"Expected observations (n_robots, columns) and active (n_robots,) of the shapes {self._shapes}, got "
                f"{(obs.shape, active.shape)}; call reset with the spec of this environment before act."
            )
        # The compiled version takes contiguous arrays of these types only. Most often nothing is copied here.
        obs, active = np.ascontiguousarray(obs, np.float32), np.ascontiguousarray(active, np.bool_)
        _, draws = self.next_ticks()
        self._draws = draws[0]
        self._call(self._kernel, obs, active, self._draws, self._given, self.n_ticks + 1)
        self.count_ticks(1)
        return self.actions

    def next_ticks(self) -> tuple[int, FloatArray]:
        """Count on from the ticks that the policy has done."""
        tick = self.n_ticks + 1
        return tick, self._chance.rows(tick)

    def count_ticks(self, n_ticks: int) -> None:
        """Note the ticks, and see `after_ticks`."""
        self.n_ticks += n_ticks
        self.after_ticks()

    def after_ticks(self) -> None:
        """Do what is to be done before the kernel is called again, and raise what has gone wrong; here nothing."""

    def compiled(self) -> "KernelPolicy | None":
        """The policy for runs without Python between ticks.

        None where somebody has put another `act` in its place, or tells tasks by an array that is made when it is
        asked for: no kernel keeps that up to date.
        """
        is_own = type(self).act is KernelPolicy.act and "act" not in vars(self)
        return self if is_own and self.task is self.task else None
