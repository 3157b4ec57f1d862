"""The compiled tick of one run: `kernels.tick`, bound to the arrays of the run."""

from collections.abc import Callable
from typing import NamedTuple

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


class CompiledTick(NamedTuple):
    """The functions of `kernels.tick`, to be called with arguments of exactly these types, contiguous."""

    observe: Callable[[World], None]
    set_out: Callable[[World, ActionArray, FloatArray, int, bool], int]
    meet_and_close: Callable[[World, ActionArray, int, FloatArray, FloatArray], int]
    close: Callable[[World, FloatArray], None]
    whole: Callable[[World, BodyState, ActionArray, FloatArray, int, bool, FloatArray, FloatArray], int] | None
    """Only with compiled bodies."""


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


def compiled_tick(
    world: World, bodies: BodyState | None, actions: ActionArray, wheel_gain: FloatArray, draws: FloatArray
) -> CompiledTick:
    """Return the functions of a tick for arguments of these types; `draws` is one row of random numbers."""
    return CompiledTick(
        observe=direct(tick.observe, world),
        set_out=direct(tick.set_out, world, actions, wheel_gain, 0, False),
        meet_and_close=direct(tick.meet_and_close, world, actions, 0, draws, draws),
        close=direct(tick.close, world, draws),
        whole=None
        if bodies is None
        else direct(tick.whole, world, bodies, actions, wheel_gain, 0, False, draws, draws),
    )
