"""What a robot knows of itself: wheels, pose, cargo, and the event of this tick."""

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.layout import EVENT_SCALE
from swarm_forage_env.contract.types import BoolArray, FloatArray, ObsArray
from swarm_forage_env.world.kernels.floor import write_cache
from swarm_forage_env.world.state import StepEvents, SwarmState


@kernel
def own_motion(
    position: FloatArray,
    facing: FloatArray,
    wheel_speed: FloatArray,
    present: BoolArray,
    scales: FloatArray,
    obs: ObsArray,
    start: int,
) -> None:
    """Write wheel_speed, position and heading, six columns from `start`.

    `scales` = wheel scale in m/s, arena width and height in m. Actuator noise can take a wheel above the scale; the
    reading then stays at the end of its range.
    """
    for i in range(facing.shape[0]):
        if not present[i]:
            obs[i, start : start + 6] = 0.0
            continue
        obs[i, start] = min(1.0, max(-1.0, wheel_speed[i, 0] / scales[0]))
        obs[i, start + 1] = min(1.0, max(-1.0, wheel_speed[i, 1] / scales[0]))
        obs[i, start + 2] = 2.0 * position[i, 0] / scales[1] - 1.0
        obs[i, start + 3] = 2.0 * position[i, 1] / scales[2] - 1.0
        obs[i, start + 4] = facing[i, 0]
        obs[i, start + 5] = facing[i, 1]


@kernel
def own_status(swarm: SwarmState, events: StepEvents, sizes: tuple[int, int, int], obs: ObsArray, start: int) -> None:
    """Write carrying, interacting, active, cargo, event_object, event, event_cache, ten columns from `start`.

    `sizes` = squares along x, along y, objects.
    """
    carried_object, event_cache = swarm.carried_object, events.event_cache
    n_objects = sizes[2]
    for i in range(carried_object.shape[0]):
        for k in range(start, start + 10):
            obs[i, k] = 0.0
        if not swarm.present[i]:
            continue
        if carried_object[i] >= 0:
            obs[i, start] = 1.0
            obs[i, start + 3] = (carried_object[i] + 1) / n_objects
        if swarm.pending_kind[i] != 0:
            obs[i, start + 1] = 1.0
        if swarm.active[i]:
            obs[i, start + 2] = 1.0
        if events.code[i] != 0:
            obs[i, start + 4] = (events.event_object[i] + 1) / n_objects
            obs[i, start + 5] = events.code[i] / EVENT_SCALE
            if event_cache[i, 0] > 0:
                fields = (event_cache[i, 0], event_cache[i, 1], event_cache[i, 2], event_cache[i, 3])
                write_cache(obs, i, start + 6, fields, sizes)
