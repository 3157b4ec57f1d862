"""What a robot knows of itself: wheels, pose, cargo, and the event of this tick."""

from swarm_forage_env._internal.compiling import part
from swarm_forage_env._internal.prefetching import AHEAD, LARGE, LINE, prefetch
from swarm_forage_env.contract.layout import EVENT_SCALE
from swarm_forage_env.contract.types import BoolArray, CodeArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.world.kernels.floor import write_cache


@part
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
    n_robots = facing.shape[0]
    for i in range(n_robots):
        if n_robots >= LARGE:
            ahead = min(i + AHEAD, n_robots - 1)
            prefetch(obs, ahead, start * obs.itemsize)
            prefetch(obs, ahead, start * obs.itemsize + LINE)
        if not present[i]:
            obs[i, start : start + 6] = 0.0
            continue
        obs[i, start] = min(1.0, max(-1.0, wheel_speed[i, 0] / scales[0]))
        obs[i, start + 1] = min(1.0, max(-1.0, wheel_speed[i, 1] / scales[0]))
        obs[i, start + 2] = 2.0 * position[i, 0] / scales[1] - 1.0
        obs[i, start + 3] = 2.0 * position[i, 1] / scales[2] - 1.0
        obs[i, start + 4] = facing[i, 0]
        obs[i, start + 5] = facing[i, 1]


@part
def own_status(
    carried_object: IntArray,
    pending_kind: CodeArray,
    present: BoolArray,
    active: BoolArray,
    code: CodeArray,
    event_object: IntArray,
    event_cache: IntArray,
    sizes: tuple[int, int, int],
    obs: ObsArray,
    start: int,
) -> None:
    """Write carrying, interacting, active, cargo, event_object, event, event_cache, ten columns from `start`.

    `sizes` = squares along x, along y, objects; the arrays are those of `SwarmState` and `StepEvents`.
    """
    n_objects = sizes[2]
    for i in range(carried_object.shape[0]):
        for k in range(start, start + 10):
            obs[i, k] = 0.0
        if not present[i]:
            continue
        if carried_object[i] >= 0:
            obs[i, start] = 1.0
            obs[i, start + 3] = (carried_object[i] + 1) / n_objects
        if pending_kind[i] != 0:
            obs[i, start + 1] = 1.0
        if active[i]:
            obs[i, start + 2] = 1.0
        if code[i] != 0:
            obs[i, start + 4] = (event_object[i] + 1) / n_objects
            obs[i, start + 5] = code[i] / EVENT_SCALE
            if event_cache[i, 0] > 0:
                fields = (event_cache[i, 0], event_cache[i, 1], event_cache[i, 2], event_cache[i, 3])
                write_cache(obs, i, start + 6, fields, sizes)
