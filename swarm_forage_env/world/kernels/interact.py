"""Pick-ups and drops, one function per rule, in a fixed order; ties are resolved in rotating order, without draws.

A robot's gripper command asks for something (`request_of`). If the condition of a request fails, it is refused at once.
If it holds, an interaction starts. It takes effect some ticks later (usually one), if the request is the same and
possible in every tick until then. A RELEASE onto open floor acts at once.
"""

from swarm_forage_env._internal.compiling import inline_kernel, kernel, part
from swarm_forage_env.contract.codes import (
    CELL_CACHE,
    CELL_EMPTY,
    CELL_OBJECT,
    GRIP_LOWER_ENDS,
    Counter,
    Event,
    ObjectStatus,
)
from swarm_forage_env.contract.types import ActionArray, FloatArray, IntArray
from swarm_forage_env.scenarios.floor import CELL_M, CELLS_PER_M
from swarm_forage_env.world.kernels.floor import note_change
from swarm_forage_env.world.state import CHANGES, CacheState, ObjectState, Rules, StepEvents, SwarmState, WorldState

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
"""Kinds of interactions that may finish one per tick each; `world.state.N_HANDLERS` counts them."""

_PICKED_UP, _PICKED_FROM_CACHE, _DELIVERED = int(Event.PICKED_UP), int(Event.PICKED_FROM_CACHE), int(Event.DELIVERED)
_DROPPED, _ELSEWHERE, _JOINED_CACHE = int(Event.DROPPED), int(Event.DROPPED_ELSEWHERE), int(Event.JOINED_CACHE)
_NOTHING_HERE, _VANISHED, _CACHE_TOO_NEAR = int(Event.NOTHING_HERE), int(Event.VANISHED), int(Event.CACHE_TOO_NEAR)

_FREE, _CARRIED = int(ObjectStatus.FREE), int(ObjectStatus.CARRIED)
_CACHED, _WAITING = int(ObjectStatus.CACHED), int(ObjectStatus.WAITING)
_COLLECTED, _FREE_PICKUPS, _FIRST_PICKED = int(Counter.COLLECTED), int(Counter.FREE_PICKUPS), int(Counter.FIRST_PICKED)
_CACHE_PICKUPS, _CACHE_DROPS = int(Counter.CACHE_PICKUPS), int(Counter.CACHE_DROPS)
_FLOOR_DROPS, _DISPLACED = int(Counter.FLOOR_DROPS), int(Counter.DISPLACED_DROPS)
_DEPLETED = int(Counter.CACHES_DEPLETED)


@part
def clear_events(swarm: SwarmState, events: StepEvents, gripper: ActionArray) -> bool:
    """Forget last tick's events; returns whether any robot asks for or is in an interaction."""
    code, first_picked = events.code, events.first_picked
    active, pending_kind, carried_object = swarm.active, swarm.pending_kind, swarm.carried_object
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


@part
def _square(position: FloatArray, floor: IntArray, i: int) -> tuple[int, int]:
    ny, nx = floor.shape
    return (
        min(nx - 1, max(0, int(position[i, 0] * CELLS_PER_M))),
        min(ny - 1, max(0, int(position[i, 1] * CELLS_PER_M))),
    )


@part
def _floor_code(position: FloatArray, floor: IntArray, i: int) -> int:
    x, y = _square(position, floor, i)
    return floor[y, x]


@part
def _in_nest(position: FloatArray, rules: Rules, i: int) -> bool:
    x = position[i, 0]
    y = position[i, 1]
    for k in range(rules.nests.shape[0]):
        if rules.nests[k, 0] <= x <= rules.nests[k, 2] and rules.nests[k, 1] <= y <= rules.nests[k, 3]:
            return True
    return False


@part
def _cache_too_near(caches: CacheState, rules: Rules, position: FloatArray, i: int) -> int:
    """Slot of the nearest cache whose centre is within the proximity distance of robot i, or -1."""
    nearest = -1
    limit = rules.cache_proximity_m * rules.cache_proximity_m
    for slot in range(caches.alive.shape[0]):
        if caches.alive[slot]:
            dx = (caches.cell[slot, 0] + 0.5) * CELL_M - position[i, 0]
            dy = (caches.cell[slot, 1] + 0.5) * CELL_M - position[i, 1]
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


@part
def request_of(state: WorldState, rules: Rules, band: int, i: int) -> tuple[int, int]:
    """What robot i asks for at its place, and which object row or cache slot is meant (-1 = none)."""
    position = state.swarm.position
    code = _floor_code(position, state.objects.floor, i)
    if state.swarm.carried_object[i] < 0:
        if band != GRASP:
            return NO_REQUEST, -1
        if code <= CELL_CACHE:
            return CACHE_PICKUP, CELL_CACHE - code
        if code >= CELL_OBJECT:
            return FLOOR_PICKUP, code - CELL_OBJECT
        return NOTHING, -1
    if band == GRASP:
        return NO_REQUEST, -1
    if _in_nest(position, rules, i) and (band == DELIVER_ONLY or not rules.only_delivering_counts):
        return DELIVER, -1
    if code <= CELL_CACHE:
        return CACHE_DROP, CELL_CACHE - code
    if band == DELIVER_ONLY:
        return NOTHING, -1
    if band == RELEASE or not rules.dynamic_caches:
        return FLOOR_DROP, -1
    near = _cache_too_near(state.caches, rules, position, i)
    if near >= 0:
        return TOO_NEAR, near
    return (SITE_DROP if band == SITE else CREATE_DROP), -1


@part
def _report(events: StepEvents, caches: CacheState, i: int, event: int, row: int, slot: int) -> None:
    events.code[i] = event
    events.event_object[i] = row
    events.event_cache[i, :] = 0
    if slot >= 0:
        events.event_cache[i, 0] = caches.serial[slot]
        events.event_cache[i, 1] = caches.cell[slot, 0]
        events.event_cache[i, 2] = caches.cell[slot, 1]
        events.event_cache[i, 3] = caches.count[slot]


@part
def _forget_pending(swarm: SwarmState, i: int) -> None:
    swarm.pending_kind[i] = NO_REQUEST
    swarm.pending_band[i] = 0
    swarm.pending_target[i] = -1
    swarm.pending_until[i] = 0


@part
def _empty_hands(swarm: SwarmState, i: int) -> int:
    row = swarm.carried_object[i]
    swarm.carried_object[i] = -1
    swarm.cargo_from_cache[i] = False
    return row


@part
def _append(entries: IntArray, value: int) -> None:
    """Add a value to a list, see `world.state`."""
    last = entries.shape[0] - 1
    entries[entries[last]] = value
    entries[last] += 1


@part
def _displace(objects: ObjectState, displaced: IntArray, row: int) -> None:
    """List an object that is placed again later in this tick."""
    objects.status[row] = _WAITING
    objects.cell[row, :] = -1
    _append(displaced, row)


@part
def deliver(state: WorldState, i: int) -> None:
    """Robot i leaves its object in the nest; the object is placed again later in this tick."""
    events = state.events
    row = _empty_hands(state.swarm, i)
    _displace(state.objects, state.requests.displaced, row)
    events.counters[_COLLECTED] += 1
    _report(events, state.caches, i, _DELIVERED, row, -1)


@part
def drop_into_cache(state: WorldState, i: int, slot: int) -> None:
    """Robot i adds its object to the cache it stands in."""
    objects, caches, events = state.objects, state.caches, state.events
    row = _empty_hands(state.swarm, i)
    objects.status[row] = _CACHED
    objects.cache_slot[row] = slot
    objects.cell[row, 0] = caches.cell[slot, 0]
    objects.cell[row, 1] = caches.cell[slot, 1]
    caches.count[slot] += 1
    events.counters[_CACHE_DROPS] += 1
    _report(events, caches, i, _JOINED_CACHE, row, slot)


@part
def lay_on_floor(state: WorldState, rules: Rules, i: int) -> bool:
    """Robot i lays its object on its square if that is free, else it is placed again; returns whether it lies there."""
    objects, events = state.objects, state.events
    row = _empty_hands(state.swarm, i)
    x, y = _square(state.swarm.position, objects.floor, i)
    inside = rules.area_x_low <= x < rules.area_x_high and rules.area_y_low <= y < rules.area_y_high
    events.counters[_FLOOR_DROPS] += 1
    if inside and objects.floor[y, x] == CELL_EMPTY:
        objects.floor[y, x] = CELL_OBJECT + row
        note_change(state.requests.changed, x, y)
        objects.status[row] = _FREE
        objects.cell[row, 0] = x
        objects.cell[row, 1] = y
        _report(events, state.caches, i, _DROPPED, row, -1)
        return True
    events.counters[_DISPLACED] += 1
    _displace(objects, state.requests.displaced, row)
    _report(events, state.caches, i, _ELSEWHERE, row, -1)
    return False


@part
def _lift(swarm: SwarmState, objects: ObjectState, events: StepEvents, i: int, row: int) -> None:
    objects.status[row] = _CARRIED
    objects.cell[row, :] = -1
    swarm.carried_object[i] = row
    if objects.carriers[row] == 0:
        events.first_picked[i] = True
        events.counters[_FIRST_PICKED] += 1
    objects.carriers[row] += 1


@part
def take_from_floor(state: WorldState, i: int, row: int) -> None:
    """Robot i picks up the free object under its centre."""
    objects, events = state.objects, state.events
    x, y = objects.cell[row, 0], objects.cell[row, 1]
    objects.floor[y, x] = CELL_EMPTY
    note_change(state.requests.changed, x, y)
    _lift(state.swarm, objects, events, i, row)
    state.swarm.cargo_from_cache[i] = False
    events.counters[_FREE_PICKUPS] += 1
    _report(events, state.caches, i, _PICKED_UP, row, -1)


@part
def take_from_cache(state: WorldState, rules: Rules, i: int, slot: int, chance: float) -> None:
    """Robot i takes an object, uniform among the cache's contents (`chance` in [0, 1)); a last pair dissolves it."""
    objects, caches, events = state.objects, state.caches, state.events
    wanted = int(chance * caches.count[slot])
    taken = -1
    for row in range(objects.cache_slot.shape[0]):
        if objects.cache_slot[row] == slot:
            if wanted == 0:
                taken = row
                break
            wanted -= 1
    objects.cache_slot[taken] = -1
    caches.count[slot] -= 1
    _lift(state.swarm, objects, events, i, taken)
    state.swarm.cargo_from_cache[i] = True
    events.counters[_CACHE_PICKUPS] += 1
    _report(events, caches, i, _PICKED_FROM_CACHE, taken, slot)
    if caches.count[slot] == 1:
        _dissolve(objects, caches, slot, rules.cache_half_side)
        state.requests.changed[-1, 0] = CHANGES + 1
        events.counters[_DEPLETED] += 1


@part
def _dissolve(objects: ObjectState, caches: CacheState, slot: int, half: int) -> None:
    """Remove a cache with one object left; this object lies free on the centre square."""
    cx = caches.cell[slot, 0]
    cy = caches.cell[slot, 1]
    objects.floor[cy - half : cy + half + 1, cx - half : cx + half + 1] = CELL_EMPTY
    for row in range(objects.cache_slot.shape[0]):
        if objects.cache_slot[row] == slot:
            objects.cache_slot[row] = -1
            objects.status[row] = _FREE
            objects.floor[cy, cx] = CELL_OBJECT + row
    caches.alive[slot] = False
    caches.count[slot] = 0


@kernel
def drop_cargo(state: WorldState, rules: Rules, i: int) -> None:
    """Robot i dies and loses its cargo here: into the cache, onto the floor, or placed again."""
    state.requests.displaced[-1] = 0
    _forget_pending(state.swarm, i)
    if state.swarm.carried_object[i] < 0:
        return
    code = _floor_code(state.swarm.position, state.objects.floor, i)
    if code <= CELL_CACHE:
        drop_into_cache(state, i, CELL_CACHE - code)
    else:
        lay_on_floor(state, rules, i)


@part
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


@part
def _target_identity(caches: CacheState, kind: int, target: int) -> int:
    """Identity of the target, which must stay the same while an interaction runs: object row or cache serial."""
    if kind == CACHE_DROP or kind == CACHE_PICKUP:
        return caches.serial[target]
    return target


@part
def _take_effect(state: WorldState, rules: Rules, i: int, kind: int, target: int, chance: float) -> None:
    if kind == DELIVER:
        deliver(state, i)
    elif kind == CACHE_DROP:
        drop_into_cache(state, i, target)
    elif kind == FLOOR_PICKUP:
        take_from_floor(state, i, target)
    elif kind == CACHE_PICKUP:
        take_from_cache(state, rules, i, target, chance)
    elif lay_on_floor(state, rules, i) and kind == CREATE_DROP:
        _append(state.requests.creators, i)


@part
def _continue(state: WorldState, rules: Rules, i: int, kind: int, target: int, tick: int, chance: float) -> None:
    """Wait on, or finish the interaction that robot i has in progress, or report that its condition is lost."""
    swarm, handler_used = state.swarm, state.requests.handler_used
    identity = _target_identity(state.caches, kind, target)
    same = kind == swarm.pending_kind[i] and identity == swarm.pending_target[i]
    if same:
        if tick < swarm.pending_until[i]:
            return
        handler = _handler_of(kind)
        if rules.serialized and handler_used[handler]:
            return
        handler_used[handler] = True
    _forget_pending(swarm, i)
    if same:
        _take_effect(state, rules, i, kind, target, chance)
    else:
        _report(state.events, state.caches, i, _VANISHED, -1, -1)


@part
def _serve(state: WorldState, rules: Rules, band: int, i: int, tick: int, chance: float) -> None:
    """Start, continue, refuse or cancel what robot i asks, by the state of the arrays at its turn."""
    swarm, caches = state.swarm, state.caches
    kind, target = request_of(state, rules, band, i)
    if swarm.pending_kind[i] != NO_REQUEST:
        if band == swarm.pending_band[i]:
            _continue(state, rules, i, kind, target, tick, chance)
            return
        _forget_pending(swarm, i)
    if kind == FLOOR_DROP:
        lay_on_floor(state, rules, i)
    elif kind == NOTHING:
        _report(state.events, caches, i, _NOTHING_HERE, -1, -1)
    elif kind == TOO_NEAR:
        _report(state.events, caches, i, _CACHE_TOO_NEAR, -1, target)
    elif kind != NO_REQUEST:
        swarm.pending_kind[i] = kind
        swarm.pending_band[i] = band
        swarm.pending_target[i] = _target_identity(caches, kind, target)
        swarm.pending_until[i] = tick + state.requests.handling_ticks[0 if band == GRASP else 1]


@part
def _phase_of(kind: int, band: int) -> int:
    """Order within a tick: deliver 0, cache drop 1, floor drops 2, pick-ups 3 (also those with nothing to pick up)."""
    if kind == DELIVER:
        return 0
    if kind == CACHE_DROP:
        return 1
    if band == GRASP:
        return 3
    return 2


@part
def _band_now(swarm: SwarmState, gripper: ActionArray, i: int) -> int:
    """Band that robot i sends; a robot in repair keeps sending the band of its running interaction."""
    if swarm.active[i]:
        return band_of(gripper[i, 2])
    return swarm.pending_band[i]


@inline_kernel
def interact(state: WorldState, rules: Rules, gripper: ActionArray, tick: int, chance: FloatArray) -> None:
    """Serve all requests of one tick, phase by phase; within a phase, robots by (row - tick) mod N, lowest first.

    `gripper` is the (N, 3) action array; `chance` (N,) uniform in [0, 1) decides which object leaves a cache.
    """
    swarm, queue = state.swarm, state.requests.queue
    active, pending_kind, carried_object = swarm.active, swarm.pending_kind, swarm.carried_object
    n_robots = active.shape[0]
    state.requests.handler_used[:] = False
    n_queued = 0
    for k in range(n_robots):
        i = (tick + k) % n_robots
        idle = not active[i] or (carried_object[i] >= 0) == (gripper[i, 2] > 0.0)
        if pending_kind[i] == NO_REQUEST and idle:
            continue  # absent, or carrying and holding, or empty and not grasping: most robots in most ticks
        band = _band_now(swarm, gripper, i)
        kind, _ = request_of(state, rules, band, i)
        if kind != NO_REQUEST or pending_kind[i] != NO_REQUEST:
            queue[n_queued] = i
            queue[n_robots + n_queued] = _phase_of(kind, band)
            n_queued += 1
    for phase in range(4):
        for place in range(n_queued):
            if queue[n_robots + place] == phase:
                i = int(queue[place])
                _serve(state, rules, _band_now(swarm, gripper, i), i, tick, chance[i])


@inline_kernel
def serve(state: WorldState, rules: Rules, gripper: ActionArray, tick: int, chance: FloatArray) -> None:
    """Rewrite the events and lists of a tick: clear them, and `interact` if any robot has a request."""
    state.requests.displaced[-1] = 0
    state.requests.creators[-1] = 0
    state.requests.changed[-1, 0] = 0
    state.events.happened[0] = clear_events(state.swarm, state.events, gripper)
    if state.events.happened[0]:
        interact(state, rules, gripper, tick, chance)
