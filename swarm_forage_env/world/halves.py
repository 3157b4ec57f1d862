"""The world's kernels in two halves that do not need each other, so that two processes can compile them side by side.

Example: one process calls `compile_half(config, 0)` and another one `compile_half(config, 1)`; the outermost kernel,
which is made of both, is compiled afterwards and finds its parts in the cache. What is compiled is the same in any
order. `runs.first_compilation` decides when this pays.
"""

import numpy as np

from swarm_forage_env._internal.compiling import compile_part, direct, is_new
from swarm_forage_env.contract.policy import CompiledPolicy, layout_for
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.bodies import Bodies
from swarm_forage_env.world.caches import n_cache_slots
from swarm_forage_env.world.compiled import Call, ExampleCalls, new_world
from swarm_forage_env.world.interactions import Interactions
from swarm_forage_env.world.kernels import tick
from swarm_forage_env.world.kernels.bodies import BodyState, move_bodies, tell_poses
from swarm_forage_env.world.kernels.interact import serve
from swarm_forage_env.world.kernels.world import World
from swarm_forage_env.world.sensors import new_sensors
from swarm_forage_env.world.state import CacheState, ObjectState, StepEvents, SwarmState


def _empty_parts(config: ScenarioConfig) -> tuple[World, BodyState | None]:
    """Return a world in which nothing is: its types are those of every run of the scenario."""
    n_robots = config.robots.n_robots
    swarm, events = SwarmState.empty(n_robots), StepEvents.empty(n_robots)
    objects, caches = ObjectState.empty(config), CacheState.empty(n_cache_slots(config))
    sensors = new_sensors(config, layout_for(config), None)
    interactions = Interactions(config, swarm, objects, caches, events)
    twist, bodies = np.zeros((n_robots + 1, 3)), None
    if config.physics == "compiled":
        bodies = Bodies(config, swarm.position, swarm.heading, sensors.near, sensors.bins).state
    return new_world(config, swarm, events, interactions, sensors, twist, 0), bodies


def compile_half(config: ScenarioConfig, half: int) -> None:
    """Compile one of the two halves, 0 or 1.

    The second is the smaller one, because the process that compiles it may have to be started first.
    """
    for function, *example in parts_of(config, half):
        # Chipmunk's bodies move between two calls from Python.
        from_python = function is tick.set_out and config.physics == "chipmunk"
        (direct if from_python else compile_part)(function, *example)


def parts_of(config: ScenarioConfig, half: int) -> tuple[Call, ...]:
    """Return the outer kernels of a half: what robots see and how they set out (0); what they do, and bodies (1)."""
    world, bodies = _empty_parts(config)
    calls = ExampleCalls(world, bodies)
    if half == 0:
        return calls.close, calls.set_out
    serving = serve, world.state, world.rules, calls.actions, 0, calls.draws
    if bodies is None:
        return (serving,)
    poses = bodies.poses, world.present, world.state.position, world.heading, world.facing
    return serving, (move_bodies, bodies, world.twist, world.present, world.dt_s), (tell_poses, *poses)


def outermost(config: ScenarioConfig, policy: CompiledPolicy | None) -> Call:
    """Return the kernel that is made of both halves, as a run calls it.

    Args:
        config: The scenario.
        policy: The policy of a run without Python between the ticks, None for other runs.
    """
    calls = ExampleCalls(*_empty_parts(config))
    if config.physics == "chipmunk":
        return calls.meet_and_close
    return calls.whole if policy is None else calls.run(policy)


def is_first(config: ScenarioConfig) -> bool:
    """Return whether not even a reset of this scenario is compiled yet, and what is compiled can be kept."""
    return is_new(*ExampleCalls(*_empty_parts(config)).observe)
