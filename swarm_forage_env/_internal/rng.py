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


class TickDraws:
    """Uniform numbers in [0, 1), a row for each tick, drawn many ticks at a time: the same numbers in fewer calls."""

    _NUMBERS_AT_ONCE = 4096

    def __init__(self, rng: np.random.Generator, n_numbers: int) -> None:
        """Draw rows of `n_numbers` from a generator that serves nobody else."""
        n_ticks = max(1, self._NUMBERS_AT_ONCE // max(1, n_numbers))
        self._rng = rng
        self._rows = np.zeros((n_ticks, n_numbers))
        self._block = -1

    def row(self, tick: int) -> np.ndarray:
        """Return the row (n_numbers,) float64 of a tick, from 1; ticks are asked for in order, maybe more than once."""
        block, place = divmod(tick - 1, len(self._rows))
        if block != self._block:
            self._rng.random(out=self._rows)
            self._block = block
        return self._rows[place]

    def rows(self, tick: int) -> np.ndarray:
        """Return the rows of a tick and of those after it that are drawn already, at least one."""
        self.row(tick)
        return self._rows[(tick - 1) % len(self._rows) :]
