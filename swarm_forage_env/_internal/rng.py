"""Named random streams: every source of chance has its own generator, derived from one seed.

Draw for all rows and mask afterwards: then a death, a malfunction or an additional wrapper never shifts
the randomness of another robot, and runs that share a seed stay paired.
"""

from enum import IntEnum

import numpy as np


class Stream(IntEnum):
    """Stream numbers. They are part of every stored result: never renumber, only append."""

    PLACEMENT = 0
    START_POSE = 1
    OBJECT_MOTION = 2
    INTERACTION = 3
    CACHE = 4
    POLICY = 5
    SENSOR_NOISE = 6
    ACTUATOR_NOISE = 7
    POPULATION = 8


def stream_rng(seed: int, stream: Stream) -> np.random.Generator:
    """Return the generator of one named stream.

    Args:
        seed: Run seed, a non-negative integer.
        stream: Which source of chance the generator serves.
    """
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(seed, spawn_key=(int(stream),))))
