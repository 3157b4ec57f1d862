"""Wheel gains: of throttled robots, and of noisy wheels."""

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import ActionArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.world.kernels.drive import limit_command
from swarm_forage_env.wrappers.kernels.gaussian import to_normal


@kernel
def throttle(
    actions: ActionArray,
    strength: float,
    only_carriers: bool,
    carried_object: IntArray,
    limits: FloatArray,
    outer_gain: FloatArray,
    wheel_gain: FloatArray,
) -> None:
    """Write the gains `outer_gain` of both wheels, times 1 - strength |l + r| / (|l| + |r|), into `wheel_gain`; (N, 2).

    l and r are the limited commands in m/s. The factor is 1 - strength with both wheels forward and 1 on the spot, and
    continuous in between. Gains of robots with standing wheels stay; with `only_carriers`, those of robots without an
    object stay, too. `limits` as in `world.kernels.drive.drive`.
    """
    scale, max_speed, max_difference = limits[0], limits[1], limits[2]
    for i in range(carried_object.shape[0]):
        wheel_gain[i, 0] = outer_gain[i, 0]
        wheel_gain[i, 1] = outer_gain[i, 1]
        if only_carriers and carried_object[i] < 0:
            continue
        left, right = limit_command(float(actions[i, 0]), float(actions[i, 1]), scale, max_speed, max_difference)
        total = abs(left) + abs(right)
        if total > 0.0:
            factor = 1.0 - strength * (abs(left + right) / total)
            wheel_gain[i, 0] *= factor
            wheel_gain[i, 1] *= factor


@kernel
def noisy_gain(
    draws: ObsArray, is_uniform: bool, factor: float, outer_gain: FloatArray, wheel_gain: FloatArray
) -> None:
    """Write outer_gain * (1 + noise * factor) into `wheel_gain`; all (N, 2). The first two as in `noise.disturb`."""
    if not is_uniform:
        to_normal(draws)
    centre = 0.5 if is_uniform else 0.0
    for i in range(draws.shape[0]):
        for wheel in range(2):
            wheel_gain[i, wheel] = outer_gain[i, wheel] * (1.0 + (float(draws[i, wheel]) - centre) * factor)
