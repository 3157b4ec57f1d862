"""Wheel commands to body velocities, and body poses back to positions and headings."""

import math

import numpy as np

from swarm_forage_env._internal.compiling import inline_kernel, kernel, part
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray

_MORE = 1.0 + 1e-12
"""What is this little above a limit is at the limit and was rounded: it stays as it is, bit for bit."""

SMALL_RAD = 0.5
"""Turns up to here are taken from series: all that a tick holds."""
_SINC = np.array([1.0, -1.0 / 6, 1.0 / 120, -1.0 / 5040, 1.0 / 362880, -1.0 / 39916800, 1.0 / 6227020800])
_COSINE = np.array(
    [1.0, -1.0 / 2, 1.0 / 24, -1.0 / 720, 1.0 / 40320, -1.0 / 3628800, 1.0 / 479001600, -1.0 / 87178291200]
)


@kernel
def sinc_and_cosine(angle: float) -> tuple[float, float]:
    """sin(angle) / angle and cos(angle), for small angles from their series; the first term left out is below 1e-17."""
    if abs(angle) > SMALL_RAD:
        return math.sin(angle) / angle, math.cos(angle)
    return small_sinc_and_cosine(angle)


@part
def small_sinc_and_cosine(angle: float) -> tuple[float, float]:
    """The same for small angles only: without a branch, so that loops take several robots at once.

    The terms are summed as three polynomials, which a processor works out at the same time.
    """
    s = angle * angle
    t = s * s
    sinc = (1.0 + s * _SINC[1]) + t * ((_SINC[2] + s * _SINC[3]) + t * ((_SINC[4] + s * _SINC[5]) + t * _SINC[6]))
    low = (1.0 + s * _COSINE[1]) + t * (_COSINE[2] + s * _COSINE[3])
    high = (_COSINE[4] + s * _COSINE[5]) + t * (_COSINE[6] + s * _COSINE[7])
    return sinc, low + t * t * high


@part
def limit_wheels(left: float, right: float, max_speed: float, max_difference: float) -> tuple[float, float]:
    """Left and right wheel speed with centre speed and difference each clipped, all in m/s."""
    speed = min(max_speed, max(-max_speed, 0.5 * (left + right)))
    difference = min(max_difference, max(-max_difference, right - left))
    return speed - 0.5 * difference, speed + 0.5 * difference


@part
def limit_command(
    command_left: float, command_right: float, scale: float, max_speed: float, max_difference: float
) -> tuple[float, float]:
    """Left and right wheel speed (m/s) for commands in [-1, 1]: centre speed and difference each clipped.

    `scale` is the wheel speed that a command of 1 stands for; all limits in m/s.
    """
    wanted_left = min(1.0, max(-1.0, command_left)) * scale
    wanted_right = min(1.0, max(-1.0, command_right)) * scale
    return limit_wheels(wanted_left, wanted_right, max_speed, max_difference)


@inline_kernel
def drive(
    actions: ActionArray,
    wheel_gain: FloatArray,
    active: BoolArray,
    pending_kind: CodeArray,
    facing: FloatArray,
    limits: FloatArray,
    dt_s: float,
    wheel_speed: FloatArray,
    twist: FloatArray,
) -> int:
    """Fill wheel speeds (N, 2) m/s and twists (N + 1, 3): world velocity x, y in m/s and turn rate in rad/s.

    Wheel speed = limit(limit(command) x gain): a gain above 1 makes no robot faster than its motors are.
    `limits` holds wheel scale, centre-speed limit, wheel-difference limit (m/s) and wheel base (m). The velocity is
    the chord of the exact arc over one tick, so that free motion is exact however the tick is divided.
    Returns -1, or the first active row with a command or gain that is not finite; then nothing is written.
    """
    for i in range(facing.shape[0]):
        if not active[i]:
            continue
        # One by one: large numbers are clipped, and their sum would be infinite.
        is_command = math.isfinite(actions[i, 0]) and math.isfinite(actions[i, 1]) and math.isfinite(actions[i, 2])
        if not (is_command and math.isfinite(wheel_gain[i, 0] + wheel_gain[i, 1])):
            return i
        for k in range(3, actions.shape[1]):  # what the robot says
            if not math.isfinite(actions[i, k]):
                return i
    scale, max_speed, max_difference = limits[0], limits[1], limits[2]
    per_wheel_base = 1.0 / limits[3]
    for i in range(facing.shape[0]):
        left = 0.0
        right = 0.0
        if active[i] and pending_kind[i] == 0:
            left, right = limit_command(float(actions[i, 0]), float(actions[i, 1]), scale, max_speed, max_difference)
            left *= wheel_gain[i, 0]
            right *= wheel_gain[i, 1]
            if abs(0.5 * (left + right)) > _MORE * max_speed or abs(right - left) > _MORE * max_difference:
                left, right = limit_wheels(left, right, max_speed, max_difference)
        wheel_speed[i, 0] = left
        wheel_speed[i, 1] = right
    _drive_arcs(wheel_speed, facing, per_wheel_base, dt_s, twist)
    if 0.5 * _MORE * max_difference * per_wheel_base * dt_s > SMALL_RAD:
        for i in range(facing.shape[0]):
            half_angle = 0.5 * twist[i, 2] * dt_s
            if abs(half_angle) > SMALL_RAD:
                sinc, cosine = sinc_and_cosine(half_angle)
                chord = 0.5 * (wheel_speed[i, 0] + wheel_speed[i, 1]) * sinc
                sine = half_angle * sinc
                twist[i, 0] = chord * (facing[i, 0] * cosine - facing[i, 1] * sine)
                twist[i, 1] = chord * (facing[i, 1] * cosine + facing[i, 0] * sine)
    return -1


@part
def _drive_arcs(
    wheel_speed: FloatArray, facing: FloatArray, per_wheel_base: float, dt_s: float, twist: FloatArray
) -> None:
    """Write the twists of wheel speeds, for small turns. Flat arrays: their steps are known to compilers."""
    wheels, ahead, flat = wheel_speed.reshape(wheel_speed.size), facing.reshape(facing.size), twist.reshape(twist.size)
    for i in range(facing.shape[0]):
        left = wheels[2 * i]
        right = wheels[2 * i + 1]
        cos = ahead[2 * i]
        sin = ahead[2 * i + 1]
        turn = (right - left) * per_wheel_base
        half_angle = 0.5 * turn * dt_s
        sinc, cosine = small_sinc_and_cosine(half_angle)
        sine = half_angle * sinc
        chord = 0.5 * (left + right) * sinc
        flat[3 * i] = chord * (cos * cosine - sin * sine)
        flat[3 * i + 1] = chord * (sin * cosine + cos * sine)
        flat[3 * i + 2] = turn


@kernel
def unpack_poses(
    poses: FloatArray, present: BoolArray, position: FloatArray, heading: FloatArray, facing: FloatArray
) -> None:
    """Copy body poses (>= N, 3: x, y, angle) of present robots; angles are wrapped to (-pi, pi]."""
    for i in range(heading.shape[0]):
        if present[i]:
            position[i, 0] = poses[i, 0]
            position[i, 1] = poses[i, 1]
            angle = poses[i, 2]
            facing[i, 0] = math.cos(angle)
            facing[i, 1] = math.sin(angle)
            heading[i] = angle - 2.0 * math.pi * math.ceil((angle - math.pi) / (2.0 * math.pi))


@kernel
def hold_inside(poses: FloatArray, present: BoolArray, room: FloatArray) -> int:
    """Move present bodies in `poses` (>= N, 3) into `room` = x low, y low, x high, y high; returns how many moved."""
    n_moved = 0
    for i in range(present.shape[0]):
        if present[i]:
            x = min(room[2], max(room[0], poses[i, 0]))
            y = min(room[3], max(room[1], poses[i, 1]))
            if x != poses[i, 0] or y != poses[i, 1]:
                poses[i, 0] = x
                poses[i, 1] = y
                n_moved += 1
    return n_moved
