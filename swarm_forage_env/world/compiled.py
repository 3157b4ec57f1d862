"""The compiled tick of one run: `kernels.tick`, bound to the arrays of the run; and how it is compiled beforehand.

The kernels of the world come in two halves that do not need each other, so that two processes can compile them side by
side: one calls `compile_half(config, 0)` and another one `compile_half(config, 1)`. The outermost kernel, which is made
of both, is compiled afterwards and finds its parts in the cache. What is compiled is the same in any order.
`runs.first_compilation` decides when this pays.
"""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import compile_part, direct, is_new
from swarm_forage_env._internal.held import held_type
from swarm_forage_env.contract.kernel_policy import CompiledPolicy
from swarm_forage_env.contract.policy import layout_for
from swarm_forage_env.contract.types import ActionArray, CodeArray, FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.allocation import new_arrays, new_state
from swarm_forage_env.world.bodies import Bodies
from swarm_forage_env.world.kernels import tick
from swarm_forage_env.world.kernels.bodies import BodyState, move_bodies, tell_poses
from swarm_forage_env.world.kernels.disturbances import Disturbances, disturb
from swarm_forage_env.world.kernels.interact import serve
from swarm_forage_env.world.kernels.placement import place_displaced
from swarm_forage_env.world.placement import new_draws
from swarm_forage_env.world.sensors import new_sensors
from swarm_forage_env.world.state import ArenaArrays, Source

Call = tuple[Callable[..., Any], *tuple[Any, ...]]
"""A kernel and arguments of the types that it is called with."""


class ExampleCalls:
    """A call of each function of `kernels.tick`, as runs make it: what is compiled beforehand is what they ask for."""

    def __init__(self, arrays: ArenaArrays, bodies: BodyState | None) -> None:
        """Take arrays and bodies (None where Chipmunk has them) as other kernels take them, or held as Python does.

        They may be those of a run or empty ones; only types matter.
        """
        self.actions: ActionArray = np.zeros((1, 3), np.float32)
        self.draws: FloatArray = np.zeros(1)
        self._arrays, self._bodies = arrays, bodies
        self._gain: FloatArray = np.zeros((1, 2))

    @classmethod
    def from_python(cls, arrays: ArenaArrays, bodies: BodyState | None) -> "ExampleCalls":
        """Return the calls that Python makes."""
        return cls(held_type(arrays), None if bodies is None else held_type(bodies))

    @property
    def bodies(self) -> BodyState:
        """The compiled bodies."""
        assert self._bodies is not None, "Chipmunk moves its bodies itself"
        return self._bodies

    @property
    def observe(self) -> Call:
        """Of `kernels.tick.observe`."""
        return tick.observe, self._arrays

    @property
    def set_out(self) -> Call:
        """Of `kernels.tick.set_out`."""
        return tick.set_out, self._arrays, self.actions, self._gain, 0, False

    @property
    def meet_and_close(self) -> Call:
        """Of `kernels.tick.meet_and_close`."""
        return tick.meet_and_close, self._arrays, self.actions, 0, self.draws, self.draws

    @property
    def close(self) -> Call:
        """Of `kernels.tick.close`."""
        return tick.close, self._arrays, self.draws

    @property
    def whole(self) -> Call:
        """Of `kernels.tick.whole`; for compiled bodies only."""
        return tick.whole, self._arrays, self.bodies, self.actions, self._gain, 0, False, self.draws, self.draws

    def run(self, policy: CompiledPolicy) -> Call:
        """Of `kernels.tick.run`, for a policy that has been reset; for compiled bodies only."""
        rows = self.draws[None]
        of_policy = policy.callback, policy.state, 0, 1, rows[None]
        tasks = tasks_of(policy), np.zeros(1)
        of_world = self._arrays, self.bodies, Disturbances(), self._gain
        return tick.run, *of_world, 0, 0, False, True, *of_policy, rows, rows, *tasks


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
        self._calls = ExampleCalls.from_python(arrays, bodies)
        self._driver: CompiledPolicy | None = None
        self._decide: Callable[..., tuple[int, int]] | None = None

    @cached_property
    def observe(self) -> Callable[[ArenaArrays], None]:
        """See `kernels.tick.observe`."""
        return direct(*self._calls.observe)

    @cached_property
    def set_out(self) -> Callable[[ArenaArrays, ActionArray, FloatArray, int, bool], int]:
        """See `kernels.tick.set_out`."""
        return direct(*self._calls.set_out)

    @cached_property
    def meet_and_close(self) -> Callable[[ArenaArrays, ActionArray, int, FloatArray, FloatArray], int]:
        """See `kernels.tick.meet_and_close`."""
        return direct(*self._calls.meet_and_close)

    @cached_property
    def close(self) -> Callable[[ArenaArrays, FloatArray], None]:
        """See `kernels.tick.close`."""
        return direct(*self._calls.close)

    @cached_property
    def whole(
        self,
    ) -> Callable[[ArenaArrays, BodyState, ActionArray, FloatArray, int, bool, FloatArray, FloatArray], int]:
        """See `kernels.tick.whole`; for compiled bodies only."""
        return direct(*self._calls.whole)

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


def _empty_parts(config: ScenarioConfig) -> tuple[ArenaArrays, BodyState | None]:
    """Return an arena in which nothing is: its types are those of every run of the scenario."""
    state = new_state(config)
    sensors = new_sensors(config, layout_for(config), None)
    twist, bodies = np.zeros((config.robots.n_robots + 1, 3)), None
    if config.physics == "compiled":
        bodies = Bodies(config, state.swarm.position, state.swarm.heading, sensors.near, sensors.bins).state
    nothing = np.zeros((0, 4), np.int32)
    source = Source(nothing, nothing[:, 0].copy(), nothing[:, 0].copy())
    return new_arrays(config, state, sensors, twist, source, new_draws(), 0), bodies


def compile_half(config: ScenarioConfig, half: int) -> None:
    """Compile one of the two halves, 0 or 1.

    The second is the smaller one, because the process that compiles it may have to be started first.
    """
    for function, *example in parts_of(config, half):
        compile_part(function, *example)
    if half == 0 and config.physics == "chipmunk":  # its bodies move between two calls from Python
        direct(*ExampleCalls.from_python(*_empty_parts(config)).set_out)


def parts_of(config: ScenarioConfig, half: int) -> tuple[Call, ...]:
    """Return the outer kernels of a half: what robots see and how they set out (0); what they do, and bodies (1).

    Disturbances of what robots see belong to the smaller half.
    """
    arrays, bodies = _empty_parts(config)
    calls, swarm, motion = ExampleCalls(arrays, bodies), arrays.state.swarm, arrays.motion
    if half == 0:
        return (calls.close,) if bodies is None else (calls.close, calls.set_out)
    state = arrays.state
    serving = serve, state, arrays.rules, calls.actions, 0, calls.draws
    where = arrays.source, arrays.wandering.area, arrays.placement_draws
    placing = place_displaced, state.requests, state.objects, *where
    if bodies is None:
        return serving, placing
    poses = bodies.poses, swarm.present, swarm.position, swarm.heading, swarm.facing
    moving = move_bodies, bodies, motion.twist, swarm.present, motion.dt_s
    nothing, sensors = Disturbances(), arrays.sensors
    numbers = nothing.draws, nothing.factors[0], nothing.noise
    robots = sensors.obs, swarm.present, swarm.active, swarm.carried_object
    disturbing = disturb, *robots, *numbers, sensors.blanks, 0, False
    return serving, placing, moving, (tell_poses, *poses), disturbing


def outermost(config: ScenarioConfig, policy: CompiledPolicy | None) -> Call:
    """Return the kernel that is made of both halves, as a run calls it.

    Args:
        config: The scenario.
        policy: The policy of a run without Python between the ticks, None for other runs.
    """
    calls = ExampleCalls.from_python(*_empty_parts(config))
    if config.physics == "chipmunk":
        return calls.meet_and_close
    return calls.whole if policy is None else calls.run(policy)


def is_first(config: ScenarioConfig) -> bool:
    """Return whether not even a reset of this scenario is compiled yet, and what is compiled can be kept."""
    return is_new(*ExampleCalls.from_python(*_empty_parts(config)).observe)
