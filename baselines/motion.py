"""Steering: forces in the robot's frame, and the drive that turns a summed force into wheel commands.

A force is a desired velocity (forward, left) in m/s. The forces of one tick are added without weights; only `drive`
limits the sum. Compiled, one robot at a time; `c` is the record of `parameters.kernel_constants`.
Source: the steering behaviours and numbers of the paper's study.
"""

import math

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.detection import ring_sum
from swarm_forage_env.contract.types import Row


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
    most = c.wander_max_change_deg
    robot.wander_deg = np.fmod(robot.wander_deg + most * (2.0 * u - 1.0), most)
    share = c.wander_speed_mps / math.sqrt(x * x + y * y)
    return share * x, share * y


@kernel
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


@kernel
def recovery(c: np.record) -> tuple[float, float]:
    """Recovery force: straight ahead."""
    return c.recovery_speed_mps, 0.0


@kernel
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
