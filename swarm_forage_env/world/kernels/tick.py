"""One tick, in its order. Here stand the phases that are compiled; each is a function of its own in another file.

drive           actions -> wheel speeds -> velocities                           set_out
press           touching robots push with the force of their motors
(bodies move: the physics of the scenario)
look            who is near; proximity readings                                 meet
interfere       who loses time to avoidance
interact        pick-ups and drops
(objects and caches are placed, where anything is to be placed: Python, rare)
walk            objects move by themselves                                      close
count           caches
sense           the rest of the observation
"""

from collections.abc import Callable
from typing import Any

from swarm_forage_env._internal.compiling import kernel
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.types import ActionArray, CodeArray, FloatArray
from swarm_forage_env.world.kernels import beams, floor, kinds, proprioception
from swarm_forage_env.world.kernels.bodies import BodyState, move_bodies, tell_poses
from swarm_forage_env.world.kernels.contact import press
from swarm_forage_env.world.kernels.counting import add_task_shares, mark
from swarm_forage_env.world.kernels.drive import drive
from swarm_forage_env.world.kernels.interact import serve
from swarm_forage_env.world.kernels.neighbourhood import bin_robots
from swarm_forage_env.world.kernels.walk import walk
from swarm_forage_env.world.kernels.world import World

DONE = -1
"""No action was refused and nothing is left to do. Rows of refused actions are 0 and above."""
TO_PLACE = -2
"""Objects or caches are to be placed, then `close` is still to come."""
NO_ROOM = -3
"""There is no room for all pairs of robots that might touch. `set_out` is done, nobody was moved."""
_CACHES_ALIVE, _OBJECTS_CACHED = int(Counter.CACHES_ALIVE), int(Counter.OBJECTS_CACHED)
_OBJECTS_MOVED = int(Counter.OBJECTS_MOVED)


@kernel
def look(w: World) -> None:
    """Find out who is near whom, and write the proximity readings: a ring of beams, 1 at contact, 0 without a hit."""
    s = w.sensors
    position = w.state.position
    bin_robots(position, w.present, s.bins[0], s.bins[1], s.bins[2])
    beams.proximity(
        position,
        w.facing,
        w.present,
        s.bins,
        s.interior,
        s.obstacles,
        s.radius_m,
        s.reach_m,
        s.obs,
        s.columns.proximity,
        s.near,
    )


@kernel
def sense(w: World) -> None:
    """Complete the observation after `look`; slices that are not read may stay zero."""
    s, a = w.sensors, w.state
    c = s.columns
    if s.reads_light:
        floor.light(
            a.position,
            w.facing,
            w.present,
            s.lights,
            s.intensity,
            a.carried_object,
            s.light_of_carriers_only,
            s.obs,
            c.light,
        )
    if s.reads_ground:
        floor.ground(a.position, w.facing, w.present, a.floor, s.obs, c.ground)
    proprioception.own_motion(a.position, w.facing, w.wheel_speed, w.present, s.scales, s.obs, c.wheel_speed)
    events = (a.code, a.event_object, a.event_cache)
    proprioception.own_status(a.carried_object, a.pending_kind, a.active, events, s.sizes, w.present, s.obs, c.carrying)
    if s.reads_line_of_sight:
        floor.line_of_sight(
            a.position,
            w.present,
            a.floor,
            s.shares,
            (a.cache_alive, a.cache_cell, a.cache_serial, a.cache_count),
            s.cache_half_side,
            s.half_windows,
            s.obs,
            (c.los_cell, c.los_object, c.los_cache),
        )
    kinds.tell_kinds(s.kinds, w.present, s.obs, s.kind_start)
    kinds.blank(s.obs, s.blanks)


@kernel
def observe(w: World) -> None:
    """Write the observation of the world as it is now."""
    look(w)
    sense(w)


@kernel
def set_out(w: World, actions: ActionArray, wheel_gain: FloatArray, tick: int, look_first: bool) -> int:
    """From actions to velocities of the bodies, in tick number `tick`.

    `look_first`: robots came or went since the last `look`. Returns `DONE`, or the first active row whose action or
    gain is not finite; then nothing has happened.
    """
    a, s = w.state, w.sensors
    bad = drive(
        actions,
        wheel_gain,
        w.speeds,
        a.active,
        a.pending_kind,
        w.facing,
        w.drive_limits,
        w.dt_s,
        w.wheel_speed,
        w.twist,
    )
    if bad >= 0:
        return bad
    if look_first:
        look(w)
    before, now = (w.pressing[0], w.pressing[1]) if tick % 2 == 0 else (w.pressing[1], w.pressing[0])
    press(a.position, w.present, s.near, s.bins, w.touch_m, before, now, w.command, w.twist)
    return DONE


@kernel
def meet(w: World, actions: ActionArray, tick: int, chance: FloatArray) -> bool:
    """After the bodies have moved: who is near, who is in interference, who picks up and drops.

    `chance` (N,) uniform in [0, 1) decides which object leaves a cache. Returns whether anything is to be placed.
    """
    s, a = w.sensors, w.state
    look(w)
    mark(
        s.obs,
        s.columns.proximity,
        s.near,
        s.behind_counts,
        a.active,
        w.present,
        a.carried_object,
        w.interfering,
        a.counters,
        w.interference_sum,
    )
    serve(a, w.rules, actions, tick, chance)
    return a.displaced[-1] > 0 or a.creators[-1] > 0 or (w.n_static_caches > 0 and _alive(w) < w.n_static_caches)


@kernel
def _alive(w: World) -> int:
    n_alive = 0
    for slot in range(w.state.cache_alive.shape[0]):
        n_alive += w.state.cache_alive[slot]
    return n_alive


@kernel
def close(w: World, walk_chance: FloatArray) -> None:
    """After everything is placed: objects walk, caches are counted, robots sense.

    `walk_chance` (M,) uniform in [0, 1); not read where objects lie still.
    """
    a, o = w.state, w.wandering
    if o.probability > 0.0:
        a.counters[_OBJECTS_MOVED] += walk(
            a.floor, a.status, a.object_cell, walk_chance, o.probability, o.area, o.self_conflict
        )
    if w.has_caches:
        a.counters[_CACHES_ALIVE] += _alive(w)
        for slot in range(a.cache_count.shape[0]):
            a.counters[_OBJECTS_CACHED] += a.cache_count[slot]
    sense(w)


@kernel
def meet_and_close(w: World, actions: ActionArray, tick: int, chance: FloatArray, walk_chance: FloatArray) -> int:
    """`meet`, then `close` unless anything is to be placed; returns `DONE` or `TO_PLACE`."""
    if meet(w, actions, tick, chance):
        return TO_PLACE
    close(w, walk_chance)
    return DONE


@kernel
def whole(
    w: World,
    b: BodyState,
    actions: ActionArray,
    wheel_gain: FloatArray,
    tick: int,
    look_first: bool,
    chance: FloatArray,
    walk_chance: FloatArray,
) -> int:
    """The whole tick, with compiled bodies; returns `DONE`, `TO_PLACE`, `NO_ROOM` or the row of a refused action."""
    refused = set_out(w, actions, wheel_gain, tick, look_first)
    if refused != DONE:
        return refused
    if not move_bodies(b, w.twist, w.present, w.dt_s):
        return NO_ROOM
    tell_poses(b.poses, w.present, w.state.position, w.heading, w.facing)
    return meet_and_close(w, actions, tick, chance, walk_chance)


@kernel
def run(
    w: World,
    b: BodyState,
    wheel_gain: FloatArray,
    first: int,
    n_ticks: int,
    look_first: bool,
    policy: Callable[..., None],
    policy_state: tuple[Any, ...],
    policy_first: int,
    policy_draws: FloatArray,
    chances: FloatArray,
    walk_chances: FloatArray,
    tasks: CodeArray,
    task_shares: FloatArray,
) -> tuple[int, int, bool]:
    """Let policy and world act in turn for up to `n_ticks` ticks.

    It ends early with a tick that is not `DONE`, or of which the tasks cannot be counted.

    Args:
        w: The world.
        b: Its bodies.
        wheel_gain: (N, 2), see `set_out`.
        first: Number of the first tick.
        n_ticks: How many, at most as many as there are draws.
        look_first: See `set_out`.
        policy: (obs, active, draws, state, tick); writes the actions, which are last in its state.
        policy_state: Its state.
        policy_first: Number of the first tick as the policy counts.
        policy_draws: (ticks, N, draws of a robot).
        chances: (ticks, N) or, where they are not read, (1, N).
        walk_chances: (ticks, M) or, where they are not read, (1, N).
        tasks: (N,) codes that the policy keeps up to date; (0,) for a policy without tasks.
        task_shares: (codes,) the shares of active robots in each task are added, tick by tick.

    Returns:
        How many ticks have begun, the outcome of the last of them, and whether its tasks were codes of `Task`, one per
        robot. Tasks of a tick with a refused action are not looked at.
    """
    obs, active, actions = w.sensors.obs, w.state.active, policy_state[-1]
    for k in range(n_ticks):
        policy(obs, active, policy_draws[k], policy_state, policy_first + k)
        chance, walk_chance = chances[k % chances.shape[0]], walk_chances[k % walk_chances.shape[0]]
        outcome = whole(w, b, actions, wheel_gain, first + k, look_first and k == 0, chance, walk_chance)
        counted = outcome >= 0 or tasks.shape[0] == 0 or add_task_shares(tasks, active, task_shares)
        if outcome != DONE or not counted:
            return k + 1, outcome, counted
    return n_ticks, DONE, True
