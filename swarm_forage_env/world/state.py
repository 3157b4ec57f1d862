"""The arrays of a world, in named tuples that Python and compiled functions share.

N, M, K are the numbers of robots, objects and cache slots. Row i is always robot i. Arrays are edited, never replaced.
There are no rules here; every rule is a function in another module of this folder, which edits the arrays it names.
A *list* is an array with room for all entries there can be, and one more place at the end that holds their number.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np

from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.contract.types import BitArray, BoolArray, CodeArray, FloatArray, IntArray, ObsArray

N_HANDLERS = 5
"""Kinds of interactions of which a tick can finish one, see `kernels.interact`."""
CHANGES = 16
"""Squares of the floor that may change in a tick before robots look at all squares again."""


def listed(entries: IntArray) -> IntArray:
    """Return the entries of a list, a view."""
    return entries[: entries[-1]]


def make_list(entries: IntArray, values: IntArray | Sequence[int]) -> None:
    """Let a list hold these values."""
    entries[: len(values)] = values
    entries[len(values) : -1] = -1
    entries[-1] = len(values)


class SwarmState(NamedTuple):
    """All robots that can appear in a run. SI units, arena frame with the origin at the lower left."""

    position: FloatArray
    """(N, 2) m."""
    heading: FloatArray
    """(N,) rad in (-pi, pi], 0 = +x, counter-clockwise."""
    facing: FloatArray
    """(N, 2) cosine and sine of the heading."""
    wheel_speed: FloatArray
    """(N, 2) m/s, left and right, as applied in the last tick (after limits, throttle and noise)."""
    carried_object: IntArray
    """(N,) object row, -1 = none."""
    cargo_from_cache: BoolArray
    """(N,) whether the carried object was taken out of a cache."""
    pending_kind: CodeArray
    """(N,) interaction in progress (codes of `kernels.interact`), 0 = none."""
    pending_band: CodeArray
    """(N,) gripper band that started it; another band cancels it."""
    pending_target: IntArray
    """(N,) object row or cache serial of the interaction in progress, -1 = none."""
    pending_until: IntArray
    """(N,) tick in which the interaction in progress can take effect, 0 = none."""
    present: BoolArray
    """(N,) born and not dead: has a body."""
    active: BoolArray
    """(N,) present and not in repair: part of the tasked swarm. active implies present."""
    dead: BoolArray
    """(N,) was present and is no longer; `position` tells where it ended. Only pictures read it, and whoever keeps
    robots back at a reset, until they are born, unsets it."""

    @classmethod
    def empty(cls, n_robots: int) -> "SwarmState":
        """All robots at the origin, present and active, carrying nothing."""
        return cls(
            position=np.zeros((n_robots, 2)),
            heading=np.zeros(n_robots),
            facing=np.tile([1.0, 0.0], (n_robots, 1)),
            wheel_speed=np.zeros((n_robots, 2)),
            carried_object=np.full(n_robots, -1, np.int32),
            cargo_from_cache=np.zeros(n_robots, np.bool_),
            pending_kind=np.zeros(n_robots, np.int8),
            pending_band=np.zeros(n_robots, np.int8),
            pending_target=np.full(n_robots, -1, np.int32),
            pending_until=np.zeros(n_robots, np.int32),
            present=np.ones(n_robots, np.bool_),
            active=np.ones(n_robots, np.bool_),
            dead=np.zeros(n_robots, np.bool_),
        )


class ObjectState(NamedTuple):
    """All objects and the floor they lie on."""

    floor: IntArray
    """(ny, nx) code per square, row = y: CELL_EMPTY, CELL_OBJECT + object row, CELL_NEST, CELL_OBSTACLE or
    CELL_CACHE - slot."""
    status: CodeArray
    """(M,) ObjectStatus."""
    cell: IntArray
    """(M, 2) square (x, y) of a free object; the cache's centre square of a cached one; else (-1, -1)."""
    cache_slot: IntArray
    """(M,) cache slot of a cached object, else -1."""
    carriers: IntArray
    """(M,) robots that have carried the object since it was last placed."""
    waiting: IntArray
    """(M + 1,) list of the rows of waiting objects, longest wait first."""

    @classmethod
    def empty(cls, floor: IntArray, n_objects: int) -> "ObjectState":
        """All objects waiting, beside a floor on which none lies."""
        return cls(
            floor=floor,
            status=np.full(n_objects, ObjectStatus.WAITING, np.int8),
            cell=np.full((n_objects, 2), -1, np.int32),
            cache_slot=np.full(n_objects, -1, np.int32),
            carriers=np.zeros(n_objects, np.int32),
            waiting=np.arange(n_objects + 1, dtype=np.int32),
        )


class CacheState(NamedTuple):
    """Cache slots. A slot is reused after its cache is gone; a serial number is never reused."""

    alive: BoolArray
    """(K,) whether the slot holds a cache."""
    cell: IntArray
    """(K, 2) centre square (x, y)."""
    serial: IntArray
    """(K,) serial number of the cache, from 1, in order of creation; 0 = slot never used."""
    count: IntArray  # pyright: ignore[reportIncompatibleMethodOverride] - nobody counts values of the tuple
    """(K,) objects inside; at least 2 while alive, 0 otherwise."""

    @classmethod
    def empty(cls, n_slots: int) -> "CacheState":
        """No cache in `n_slots` slots."""
        return cls(
            alive=np.zeros(n_slots, np.bool_),
            cell=np.full((n_slots, 2), -1, np.int32),
            serial=np.zeros(n_slots, np.int32),
            count=np.zeros(n_slots, np.int32),
        )


class StepEvents(NamedTuple):
    """What happened in this tick, per robot, rewritten in place; and cumulative counters."""

    code: CodeArray
    """(N,) `Event` code."""
    event_object: IntArray
    """(N,) object row of the event, -1 = none."""
    event_cache: IntArray
    """(N, 4) serial, centre square x, y, count of the event's cache; serial 0 = none."""
    first_picked: BoolArray
    """(N,) picked up an object that no robot had carried since it was placed."""
    interfering: BoolArray
    """(N,) active and the obstacle rule holds on true readings."""
    happened: BoolArray
    """(1,) whether any robot asked for an interaction or was in one; if not, no event code is set."""
    counters: np.ndarray
    """(len(Counter),) int64, cumulative since reset."""
    interference_sum: FloatArray
    """(1,) sum over ticks of the fraction of active robots in interference."""

    @classmethod
    def empty(cls, n_robots: int) -> "StepEvents":
        """No events, all counters zero."""
        return cls(
            code=np.zeros(n_robots, np.int8),
            event_object=np.full(n_robots, -1, np.int32),
            event_cache=np.zeros((n_robots, 4), np.int32),
            first_picked=np.zeros(n_robots, np.bool_),
            interfering=np.zeros(n_robots, np.bool_),
            happened=np.zeros(1, np.bool_),
            counters=np.zeros(len(Counter), np.int64),
            interference_sum=np.zeros(1),
        )


class Requests(NamedTuple):
    """What robots ask for in a tick, while it is served, and what is left to be placed afterwards."""

    queue: IntArray
    """(2 N,) scratch: robots with a request and what they ask."""
    handler_used: BoolArray
    """(N_HANDLERS,) scratch: kinds of interaction that finished this tick."""
    displaced: IntArray
    """(N + 1,) list of objects to re-place: delivered, or dropped without a free square."""
    creators: IntArray
    """(N + 1,) list of robots whose CREATE_CACHE drop left an object lying at their square."""
    changed: IntArray
    """(`CHANGES` + 1, 2) squares (x, y) of the floor that changed in this tick outside of Python; in the last row first
    how many, which is more than `CHANGES` where they are not all listed."""
    handling_ticks: IntArray
    """(2,) ticks that a pick-up and a drop take which start in this tick, at least 1."""

    @classmethod
    def empty(cls, n_robots: int, pickup_ticks: int, drop_ticks: int) -> "Requests":
        """No requests."""
        return cls(
            queue=np.zeros(2 * n_robots, np.int32),
            handler_used=np.zeros(N_HANDLERS, np.bool_),
            displaced=np.zeros(n_robots + 1, np.int32),
            creators=np.zeros(n_robots + 1, np.int32),
            changed=np.zeros((CHANGES + 1, 2), np.int32),
            handling_ticks=np.array([pickup_ticks, drop_ticks], np.int32),
        )


class WorldState(NamedTuple):
    """Robots, objects, caches and what happens to them."""

    swarm: SwarmState
    objects: ObjectState
    caches: CacheState
    events: StepEvents
    requests: Requests


class Rules(NamedTuple):
    """Constants of interactions."""

    nests: FloatArray
    """(K, 4) x low, y low, x high, y high of every nest, in m."""
    area_x_low: int
    area_y_low: int
    area_x_high: int
    area_y_high: int
    """Squares on which objects may lie, half-open."""
    cache_half_side: int
    """(cache side in squares - 1) / 2."""
    cache_proximity_m: float
    """SITE and CREATE_CACHE are refused this close to a cache centre."""
    dynamic_caches: bool
    serialized: bool
    """At most one interaction per handler finishes in a tick (quirk `serialized_interactions`)."""
    only_delivering_counts: bool
    """In the nest only DELIVER delivers (quirk of this name)."""


class Columns(NamedTuple):
    """First column of every slice of the observation that sensors write."""

    proximity: int
    light: int
    ground: int
    wheel_speed: int
    carrying: int
    los_cell: int
    los_object: int
    los_cache: int


Bins: TypeAlias = tuple[float, IntArray, IntArray]
"""Present robots by place, as of the last look: side of a bin's cells in m, first_in_bin (bins,), next_in_bin (N,),
-1 = end; see `kernels.bins`."""


class Sensors(NamedTuple):
    """Buffers and constants of all sensors."""

    obs: ObsArray
    """(N, D), rewritten in every tick."""
    near: BoolArray
    """(N,) whether any proximity beam may have hit something in the last sweep."""
    lit: BoolArray
    """(N,) whether a robot looked for lights in the last tick."""
    kept: BoolArray
    """(1,) whether `obs` is as the last tick left it: only while nobody but the world has it, in `kernels.tick.run`."""
    bins: Bins
    occupied: BitArray
    """(words,) a bit for each cell of `bins` with a robot, see `kernels.bins`; one word in small swarms."""
    columns: Columns
    interior: FloatArray
    """x low, y low, x high, y high of the free floor in m."""
    lights: FloatArray
    """(L, 3) x, y, height in m."""
    intensity: float
    radius_m: float
    reach_m: float
    """Of a proximity beam, beyond the body."""
    scales: FloatArray
    """Wheel scale in m/s, arena width and height in m."""
    sizes: tuple[int, int, int]
    """Squares along x, along y, objects."""
    shares: ObsArray
    """(M + 1,) what the window shows: 0 for no object, (row + 1) / M for each."""
    obstacles: FloatArray
    """(B, 4) boxes on the floor: x low, y low, x high, y high in m."""
    cache_half_side: int
    reads_light: bool
    light_is_due: BoolArray
    """(1,) whether light is sensed in this tick; False only in `kernels.tick.run`, while no decision is near."""
    light_of_carriers_only: bool
    light_seen: FloatArray
    """(2, N) scratch."""
    reads_ground: bool
    reads_line_of_sight: bool
    behind_counts: bool
    """Quirk `obstacle_behind_counts`."""


Touching: TypeAlias = tuple[IntArray, IntArray, FloatArray]
"""Pairs of robots in touch: number of partners (N,), partners (N, slots), common speeds (N, slots) in m/s."""


class Motion(NamedTuple):
    """How robots are driven, and how they press against each other."""

    twist: FloatArray
    """(N + 1, 3) velocity x, y in m/s and turn rate in rad/s, for the bodies; the last row stays zero."""
    command: FloatArray
    """(N, 2) scratch."""
    drive_limits: FloatArray
    """Wheel scale, centre-speed limit, difference limit in m/s, wheel base in m."""
    dt_s: float
    touch_m: float
    """Distance of centres within which two robots touch."""
    touching: tuple[Touching, Touching]
    """Pairs in touch as of the last tick, by turns in the first (before even ticks) or in the second."""


class Wandering(NamedTuple):
    """How objects move by themselves."""

    probability: float
    """Per object and tick; 0 = they lie still."""
    area: tuple[int, int, int, int]
    """Squares on which they may lie, half-open box."""
    self_conflict: bool
    """Quirk `motion_self_conflict`."""


class Source(NamedTuple):
    """Where objects come from in one run: regions of the floor, in groups of equal capacity."""

    regions: IntArray
    """(R, 4) boxes in cells, half-open: x low, y low, x high, y high; rows of one group are neighbours."""
    capacity: IntArray
    """(R,) most objects in a region, also counting those dropped there; `kernels.placement.UNLIMITED` = as many as it
    has free cells."""
    group_start: IntArray
    """(G + 1,) first region of each group, then R."""


class PlacementDraws(NamedTuple):
    """Random numbers for the next objects that are placed, drawn ahead."""

    rows: FloatArray
    """(rows, `kernels.placement.DRAWS`) a row for each object."""
    n_used: IntArray
    """(1,) how many of the rows are used up."""


class ArenaArrays(NamedTuple):
    """Everything that a tick of an arena reads and writes."""

    state: WorldState
    rules: Rules
    motion: Motion
    sensors: Sensors
    wandering: Wandering
    source: Source
    placement_draws: PlacementDraws
    n_static_caches: int
    """Caches that are there again when they were used up; 0 where there are none or they are dynamic."""
    has_caches: bool
