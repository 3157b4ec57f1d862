"""Wheel gains of throttled robots."""

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import ActionArray, FloatArray, IntArray
from swarm_forage_env.world.kernels.drive import limit_command


@kernel
def throttle(
    actions: ActionArray,
    strength: float,
    only_carriers: bool,
    carried_object: IntArray,
    limits: FloatArray,
    wheel_gain: FloatArray,
) -> None:
    """Multiply the gains (N, 2) of both wheels by 1 - strength |l + r| / (|l| + |r|).

    l and r are the limited commands in m/s: with both wheels forward the gain is 1 - strength, on the spot it is 1, in
    between it is continuous. Robots whose wheels stand, and with `only_carriers` those that carry nothing, keep theirs.
    `limits` as in `world.kernels.drive.drive`.
    """
    scale, max_speed, max_difference = limits[0], limits[1], limits[2]
    for i in range(carried_object.shape[0]):
        if only_carriers and carried_object[i] < 0:
            continue
        left, right = limit_command(float(actions[i, 0]), float(actions[i, 1]), scale, max_speed, max_difference)
        total = abs(left) + abs(right)
        if total > 0.0:
            factor = 1.0 - strength * (abs(left + right) / total)
            wheel_gain[i, 0] *= factor
            wheel_gain[i, 1] *= factor
