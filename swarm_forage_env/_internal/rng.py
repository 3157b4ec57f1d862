"""Named random streams: every source of chance has its own generator, derived from one seed.

Draw for all rows and mask afterwards: then a death, a malfunction or an additional wrapper never shifts
the randomness of another robot, and runs that share a seed stay paired.
"""

import math
from collections.abc import Iterable
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
    SCENARIO = 12


def stream_rng(seed: int, stream: Stream, level: Iterable[float] = ()) -> np.random.Generator:
    """Return the generator of one named stream.

    Args:
        seed: Run seed, a non-negative integer.
        stream: Which source of chance the generator serves.
        level: Numbers that tell strengths of a disturbance apart, where each is to have chance of its own.
    """
    bits = (np.array([*level], "<f8") + 0.0).view("<u4")  # + 0.0: what equals 0.0 has its bits
    sequence = np.random.SeedSequence(seed, spawn_key=(int(stream), *bits.tolist()))
    return np.random.Generator(np.random.PCG64(sequence))


class TickDraws:
    """Uniform numbers in [0, 1) for each tick: those of one call of `rng.random` per tick, made in fewer calls."""

    _NUMBERS_AT_ONCE = 8192
    """Drawn in one call: 64 KiB of numbers, which stay in a processor's cache."""

    def __init__(self, rng: np.random.Generator, *shape: int) -> None:
        """Take the generator; nobody else may draw from it from now on.

        Args:
            rng: The generator.
            shape: Of the numbers of one tick.
        """
        self._rng = rng
        self._shape = (max(1, self._NUMBERS_AT_ONCE // max(1, math.prod(shape))), *shape)
        self._rows = np.empty((0, *shape))  # numbers come with the first draw: snapshots hold none that is never used
        self._block = -1

    @property
    def n_ticks(self) -> int:
        """Of how many ticks `rows` returns the numbers at most."""
        return self._shape[0]

    def row(self, tick: int) -> np.ndarray:
        """Return the numbers of a tick, float64 of the given shape.

        Ticks count from 1 and are asked for in order, maybe more than once. Later ones may overwrite the array.
        """
        return self.rows(tick)[0]

    def rows(self, tick: int) -> np.ndarray:
        """Return the numbers (ticks, *shape) of a tick and of those after it that are drawn already, at least one."""
        block, place = divmod(tick - 1, self._shape[0])
        if self._block < 0:
            self._rows = np.empty(self._shape)
        while self._block < block:
            self._rng.random(out=self._rows)
            self._block += 1
        return self._rows[place:]
