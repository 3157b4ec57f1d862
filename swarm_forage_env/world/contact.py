"""Touching robots: driven by wheel motors of limited force, they neither stand for ever nor push at full speed.

For a touching pair let c_i and c_j be the commanded speeds of i and j towards each other. They press if
c_i + c_j > 0. Then both move along the line from i to j with one common speed:

    first tick of pressing:  u = (c_i - c_j) / 2
    later ticks:             u = clip(u of the tick before, -c_j, c_i)

but |u| is at least 0.3 mm/s while the commands allow it, so that equally strong robots do not stand for ever.

Velocities across that line and turn rates stay as commanded. The common speed is forgotten when the pair no longer
presses. This is what a pair of velocity motors of limited force does: pressed together both are at their limit, the
forces cancel, and the pair keeps the speed it has. So the robot that came faster shoves the other one back. Were
each tick to start from the commands alone, two robots after one object would stand against each other for ever.

The engine comes after that. It stops who still runs into somebody, and undoes overlap.
"""

import numpy as np

from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.kernels.contact import press
from swarm_forage_env.world.state import SwarmState

TOUCH_SLACK_M = 0.001
"""Gap within which two robots still touch: what the engine leaves when it undoes an overlap does not part a pair."""
PARTNER_SLOTS = 8
"""Pairs remembered per robot. Six equal discs fit around one; two more are for robots that overlap."""


class Contact:
    """Common speeds of the pairs of one run; made anew at reset."""

    def __init__(self, config: ScenarioConfig) -> None:
        """Start with no pair in touch."""
        n_robots = config.robots.n_robots
        self._touch_m = 2 * config.robots.radius_m + TOUCH_SLACK_M
        self._memory = _empty_memory(n_robots)
        self._next_memory = _empty_memory(n_robots)
        self._command: FloatArray = np.zeros((n_robots, 2))

    def apply(
        self, swarm: SwarmState, near: BoolArray, bins: tuple[float, IntArray, IntArray], twist: FloatArray
    ) -> None:
        """Edit the velocities of robots that press against others.

        Args:
            swarm: Read: position, present.
            near: (N,) who has anything within reach; others are skipped.
            bins: Robots by place as they stand now: cell size in m, first_in_bin, next_in_bin.
            twist: (N + 1, 3) commanded world velocity x, y in m/s and turn rate in rad/s.
        """
        press(
            swarm.position,
            swarm.present,
            near,
            bins,
            self._touch_m,
            self._memory,
            self._next_memory,
            self._command,
            twist,
        )
        self._memory, self._next_memory = self._next_memory, self._memory


def _empty_memory(n_robots: int) -> tuple[IntArray, IntArray, FloatArray]:
    return (
        np.zeros(n_robots, np.int32),
        np.full((n_robots, PARTNER_SLOTS), -1, np.int32),
        np.zeros((n_robots, PARTNER_SLOTS)),
    )
