"""Compiled functions behind what a learned policy sees and does.

* The compact view: sums, decisions and directions instead of single readings.
* Site memory: two places that each robot remembers, from what it senses itself. The *pickup site* is where it picked an
  object up last; going back there is site fidelity, as of foraging ants. The *sighting site* is where it last saw an
  object while it carried another one. A robot without cargo that comes near a site and sees no object forgets it. Our
  choice: so little that a network can use it, and enough to come back to a cluster.
* From a learner's actions to commands of the contract: motions by number, automatic gripper, masks.
"""

import math
from typing import NamedTuple

import numpy as np

from swarm_forage_env._internal.compiling import kernel, part
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.detection import is_obstacle_vector, ring_sum, sees_cache, sees_nest
from swarm_forage_env.contract.layout import GROUND_SENSORS, RING_SENSORS, WINDOW_CELLS
from swarm_forage_env.contract.types import ActionArray, BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.policies.kernels.frames import Frames
from swarm_forage_env.scenarios.floor import CELLS_PER_M

COMPACT_COLUMNS = 23
VIEW_REACH_M = 1.0
"""Distance at which a direction gets length 1: the side of the line-of-sight window."""
_TIE_M2 = 1e-6
"""Squared distances that differ by less count as equal, so that rounding does not decide."""
_HALF_WINDOW = WINDOW_CELLS // 2
_WINDOW = WINDOW_CELLS * WINDOW_CELLS
_OWN_CELL = _WINDOW // 2
N_SITES = 2
SITE_COLUMNS = 4
"""Of one site: forward, left, 1 if there is one (`write_direction`), distance."""
PICKUP, SIGHTING = 0, 1
FAR_M = 20.0
"""Distance from which on a site counts as far (our choice: more than half of an arena of 32 m)."""
_NEAR_M = WINDOW_CELLS // 2 / CELLS_PER_M
"""Along x and y: so far a robot sees for certain, wherever in its cell it is."""
GRASP = float(Grip.GRASP)
RELEASE = float(Grip.RELEASE)
DELIVER = float(Grip.DELIVER)
MOTION_WHEELS = {
    "stand": (0.0, 0.0),
    "forward": (0.5, 0.5),
    "arc left": (0.4, 0.6),
    "arc right": (0.6, 0.4),
    "turn left": (-0.25, 0.25),
    "turn right": (0.25, -0.25),
}
"""Discrete actions that move, in order, and their wheel commands (our choice): full speed, arcs of 0.35 m radius, turns
of 8 degrees per tick."""
GRIP_COMMANDS = {
    "grasp": Grip.GRASP,
    "release": Grip.RELEASE,
    "deliver": Grip.DELIVER,
    "site": Grip.SITE,
    "create_cache": Grip.CREATE_CACHE,
}
"""Discrete actions of the gripper, in order after the motions; wheels stand meanwhile, as they would in the
interaction."""
N_MOTIONS = len(MOTION_WHEELS)
N_GRIPS = len(GRIP_COMMANDS)
_NUMBERS = {name: number for number, name in enumerate((*MOTION_WHEELS, *GRIP_COMMANDS))}
_STAND = _NUMBERS["stand"]
_GRASP, _RELEASE, _DELIVER = _NUMBERS["grasp"], _NUMBERS["release"], _NUMBERS["deliver"]
_SITE, _CREATE_CACHE = _NUMBERS["site"], _NUMBERS["create_cache"]


@part
def is_over_object(row: ObsArray, object_start: int) -> bool:
    """Return whether a free object lies in the robot's own cell, the centre of its line-of-sight window."""
    return row[object_start + _OWN_CELL] > 0.0


@part
def nearest_object(row: ObsArray, starts: tuple[int, int, int], half_x: float, half_y: float) -> tuple[float, float]:
    """Vector in m, along the axes of the arena, to the nearest object in view; (inf, inf) when there is none.

    Ties go to the first in the order of the window. `starts` = first columns of position, los_cell, los_object;
    `half_x`, `half_y` = half the arena, m.
    """
    position, own_cell, window = starts
    # The sensed position, which noise may disturb, kept inside the robot's cell, which is exact.
    reach = 0.5 / CELLS_PER_M
    off_x = min(reach, max(-reach, (row[position] - row[own_cell]) * half_x))
    off_y = min(reach, max(-reach, (row[position + 1] - row[own_cell + 1]) * half_y))
    best_x = math.inf
    best_y = math.inf
    best = math.inf
    for k in range(_WINDOW):
        if row[window + k] > 0.0:
            x = (k % WINDOW_CELLS - _HALF_WINDOW) / CELLS_PER_M - off_x
            y = (k // WINDOW_CELLS - _HALF_WINDOW) / CELLS_PER_M - off_y
            if x * x + y * y < best - _TIE_M2:
                best = x * x + y * y
                best_x = x
                best_y = y
    return best_x, best_y


@part
def nearest_cache(row: ObsArray, starts: tuple[int, int], half_x: float, half_y: float) -> tuple[float, float]:
    """Vector in m, along the axes of the arena, to the centre of the nearest visible cache; (inf, inf) without one.

    `starts` = first columns of position, los_cache.
    """
    position, caches = starts
    if row[caches] == 0.0:
        return math.inf, math.inf
    return (row[caches + 1] - row[position]) * half_x, (row[caches + 2] - row[position + 1]) * half_y


@part
def write_direction(out: ObsArray, at: int, x: float, y: float, cos: float, sin: float) -> None:
    """Write a vector into three columns: forward and left over VIEW_REACH_M, cut to length 1; whether there is one."""
    if x == math.inf:
        out[at] = 0.0
        out[at + 1] = 0.0
        out[at + 2] = 0.0
        return
    share = 1.0 / max(VIEW_REACH_M, math.sqrt(x * x + y * y))
    out[at] = (x * cos + y * sin) * share
    out[at + 1] = (y * cos - x * sin) * share
    out[at + 2] = 1.0


@kernel
def compact_view(
    obs: ObsArray, starts: tuple[int, ...], half_x: float, half_y: float, behind_counts: bool, out: ObsArray
) -> None:
    """Write the compact view (N, COMPACT_COLUMNS) of observations (N, D); rows of zeros stay zeros.

    `starts` = first columns of proximity, light, ground, wheel_speed, position, heading, carrying, interacting,
    active, los_cell, los_object, los_cache; `half_x`, `half_y` = half the arena, m; `behind_counts` = quirk
    `obstacle_behind_counts`.
    """
    for i in range(obs.shape[0]):
        row = obs[i]
        view = out[i]
        heading = starts[5]
        cos = row[heading]
        sin = row[heading + 1]
        if cos == 0.0 and sin == 0.0:  # not in the world
            view[:] = 0.0
            continue
        x, y = ring_sum(row[starts[0] : starts[0] + RING_SENSORS])
        share = 1.0 / max(1.0, math.sqrt(x * x + y * y))
        view[0] = x * share
        view[1] = y * share
        view[2] = 1.0 if is_obstacle_vector(x, y, behind_counts) else 0.0
        x, y = ring_sum(row[starts[1] : starts[1] + RING_SENSORS])
        length = math.sqrt(x * x + y * y)
        share = 1.0 / length if length > 0.0 else 0.0
        view[3] = x * share
        view[4] = y * share
        ground = row[starts[2] : starts[2] + GROUND_SENSORS]
        view[5] = 1.0 if is_over_object(row, starts[10]) else 0.0
        view[6] = 1.0 if sees_nest(ground) else 0.0
        view[7] = 1.0 if sees_cache(ground) else 0.0
        for k in range(6):  # wheel_speed, position, heading
            view[8 + k] = row[starts[3 + k // 2] + k % 2]
        for k in range(3):  # carrying, interacting, active
            view[14 + k] = row[starts[6 + k]]
        x, y = nearest_object(row, (starts[4], starts[9], starts[10]), half_x, half_y)
        write_direction(view, 17, x, y, cos, sin)
        x, y = nearest_cache(row, (starts[4], starts[11]), half_x, half_y)
        write_direction(view, 20, x, y, cos, sin)


class SiteMemory(NamedTuple):
    """What all robots remember."""

    place: FloatArray
    """(N, N_SITES, 2) m from the middle of the arena."""
    is_known: BoolArray
    """(N, N_SITES)."""
    carried: BoolArray
    """(N,) whether the robot carried an object when it looked last."""
    since: IntArray
    """(N,) decision in which somebody picked up there, or the robot found the place empty."""
    told: FloatArray
    """(N, 3) what each robot tells: x, y and `since`, 0 if it knows of no place; room to work in."""


def new_site_memory(n_robots: int) -> SiteMemory:
    """Return memories without any site."""
    return SiteMemory(
        np.zeros((n_robots, N_SITES, 2)),
        np.zeros((n_robots, N_SITES), np.bool_),
        np.zeros(n_robots, np.bool_),
        np.zeros(n_robots, np.int32),
        np.zeros((n_robots, 3)),
    )


class Translation(NamedTuple):
    """What a `LearnerInterface` consists of."""

    is_compact: bool
    """Whether the view is the compact one; else it is the first `n_shown` columns as they are."""
    is_discrete: bool
    grips_itself: bool
    has_memory: bool
    behind_counts: bool
    """Quirk `obstacle_behind_counts`."""
    decision_ticks: int
    n_shown: int
    """Columns of the view before site memory and own columns."""
    n_driven: int
    """Values of a continuous action before those of the message."""
    own_columns: IntArray
    """(K,) columns of the observation that come last in the view."""
    view_starts: tuple[int, ...]
    """First columns of the observation, see `compact_view`."""
    pose_starts: tuple[int, int]
    """See `remember_sites`."""
    cargo_starts: tuple[int, int, int]
    """See `remember_sites`."""
    grip_starts: tuple[int, int, int]
    """See `automatic_grip`."""
    half: tuple[float, float]
    """Half the arena, m."""
    hearing_m: float
    """Distance within which robots tell each other of pickup sites; 0 = they do not."""
    sites: SiteMemory
    frames: Frames
    wheels: ActionArray
    """(N_MOTIONS, 2)."""
    grips: ActionArray
    """(N_GRIPS,)."""


@part
def is_near(place: FloatArray, x: float, y: float) -> bool:
    """Return whether a place lies in the window of a robot at (x, y), wherever in its cell the robot is."""
    return abs(place[0] - x) < _NEAR_M and abs(place[1] - y) < _NEAR_M


@kernel
def remember_sites(
    obs: ObsArray,
    pose_starts: tuple[int, int],
    cargo_starts: tuple[int, int, int],
    half: tuple[float, float],
    decision: int,
    memory: SiteMemory,
) -> None:
    """Bring the memories up to date with observations (N, D); twice with the same ones is as good as once.

    Rows of robots that are not in the world forget everything. `pose_starts` = first columns of position, heading;
    `cargo_starts` = those of carrying, los_cell, los_object; `half` = half the arena, m.
    """
    position, heading = pose_starts
    carrying, cell, window = cargo_starts
    half_x, half_y = half
    for i in range(obs.shape[0]):
        row = obs[i]
        place = memory.place[i]
        is_known = memory.is_known[i]
        if row[heading] == 0.0 and row[heading + 1] == 0.0:
            is_known[:] = False
            memory.carried[i] = False
            memory.since[i] = 0
            continue
        x = row[position] * half_x
        y = row[position + 1] * half_y
        carries = row[carrying] > 0.5
        off_x, off_y = nearest_object(row, (position, cell, window), half_x, half_y)
        sees = off_x != math.inf
        if carries and not memory.carried[i]:
            place[PICKUP, 0] = x
            place[PICKUP, 1] = y
            is_known[PICKUP] = True
            memory.since[i] = decision
            if is_near(place[SIGHTING], x, y):
                is_known[SIGHTING] = False  # it was this object
        memory.carried[i] = carries
        if carries and sees:
            place[SIGHTING, 0] = x + off_x
            place[SIGHTING, 1] = y + off_y
            is_known[SIGHTING] = True
        if not carries and not sees:
            for k in range(N_SITES):
                if is_near(place[k], x, y):
                    if k == PICKUP and is_known[k]:
                        memory.since[i] = decision
                    is_known[k] = False


@kernel
def tell_sites(
    obs: ObsArray, pose_starts: tuple[int, int], half: tuple[float, float], hearing_m: float, memory: SiteMemory
) -> None:
    """Let robots hear of the pickup sites of others within `hearing_m`, as far as they know where they are.

    All tell at once; the latest pick-up counts. What a robot has found empty since, it does not believe again.
    `pose_starts` and `half` as in `remember_sites`.
    """
    position, heading = pose_starts
    told = memory.told
    for i in range(obs.shape[0]):
        told[i, 0] = memory.place[i, PICKUP, 0]
        told[i, 1] = memory.place[i, PICKUP, 1]
        told[i, 2] = memory.since[i] if memory.is_known[i, PICKUP] else 0.0
    for i in range(obs.shape[0]):
        if obs[i, heading] == 0.0 and obs[i, heading + 1] == 0.0:
            continue
        for j in range(obs.shape[0]):
            x = (obs[j, position] - obs[i, position]) * half[0]
            y = (obs[j, position + 1] - obs[i, position + 1]) * half[1]
            if told[j, 2] > memory.since[i] and x * x + y * y <= hearing_m * hearing_m:
                memory.place[i, PICKUP, 0] = told[j, 0]
                memory.place[i, PICKUP, 1] = told[j, 1]
                memory.is_known[i, PICKUP] = True
                memory.since[i] = int(told[j, 2])


@kernel
def show_sites(
    obs: ObsArray, pose_starts: tuple[int, int], half: tuple[float, float], memory: SiteMemory, out: ObsArray
) -> None:
    """Write what is remembered, N_SITES times SITE_COLUMNS columns of `out`.

    `pose_starts` = first columns of position, heading in `obs` (N, D); `half` = half the arena, m.
    """
    position, heading = pose_starts
    half_x, half_y = half
    for i in range(obs.shape[0]):
        row = obs[i]
        for k in range(N_SITES):
            at = k * SITE_COLUMNS
            if not memory.is_known[i, k]:
                out[i, at : at + SITE_COLUMNS] = 0.0
                continue
            x = memory.place[i, k, 0] - row[position] * half_x
            y = memory.place[i, k, 1] - row[position + 1] * half_y
            write_direction(out[i], at, x, y, row[heading], row[heading + 1])
            out[i, at + 3] = min(1.0, math.sqrt(x * x + y * y) / FAR_M)


@part
def idle_grip(row: ObsArray, carrying: int) -> float:
    """Gripper command without a request: hold when carrying, release when empty."""
    return GRASP if row[carrying] > 0.5 else RELEASE


@kernel
def automatic_grip(obs: ObsArray, starts: tuple[int, int, int], actions: ActionArray) -> None:
    """Write the gripper column: grasp when empty and over an object or a cache, deliver when carrying in the nest.

    `starts` = first columns of ground, carrying, los_object.
    """
    ground, carrying, window = starts
    for i in range(obs.shape[0]):
        row = obs[i]
        below = row[ground : ground + GROUND_SENSORS]
        grip = idle_grip(row, carrying)
        if row[carrying] > 0.5:
            if sees_nest(below):
                grip = DELIVER
        elif is_over_object(row, window) or sees_cache(below):
            grip = GRASP
        actions[i, 2] = grip


@kernel
def numbered_actions(
    chosen: IntArray, wheels: ActionArray, grips: ActionArray, obs: ObsArray, carrying: int, actions: ActionArray
) -> None:
    """Write (N, 3) commands for actions by number.

    `wheels` = (N_MOTIONS, 2) wheel commands per motion; `grips` = (N_GRIPS,) command per gripper action.
    """
    for i in range(chosen.shape[0]):
        number = chosen[i]
        if number < N_MOTIONS:
            actions[i, 0] = wheels[number, 0]
            actions[i, 1] = wheels[number, 1]
            actions[i, 2] = idle_grip(obs[i], carrying)
        else:
            actions[i, 0] = 0.0
            actions[i, 1] = 0.0
            actions[i, 2] = grips[number - N_MOTIONS]


@kernel
def mask_actions(obs: ObsArray, starts: tuple[int, int, int, int, int], dynamic_caches: bool, mask: BoolArray) -> None:
    """Write which actions make sense, (N, N_MOTIONS) or (N, N_MOTIONS + N_GRIPS); at least one per row.

    `starts` = first columns of ground, carrying, interacting, active, los_object. During an interaction, only `stand`
    makes sense if the gripper is automatic; otherwise only gripper actions do, because a motion would cancel it.
    """
    ground, carrying, interacting, active, window = starts
    with_grips = mask.shape[1] > N_MOTIONS
    for i in range(obs.shape[0]):
        row = obs[i]
        allowed = mask[i]
        allowed[:] = False
        if row[active] < 0.5:
            allowed[_STAND] = True
            continue
        busy = row[interacting] > 0.5
        allowed[:N_MOTIONS] = not busy
        if not with_grips:
            allowed[_STAND] = True
            continue
        below = row[ground : ground + GROUND_SENSORS]
        if row[carrying] > 0.5:
            in_nest = sees_nest(below)
            allowed[_RELEASE] = True
            allowed[_DELIVER] = in_nest or sees_cache(below)
            allowed[_SITE] = dynamic_caches and not in_nest
            allowed[_CREATE_CACHE] = allowed[_SITE]
        else:
            allowed[_GRASP] = busy or is_over_object(row, window) or sees_cache(below)
