"""The compiled tick of one run: `kernels.tick`, bound to the arrays of the run."""

from collections.abc import Callable
from functools import cached_property

import numpy as np

from swarm_forage_env._internal.compiling import direct
from swarm_forage_env.contract.types import ActionArray, FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.actuators import drive_limits
from swarm_forage_env.world.contact import TOUCH_SLACK_M, new_memory
from swarm_forage_env.world.interactions import Interactions
from swarm_forage_env.world.kernels import tick
from swarm_forage_env.world.kernels.bodies import BodyState
from swarm_forage_env.world.kernels.world import Sensors, Wandering, World
from swarm_forage_env.world.state import StepEvents, SwarmState


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
        n_robots = len(world.present)
        self._world, self._bodies = world, bodies
        self._actions: ActionArray = np.zeros((n_robots, 3), np.float32)
        self._gain: FloatArray = np.zeros((n_robots, 2))
        self._draws: FloatArray = np.zeros(n_robots)

    @cached_property
    def observe(self) -> Callable[[World], None]:
        """See `kernels.tick.observe`."""
        return direct(tick.observe, self._world)

    @cached_property
    def set_out(self) -> Callable[[World, ActionArray, FloatArray, int, bool], int]:
        """See `kernels.tick.set_out`."""
        return direct(tick.set_out, self._world, self._actions, self._gain, 0, False)

    @cached_property
    def meet_and_close(self) -> Callable[[World, ActionArray, int, FloatArray, FloatArray], int]:
        """See `kernels.tick.meet_and_close`."""
        return direct(tick.meet_and_close, self._world, self._actions, 0, self._draws, self._draws)

    @cached_property
    def close(self) -> Callable[[World, FloatArray], None]:
        """See `kernels.tick.close`."""
        return direct(tick.close, self._world, self._draws)

    @cached_property
    def whole(self) -> Callable[[World, BodyState, ActionArray, FloatArray, int, bool, FloatArray, FloatArray], int]:
        """See `kernels.tick.whole`; for compiled bodies only."""
        assert self._bodies is not None, "Chipmunk moves its bodies itself"
        draws = self._draws, self._draws
        return direct(tick.whole, self._world, self._bodies, self._actions, self._gain, 0, False, *draws)


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
