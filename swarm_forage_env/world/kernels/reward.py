"""What a tick brings learners: rewards, and what it adds to the episodes of robots.

The terms of a reward are one small function each, for one robot.
"""

import math
from typing import NamedTuple

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.codes import Event
from swarm_forage_env.contract.types import FloatArray, ObsArray
from swarm_forage_env.world.state import StepEvents, SwarmState

_DELIVERED = int(Event.DELIVERED)


class Weights(NamedTuple):
    """Weights of the terms, as in `scenarios.config.RewardConfig`."""

    delivery: float
    first_pickup: float
    nest_progress: float
    interference: float
    tick: float


class Payment(NamedTuple):
    """Everything that the rewards of a tick are made of."""

    swarm: SwarmState
    events: StepEvents
    previous_position: FloatArray
    """(N, 2) m, before the tick; kept up to date if a term needs it."""
    nest_centres_m: FloatArray
    """(K, 2)."""
    total: FloatArray
    """(N,) the rewards of the tick."""
    reward: ObsArray
    """(N,) the same, rounded to float32."""
    weights: Weights
    is_dense: bool
    """Whether there may be a reward in a tick in which nothing happened."""


@part
def delivered(p: Payment, i: int) -> float:
    """1 for a robot that delivered an object to the nest in this tick."""
    return 1.0 if p.events.code[i] == _DELIVERED else 0.0


@part
def picked_first(p: Payment, i: int) -> float:
    """1 for a robot that picked up an object that no robot had carried since it was placed."""
    return 1.0 if p.events.first_picked[i] else 0.0


@part
def came_nearer(p: Payment, i: int) -> float:
    """Metres that a carrying robot came closer to the centre of the nearest nest in this tick."""
    if p.swarm.carried_object[i] < 0:
        return 0.0
    before = _to_nearest(p.previous_position, p.nest_centres_m, i)
    return before - _to_nearest(p.swarm.position, p.nest_centres_m, i)


@part
def _to_nearest(position: FloatArray, places: FloatArray, i: int) -> float:
    nearest = math.inf
    for k in range(places.shape[0]):
        dx = position[i, 0] - places[k, 0]
        dy = position[i, 1] - places[k, 1]
        nearest = min(nearest, math.sqrt(dx * dx + dy * dy))
    return nearest


@part
def lost_time(p: Payment, i: int) -> float:
    """1 for a robot in interference."""
    return 1.0 if p.events.interfering[i] else 0.0


@kernel
def rewards(p: Payment) -> None:
    """Write the weighted sums to `total`, and rounded to `reward`. Inactive robots receive none."""
    weights = p.weights
    for i in range(p.total.shape[0]):
        value = weights.delivery * delivered(p, i) + weights.first_pickup * picked_first(p, i)
        if weights.nest_progress != 0.0:
            value += weights.nest_progress * came_nearer(p, i)
        if weights.interference != 0.0:
            value += weights.interference * lost_time(p, i)
        value += weights.tick
        p.total[i] = value if p.swarm.active[i] else 0.0
        p.reward[i] = p.total[i]


@part
def remember(p: Payment) -> None:
    """Keep the positions before a tick, if a term needs them."""
    if p.weights.nest_progress != 0.0:
        for i in range(p.total.shape[0]):
            p.previous_position[i, 0] = p.swarm.position[i, 0]
            p.previous_position[i, 1] = p.swarm.position[i, 1]


@part
def pay(p: Payment, paid: ObsArray) -> None:
    """Work out the rewards of a tick, where no function of Python adds to them, and add them to `paid` (N,) float32."""
    if p.events.happened[0] or p.is_dense:
        rewards(p)
    else:
        p.reward[:] = 0.0
    for i in range(paid.shape[0]):
        paid[i] += p.reward[i]
