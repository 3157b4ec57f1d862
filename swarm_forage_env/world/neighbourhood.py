"""What robots perceive of each other: the nearest of them, and messages; where a scenario has them.

Both are off in the paper's worlds. They are called after the compiled tick, only where somebody reads them, so that
other worlds are not slowed down.
"""

from collections.abc import Collection

import numpy as np

from swarm_forage_env.contract.layout import MESSAGES, NEIGHBOURS, ObservationLayout
from swarm_forage_env.contract.policy import COMMANDS
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.scenarios.config import RobotConfig
from swarm_forage_env.world.kernels.bins import bin_robots
from swarm_forage_env.world.kernels.neighbourhood import hear, see_neighbours
from swarm_forage_env.world.state import SwarmState

_CELL_SLACK = 1.0 + 1e-9
"""Cells are this much larger than the range, so that no rounding puts a robot in range two cells away."""


class Neighbourhood:
    """Sensors of neighbours and messages of one run, with bins of their own: those of proximity are 0.27 m wide."""

    def __init__(self, robots: RobotConfig, layout: ObservationLayout, reads: Collection[str]) -> None:
        """Allocate what the slices need that are read.

        Args:
            robots: Says how many neighbours are seen, how long a message is, and how far.
            layout: Tells the columns.
            reads: Names of the slices that are read.
        """
        n_robots = robots.n_robots
        self._sees = robots.neighbours_seen > 0 and NEIGHBOURS in reads
        self._hears = robots.message_size > 0 and MESSAGES in reads
        self.is_used = self._sees or self._hears
        """Whether there is anything to sense."""
        self._starts = tuple(layout.part(name).start if name in layout.names else -1 for name in (NEIGHBOURS, MESSAGES))
        self._neighbour_range_m, self._message_range_m = robots.neighbour_range_m, robots.message_range_m
        ranges = (robots.neighbour_range_m if self._sees else 0.0, robots.message_range_m if self._hears else 0.0)
        n_bins = 1 << max(4, (4 * n_robots - 1).bit_length()) if self.is_used else 0
        self._bins: tuple[float, IntArray, IntArray] = (
            max(ranges) * _CELL_SLACK,
            np.full(n_bins, -1, np.int32),
            np.full(n_robots, -1, np.int32),
        )
        n_seen = robots.neighbours_seen
        self._nearest: tuple[FloatArray, IntArray] = np.zeros(n_seen), np.zeros(n_seen, np.int32)
        self._said: ObsArray = np.zeros((n_robots, robots.message_size), np.float32)
        self._speaks: BoolArray = np.zeros(n_robots, np.bool_)
        self._total: FloatArray = np.zeros(robots.message_size)

    def listen(self, actions: ActionArray, active: BoolArray) -> None:
        """Take what is said in a tick.

        Args:
            actions: (N, A) of the tick.
            active: (N,) robots at work; only these say something.
        """
        if self._hears:
            self._speaks[:] = active
            self._said[:] = np.where(active[:, None], np.clip(actions[:, COMMANDS:], -1.0, 1.0), 0.0)

    def sense(self, swarm: SwarmState, obs: ObsArray) -> None:
        """Write the columns of neighbours and messages in `obs` (N, D), for the robots where they are now."""
        bins = self._bins
        bin_robots(swarm.position, swarm.present, *bins)
        if self._sees:
            see_neighbours(
                swarm.position,
                swarm.facing,
                swarm.present,
                swarm.carried_object,
                bins,
                self._neighbour_range_m,
                self._nearest,
                obs,
                self._starts[0],
            )
        if self._hears:
            hear(
                swarm.position,
                swarm.present,
                bins,
                self._message_range_m,
                self._said,
                self._speaks,
                self._total,
                obs,
                self._starts[1],
            )
