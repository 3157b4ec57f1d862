"""Robots as discs in compiled code: what `world.physics` does with Chipmunk, with the same model of contact.

Chipmunk is for bodies of every kind; this is for equal discs in a rectangle, and takes the neighbours that proximity
sensing found. Only robots that can touch something within the tick are moved in substeps.
`swarm_forage_env/world/kernels/bodies.py` says how contacts are resolved.
"""

from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import direct
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.kernels.bodies import WALLS, Memory, Work, move_bodies, tell_poses
from swarm_forage_env.world.physics import PARKED_M, room_of_centres
from swarm_forage_env.world.state import SwarmState

PAIRS_PER_ROBOT = 8
"""Room for pairs at the start, per robot. About six equal discs fit around one, and each pair is held once; it grows
where more than that lie on top of each other."""


class Bodies:
    """Bodies of one run, with the methods of `physics.Physics`.

    Attributes:
        twist: (N + 1, 3) float64 to be filled before `advance`: velocity x, y in m/s and turn rate in rad/s.
            The last row belongs to nobody; it is that of Chipmunk's static body.
    """

    def __init__(
        self,
        config: ScenarioConfig,
        position: FloatArray,
        heading: FloatArray,
        near: BoolArray,
        bins: tuple[float, IntArray, IntArray],
    ) -> None:
        """Create one disc per robot.

        Args:
            config: The scenario.
            position: (N, 2) m.
            heading: (N,) rad.
            near: (N,) who has anything within reach; read in every `advance`, so keep it up to date.
            bins: Robots by place as they stand: cell size in m, first_in_bin, next_in_bin; likewise.
        """
        n_robots = len(heading)
        self.twist: FloatArray = np.zeros((n_robots + 1, 3))
        self._poses = np.zeros((n_robots + 1, 3))
        self._poses[:-1, :2], self._poses[:-1, 2] = position, heading
        self._near, self._bins = near, bins
        self._room = room_of_centres(config)
        self._shape = (config.robots.radius_m, config.dt_s, len(config.physics_substeps))
        self._make_room(PAIRS_PER_ROBOT * n_robots)
        self._memory: Memory = np.zeros(1, np.int32), np.zeros((len(self._work[-1]), 3))
        self._move = direct(move_bodies, *self._arguments(near))
        self._tell = direct(tell_poses, self._poses, near, self._poses, np.zeros(n_robots), self._poses)

    def _make_room(self, n_pairs: int) -> None:
        """Make arrays for so many pairs; the old ones hold nothing that is needed."""
        n_robots = len(self.twist) - 1
        n_contacts = n_pairs + WALLS * n_robots
        self._pairs: IntArray = np.zeros((n_pairs, 2), np.int32)
        self._work: Work = (
            np.zeros((n_robots, 5)),
            np.zeros(n_robots, np.int32),
            np.zeros(n_robots, np.bool_),
            np.zeros((n_contacts, 2), np.int32),
            np.zeros((n_contacts, 7)),
        )

    def advance(self, swarm: SwarmState) -> None:
        """Move all bodies by one tick along `twist` and write position, heading and facing of present robots."""
        while (n_pairs := self._move(*self._arguments(swarm.present))) > len(self._pairs):
            self._make_room(2 * n_pairs)
            n_before, before = self._memory
            self._memory = n_before, np.zeros((len(self._work[-1]), 3))
            self._memory[1][: len(before)] = before
        self._tell(self._poses, swarm.present, swarm.position, swarm.heading, swarm.facing)

    def _arguments(self, present: BoolArray) -> tuple[Any, ...]:
        """What `move_bodies` takes."""
        where = (self._poses, self.twist, present, self._near, self._bins, self._room)
        return (*where, *self._shape, self._pairs, self._work, self._memory)

    def poses(self) -> FloatArray:
        """Poses of all bodies, (N + 1, 3): x, y in m and unwrapped angle in rad; `advance` edits them."""
        return self._poses

    def park(self, row: int) -> None:
        """Take a robot's body out of the world: far outside, where Chipmunk has it too. Absent robots touch nothing."""
        self._poses[row, :2] = PARKED_M - row, PARKED_M

    def place(self, row: int, x: float, y: float, angle: float) -> None:
        """Put a robot's body (back) into the world at a pose in m and rad."""
        self._poses[row] = x, y, angle
