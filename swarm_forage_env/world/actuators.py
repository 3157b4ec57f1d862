"""Limits of the differential drive: wheel speed = limit(limit(command) x gain).

Commands beyond [-1, 1] are clipped. Centre speed and wheel difference are limited each by clipping, before the gains of
wrappers and again after them: noise makes no motor faster than it is, and no robot drives through a wall. Wheels of
inactive robots and of robots in an interaction stand still. The rule is `kernels.drive`.
"""

import numpy as np

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.units import WHEEL_SCALE_MPS


def drive_limits(config: ScenarioConfig) -> FloatArray:
    """Return the array `limits` of the drive kernels: wheel scale, centre-speed limit, difference limit, wheel base."""
    robots = config.robots
    return np.array([WHEEL_SCALE_MPS, robots.max_speed_mps, robots.max_wheel_difference_mps, robots.wheel_base_m])
