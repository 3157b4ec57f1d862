"""How robots move: wheels of limited speed, and what becomes of it where robots touch.

The differential drive: wheel speed = limit(limit(command) x gain). Commands beyond [-1, 1] are clipped. Centre speed
and wheel difference are limited each by clipping, before the gains of wrappers and again after them: noise makes no
motor faster than it is, and no robot drives through a wall. Wheels of inactive robots and of robots in an interaction
stand still. The rule is `kernels.drive`.

Touching robots, driven by wheel motors of limited force, neither stand for ever nor push at full speed.

For a touching pair let c_i and c_j be the commanded speeds of i and j towards each other. They press if
c_i + c_j > 0. Then both move along the line from i to j with one common speed:

    first tick of pressing:  u = (c_i - c_j) / 2
    later ticks:             u = clip(u of the tick before, -c_j, c_i)

but |u| is at least 0.3 mm/s while the commands allow it, so that equally strong robots do not stand for ever.

Velocities across that line and turn rates stay as commanded. The common speed is forgotten when the pair no longer
presses. This is what a pair of velocity motors of limited force does: pressed together both are at their limit, the
forces cancel, and the pair keeps the speed it has. So the robot that came faster shoves the other one back. Were
each tick to start from the commands alone, two robots after one object would stand against each other for ever.

The rule is `kernels.contact`. The physics comes after that. It stops who still runs into somebody, and undoes overlap.
"""

import numpy as np

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import WHEEL_SCALE_MPS
from swarm_forage_env.world.state import Motion, Touching

TOUCH_SLACK_M = 0.001
"""Gap within which two robots still touch: one that physics leaves when it undoes an overlap does not part a pair."""
PARTNER_SLOTS = 8
"""Pairs remembered per robot. Six equal discs fit around one; two more are for robots that overlap."""


def drive_limits(config: ScenarioConfig) -> FloatArray:
    """Return the array `limits` of the drive kernels: wheel scale, centre-speed limit, difference limit, wheel base."""
    robots = config.robots
    return np.array([WHEEL_SCALE_MPS, robots.max_speed_mps, robots.max_wheel_difference_mps, robots.wheel_base_m])


def new_motion(config: ScenarioConfig, twist: FloatArray) -> Motion:
    """Return what robots are driven with, none of them in touch.

    Args:
        config: The scenario.
        twist: (N + 1, 3) velocities that the bodies take.
    """
    n_robots = config.robots.n_robots
    return Motion(
        twist=twist,
        command=np.zeros((n_robots, 2)),
        drive_limits=drive_limits(config),
        dt_s=float(config.dt_s),
        touch_m=2 * config.robots.radius_m + TOUCH_SLACK_M,
        touching=(_nobody_touching(n_robots), _nobody_touching(n_robots)),
    )


def _nobody_touching(n_robots: int) -> Touching:
    return (
        np.zeros(n_robots, np.int32),
        np.full((n_robots, PARTNER_SLOTS), -1, np.int32),
        np.zeros((n_robots, PARTNER_SLOTS)),
    )
