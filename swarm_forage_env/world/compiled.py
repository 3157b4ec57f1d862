"""The compiled tick of one run: `kernels.tick`, bound to the types of the run."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import direct, is_new
from swarm_forage_env._internal.held import held_type
from swarm_forage_env.contract.kernel_policy import CompiledPolicy
from swarm_forage_env.contract.policy import layout_for
from swarm_forage_env.contract.types import ActionArray, CodeArray, FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.allocation import new_arrays, new_state
from swarm_forage_env.world.kernels import tick
from swarm_forage_env.world.kernels.bodies import BodyState
from swarm_forage_env.world.placement import new_draws
from swarm_forage_env.world.sensors import new_sensors
from swarm_forage_env.world.state import ArenaArrays, Source

_ACTIONS: ActionArray = np.zeros((1, 3), np.float32)
_DRAWS: FloatArray = np.zeros(1)
_GAIN: FloatArray = np.zeros((1, 2))
"""Examples of arguments, of which only the types matter."""


def tasks_of(policy: CompiledPolicy) -> CodeArray:
    """Return where a policy writes its tasks, (N,), or (0,) for a policy without tasks."""
    return policy.task if policy.task is not None else np.zeros(0, np.int8)


class CompiledTick:
    """The functions of `kernels.tick`, each compiled when it is first asked for.

    They are called without a look at the arguments, which must be contiguous arrays of exactly these types. Arrays and
    bodies of the run are handed over as `held` tuples.
    """

    def __init__(self, arrays: ArenaArrays, bodies: BodyState | None) -> None:
        """Take the types of the arguments from a run; the types are the same in all runs of a scenario.

        Args:
            arrays: State and constants of the run.
            bodies: Compiled bodies, None where Chipmunk has them.
        """
        self._arrays, self._bodies = held_type(arrays), None if bodies is None else held_type(bodies)
        self._driver: CompiledPolicy | None = None
        self._decide: Callable[..., tuple[int, int]] | None = None

    @cached_property
    def observe(self) -> Callable[[ArenaArrays], None]:
        """See `kernels.tick.observe`."""
        return direct(tick.observe, self._arrays)

    @cached_property
    def set_out(self) -> Callable[[ArenaArrays, ActionArray, FloatArray, int, bool], int]:
        """See `kernels.tick.set_out`."""
        return direct(tick.set_out, self._arrays, _ACTIONS, _GAIN, 0, False)

    @cached_property
    def meet_and_close(self) -> Callable[[ArenaArrays, ActionArray, int, FloatArray, FloatArray], int]:
        """See `kernels.tick.meet_and_close`."""
        return direct(tick.meet_and_close, self._arrays, _ACTIONS, 0, _DRAWS, _DRAWS)

    @cached_property
    def close(self) -> Callable[[ArenaArrays, FloatArray], None]:
        """See `kernels.tick.close`."""
        return direct(tick.close, self._arrays, _DRAWS)

    @cached_property
    def whole(
        self,
    ) -> Callable[[ArenaArrays, BodyState, ActionArray, FloatArray, int, bool, FloatArray, FloatArray], int]:
        """See `kernels.tick.whole`; for compiled bodies only."""
        return direct(tick.whole, self._arrays, self._bodies, _ACTIONS, _GAIN, 0, False, _DRAWS, _DRAWS)

    def run(self, policy: CompiledPolicy, *arguments: Any) -> tuple[int, int, bool]:
        """See `kernels.tick.run`; for compiled bodies only. The types are the same in all calls for a policy."""
        if policy is not self._driver:
            self._driver, self._run = policy, direct(tick.run, *arguments)
        return self._run(*arguments)

    def decide(self, *arguments: Any) -> tuple[int, int]:
        """See `kernels.tick.decide`; for compiled bodies only. The types are the same in all calls."""
        if self._decide is None:
            self._decide = direct(tick.decide, *arguments)
        return self._decide(*arguments)


def is_first(config: ScenarioConfig) -> bool:
    """Return whether not even a reset of this scenario is compiled yet, and what is compiled can be kept."""
    state = new_state(config)
    sensors, twist = new_sensors(config, layout_for(config), None), np.zeros((config.robots.n_robots + 1, 3))
    nothing = np.zeros((0, 4), np.int32)
    source = Source(nothing, nothing[:, 0].copy(), nothing[:, 0].copy())
    return is_new(tick.observe, held_type(new_arrays(config, state, sensors, twist, source, new_draws(), 0)))
