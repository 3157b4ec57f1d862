"""The compiled tick of one run: `kernels.tick`, bound to the arrays of the run."""

from collections.abc import Callable
from functools import cached_property
from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import direct
from swarm_forage_env.contract.policy import CompiledPolicy
from swarm_forage_env.contract.types import ActionArray, CodeArray, FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.actuators import drive_limits
from swarm_forage_env.world.contact import TOUCH_SLACK_M, new_memory
from swarm_forage_env.world.interactions import Interactions
from swarm_forage_env.world.kernels import tick
from swarm_forage_env.world.kernels.bodies import BodyState
from swarm_forage_env.world.kernels.world import Sensors, Wandering, World
from swarm_forage_env.world.kinds import speeds
from swarm_forage_env.world.state import StepEvents, SwarmState

Call = tuple[Callable[..., Any], *tuple[Any, ...]]
"""A kernel and arguments of the types that it is called with."""


class ExampleCalls:
    """A call of each function of `kernels.tick`, as runs make it: what is compiled beforehand is what they ask for."""

    def __init__(self, world: World, bodies: BodyState | None) -> None:
        """Take world and bodies (None where Chipmunk has them) from a run, or empty ones; only types matter."""
        n_robots = len(world.present)
        self.actions: ActionArray = np.zeros((n_robots, 3), np.float32)
        self.draws: FloatArray = np.zeros(n_robots)
        self._world, self._bodies = world, bodies
        self._gain: FloatArray = np.zeros((n_robots, 2))

    @property
    def bodies(self) -> BodyState:
        """The compiled bodies."""
        assert self._bodies is not None, "Chipmunk moves its bodies itself"
        return self._bodies

    @property
    def observe(self) -> Call:
        """Of `kernels.tick.observe`."""
        return tick.observe, self._world

    @property
    def set_out(self) -> Call:
        """Of `kernels.tick.set_out`."""
        return tick.set_out, self._world, self.actions, self._gain, 0, False

    @property
    def meet_and_close(self) -> Call:
        """Of `kernels.tick.meet_and_close`."""
        return tick.meet_and_close, self._world, self.actions, 0, self.draws, self.draws

    @property
    def close(self) -> Call:
        """Of `kernels.tick.close`."""
        return tick.close, self._world, self.draws

    @property
    def whole(self) -> Call:
        """Of `kernels.tick.whole`; for compiled bodies only."""
        return tick.whole, self._world, self.bodies, self.actions, self._gain, 0, False, self.draws, self.draws

    def run(self, policy: CompiledPolicy) -> Call:
        """Of `kernels.tick.run`, for a policy that has been reset; for compiled bodies only."""
        rows = self.draws[None]
        of_policy = policy.callback, policy.state, 0, rows[None]
        tasks = tasks_of(policy), np.zeros(1)
        return tick.run, self._world, self.bodies, self._gain, 0, 0, False, *of_policy, rows, rows, *tasks


def tasks_of(policy: CompiledPolicy) -> CodeArray:
    """Return where a policy writes its tasks, (N,), or (0,) for a policy without tasks."""
    return policy.task if policy.task is not None else np.zeros(0, np.int8)


class CompiledTick:
    """The functions of `kernels.tick`, each compiled when it is first asked for.

    They are called without a look at the arguments, which must be contiguous arrays of exactly these types.
    """

    def __init__(self, world: World, bodies: BodyState | None) -> None:
        """Take the types of the arguments from a run; the types are the same in all runs of a scenario.

        Args:
            world: State and constants of the run.
            bodies: Compiled bodies, None where Chipmunk has them.
        """
        self._calls = ExampleCalls(world, bodies)

    @cached_property
    def observe(self) -> Callable[[World], None]:
        """See `kernels.tick.observe`."""
        return direct(*self._calls.observe)

    @cached_property
    def set_out(self) -> Callable[[World, ActionArray, FloatArray, int, bool], int]:
        """See `kernels.tick.set_out`."""
        return direct(*self._calls.set_out)

    @cached_property
    def meet_and_close(self) -> Callable[[World, ActionArray, int, FloatArray, FloatArray], int]:
        """See `kernels.tick.meet_and_close`."""
        return direct(*self._calls.meet_and_close)

    @cached_property
    def close(self) -> Callable[[World, FloatArray], None]:
        """See `kernels.tick.close`."""
        return direct(*self._calls.close)

    @cached_property
    def whole(self) -> Callable[[World, BodyState, ActionArray, FloatArray, int, bool, FloatArray, FloatArray], int]:
        """See `kernels.tick.whole`; for compiled bodies only."""
        return direct(*self._calls.whole)


def new_world(
    config: ScenarioConfig,
    swarm: SwarmState,
    events: StepEvents,
    interactions: Interactions,
    sensors: Sensors,
    twist: FloatArray,
    n_static_caches: int,
) -> World:
    """Bind the state of a run and what else a tick needs; the arrays must not be replaced afterwards, only edited."""
    n_robots = config.robots.n_robots
    return World(
        state=interactions.state,
        rules=interactions.rules,
        heading=swarm.heading,
        facing=swarm.facing,
        wheel_speed=swarm.wheel_speed,
        present=swarm.present,
        twist=twist,
        command=np.zeros((n_robots, 2)),
        drive_limits=drive_limits(config),
        speeds=speeds(config.robots),
        dt_s=config.dt_s,
        touch_m=2 * config.robots.radius_m + TOUCH_SLACK_M,
        pressing=(new_memory(n_robots), new_memory(n_robots)),
        sensors=sensors,
        interfering=events.interfering,
        interference_sum=events.interference_sum,
        wandering=Wandering(
            probability=config.objects.walk_probability,
            area=config.arena.distributable_cells,
            self_conflict=config.quirks.motion_self_conflict,
        ),
        n_static_caches=n_static_caches,
        has_caches=config.caches != "none",
    )
