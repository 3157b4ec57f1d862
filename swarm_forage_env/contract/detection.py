"""Four decisions from raw readings: obstacle, nest, object, cache. Pure functions of one robot's readings.

The environment applies them to true readings (interference), policies to what they see. All are compiled, so
that controllers can call them inside their own kernels; each takes one row of readings and returns a bool.
Sources: the robot model of the paper's study (field of view, thresholds and grey bands of its sensors).
"""

import math

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.layout import GROUND_SENSORS, RING_SENSORS
from swarm_forage_env.contract.types import ObsArray

OBSTACLE_ANGLE_RAD = 2.61
"""Half the field of view: what a summed proximity vector outside [-2.61, 2.61] rad shows is behind the robot."""
OBSTACLE_LENGTH = 0.1
"""A summed proximity vector longer than this, within the field of view, is an obstacle."""
NEST_GREY = (0.6, 0.8)
OBJECT_GREY = (-0.05, 0.05)
CACHE_GREY = (0.3, 0.5)

BEAM_ANGLES_RAD = np.deg2rad(7.5 + 15.0 * np.arange(RING_SENSORS))
"""Body-frame angles of the proximity beams and of the light sensors, counter-clockwise from straight ahead."""
_HALF_RING = RING_SENSORS // 2
_CANCELLED = 1e-12
_BEAM_COS = np.cos(BEAM_ANGLES_RAD)
_BEAM_SIN = np.sin(BEAM_ANGLES_RAD)


@kernel
def ring_sum(readings: ObsArray) -> tuple[float, float]:
    """Sum the readings of one ring as polar vectors; returns the body-frame vector (forward, left)."""
    x = 0.0
    y = 0.0
    for k in range(_HALF_RING):  # opposite sensors are paired, so that equal readings cancel exactly
        difference = np.float64(readings[k]) - np.float64(readings[k + _HALF_RING])
        x += difference * _BEAM_COS[k]
        y += difference * _BEAM_SIN[k]
    return x, y


@kernel
def ring_is_empty(readings: ObsArray) -> bool:
    """Return whether all readings of one ring are zero; if so, `ring_sum` is (0, 0), and needs no computing.

    The readings must be float32. Negative zeros count as something, which is correct but slower.
    """
    bits = readings.view(np.uint32)  # whole numbers are combined faster than others are compared
    something = np.uint32(0)
    for k in range(RING_SENSORS):
        something |= bits[k]
    return something == 0


@kernel
def is_obstacle_vector(x: float, y: float, behind_counts: bool) -> bool:
    """Obstacle rule on a summed proximity vector (x, y): long, and within the field of view.

    Under the quirk `obstacle_behind_counts` anything behind is an obstacle, too, however weak.
    """
    length_squared = x * x + y * y
    is_long = length_squared > OBSTACLE_LENGTH * OBSTACLE_LENGTH
    if is_long == behind_counts:  # wherever it is; to know where takes time
        return is_long
    # Equal obstacles on opposite sides cancel up to rounding; what is left points anywhere.
    if x < 0.0 and length_squared > _CANCELLED and abs(math.atan2(y, x)) > OBSTACLE_ANGLE_RAD:
        return behind_counts
    return is_long


@kernel
def sees_obstacle(proximity: ObsArray, behind_counts: bool) -> bool:
    """Return whether one ring of proximity readings means an obstacle; see `is_obstacle_vector`."""
    if ring_is_empty(proximity):
        return False
    x, y = ring_sum(proximity)
    return is_obstacle_vector(x, y, behind_counts)


@part
def _count_in_band(ground: ObsArray, low: float, high: float) -> int:
    count = 0
    for k in range(GROUND_SENSORS):
        # 1e-6 absorbs the rounding of float32 readings at the edge of a band.
        if low - 1e-6 <= ground[k] <= high + 1e-6:
            count += 1
    return count


@kernel
def sees_nest(ground: ObsArray) -> bool:
    """Return whether at least 3 of 4 ground readings show the nest."""
    return _count_in_band(ground, NEST_GREY[0], NEST_GREY[1]) >= 3


@kernel
def sees_object(ground: ObsArray) -> bool:
    """Return whether all 4 ground readings show an object."""
    return _count_in_band(ground, OBJECT_GREY[0], OBJECT_GREY[1]) == 4


@kernel
def sees_cache(ground: ObsArray) -> bool:
    """Return whether at least 3 of 4 ground readings show a cache."""
    return _count_in_band(ground, CACHE_GREY[0], CACHE_GREY[1]) >= 3
