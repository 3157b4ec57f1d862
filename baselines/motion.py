"""Steering: forces in the robot's frame, and the drive that turns a summed force into wheel commands.

A force is a desired velocity (forward, left) in m/s. The forces of one tick are added without weights; only `drive`
limits the sum. Compiled, one robot at a time; `c` is the record of `parameters.kernel_constants`.
Source: the steering behaviours and numbers of the paper's study.

Angles become wheel commands, which are float32. So two functions here, `drive` and `wander_freely`, take angles from
short series instead of the slow functions of the machine's library. They use them only where every number within
`_MARGIN` rounds to the same float32, which is almost always; the other angles are computed again with the library.
Commands are therefore the same, bit for bit, as those of the library alone.
"""

import math

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.detection import ring_sum
from swarm_forage_env.contract.types import Row

_MARGIN = 1e-12
"""How far wheel commands from series may be from those of the library, as a share of the speed; they are nearer."""
_STEEPEST = 0.3
"""Slope up to which `_arctangent` is used; beyond it the first term left out would be more than 1e-14 of the angle."""
_STEEPEST_RAD = math.atan(_STEEPEST) - 1e-6
"""Whatever is steeper points further to the side than this."""
_TERMS = (-1.0) ** np.arange(12) / (2.0 * np.arange(12) + 1.0)
_EVEN_TERMS = _TERMS[0::2].copy()
_ODD_TERMS = _TERMS[1::2].copy()


@part
def _arctangent(slope: float) -> float:
    """Sum t - t^3/3 + t^5/5 - ... up to t^23, even and odd terms apart, which a processor adds at the same time."""
    square = slope * slope
    step = square * square
    even = 0.0
    odd = 0.0
    for k in range(5, -1, -1):
        even = even * step + _EVEN_TERMS[k]
        odd = odd * step + _ODD_TERMS[k]
    return slope * (even + square * odd)


@part
def _drive_arc(size: float, is_left: bool, speed: float, c: np.record, wheels: Row) -> bool:
    """Write the wheel commands of a soft turn; see `drive`.

    Args:
        size: Angle of the force without its sign, rad, from a series.
        is_left: Whether the force points to the left.
        speed: Speed as a share of the wheel scale.
        c: Constants of the run.
        wheels: As for `drive`.

    Returns:
        False, and nothing is written, if the turn is not soft or the commands depend on the last digits of `size`.
    """
    share = 1.0 - size * c.per_soft_turn
    if share < 1e-6:
        return False
    slow = speed * share
    fast = speed * (2.0 - share)
    margin = speed * _MARGIN
    slow_wheel = np.float32(slow - margin)
    fast_wheel = np.float32(fast - margin)
    if slow_wheel != np.float32(slow + margin) or fast_wheel != np.float32(fast + margin):
        return False
    wheels[0] = slow_wheel if is_left else fast_wheel
    wheels[1] = fast_wheel if is_left else slow_wheel
    return True


@part
def _next_wander_deg(angle_deg: float, c: np.record, u: float) -> float:
    """Angle of the next wander force: fmod(w + U(-m, m), m)."""
    most = c.wander_max_change_deg
    moved = angle_deg + most * (2.0 * u - 1.0)
    size = abs(moved)
    if size >= 2.0 * most:
        return np.fmod(moved, most)
    # Up to twice the modulus one exact subtraction gives what fmod gives.
    return math.copysign(size - most, moved) if size >= most else moved


@kernel
def wander(robot: np.record, c: np.record, u: float) -> tuple[float, float]:
    """Wander force: towards a point on a circle that is centred a little behind the robot.

        d = R (cos w, sin w) - (D, 0);   force = speed d / |d|;   w <- fmod(w + U(-m, m), m) for the next call

    The truncated modulus keeps |w| < m with its sign, so turns are correlated but bounded.

    Args:
        robot: Its `wander_deg` is w, updated here.
        c: Constants of the run.
        u: Uniform draw in [0, 1) for the next angle.
    """
    angle = math.radians(robot.wander_deg)
    x = c.wander_circle_radius * math.cos(angle) - c.wander_circle_distance
    y = c.wander_circle_radius * math.sin(angle)
    robot.wander_deg = _next_wander_deg(robot.wander_deg, c, u)
    share = c.wander_speed_mps / math.sqrt(x * x + y * y)
    return share * x, share * y


@kernel
def wander_freely(robot: np.record, c: np.record, u: float, wheels: Row) -> bool:
    """Do what `wander` and then `drive` would do, where there is no other force; the angle comes from a series in w.

    Args:
        robot: As for `wander`.
        c: Constants of the run; `parameters.wander_series` makes the coefficients.
        u: As for `wander`.
        wheels: As for `drive`.

    Returns:
        False, and nothing has happened, if the series may differ from them.
    """
    if not c.has_wander_series:
        return False
    size = abs(robot.wander_deg)
    square = size * size
    step = square * square
    even = c.wander_series_0 + step * (c.wander_series_2 + step * c.wander_series_4)
    odd = c.wander_series_1 + step * (c.wander_series_3 + step * c.wander_series_5)
    if not _drive_arc(size * (even + square * odd), robot.wander_deg > 0.0, c.wander_wheel_share, c, wheels):
        return False
    robot.wander_deg = _next_wander_deg(robot.wander_deg, c, u)
    return True


@part
def avoidance(x: float, y: float, c: np.record) -> tuple[float, float]:
    """Avoidance force: exactly opposite to the summed proximity vector (x, y), which must not be zero."""
    share = -c.avoidance_speed_mps / math.sqrt(x * x + y * y)
    return share * x, share * y


@kernel
def phototaxis(light: Row, c: np.record) -> tuple[float, float]:
    """Force towards the vector sum of the 24 light readings; straight ahead in the dark."""
    x, y = ring_sum(light)
    length = math.sqrt(x * x + y * y)
    if length == 0.0:
        return c.phototaxis_speed_mps, 0.0
    share = c.phototaxis_speed_mps / length
    return share * x, share * y


@kernel
def arrival(robot: np.record, x: float, y: float, cos: float, sin: float, c: np.record) -> tuple[float, float]:
    """Arrival force towards the robot's goal, slowing down near it.

        length = arrival_speed                                     if d > slowing_radius
                 max(slowest_arrival, arrival_speed d / radius)    else;  d = distance to the goal

    Args:
        robot: Its `goal_x_m`, `goal_y_m` is the goal; `is_slowing` (d <= radius) is set here.
        x: Robot position, m.
        y: Robot position, m.
        cos: Cosine of the heading.
        sin: Sine of the heading.
        c: Constants of the run.
    """
    dx = robot.goal_x_m - x
    dy = robot.goal_y_m - y
    distance = math.sqrt(dx * dx + dy * dy)
    robot.is_slowing = distance <= c.slowing_radius_m
    length = c.arrival_speed_mps
    if robot.is_slowing:
        length = max(c.slowest_arrival_mps, length * distance / c.slowing_radius_m)
    if distance == 0.0:
        return length, 0.0
    share = length / distance
    return share * (dx * cos + dy * sin), share * (dy * cos - dx * sin)


@part
def recovery(c: np.record) -> tuple[float, float]:
    """Recovery force: straight ahead."""
    return c.recovery_speed_mps, 0.0


@part
def is_standing(wheel_speed: Row, c: np.record) -> bool:
    """Return whether the mean of two wheel readings means standing, spinning on the spot or driving backwards."""
    return 0.5 * (wheel_speed[0] + wheel_speed[1]) * c.wheel_scale_mps <= c.standing_speed_mps


@kernel
def drive(x: float, y: float, c: np.record, wheels: Row) -> None:
    """Turn the summed force into wheel commands, as shares of the wheel scale.

        base = min(|F|, max_speed),  a = angle of F
        |a| <= soft turn:  slow wheel = base s,  fast wheel = base (2 - s),  s = (soft turn - |a|) / soft turn
        else:              slow wheel = -max_speed,  fast wheel = +max_speed (turn on the spot, whatever |F|)

    The left wheel is the slow one for a > 0. Throttling is the environment's business.

    Args:
        x: Summed force, forward, m/s.
        y: Summed force, left, m/s.
        c: Constants of the run.
        wheels: (2,) or longer float32, the first two are written: left, right.
    """
    side = abs(y)
    if side < _STEEPEST * x:
        speed = min(math.sqrt(x * x + y * y), c.max_speed_mps) * c.per_wheel_scale
        if _drive_arc(_arctangent(side / x), y > 0.0, speed, c, wheels):
            return
    elif side > 0.0 and c.soft_turn_rad < _STEEPEST_RAD:
        turn = c.max_speed_mps / c.wheel_scale_mps
        wheels[0] = -turn if y > 0.0 else turn
        wheels[1] = turn if y > 0.0 else -turn
        return
    angle = math.atan2(y, x)
    size = abs(angle)
    if size <= c.soft_turn_rad:
        base = min(math.sqrt(x * x + y * y), c.max_speed_mps)
        share = (c.soft_turn_rad - size) / c.soft_turn_rad
        slow = base * share
        fast = base * (2.0 - share)
    else:
        slow = -c.max_speed_mps
        fast = c.max_speed_mps
    if angle > 0.0:
        wheels[0] = slow / c.wheel_scale_mps
        wheels[1] = fast / c.wheel_scale_mps
    else:
        wheels[0] = fast / c.wheel_scale_mps
        wheels[1] = slow / c.wheel_scale_mps
