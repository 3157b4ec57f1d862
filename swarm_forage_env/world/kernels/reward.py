"""What a tick brings learners: rewards, and what it adds to the episodes of robots.

The terms of a reward are one small function each, for one robot.
"""

import math
from typing import NamedTuple

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.codes import Event
from swarm_forage_env.contract.types import BoolArray, CodeArray, FloatArray, IntArray, ObsArray

_DELIVERED = int(Event.DELIVERED)


class Weights(NamedTuple):
    """Weights of the terms, as in `scenarios.config.RewardConfig`."""

    delivery: float
    first_pickup: float
    nest_progress: float
    interference: float
    tick: float


class Happenings(NamedTuple):
    """What the terms look at, a row per robot."""

    code: CodeArray
    """(N,) `Event` codes."""
    first_picked: BoolArray
    interfering: BoolArray
    carried_object: IntArray
    active: BoolArray
    position: FloatArray
    """(N, 2) m."""
    previous_position: FloatArray
    """(N, 2) m, before the tick."""
    nest_centre_m: FloatArray
    """(2,)."""


class Payment(NamedTuple):
    """Everything that the rewards of a tick are made of, where no function of Python adds to them."""

    happenings: Happenings
    happened: BoolArray
    """(1,) see `world.state.StepEvents`."""
    total: FloatArray
    """(N,) the rewards of the tick."""
    reward: ObsArray
    """(N,) the same, rounded to float32."""
    weights: Weights
    is_dense: bool
    """Whether there may be a reward in a tick in which nothing happened."""


class Robots(NamedTuple):
    """The robots of an arena as they are after a step."""

    dead: BoolArray
    """(N,)"""
    is_present: BoolArray
    """(N,) in the world."""
    is_active: BoolArray
    """(N,) at work."""
    obs: ObsArray
    """(N, D)"""


@kernel
def delivered(h: Happenings, i: int) -> float:
    """1 for a robot that delivered an object to the nest in this tick."""
    return 1.0 if h.code[i] == _DELIVERED else 0.0


@kernel
def picked_first(h: Happenings, i: int) -> float:
    """1 for a robot that picked up an object that no robot had carried since it was placed."""
    return 1.0 if h.first_picked[i] else 0.0


@kernel
def came_nearer(h: Happenings, i: int) -> float:
    """Metres that a carrying robot came closer to the nest centre in this tick."""
    if h.carried_object[i] < 0:
        return 0.0
    return _nest_distance(h, h.previous_position, i) - _nest_distance(h, h.position, i)


@kernel
def _nest_distance(h: Happenings, position: FloatArray, i: int) -> float:
    dx = position[i, 0] - h.nest_centre_m[0]
    dy = position[i, 1] - h.nest_centre_m[1]
    return math.sqrt(dx * dx + dy * dy)


@kernel
def lost_time(h: Happenings, i: int) -> float:
    """1 for a robot in interference."""
    return 1.0 if h.interfering[i] else 0.0


@kernel
def rewards(h: Happenings, weights: Weights, total: FloatArray, reward: ObsArray) -> None:
    """Write the weighted sums to `total` (N,), and rounded to `reward` (N,) float32. Inactive robots receive none."""
    for i in range(total.shape[0]):
        value = weights.delivery * delivered(h, i) + weights.first_pickup * picked_first(h, i)
        if weights.nest_progress != 0.0:
            value += weights.nest_progress * came_nearer(h, i)
        if weights.interference != 0.0:
            value += weights.interference * lost_time(h, i)
        value += weights.tick
        total[i] = value if h.active[i] else 0.0
        reward[i] = total[i]


@kernel
def pay(p: Payment, paid: ObsArray) -> None:
    """Work out the rewards of a tick and add them to `paid` (N,) float32."""
    if p.happened[0] or p.is_dense:
        rewards(p.happenings, p.weights, p.total, p.reward)
    else:
        p.reward[:] = 0.0
    for i in range(paid.shape[0]):
        paid[i] += p.reward[i]


@kernel
def book_rows(
    dead: BoolArray,
    is_present: BoolArray,
    is_active: BoolArray,
    reward: ObsArray,
    absent: BoolArray,
    present: BoolArray,
    returns: FloatArray,
    lengths: IntArray,
    terminated: BoolArray,
    active: BoolArray,
) -> int:
    """Book a step of one arena; returns how many rows terminate.

    Args:
        dead: (N,) robots that are dead after the step.
        is_present: (N,) robots in the world after the step.
        is_active: (N,) robots at work after the step.
        reward: (N,) float32, of this step.
        absent: (N,) rows that had terminated before.
        present: (N,) robots in the world before the step; becomes `is_present`.
        returns: (N,) the sums of rewards grow by `reward`.
        lengths: (N,) int32, grow by 1 where the robot was in the world before the step: if it died, it had begun it.
        terminated: (N,) is written.
        active: (N,) is written.
    """
    n_terminated = 0
    for i in range(dead.shape[0]):
        lengths[i] += present[i]
        returns[i] += reward[i]
        present[i] = is_present[i]
        active[i] = is_active[i]
        terminated[i] = dead[i] and not absent[i]
        n_terminated += terminated[i]
    return n_terminated
