"""Several arenas of one scenario, stepped by one call. Each stays where it is; a table tells where its arrays are.

B is the number of arenas. They know nothing of each other: each is stepped by the function that steps a single one.
What is given for all is one of the `held` tuples, for its type; those of the others are at the addresses of the table.
"""

from typing import Any, NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env._internal.held import at
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.world.kernels.bodies import BodyState
from swarm_forage_env.world.kernels.reward import Payment, book_rows, pay
from swarm_forage_env.world.kernels.tick import whole
from swarm_forage_env.world.state import ArenaArrays, SwarmState


@kernel
def whole_each(
    arrays: ArenaArrays,
    bodies: BodyState,
    places: np.ndarray,
    seats: np.ndarray,
    actions: ActionArray,
    wheel_gain: FloatArray,
    ticks: Any,
    look_first: Any,
    chance: FloatArray,
    walk_chance: FloatArray,
    outcomes: np.ndarray,
) -> None:
    """Step arenas, each by `tick.whole`.

    Args:
        arrays: Those of any of the arenas, held.
        bodies: Likewise.
        places: (B, 2) addresses of both, of each arena.
        seats: Which of the B arenas are stepped.
        actions: (B, N, A), and all others as in `tick.whole` with one more dimension in front.
        wheel_gain: (B, N, 2).
        ticks: (B,) int64.
        look_first: (B,) bool.
        chance: (B, N).
        walk_chance: (B, M), or (B, N) where it is not read.
        outcomes: (B,) is written for the arenas that are stepped.
    """
    for seat in range(seats.shape[0]):
        b = seats[seat]
        own_arrays, own_bodies = at(arrays, places[b, 0]), at(bodies, places[b, 1])
        outcomes[b] = whole(
            own_arrays, own_bodies, actions[b], wheel_gain[b], ticks[b], look_first[b], chance[b], walk_chance[b]
        )


@kernel
def pay_each(payment: Payment, places: np.ndarray, seats: np.ndarray, paid: ObsArray) -> None:
    """Add the rewards of a tick, arena by arena, as `reward.pay` does.

    Args:
        payment: Any of the payments, held.
        places: (B,) address of each.
        seats: Which of the B arenas were stepped.
        paid: (B, N) float32.
    """
    for seat in range(seats.shape[0]):
        b = seats[seat]
        pay(at(payment, places[b]), paid[b])


class Robots(NamedTuple):
    """What is booked and copied of an arena."""

    swarm: SwarmState
    dead: BoolArray
    """(N,) for good."""
    obs: ObsArray
    """(N, D)."""


@kernel
def book_each(
    robots: Robots,
    places: np.ndarray,
    reward: ObsArray,
    absent: BoolArray,
    present: BoolArray,
    returns: FloatArray,
    lengths: IntArray,
    terminated: BoolArray,
    active: BoolArray,
    n_terminated: np.ndarray,
    obs: ObsArray,
) -> None:
    """Book a step of learners, arena by arena, as `reward.book_rows` does, and copy the observations.

    Args:
        robots: Those of any of the arenas, held.
        places: (B,) address of each.
        reward: (B, N), and all others as in `book_rows` with one more dimension in front.
        absent: (B, N).
        present: (B, N).
        returns: (B, N).
        lengths: (B, N).
        terminated: (B, N).
        active: (B, N).
        n_terminated: (B,) is written: how many rows of each arena terminate.
        obs: (B, N, D) is written, or (0, N, D) where nobody wants it.
    """
    for b in range(places.shape[0]):
        own = at(robots, places[b])
        seen = own.obs
        n_terminated[b] = book_rows(
            own.swarm,
            own.dead,
            reward[b],
            absent[b],
            present[b],
            returns[b],
            lengths[b],
            terminated[b],
            active[b],
        )
        if obs.shape[0] > 0:
            for i in range(seen.shape[0]):
                for k in range(seen.shape[1]):
                    obs[b, i, k] = seen[i, k]
