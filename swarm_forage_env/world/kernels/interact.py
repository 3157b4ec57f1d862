"""Pick-ups and drops, one function per rule, in a fixed order; ties are resolved in rotating order, without draws.

A robot's gripper command asks for something (`request_of`). If the condition of a request fails, it is refused at once.
If it holds, an interaction starts. It takes effect some ticks later (usually one), if the request is the same and
possible in every tick until then.
"""

from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY, GRIP_LOWER_ENDS, Counter, Event, ObjectStatus
from swarm_forage_env.contract.types import ActionArray, BoolArray, CodeArray, FloatArray, IntArray
from swarm_forage_env.scenarios.units import CELL_M, CELLS_PER_M

NO_REQUEST = 0
DELIVER = 1
CACHE_DROP = 2
FLOOR_DROP = 3
SITE_DROP = 4
CREATE_DROP = 5
FLOOR_PICKUP = 6
CACHE_PICKUP = 7
NOTHING = 8
"""Asked for something that is not possible here."""
TOO_NEAR = 9
"""Asked for a cache site too near an existing cache."""

GRASP, RELEASE, DELIVER_ONLY, SITE, CREATE_CACHE = range(1, 6)
"""Gripper bands from the top, in the order of `contract.codes.GRIP_LOWER_ENDS`."""

FREE_PICKUP_HANDLER, NEST_HANDLER, CACHE_HANDLER, SITE_HANDLER, CREATE_HANDLER = range(5)
N_HANDLERS = CREATE_HANDLER + 1

_PICKED_UP, _PICKED_FROM_CACHE, _DELIVERED = int(Event.PICKED_UP), int(Event.PICKED_FROM_CACHE), int(Event.DELIVERED)
_DROPPED, _ELSEWHERE, _JOINED_CACHE = int(Event.DROPPED), int(Event.DROPPED_ELSEWHERE), int(Event.JOINED_CACHE)
_NOTHING_HERE, _VANISHED, _CACHE_TOO_NEAR = int(Event.NOTHING_HERE), int(Event.VANISHED), int(Event.CACHE_TOO_NEAR)

_FREE, _CARRIED = int(ObjectStatus.FREE), int(ObjectStatus.CARRIED)
_CACHED, _WAITING = int(ObjectStatus.CACHED), int(ObjectStatus.WAITING)
_COLLECTED, _FREE_PICKUPS, _FIRST_PICKED = int(Counter.COLLECTED), int(Counter.FREE_PICKUPS), int(Counter.FIRST_PICKED)
_CACHE_PICKUPS, _CACHE_DROPS = int(Counter.CACHE_PICKUPS), int(Counter.CACHE_DROPS)
_FLOOR_DROPS, _DISPLACED = int(Counter.FLOOR_DROPS), int(Counter.DISPLACED_DROPS)
_DEPLETED = int(Counter.CACHES_DEPLETED)


class InteractionState(NamedTuple):
    """The arrays that interactions read and write; fields and the letters N, M, K as in `world.state`."""

    position: FloatArray
    carried_object: IntArray
    cargo_from_cache: BoolArray
    pending_kind: CodeArray
    pending_band: CodeArray
    pending_target: IntArray
    pending_until: IntArray
    active: BoolArray
    floor: IntArray
    status: CodeArray
    object_cell: IntArray
    cache_slot: IntArray
    carriers: IntArray
    cache_alive: BoolArray
    cache_cell: IntArray
    cache_serial: IntArray
    cache_count: IntArray
    code: CodeArray
    event_object: IntArray
    event_cache: IntArray
    first_picked: BoolArray
    counters: np.ndarray
    happened: BoolArray
    """(1,) whether any robot asks for an interaction or is in one, in this tick."""
    displaced: IntArray
    """(N + 1,) object rows to re-place this tick; the last entry holds their number."""
    creators: IntArray
    """(N + 1,) robot rows whose CREATE_CACHE drop left an object lying; the last entry holds their number."""
    queue: IntArray
    """(2 N,) scratch: robots with a request and what they ask."""
    handler_used: BoolArray
    """(N_HANDLERS,) scratch: kinds of interaction that finished this tick."""
    handling_ticks: IntArray
    """(2,) ticks that a pick-up and a drop take which start in this tick, at least 1."""


class Rules(NamedTuple):
    """Constants of interactions."""

    nest_x_low: float
    nest_y_low: float
    nest_x_high: float
    nest_y_high: float
    area_x_low: int
    area_y_low: int
    area_x_high: int
    area_y_high: int
    cache_half_side: int
    """(cache side in cells - 1) / 2."""
    cache_proximity_m: float
    """SITE and CREATE_CACHE are refused this close to a cache centre."""
    dynamic_caches: bool
    serialized: bool
    """At most one interaction per handler finishes in a tick (quirk `serialized_interactions`)."""


@kernel
def clear_events(
    gripper: ActionArray,
    carried_object: IntArray,
    pending_kind: CodeArray,
    active: BoolArray,
    code: CodeArray,
    first_picked: BoolArray,
) -> bool:
    """Forget last tick's events; returns whether any robot asks for or is in an interaction."""
    busy = False
    for i in range(code.shape[0]):
        code[i] = 0
        first_picked[i] = False
        if pending_kind[i] != 0:
            busy = True
        elif active[i]:
            grasps = gripper[i, 2] > 0.0
            if grasps != (carried_object[i] >= 0):
                busy = True
    return busy


@kernel
def _cell(state: InteractionState, i: int) -> tuple[int, int]:
    ny, nx = state.floor.shape
    return (
        min(nx - 1, max(0, int(state.position[i, 0] * CELLS_PER_M))),
        min(ny - 1, max(0, int(state.position[i, 1] * CELLS_PER_M))),
    )


@kernel
def _floor_code(state: InteractionState, i: int) -> int:
    x, y = _cell(state, i)
    return state.floor[y, x]


@kernel
def _in_nest(state: InteractionState, rules: Rules, i: int) -> bool:
    x = state.position[i, 0]
    y = state.position[i, 1]
    return rules.nest_x_low <= x <= rules.nest_x_high and rules.nest_y_low <= y <= rules.nest_y_high


@kernel
def _cache_too_near(state: InteractionState, rules: Rules, i: int) -> int:
    """Slot of the nearest cache whose centre is within the proximity distance of robot i, or -1."""
    nearest = -1
    limit = rules.cache_proximity_m * rules.cache_proximity_m
    for slot in range(state.cache_alive.shape[0]):
        if state.cache_alive[slot]:
            dx = (state.cache_cell[slot, 0] + 0.5) * CELL_M - state.position[i, 0]
            dy = (state.cache_cell[slot, 1] + 0.5) * CELL_M - state.position[i, 1]
            distance = dx * dx + dy * dy
            if distance <= limit:
                nearest = slot
                limit = distance
    return nearest


@kernel
def band_of(grip: float) -> int:
    """Gripper band of a command."""
    for k in range(len(GRIP_LOWER_ENDS)):
        if grip > GRIP_LOWER_ENDS[k]:
            return GRASP + k
    return CREATE_CACHE


@kernel
def request_of(state: InteractionState, rules: Rules, band: int, i: int) -> tuple[int, int]:
    """What robot i asks for at its place, and which object row or cache slot is meant (-1 = none)."""
    code = _floor_code(state, i)
    if state.carried_object[i] < 0:
        if band != GRASP:
            return NO_REQUEST, -1
        if code <= CELL_CACHE:
            return CACHE_PICKUP, CELL_CACHE - code
        if code >= 0:
            return FLOOR_PICKUP, code
        return NOTHING, -1
    if band == GRASP:
        return NO_REQUEST, -1
    if _in_nest(state, rules, i):
        return DELIVER, -1
    if code <= CELL_CACHE:
        return CACHE_DROP, CELL_CACHE - code
    if band == DELIVER_ONLY:
        return NOTHING, -1
    if band == RELEASE or not rules.dynamic_caches:
        return FLOOR_DROP, -1
    near = _cache_too_near(state, rules, i)
    if near >= 0:
        return TOO_NEAR, near
    return (SITE_DROP if band == SITE else CREATE_DROP), -1


@kernel
def _report(state: InteractionState, i: int, event: int, row: int, slot: int) -> None:
    state.code[i] = event
    state.event_object[i] = row
    state.event_cache[i, :] = 0
    if slot >= 0:
        state.event_cache[i, 0] = state.cache_serial[slot]
        state.event_cache[i, 1] = state.cache_cell[slot, 0]
        state.event_cache[i, 2] = state.cache_cell[slot, 1]
        state.event_cache[i, 3] = state.cache_count[slot]


@kernel
def _forget_pending(state: InteractionState, i: int) -> None:
    state.pending_kind[i] = NO_REQUEST
    state.pending_band[i] = 0
    state.pending_target[i] = -1
    state.pending_until[i] = 0


@kernel
def _empty_hands(state: InteractionState, i: int) -> int:
    row = state.carried_object[i]
    state.carried_object[i] = -1
    state.cargo_from_cache[i] = False
    return row


@kernel
def _displace(state: InteractionState, row: int) -> None:
    """List an object that is placed again later in this tick."""
    state.status[row] = _WAITING
    state.object_cell[row, :] = -1
    last = state.displaced.shape[0] - 1
    state.displaced[state.displaced[last]] = row
    state.displaced[last] += 1


@kernel
def deliver(state: InteractionState, i: int) -> None:
    """Robot i leaves its object in the nest; the object is placed again later in this tick."""
    row = _empty_hands(state, i)
    _displace(state, row)
    state.counters[_COLLECTED] += 1
    _report(state, i, _DELIVERED, row, -1)


@kernel
def drop_into_cache(state: InteractionState, i: int, slot: int) -> None:
    """Robot i adds its object to the cache it stands in."""
    row = _empty_hands(state, i)
    state.status[row] = _CACHED
    state.cache_slot[row] = slot
    state.object_cell[row, 0] = state.cache_cell[slot, 0]
    state.object_cell[row, 1] = state.cache_cell[slot, 1]
    state.cache_count[slot] += 1
    state.counters[_CACHE_DROPS] += 1
    _report(state, i, _JOINED_CACHE, row, slot)


@kernel
def lay_on_floor(state: InteractionState, rules: Rules, i: int) -> bool:
    """Robot i lays its object on its cell if that is free, else it is placed again; returns whether it lies there."""
    row = _empty_hands(state, i)
    x, y = _cell(state, i)
    inside = rules.area_x_low <= x < rules.area_x_high and rules.area_y_low <= y < rules.area_y_high
    state.counters[_FLOOR_DROPS] += 1
    if inside and state.floor[y, x] == CELL_EMPTY:
        state.floor[y, x] = row
        state.status[row] = _FREE
        state.object_cell[row, 0] = x
        state.object_cell[row, 1] = y
        _report(state, i, _DROPPED, row, -1)
        return True
    state.counters[_DISPLACED] += 1
    _displace(state, row)
    _report(state, i, _ELSEWHERE, row, -1)
    return False


@kernel
def _lift(state: InteractionState, i: int, row: int) -> None:
    state.status[row] = _CARRIED
    state.object_cell[row, :] = -1
    state.carried_object[i] = row
    if state.carriers[row] == 0:
        state.first_picked[i] = True
        state.counters[_FIRST_PICKED] += 1
    state.carriers[row] += 1


@kernel
def take_from_floor(state: InteractionState, i: int, row: int) -> None:
    """Robot i picks up the free object under its centre."""
    state.floor[state.object_cell[row, 1], state.object_cell[row, 0]] = CELL_EMPTY
    _lift(state, i, row)
    state.cargo_from_cache[i] = False
    state.counters[_FREE_PICKUPS] += 1
    _report(state, i, _PICKED_UP, row, -1)


@kernel
def take_from_cache(state: InteractionState, rules: Rules, i: int, slot: int, chance: float) -> None:
    """Robot i takes an object, uniform among the cache's contents (`chance` in [0, 1)); a last pair dissolves it."""
    wanted = int(chance * state.cache_count[slot])
    taken = -1
    for row in range(state.cache_slot.shape[0]):
        if state.cache_slot[row] == slot:
            if wanted == 0:
                taken = row
                break
            wanted -= 1
    state.cache_slot[taken] = -1
    state.cache_count[slot] -= 1
    _lift(state, i, taken)
    state.cargo_from_cache[i] = True
    state.counters[_CACHE_PICKUPS] += 1
    _report(state, i, _PICKED_FROM_CACHE, taken, slot)
    if state.cache_count[slot] == 1:
        _dissolve(state, rules, slot)


@kernel
def _dissolve(state: InteractionState, rules: Rules, slot: int) -> None:
    """Remove a cache with one object left; this object lies free on the centre cell."""
    cx = state.cache_cell[slot, 0]
    cy = state.cache_cell[slot, 1]
    half = rules.cache_half_side
    state.floor[cy - half : cy + half + 1, cx - half : cx + half + 1] = CELL_EMPTY
    for row in range(state.cache_slot.shape[0]):
        if state.cache_slot[row] == slot:
            state.cache_slot[row] = -1
            state.status[row] = _FREE
            state.floor[cy, cx] = row
    state.cache_alive[slot] = False
    state.cache_count[slot] = 0
    state.counters[_DEPLETED] += 1


@kernel
def drop_cargo(state: InteractionState, rules: Rules, i: int) -> None:
    """Robot i dies and loses its cargo here: into the cache, onto the floor, or placed again."""
    _forget_pending(state, i)
    if state.carried_object[i] < 0:
        return
    code = _floor_code(state, i)
    if code <= CELL_CACHE:
        drop_into_cache(state, i, CELL_CACHE - code)
    else:
        lay_on_floor(state, rules, i)


@kernel
def _handler_of(kind: int) -> int:
    if kind == FLOOR_PICKUP:
        return FREE_PICKUP_HANDLER
    if kind == DELIVER:
        return NEST_HANDLER
    if kind == SITE_DROP:
        return SITE_HANDLER
    if kind == CREATE_DROP:
        return CREATE_HANDLER
    return CACHE_HANDLER


@kernel
def _target_identity(state: InteractionState, kind: int, target: int) -> int:
    """Identity of the target, which must stay the same while an interaction runs: object row or cache serial."""
    if kind == CACHE_DROP or kind == CACHE_PICKUP:
        return state.cache_serial[target]
    return target


@kernel
def _take_effect(state: InteractionState, rules: Rules, i: int, kind: int, target: int, chance: float) -> None:
    if kind == DELIVER:
        deliver(state, i)
    elif kind == CACHE_DROP:
        drop_into_cache(state, i, target)
    elif kind == FLOOR_PICKUP:
        take_from_floor(state, i, target)
    elif kind == CACHE_PICKUP:
        take_from_cache(state, rules, i, target, chance)
    elif lay_on_floor(state, rules, i) and kind == CREATE_DROP:
        last = state.creators.shape[0] - 1
        state.creators[state.creators[last]] = i
        state.creators[last] += 1


@kernel
def _continue(state: InteractionState, rules: Rules, i: int, kind: int, target: int, tick: int, chance: float) -> None:
    """Wait on, or finish the interaction that robot i has in progress, or report that its condition is lost."""
    same = kind == state.pending_kind[i] and _target_identity(state, kind, target) == state.pending_target[i]
    if same:
        if tick < state.pending_until[i]:
            return
        handler = _handler_of(kind)
        if rules.serialized and state.handler_used[handler]:
            return
        state.handler_used[handler] = True
    _forget_pending(state, i)
    if same:
        _take_effect(state, rules, i, kind, target, chance)
    else:
        _report(state, i, _VANISHED, -1, -1)


@kernel
def _serve(state: InteractionState, rules: Rules, band: int, i: int, tick: int, chance: float) -> None:
    """Start, continue, refuse or cancel what robot i asks, by the state of the arrays at its turn."""
    kind, target = request_of(state, rules, band, i)
    if state.pending_kind[i] != NO_REQUEST:
        if band == state.pending_band[i]:
            _continue(state, rules, i, kind, target, tick, chance)
            return
        _forget_pending(state, i)
    if kind == FLOOR_DROP:
        lay_on_floor(state, rules, i)
    elif kind == NOTHING:
        _report(state, i, _NOTHING_HERE, -1, -1)
    elif kind == TOO_NEAR:
        _report(state, i, _CACHE_TOO_NEAR, -1, target)
    elif kind != NO_REQUEST:
        state.pending_kind[i] = kind
        state.pending_band[i] = band
        state.pending_target[i] = _target_identity(state, kind, target)
        state.pending_until[i] = tick + state.handling_ticks[0 if band == GRASP else 1]


@kernel
def _phase_of(kind: int, band: int) -> int:
    """Order within a tick: deliver 0, cache drop 1, floor drops 2, pick-ups 3 (also those with nothing to pick up)."""
    if kind == DELIVER:
        return 0
    if kind == CACHE_DROP:
        return 1
    if band == GRASP:
        return 3
    return 2


@kernel
def _band_now(state: InteractionState, gripper: ActionArray, i: int) -> int:
    """Band that robot i sends; a robot in repair keeps sending the band of its running interaction."""
    if state.active[i]:
        return band_of(gripper[i, 2])
    return state.pending_band[i]


@kernel
def interact(state: InteractionState, rules: Rules, gripper: ActionArray, tick: int, chance: FloatArray) -> None:
    """Serve all requests of one tick, phase by phase; within a phase, robots by (row - tick) mod N, lowest first.

    `gripper` is the (N, 3) action array; `chance` (N,) uniform in [0, 1) decides which object leaves a cache.
    """
    n_robots = state.code.shape[0]
    state.handler_used[:] = False
    n_queued = 0
    for k in range(n_robots):
        i = (tick + k) % n_robots
        idle = not state.active[i] or (state.carried_object[i] >= 0) == (gripper[i, 2] > 0.0)
        if state.pending_kind[i] == NO_REQUEST and idle:
            continue  # absent, or carrying and holding, or empty and not grasping: most robots in most ticks
        band = _band_now(state, gripper, i)
        kind, _ = request_of(state, rules, band, i)
        if kind != NO_REQUEST or state.pending_kind[i] != NO_REQUEST:
            state.queue[n_queued] = i
            state.queue[n_robots + n_queued] = _phase_of(kind, band)
            n_queued += 1
    for phase in range(4):
        for place in range(n_queued):
            if state.queue[n_robots + place] == phase:
                i = int(state.queue[place])
                _serve(state, rules, _band_now(state, gripper, i), i, tick, chance[i])


@kernel
def serve(state: InteractionState, rules: Rules, gripper: ActionArray, tick: int, chance: FloatArray) -> None:
    """Rewrite the events and lists of a tick: clear them, and `interact` if any robot has a request."""
    state.displaced[-1] = 0
    state.creators[-1] = 0
    state.happened[0] = clear_events(
        gripper, state.carried_object, state.pending_kind, state.active, state.code, state.first_picked
    )
    if state.happened[0]:
        interact(state, rules, gripper, tick, chance)
