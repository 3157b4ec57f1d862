"""Several worlds of one scenario, stepped by one call. Each stays where it is; a table tells where its arrays are.

B is the number of worlds. Worlds know nothing of each other: each is stepped by the function that steps a single one.
Only arrays have addresses. Everything else, such as rules, columns and other constants, is that of the world that is
given for all, so all must be of one scenario. Numbers in brackets are places in a row of the table, which has the
arrays in the order of the fields; `tests/world/test_many.py` compares field by field.
"""

from typing import Any

import numpy as np
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.world.kernels.bodies import BodyState
from swarm_forage_env.world.kernels.interact import InteractionState
from swarm_forage_env.world.kernels.reward import Happenings, Payment, pay
from swarm_forage_env.world.kernels.rows import Robots, book_rows
from swarm_forage_env.world.kernels.tick import whole
from swarm_forage_env.world.kernels.world import Sensors, World


def _array_at(typingctx: Any, like: Any, address: Any) -> Any:  # noqa: ARG001 - numba hands over the types
    """Say how compiled code makes an array of the type and shape of `like` with its data at an address."""

    def generate(context: Any, builder: Any, signature: Any, args: Any) -> Any:
        array = context.make_array(signature.return_type)(context, builder, value=args[0])
        array.data = builder.inttoptr(args[1], array.data.type)
        # The memory belongs to whoever made the array; nobody here may free it.
        array.meminfo = cgutils.get_null_value(array.meminfo.type)
        array.parent = cgutils.get_null_value(array.parent.type)
        return array._getvalue()

    return like(like, types.intp), generate


array_at: Any = intrinsic(_array_at)
"""(array, address) -> an array like it whose data is there; for compiled code only."""


@kernel
def state_at(s: InteractionState, at: np.ndarray) -> InteractionState:
    """State like `s` whose arrays are `at` (28,) these addresses."""
    return InteractionState(
        array_at(s.position, at[0]),
        array_at(s.carried_object, at[1]),
        array_at(s.cargo_from_cache, at[2]),
        array_at(s.pending_kind, at[3]),
        array_at(s.pending_band, at[4]),
        array_at(s.pending_target, at[5]),
        array_at(s.pending_until, at[6]),
        array_at(s.active, at[7]),
        array_at(s.floor, at[8]),
        array_at(s.status, at[9]),
        array_at(s.object_cell, at[10]),
        array_at(s.cache_slot, at[11]),
        array_at(s.carriers, at[12]),
        array_at(s.cache_alive, at[13]),
        array_at(s.cache_cell, at[14]),
        array_at(s.cache_serial, at[15]),
        array_at(s.cache_count, at[16]),
        array_at(s.code, at[17]),
        array_at(s.event_object, at[18]),
        array_at(s.event_cache, at[19]),
        array_at(s.first_picked, at[20]),
        array_at(s.counters, at[21]),
        array_at(s.happened, at[22]),
        array_at(s.displaced, at[23]),
        array_at(s.creators, at[24]),
        array_at(s.queue, at[25]),
        array_at(s.handler_used, at[26]),
        array_at(s.handling_ticks, at[27]),
    )


@kernel
def sensors_at(s: Sensors, at: np.ndarray) -> Sensors:
    """Sensors like `s` whose arrays are `at` (12,) these addresses."""
    return Sensors(
        array_at(s.obs, at[0]),
        array_at(s.near, at[1]),
        (s.bins[0], array_at(s.bins[1], at[2]), array_at(s.bins[2], at[3])),
        s.columns,
        array_at(s.interior, at[4]),
        array_at(s.lights, at[5]),
        s.intensity,
        s.radius_m,
        s.reach_m,
        array_at(s.scales, at[6]),
        s.sizes,
        array_at(s.shares, at[7]),
        array_at(s.obstacles, at[8]),
        s.cache_half_side,
        s.reads_light,
        s.light_of_carriers_only,
        s.reads_ground,
        s.reads_line_of_sight,
        s.behind_counts,
        array_at(s.half_windows, at[9]),
        array_at(s.kinds, at[10]),
        s.kind_start,
        array_at(s.blanks, at[11]),
    )


@kernel
def world_at(w: World, at: np.ndarray) -> World:
    """World like `w` whose arrays are `at` (56,) these addresses, in the order of `world.rack.addresses`."""
    before, now = w.pressing
    return World(
        state_at(w.state, at[:28]),
        w.rules,
        array_at(w.heading, at[28]),
        array_at(w.facing, at[29]),
        array_at(w.wheel_speed, at[30]),
        array_at(w.present, at[31]),
        array_at(w.twist, at[32]),
        array_at(w.command, at[33]),
        array_at(w.drive_limits, at[34]),
        array_at(w.speeds, at[35]),
        w.dt_s,
        w.touch_m,
        (
            (array_at(before[0], at[36]), array_at(before[1], at[37]), array_at(before[2], at[38])),
            (array_at(now[0], at[39]), array_at(now[1], at[40]), array_at(now[2], at[41])),
        ),
        sensors_at(w.sensors, at[42:54]),
        array_at(w.interfering, at[54]),
        array_at(w.interference_sum, at[55]),
        w.wandering,
        w.n_static_caches,
        w.has_caches,
    )


@kernel
def bodies_at(b: BodyState, at: np.ndarray) -> BodyState:
    """Bodies like `b` whose arrays are `at` (14,) these addresses."""
    work, memory = b.work, b.memory
    return BodyState(
        array_at(b.poses, at[0]),
        array_at(b.near, at[1]),
        (b.bins[0], array_at(b.bins[1], at[2]), array_at(b.bins[2], at[3])),
        array_at(b.room, at[4]),
        array_at(b.obstacles, at[5]),
        b.radius_m,
        b.n_substeps,
        array_at(b.pairs, at[6]),
        (
            array_at(work[0], at[7]),
            array_at(work[1], at[8]),
            array_at(work[2], at[9]),
            array_at(work[3], at[10]),
            array_at(work[4], at[11]),
        ),
        (array_at(memory[0], at[12]), array_at(memory[1], at[13])),
    )


@kernel
def whole_each(
    w: World,
    bodies: BodyState,
    worlds_at: np.ndarray,
    bodies_are_at: np.ndarray,
    seats: np.ndarray,
    actions: ActionArray,
    wheel_gain: FloatArray,
    ticks: Any,
    look_first: Any,
    chance: FloatArray,
    walk_chance: FloatArray,
    outcomes: np.ndarray,
) -> None:
    """Step worlds, each by `tick.whole`.

    Args:
        w: Any of the worlds: gives types, shapes and constants.
        bodies: Its bodies.
        worlds_at: (B, 52) addresses of the arrays of each world.
        bodies_are_at: (B, 14) addresses of the arrays of its bodies.
        seats: Which of the B worlds are stepped.
        actions: (B, N, A), and all others as in `tick.whole` with one more dimension in front.
        wheel_gain: (B, N, 2).
        ticks: (B,) int64.
        look_first: (B,) bool.
        chance: (B, N).
        walk_chance: (B, M), or (B, N) where it is not read.
        outcomes: (B,) is written for the worlds that are stepped.
    """
    for seat in range(seats.shape[0]):
        b = seats[seat]
        outcomes[b] = whole(
            world_at(w, worlds_at[b]),
            bodies_at(bodies, bodies_are_at[b]),
            actions[b],
            wheel_gain[b],
            ticks[b],
            look_first[b],
            chance[b],
            walk_chance[b],
        )


@kernel
def payment_at(p: Payment, at: np.ndarray) -> Payment:
    """Payment like `p` whose arrays are `at` (11,) these addresses."""
    h = p.happenings
    return Payment(
        Happenings(
            array_at(h.code, at[0]),
            array_at(h.first_picked, at[1]),
            array_at(h.interfering, at[2]),
            array_at(h.carried_object, at[3]),
            array_at(h.active, at[4]),
            array_at(h.position, at[5]),
            array_at(h.previous_position, at[6]),
            array_at(h.nest_centre_m, at[7]),
        ),
        array_at(p.happened, at[8]),
        array_at(p.total, at[9]),
        array_at(p.reward, at[10]),
        p.weights,
        p.is_dense,
    )


@kernel
def pay_each(p: Payment, payments_at: np.ndarray, seats: np.ndarray, paid: ObsArray) -> None:
    """Add the rewards of a tick, world by world, as `reward.pay` does.

    Args:
        p: Any of the payments: gives types, shapes and weights.
        payments_at: (B, 11) addresses of the arrays of each.
        seats: Which of the B worlds were stepped.
        paid: (B, N) float32.
    """
    for seat in range(seats.shape[0]):
        b = seats[seat]
        pay(payment_at(p, payments_at[b]), paid[b])


@kernel
def book_each(
    robots: Robots,
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
    """Book a step of learners, world by world, as `rows.book_rows` does, and copy the observations.

    Args:
        robots: Those of any of the worlds: gives types and shapes.
        robots_at: (B, 4) addresses of the arrays of each.
        reward: (B, N), and all others as in `book_rows` with one more dimension in front.
        absent: (B, N).
        present: (B, N).
        returns: (B, N).
        lengths: (B, N).
        terminated: (B, N).
        active: (B, N).
        n_terminated: (B,) is written: how many rows of each world terminate.
        obs: (B, N, D) is written, or (0, N, D) where nobody wants it.
    """
    for b in range(robots_at.shape[0]):
        n_terminated[b] = book_rows(
            array_at(robots.dead, robots_at[b, 0]),
            array_at(robots.is_present, robots_at[b, 1]),
            array_at(robots.is_active, robots_at[b, 2]),
            reward[b],
            absent[b],
            present[b],
            returns[b],
            lengths[b],
            terminated[b],
            active[b],
        )
        if obs.shape[0] > 0:
            seen = array_at(robots.obs, robots_at[b, 3])
            for i in range(seen.shape[0]):
                for k in range(seen.shape[1]):
                    obs[b, i, k] = seen[i, k]
