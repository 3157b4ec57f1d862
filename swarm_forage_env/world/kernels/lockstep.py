"""Several arenas of one scenario, stepped by one call. Each stays where it is; a table tells where its arrays are.

B is the number of arenas. They know nothing of each other: each is stepped by the function that steps a single one.
Only arrays have addresses. Everything else, such as rules, columns and other constants, is that of the arena that is
given for all, so all must be of one scenario.
"""

import itertools
from typing import Any, cast

import numpy as np

from swarm_forage_env._internal import numba_settings  # noqa: F401  (before numba)

# isort: split
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.world.kernels.bodies import BodyState
from swarm_forage_env.world.kernels.reward import Payment, book_rows, pay
from swarm_forage_env.world.kernels.tick import whole
from swarm_forage_env.world.state import ArenaArrays, SwarmState


def _alike(typingctx: Any, like: Any, at: Any) -> Any:  # noqa: ARG001 - numba hands over the types
    """Say how compiled code makes a value of the type of `like` whose arrays have their data at the addresses `at`."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        table = context.make_array(at)(context, builder, value=args[1])
        places = itertools.count()

        def moved(kind: Any, value: Any) -> Any:
            if isinstance(kind, types.BaseTuple):
                fields = enumerate(cast(Any, kind))
                parts = [moved(part, builder.extract_value(value, k)) for k, part in fields]
                return context.make_tuple(builder, kind, parts)
            if not isinstance(kind, types.Array):
                return value
            array = context.make_array(kind)(context, builder, value=value)
            place = context.get_constant(types.intp, next(places))
            array.data = builder.inttoptr(builder.load(builder.gep(table.data, [place])), array.data.type)
            # The memory belongs to whoever made the array; nobody here may free it.
            array.meminfo = cgutils.get_null_value(array.meminfo.type)
            array.parent = cgutils.get_null_value(array.parent.type)
            return array._getvalue()

        return moved(signature.return_type, args[0])

    return like(like, at), generate


alike: Any = intrinsic(_alike)
"""(nested tuples, addresses) -> the same tuples with the arrays that are at these addresses, a row of a table of
`world.lockstep.addresses`; what is no array stays. For compiled code only."""


@kernel
def whole_each(
    parts: tuple[ArenaArrays, BodyState],
    parts_at: np.ndarray,
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
        parts: Those of any of the arenas, with its bodies: gives types, shapes and constants.
        parts_at: (B, arrays) addresses of the arrays of each.
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
        arrays, bodies = alike(parts, parts_at[b])
        outcomes[b] = whole(
            arrays, bodies, actions[b], wheel_gain[b], ticks[b], look_first[b], chance[b], walk_chance[b]
        )


@kernel
def pay_each(payment: Payment, payments_at: np.ndarray, seats: np.ndarray, paid: ObsArray) -> None:
    """Add the rewards of a tick, arena by arena, as `reward.pay` does.

    Args:
        payment: Any of the payments: gives types, shapes and weights.
        payments_at: (B, arrays) addresses of the arrays of each.
        seats: Which of the B arenas were stepped.
        paid: (B, N) float32.
    """
    for seat in range(seats.shape[0]):
        b = seats[seat]
        pay(alike(payment, payments_at[b]), paid[b])


@kernel
def book_each(
    robots: tuple[SwarmState, BoolArray, ObsArray],
    robots_at: np.ndarray,
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
        robots: Those of any of the arenas, who of them is dead for good, and observations: gives types and shapes.
        robots_at: (B, arrays) addresses of the arrays of each.
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
    for b in range(robots_at.shape[0]):
        swarm, dead, seen = alike(robots, robots_at[b])
        n_terminated[b] = book_rows(
            swarm,
            dead,
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
