"""Robots as discs in compiled code: what `world.chipmunk` does with Chipmunk, with the same model of contact.

Chipmunk is for bodies of every kind; this is for equal discs among boxes in a rectangle, and takes the neighbours that
proximity sensing found. Only robots that can touch something within the tick are moved in substeps.
`swarm_forage_env/world/kernels/bodies.py` says how contacts are resolved.
"""

from typing import Any

import numpy as np

from swarm_forage_env._internal.compiling import Calls
from swarm_forage_env._internal.held import hold
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.kernels.bodies import WALLS, BodyState, move_bodies, tell_poses
from swarm_forage_env.world.state import SwarmState

PARKED_M = -10.0
"""Where robots are parked: far outside."""
PAIRS_PER_ROBOT = 8
"""Room for pairs at the start, per robot. About six equal discs fit around one, and each pair is held once; it grows
where more than that lie on top of each other."""


class Bodies:
    """Bodies of one run, with the methods of `chipmunk.ChipmunkBodies`.

    Attributes:
        twist: (N + 1, 3) float64 to be filled before `advance`: velocity x, y in m/s and turn rate in rad/s.
            The last row belongs to nobody; it is that of Chipmunk's static body.
        state: Everything that the compiled functions need.
        held: The same, as they take it.
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
        poses = np.zeros((n_robots + 1, 3))
        poses[:-1, :2], poses[:-1, 2] = position, heading
        self._dt_s = float(config.dt_s)
        self._call = Calls()
        obstacles = obstacle_rows(config)
        self.state = BodyState(
            poses=poses,
            near=near,
            bins=bins,
            room=room_of_centres(config),
            obstacles=obstacles,
            radius_m=float(config.robots.radius_m),
            n_substeps=len(config.physics_substeps),
            **_room_for(n_robots, PAIRS_PER_ROBOT * n_robots, WALLS + len(obstacles)),
        )
        self.held = hold(self.state)

    @property
    def n_pairs(self) -> int:
        """Pairs that there is room for."""
        return len(self.state.pairs)

    def make_room(self) -> None:
        """Make room for twice as many pairs; what is remembered of the last tick is kept."""
        before = self.state.memory
        more = _room_for(len(self.twist) - 1, 2 * len(self.state.pairs), WALLS + len(self.state.obstacles))
        n_contacts, contacts = more["memory"]
        n_contacts[:] = before[0]
        contacts[: len(before[1])] = before[1]
        self.state = self.state._replace(**more)
        self.held = hold(self.state)

    def advance(self, swarm: SwarmState) -> None:
        """Move all bodies by one tick along `twist` and write position, heading and facing of present robots."""
        while not self._call(move_bodies, self.state, self.twist, swarm.present, self._dt_s):
            self.make_room()
        self._call(tell_poses, self.state.poses, swarm.present, swarm.position, swarm.heading, swarm.facing)

    def poses(self) -> FloatArray:
        """Poses of all bodies, (N + 1, 3): x, y in m and unwrapped angle in rad; `advance` edits them."""
        return self.state.poses

    def park(self, row: int) -> None:
        """Take a robot's body out of the world: far outside, where Chipmunk has it too. Absent robots touch nothing."""
        self.state.poses[row, :2] = PARKED_M - row, PARKED_M

    def place(self, row: int, x: float, y: float, angle: float) -> None:
        """Put a robot's body (back) into the world at a pose in m and rad."""
        self.state.poses[row] = x, y, angle


def _room_for(n_robots: int, n_pairs: int, n_fixed: int) -> dict[str, Any]:
    """Return the fields of `BodyState` that depend on the numbers of pairs and of walls and boxes, empty."""
    n_contacts = n_pairs + n_fixed * n_robots
    return {
        "pairs": np.zeros((n_pairs, 2), np.int32),
        "work": (
            np.zeros((n_robots, 5)),
            np.zeros(n_robots, np.int32),
            np.zeros(n_robots, np.bool_),
            np.zeros((n_contacts, 2), np.int32),
            np.zeros((n_contacts, 7)),
        ),
        "memory": (np.zeros(1, np.int32), np.zeros((n_contacts, 3))),
    }


def room_of_centres(config: ScenarioConfig) -> FloatArray:
    """Where centres of robots can be whose bodies are inside: x low, y low, x high, y high in m."""
    x_low, y_low, x_high, y_high = config.arena.interior_m
    radius = config.robots.radius_m
    return np.array([x_low + radius, y_low + radius, x_high - radius, y_high - radius])


def obstacle_rows(config: ScenarioConfig) -> FloatArray:
    """Obstacles as kernels take them: (B, 4) x low, y low, x high, y high in m."""
    return np.array(config.arena.obstacles, np.float64).reshape(-1, 4)
