"""The only file that knows pymunk: robots are discs in Chipmunk, read and written in batch.

Facts this file relies on, each held by a test:

* Chipmunk moves bodies first and resolves contacts afterwards, so a contact is met one substep late. How a tick is
  divided bounds how deep robots push into each other. It undoes an overlap in the substep after the one it saw it in,
  at a speed worked out for the length of the first: substeps are equal. `tests/science/test_physics_convergence.py`
  shows the choice.
* In a crowd that is pushed against a wall the solver does not come to rest, and bodies end a tick a little inside the
  wall or a box. They are put back onto the floor at the end of the tick, so that nobody ever comes through.
* A batch lists dynamic bodies in the order they were added, then the space's static body. Bodies are never removed
  (removal would reorder them): a robot that leaves the world is parked, out of reach and colliding with nothing.
* Chipmunk's search tree pads each box by what the body covers in 0.1 time units. Speeds are of the order of
  0.1 m/s, so that in seconds nearly every body leaves its box in every tick. Time is therefore counted in units of
  `TIME_UNIT_S`, which changes no trajectory and makes a step several times cheaper.
* A space cannot be copied such that the copy goes on bit for bit: what Chipmunk remembers of contacts, and the order of
  its search tree, are out of reach.
"""

from typing import NoReturn

import numpy as np
import pymunk
import pymunk.batch

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.world.bodies import PARKED_M, obstacle_rows, room_of_centres
from swarm_forage_env.world.kernels.bodies import COLLISION_SLOP_M, FRICTION, WALL_INSET_M
from swarm_forage_env.world.kernels.drive import hold_inside, unpack_poses
from swarm_forage_env.world.kernels.obstacles import hold_outside
from swarm_forage_env.world.snapshots import SnapshotError
from swarm_forage_env.world.state import SwarmState

TIME_UNIT_S = 40.0
"""Seconds per Chipmunk time unit."""
MASS_KG = 1.6
WALL_RADIUS_M = 0.2
"""Half the thickness of a wall."""
ITERATIONS = 80
"""Rounds of Chipmunk's solver per substep; only contacts cost. Mean of the deepest overlap per tick of 512 robots,
packed into a corner, that all push into it, as a share of a diameter: 10 rounds (its default) or 20: 0.93, which is one
robot on top of another; 40 rounds 0.04, 80 rounds 0.01. 1,000 robots pile up at 60 rounds, too."""

_POSE = pymunk.batch.BodyFields.POSITION | pymunk.batch.BodyFields.ANGLE
_TWIST = pymunk.batch.BodyFields.VELOCITY | pymunk.batch.BodyFields.ANGULAR_VELOCITY


class ChipmunkBodies:
    """Bodies, walls and boxes of one run. Copies and pickles raise a SnapshotError.

    Attributes:
        twist: (N + 1, 3) float64 to be filled before `advance`: velocity x, y in m/s and turn rate in rad/s.
            The last row belongs to the static body and stays zero.
    """

    def __init__(self, config: ScenarioConfig, position: FloatArray, heading: FloatArray) -> None:
        """Create the space with one disc per robot at `position` (N, 2) m and `heading` (N,) rad."""
        self.twist: FloatArray = np.zeros((len(heading) + 1, 3))
        self._config = config
        self._scaled = np.zeros((len(heading) + 1, 3))
        self._substeps = [config.dt_s / TIME_UNIT_S * share for share in config.physics_substeps]
        self._space = pymunk.Space()
        self._space.collision_slop = COLLISION_SLOP_M
        self._space.collision_bias = 0.0  # any overlap beyond the slop is undone in the next substep
        self._room = room_of_centres(config)
        self._space.iterations = ITERATIONS
        self._add_walls(config)
        self._obstacles = obstacle_rows(config)
        self._add_obstacles()
        self._bodies: list[pymunk.Body] = []
        self._shapes: list[pymunk.Circle] = []
        moment = pymunk.moment_for_circle(MASS_KG, 0.0, config.robots.radius_m)
        for (x, y), angle in zip(position.tolist(), heading.tolist(), strict=True):
            body = pymunk.Body(MASS_KG, moment)
            body.position = (x, y)
            body.angle = angle
            disc = pymunk.Circle(body, config.robots.radius_m)
            disc.friction = FRICTION
            self._space.add(body, disc)
            self._bodies.append(body)
            self._shapes.append(disc)
        self._poses = pymunk.batch.Buffer()
        self._write = pymunk.batch.Buffer()
        self._write.set_float_buf(self._scaled)

    def _add_walls(self, config: ScenarioConfig) -> None:
        x_low, y_low, x_high, y_high = config.arena.interior_m
        outwards = WALL_RADIUS_M - WALL_INSET_M
        west, east = x_low - outwards, x_high + outwards
        south, north = y_low - outwards, y_high + outwards
        corners = [(west, south), (east, south), (east, north), (west, north)]
        for start, end in zip(corners, corners[1:] + corners[:1], strict=True):
            wall = pymunk.Segment(self._space.static_body, start, end, WALL_RADIUS_M)
            wall.friction = FRICTION
            self._space.add(wall)

    def _add_obstacles(self) -> None:
        for x_low, y_low, x_high, y_high in self._obstacles.tolist():
            corners = [(x_low, y_low), (x_high, y_low), (x_high, y_high), (x_low, y_high)]
            box = pymunk.Poly(self._space.static_body, corners, radius=WALL_INSET_M)
            box.friction = FRICTION
            self._space.add(box)

    def advance(self, swarm: SwarmState) -> None:
        """Move all bodies by one tick along `twist` and write position, heading and facing of present robots."""
        present = swarm.present
        np.multiply(self.twist, TIME_UNIT_S, out=self._scaled)
        pymunk.batch.set_space_bodies(self._space, _TWIST, self._write)
        for substep in self._substeps:
            self._space.step(substep)
        poses = self.poses()
        n_moved = hold_inside(poses, present, self._room)
        if len(self._obstacles):
            n_moved += hold_outside(poses, present, self._obstacles, self._room, self._config.robots.radius_m)
        if n_moved:
            pymunk.batch.set_space_bodies(self._space, _POSE, self._poses)
        unpack_poses(poses, present, swarm.position, swarm.heading, swarm.facing)

    def poses(self) -> FloatArray:
        """Poses of all bodies, (N + 1, 3): x, y in m and unwrapped angle in rad; valid until the next call."""
        self._poses.clear()
        pymunk.batch.get_space_bodies(self._space, _POSE, self._poses)
        return np.frombuffer(self._poses.float_buf(), dtype=np.float64).reshape(-1, 3)

    def park(self, row: int) -> None:
        """Take a robot's body out of the world: far outside, colliding with nothing, a metre from other parked ones.

        Bodies parked on one spot would be tested against each other in every substep, only to be told apart by filter.
        """
        body = self._bodies[row]
        self._shapes[row].filter = pymunk.ShapeFilter(categories=0, mask=0)
        body.position = (PARKED_M - row, PARKED_M)
        self._space.reindex_shapes_for_body(body)

    def place(self, row: int, x: float, y: float, angle: float) -> None:
        """Put a robot's body (back) into the world at a pose in m and rad."""
        body = self._bodies[row]
        self._shapes[row].filter = pymunk.ShapeFilter()
        body.position = (x, y)
        body.angle = angle
        self._space.reindex_shapes_for_body(body)

    def __getstate__(self) -> NoReturn:
        """Refuse copies and snapshots, which need the state of the space."""
        raise SnapshotError(
            "Expected physics='compiled' for a snapshot, copy or pickle, got physics='chipmunk': Chipmunk's state "
            "cannot be copied. Make the environment with compiled bodies; runs of the two engines differ."
        )
