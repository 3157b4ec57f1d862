"""OraclePolicy: what robots could do that see the whole world. It shows how near to the limit a swarm can come.

It is no contestant: it takes the places of robots and objects from the world, which no robot can do. A run gives the
world to a policy that has the method `see_world`, see `contract.policy.Policy`.

Its rules (ours, the simplest that we know): an empty robot drives straight to the nearest free object that no other
robot has chosen, a robot with an object straight to the nearest nest; whoever has another robot in the way leaves it on
the left, so that robots pass each other on the right.
"""

from typing import Any, ClassVar

import numpy as np
from scipy.spatial import KDTree

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Grip, ObjectStatus
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, IntArray, ObsArray

LOOK_AHEAD_M = 1.0
"""How far ahead a robot looks for others, between centres (our choice: a tenth more or less changes nothing)."""
CLEARANCE_M = 0.20
"""How far apart centres pass (our choice: a diameter of 0.17 m and a little)."""
CLOSING = 0.2
"""Share of full speed above which a robot counts as coming nearer; one that drives ahead in a column does not."""
INSET_M = 0.04
"""How far inside its edge a robot aims for a cell or a nest (our choice: two ticks of driving)."""


class OraclePolicy:
    """Sees the whole world; not a contestant.

    It drives to the nearest free object and straight home, and passes other robots on the right.
    """

    reads: ClassVar[tuple[str, ...]] = ()
    caches: ClassVar[str] = "none"
    """Kind of caches that it is made for."""

    def reset(self, spec: SwarmSpec, rng: np.random.Generator) -> None:
        """Forget what robots have chosen, and the world."""
        self._spec = spec
        self._nests: FloatArray = np.array(spec.nest_boxes_m)
        self._chosen: IntArray = np.full(spec.n_robots, -1, np.int32)
        self._actions: ActionArray = np.zeros((spec.n_robots, spec.action_size), np.float32)
        self._world: Any = None

    def see_world(self, world: Any) -> None:
        """Take the world of this run, a `ForageEnv` that is only read."""
        self._world = world

    def act(self, obs: ObsArray, active: BoolArray) -> ActionArray:
        """Choose actions; observations are not looked at. The returned (N, A) array is reused by the next call.

        Raises:
            ConfigError: nobody gave it the world; only runs do.
        """
        if self._world is None:
            raise ConfigError(
                "Expected a run that gives the oracle its world, got none: it drives whole swarms in runs, films and "
                "replays, and no environments of your own."
            )
        swarm, objects = self._world.swarm, self._world.objects
        carries = swarm.carried_object >= 0
        chosen = self._chosen
        chosen[~active | carries | (objects.status[chosen] != ObjectStatus.FREE)] = -1
        self._choose(np.flatnonzero(active & ~carries & (chosen < 0)).astype(np.int32))
        moves = active & (carries | (chosen >= 0))
        way = np.where(carries[:, None], self._ways_home(), self._ways_to_objects())
        wanted = self._passing(np.arctan2(way[:, 1], way[:, 0]), np.hypot(way[:, 0], way[:, 1]), moves)
        self._drive(_turned(wanted - swarm.heading), moves)
        self._actions[:, 2] = np.where(carries, Grip.DELIVER, Grip.GRASP)
        return self._actions

    def _choose(self, rows: IntArray) -> None:
        """Give each of the robots `rows` the nearest free object that nobody has chosen; of rivals the nearest has it.

        A round for all robots at once gives each object to one of them at most; those left out try the next round.
        """
        objects, position = self._world.objects, self._world.swarm.position
        if not len(rows):
            return
        is_free = objects.status == ObjectStatus.FREE
        is_free[self._chosen[self._chosen >= 0]] = False
        free = np.flatnonzero(is_free)
        while len(rows) and len(free):
            middles = (objects.cell[free] + 0.5) * self._spec.cell_m
            square = ((position[rows, None] - middles) ** 2).sum(axis=2)
            nearest = square.argmin(axis=1)
            by_object = np.lexsort((square[np.arange(len(rows)), nearest], nearest))
            winners = by_object[np.unique(nearest[by_object], return_index=True)[1]]
            self._chosen[rows[winners]] = free[nearest[winners]]
            rows, free = np.delete(rows, winners), np.delete(free, nearest[winners])

    def _ways_to_objects(self) -> FloatArray:
        """Return the way from each robot to the nearest point in the cell of its object, (N, 2) m."""
        position = self._world.swarm.position
        low = self._world.objects.cell[self._chosen] * self._spec.cell_m
        return np.clip(position, low + INSET_M, low + self._spec.cell_m - INSET_M) - position

    def _ways_home(self) -> FloatArray:
        """Return the way from each robot to the nearest point in a nest, (N, 2) m."""
        position = self._world.swarm.position
        low, high = self._nests[:, None, :2] + INSET_M, self._nests[:, None, 2:] - INSET_M
        ways = np.clip(position, low, high) - position
        return ways[(ways**2).sum(axis=2).argmin(axis=0), np.arange(len(position))]

    def _passing(self, wanted: FloatArray, far_m: FloatArray, moves: BoolArray) -> FloatArray:
        """Return the directions (N,) in rad that leave robots in the way on the left.

        Robot j is in the way of robot i if it is nearer than the goal, comes nearer, and would come within the
        clearance of the straight way. Then i drives along the tangent to the circle of the clearance around j, on its
        right. Of several tangents the rightmost counts.

        Args:
            wanted: (N,) directions of the straight ways.
            far_m: (N,) their lengths.
            moves: (N,) whether a robot drives.
        """
        swarm = self._world.swarm
        present = np.flatnonzero(swarm.present)
        pairs = present[KDTree(swarm.position[present]).query_pairs(LOOK_AHEAD_M, output_type="ndarray")]
        robot, other = np.concatenate((pairs, pairs[:, ::-1])).T
        x, y = (swarm.position[other] - swarm.position[robot]).T
        bearing, distance = np.arctan2(y, x), np.hypot(x, y)
        aside = _turned(bearing - wanted[robot])
        closing = moves[robot] * np.cos(aside) - moves[other] * np.cos(bearing - wanted[other])
        half = np.arcsin(np.minimum(1.0, CLEARANCE_M / np.maximum(distance, CLEARANCE_M)))
        is_between = distance < far_m[robot] + CLEARANCE_M
        blocks = moves[robot] & is_between & (closing > CLOSING) & (np.abs(aside) < half)
        turn = np.zeros(len(wanted))
        np.minimum.at(turn, robot[blocks], (aside - half)[blocks])
        return wanted + turn

    def _drive(self, turn: FloatArray, moves: BoolArray) -> None:
        """Write the wheels of robots that turn by these angles (N,) in rad, and drive as far as they look there."""
        spec = self._spec
        speed = spec.max_speed_mps * moves * np.maximum(0.0, np.cos(turn))
        most = spec.max_wheel_difference_mps
        difference = np.clip(turn * spec.wheel_base_m / spec.dt_s, -most, most) * moves
        self._actions[:, 0] = (speed - 0.5 * difference) / spec.wheel_scale_mps
        self._actions[:, 1] = (speed + 0.5 * difference) / spec.wheel_scale_mps


def _turned(angle: FloatArray) -> FloatArray:
    """Return angles in [-pi, pi]."""
    return angle - 2.0 * np.pi * np.round(angle / (2.0 * np.pi))
