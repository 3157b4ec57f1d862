"""One tick, in its order. Here stand the phases that are compiled; each is a function of its own in another file.

(wrappers disturb the wheels)
drive           actions -> wheel speeds -> velocities                           set_out
press           touching robots push with the force of their motors
(bodies move: the physics of the scenario)
look            who is near; proximity readings                                 meet
interfere       who loses time to avoidance
interact        pick-ups and drops
place_displaced delivered objects come back on the floor
(caches, and objects for which there was no room, are placed: Python, rare)
walk            objects move by themselves                                      close
count           caches
sense           the rest of the observation
(wrappers disturb it)
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import Callback, inline_kernel, kernel, kind_of, part
from swarm_forage_env._internal.held import hold
from swarm_forage_env._internal.prefetching import LARGE
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.kernel_policy import Drive
from swarm_forage_env.contract.types import ActionArray, CodeArray, FloatArray, ObsArray
from swarm_forage_env.world.kernels import beams, floor, proprioception
from swarm_forage_env.world.kernels.bins import bin_robots, mark_cells
from swarm_forage_env.world.kernels.bodies import BodyState, move_bodies, tell_poses
from swarm_forage_env.world.kernels.contact import press
from swarm_forage_env.world.kernels.counting import add_task_shares, mark
from swarm_forage_env.world.kernels.disturbances import Disturbances, disturb, disturb_wheels, draw_bits
from swarm_forage_env.world.kernels.drive import drive
from swarm_forage_env.world.kernels.interact import serve
from swarm_forage_env.world.kernels.placement import place_displaced
from swarm_forage_env.world.kernels.reward import Payment, pay, remember
from swarm_forage_env.world.kernels.walk import walk
from swarm_forage_env.world.state import CHANGES, ArenaArrays, CacheState

DONE = -1
"""No action was refused and nothing is left to do. Rows of refused actions are 0 and above."""
TO_PLACE = -2
"""Caches, or objects that wait, are to be placed, then `close` is still to come."""
NO_ROOM = -3
"""There is no room for all pairs of robots that might touch. `set_out` is done, nobody was moved."""
_CACHES_ALIVE, _OBJECTS_CACHED = int(Counter.CACHES_ALIVE), int(Counter.OBJECTS_CACHED)
_OBJECTS_MOVED = int(Counter.OBJECTS_MOVED)


@kernel
def start(a: ArenaArrays, actions: ActionArray, wheel_gain: FloatArray) -> int:
    """From actions to velocities of the bodies.

    Returns `DONE`, or the first active row whose action or gain is not finite; then nothing has happened.
    """
    swarm, m = a.state.swarm, a.motion
    return drive(
        actions,
        wheel_gain,
        swarm.active,
        swarm.pending_kind,
        swarm.facing,
        m.drive_limits,
        m.dt_s,
        swarm.wheel_speed,
        m.twist,
    )


@kernel
def push(a: ArenaArrays, tick: int) -> None:
    """Let robots in touch press against each other, in tick number `tick`."""
    swarm, m, s = a.state.swarm, a.motion, a.sensors
    before, now = (m.touching[0], m.touching[1]) if tick % 2 == 0 else (m.touching[1], m.touching[0])
    press(swarm.position, swarm.present, s.near, s.bins, m.touch_m, before, now, m.command, m.twist)


@kernel
def move(a: ArenaArrays, b: BodyState) -> bool:
    """Move compiled bodies; returns whether there was room for all pairs that might touch, else nobody was moved."""
    swarm = a.state.swarm
    if not move_bodies(b, a.motion.twist, swarm.present, a.motion.dt_s):
        return False
    tell_poses(b.poses, swarm.present, swarm.position, swarm.heading, swarm.facing)
    return True


@kernel
def look(a: ArenaArrays) -> None:
    """Find out who is near whom, and write the proximity readings: a ring of beams, 1 at contact, 0 without a hit."""
    swarm, s = a.state.swarm, a.sensors
    bin_robots(swarm.position, swarm.present, s.bins[0], s.bins[1], s.bins[2])
    mark_cells(swarm.position, swarm.present, s.bins[0], s.occupied)
    beams.proximity(
        swarm.position,
        swarm.facing,
        swarm.present,
        s.bins,
        s.occupied,
        s.interior,
        s.obstacles,
        s.radius_m,
        s.reach_m,
        s.obs,
        s.columns.proximity,
        s.near,
        s.kept[0],
    )


@kernel
def meet(a: ArenaArrays, actions: ActionArray, tick: int, chance: FloatArray) -> bool:
    """After a look: who is in interference, who picks up and drops; objects come back on the floor.

    `chance` (N,) uniform in [0, 1) decides which object leaves a cache. Returns whether anything is to be placed.
    """
    state, s = a.state, a.sensors
    mark(s.obs, s.columns.proximity, s.near, s.behind_counts, state.swarm, state.caches, state.events)
    serve(state, a.rules, actions, tick, chance)
    displaced, creators = state.requests.displaced, state.requests.creators
    if creators[-1] == 0:  # new caches come first
        place_displaced(state.requests, state.objects, a.source, a.wandering.area, a.placement_draws)
    is_to_place = displaced[-1] > 0 or creators[-1] > 0
    return is_to_place or (a.n_static_caches > 0 and _alive(state.caches) < a.n_static_caches)


@part
def _alive(caches: CacheState) -> int:
    n_alive = 0
    for slot in range(caches.alive.shape[0]):
        n_alive += caches.alive[slot]
    return n_alive


@kernel
def sense(a: ArenaArrays) -> None:
    """Complete the observation after `look`; slices that are not read may stay zero."""
    swarm, objects, events, s = a.state.swarm, a.state.objects, a.state.events, a.sensors
    position, facing, present, c = swarm.position, swarm.facing, swarm.present, s.columns
    if s.reads_light and s.light_is_due[0]:
        floor.light(
            position,
            facing,
            present,
            s.lights,
            s.intensity,
            swarm.carried_object,
            s.light_of_carriers_only,
            s.obs,
            c.light,
            s.lit,
            s.kept[0],
            s.light_seen,
        )
    # Block by block: so the next of the three finds a row of the observation in the processor's cache.
    for first in range(0, present.shape[0], LARGE):
        rows = slice(first, min(first + LARGE, present.shape[0]))
        at, ahead, here, obs = position[rows], facing[rows], present[rows], s.obs[rows]
        proprioception.own_motion(at, ahead, swarm.wheel_speed[rows], here, s.scales, obs, c.wheel_speed)
        proprioception.own_status(
            swarm.carried_object[rows],
            swarm.pending_kind[rows],
            here,
            swarm.active[rows],
            events.code[rows],
            events.event_object[rows],
            events.event_cache[rows],
            s.sizes,
            obs,
            c.carrying,
        )
        if s.reads_ground:
            floor.ground(at, ahead, here, objects.floor, obs, c.ground)
    if s.reads_line_of_sight:
        floor.line_of_sight(
            position,
            present,
            objects.floor,
            a.state.requests.changed,
            s.kept[0],
            s.shares,
            a.state.caches,
            s.cache_half_side,
            s.obs,
            (c.los_cell, c.los_object, c.los_cache),
        )


class Phases(NamedTuple):
    """Phases that are called by address: each is compiled once, alone, and not anew with all that calls it."""

    start: Callable[..., int]
    push: Callable[..., None]
    move: Callable[..., bool]
    """Not called where Chipmunk has the bodies."""
    look: Callable[..., None]
    meet: Callable[..., bool]
    sense: Callable[..., None]


def phases_of(a: ArenaArrays, b: BodyState | None) -> Phases:
    """Return the phases for an arena and its bodies, both held; held, too."""
    kinds = kind_of((a, b))
    if kinds not in _phases:
        actions, chance = np.empty((1, 1), np.float32), np.empty(1)
        phases = Phases(
            start=Callback(start, a, actions, np.empty((1, 1)), gives=1),
            push=Callback(push, a, 1),
            move=Callback(move, a, b, gives=True) if b is not None else Callback(push, a, 1),
            look=Callback(look, a),
            meet=Callback(meet, a, actions, 1, chance, gives=True),
            sense=Callback(sense, a),
        )
        _phases[kinds] = hold(phases)
    return _phases[kinds]


_phases: dict[Any, Phases] = {}
"""Kinds of arenas and bodies -> what `phases_of` returns."""


@inline_kernel
def observe(a: ArenaArrays, p: Phases) -> None:
    """Write the observation of the world as it is now."""
    p.look(a)
    p.sense(a)


@inline_kernel
def set_out(
    a: ArenaArrays, p: Phases, actions: ActionArray, wheel_gain: FloatArray, tick: int, look_first: bool
) -> int:
    """What comes before the bodies move; `look_first`: robots came or went. Returns as `start`."""
    refused = p.start(a, actions, wheel_gain)
    if refused != DONE:
        return refused
    if look_first:
        p.look(a)
    p.push(a, tick)
    return DONE


@inline_kernel
def close(a: ArenaArrays, p: Phases, walk_chance: FloatArray) -> None:
    """After everything is placed: objects walk, caches are counted, robots sense.

    `walk_chance` (M,) uniform in [0, 1); not read where objects lie still.
    """
    objects, caches = a.state.objects, a.state.caches
    counters, w = a.state.events.counters, a.wandering
    if w.probability > 0.0:
        counters[_OBJECTS_MOVED] += walk(
            objects.floor, objects.status, objects.cell, walk_chance, w.probability, w.area, w.self_conflict
        )
        a.state.requests.changed[-1, 0] = CHANGES + 1
    if a.has_caches:
        counters[_CACHES_ALIVE] += _alive(caches)
        for slot in range(caches.count.shape[0]):
            counters[_OBJECTS_CACHED] += caches.count[slot]
    p.sense(a)


@inline_kernel
def meet_and_close(
    a: ArenaArrays, p: Phases, actions: ActionArray, tick: int, chance: FloatArray, walk_chance: FloatArray
) -> int:
    """After the bodies have moved; returns `DONE`, or `TO_PLACE` if `close` is still to come."""
    p.look(a)
    if p.meet(a, actions, tick, chance):
        return TO_PLACE
    close(a, p, walk_chance)
    return DONE


@inline_kernel
def whole(
    a: ArenaArrays,
    b: BodyState,
    p: Phases,
    actions: ActionArray,
    wheel_gain: FloatArray,
    tick: int,
    look_first: bool,
    chance: FloatArray,
    walk_chance: FloatArray,
) -> int:
    """The whole tick, with compiled bodies; returns `DONE`, `TO_PLACE`, `NO_ROOM` or the row of a refused action."""
    refused = set_out(a, p, actions, wheel_gain, tick, look_first)
    if refused != DONE:
        return refused
    if not p.move(a, b):
        return NO_ROOM
    return meet_and_close(a, p, actions, tick, chance, walk_chance)


@inline_kernel
def disturb_senses(d: Disturbances, k: int, a: ArenaArrays) -> None:
    """Write noise into the observation after tick `k` of `d`, if there is any."""
    if d.lanes.shape[0] == 0:
        return
    s, swarm = a.sensors, a.state.swarm
    draw_bits(d.lanes, d.draws)
    d.believing[0] += disturb(
        s.obs,
        swarm.present,
        swarm.active,
        swarm.carried_object,
        d.draws,
        d.factors[k % d.factors.shape[0]],
        d.noise,
        s.columns.proximity,
        s.behind_counts,
    )
    d.believing[1] += 1.0


@kernel
def run(
    a: ArenaArrays,
    b: BodyState,
    p: Phases,
    d: Disturbances | None,
    driver: Drive,
    payment: Payment | None,
    paid: ObsArray,
    wheel_gain: FloatArray,
    first: int,
    n_ticks: int,
    look_first: bool,
    acts: bool,
    driver_first: int,
    decision_ticks: int,
    driver_draws: FloatArray,
    chances: FloatArray,
    walk_chances: FloatArray,
    tasks: CodeArray,
    task_shares: FloatArray,
) -> tuple[int, int, bool]:
    """Let a driver and the world act in turn for up to `n_ticks` ticks.

    It ends early with a tick that is not `DONE`, or of which the tasks cannot be counted.

    Args:
        a: The arena.
        b: Its bodies.
        p: Its phases.
        d: What disturbs the robots, if anything. The observation after a tick that is not `DONE` is left as it is.
        driver: Who acts.
        payment: What rewards are made of; None = there are none.
        paid: (N,) float32, the rewards of ticks that are `DONE` are added.
        wheel_gain: (N, 2), see `set_out`.
        first: Number of the first tick.
        n_ticks: How many, at most as many as there are draws. With 0 the driver acts in the first, and that is all.
        look_first: See `set_out`.
        acts: Whether the driver acts; else its actions stand as they are.
        driver_first: Number of the first tick as the driver counts.
        decision_ticks: See `KernelPolicy`; light, the dearest sense, is left out until the next decision, or the end.
        driver_draws: (ticks, N, draws of a robot) or, where they are not read, (1, N, 1).
        chances: (ticks, N) or, where they are not read, (1, N).
        walk_chances: (ticks, M) or, where they are not read, (1, N).
        tasks: (N,) codes that the driver keeps up to date; (0,) for one without tasks.
        task_shares: (codes,) the shares of active robots in each task are added, tick by tick.

    Returns:
        How many ticks have begun, the outcome of the last of them, and whether its tasks were codes of `Task`, one per
        robot. Tasks of a tick with a refused action are not looked at.
    """
    state, act = driver.state, driver.act
    obs, swarm, s, actions = a.sensors.obs, a.state.swarm, a.sensors, state[-1]
    light_is_due = s.light_is_due
    gain, is_noisy = wheel_gain, False
    if d is not None:
        gain = d.gain if d.gain.shape[0] > 0 else wheel_gain
        is_noisy = d.draws.shape[0] > 0
    if n_ticks == 0:
        act(obs, swarm.active, driver_draws[0], state, driver_first)
    for k in range(n_ticks):
        if payment is not None:
            remember(payment)
        if acts:
            act(obs, swarm.active, driver_draws[k % driver_draws.shape[0]], state, driver_first + k)
        if d is not None:
            disturb_wheels(d, k, actions, swarm.carried_object, a.motion.drive_limits, wheel_gain)
        chance, walk_chance = chances[k % chances.shape[0]], walk_chances[k % walk_chances.shape[0]]
        now_then = driver_first + k + 1  # the tick in which the driver sees what is sensed here
        is_due = (now_then - 1) % decision_ticks == 0 or k == n_ticks - 1
        light_is_due[0] = is_due
        outcome = whole(a, b, p, actions, gain, first + k, look_first and k == 0, chance, walk_chance)
        light_is_due[0] = True  # for what Python may have to finish
        if outcome == DONE:
            if d is not None:
                disturb_senses(d, k, a)
            s.kept[0] = not is_noisy and (is_due or s.kept[0])
            if payment is not None:
                pay(payment, paid)
        counted = outcome >= 0 or tasks.shape[0] == 0 or add_task_shares(tasks, swarm.active, task_shares)
        if outcome != DONE or not counted:
            return k + 1, outcome, counted
    return n_ticks, DONE, True
