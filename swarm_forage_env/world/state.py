"""The state of the world as arrays: robots, objects, caches, this tick's events. Row i is always robot i.

There are no rules here; every rule is a function in another module of this folder, which edits the arrays it names.
"""

from dataclasses import dataclass, field

import numpy as np

from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_NEST, CELL_OBSTACLE, Counter, ObjectStatus
from swarm_forage_env.contract.types import BoolArray, CodeArray, FloatArray, IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig


@dataclass(slots=True)
class SwarmState:
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


@dataclass(slots=True)
class ObjectState:
    """All objects and the floor they lie on."""

    floor: IntArray
    """(ny, nx) code per cell, row = y: object row, CELL_EMPTY, CELL_NEST, CELL_OBSTACLE or CELL_CACHE - slot."""
    status: CodeArray
    """(M,) ObjectStatus."""
    cell: IntArray
    """(M, 2) cell (x, y) of a free object; the cache's centre cell of a cached one; else (-1, -1)."""
    cache_slot: IntArray
    """(M,) cache slot of a cached object, else -1."""
    carriers: IntArray
    """(M,) robots that have carried the object since it was last placed."""
    waiting: list[int] = field(default_factory=list)
    """Rows of waiting objects, longest wait first."""

    @classmethod
    def empty(cls, config: ScenarioConfig) -> "ObjectState":
        """All objects waiting, the floor painted with obstacles and nest only."""
        n_objects = config.objects.n_objects
        nx, ny = config.arena.n_cells
        floor = np.full((ny, nx), CELL_EMPTY, np.int32)
        # The nest comes last: an obstacle beside it may keep cells free that reach into it.
        painted = [*((box, CELL_OBSTACLE) for box in config.obstacle_cells), (config.arena.nest_cells, CELL_NEST)]
        for (x_low, y_low, x_high, y_high), code in painted:
            floor[y_low:y_high, x_low:x_high] = code
        return cls(
            floor=floor,
            status=np.full(n_objects, ObjectStatus.WAITING, np.int8),
            cell=np.full((n_objects, 2), -1, np.int32),
            cache_slot=np.full(n_objects, -1, np.int32),
            carriers=np.zeros(n_objects, np.int32),
            waiting=list(range(n_objects)),
        )


@dataclass(slots=True)
class CacheState:
    """Cache slots. A slot is reused after its cache is gone; a serial number is never reused."""

    alive: BoolArray
    """(K,) whether the slot holds a cache."""
    cell: IntArray
    """(K, 2) centre cell (x, y)."""
    serial: IntArray
    """(K,) serial number of the cache, from 1, in order of creation; 0 = slot never used."""
    count: IntArray
    """(K,) objects inside; at least 2 while alive, 0 otherwise."""
    last_serial: int = 0

    @classmethod
    def empty(cls, n_slots: int) -> "CacheState":
        """No cache in `n_slots` slots."""
        return cls(
            alive=np.zeros(n_slots, np.bool_),
            cell=np.full((n_slots, 2), -1, np.int32),
            serial=np.zeros(n_slots, np.int32),
            count=np.zeros(n_slots, np.int32),
        )


@dataclass(slots=True)
class StepEvents:
    """What happened in this tick, per robot, rewritten in place; and cumulative counters."""

    code: CodeArray
    """(N,) `Event` code."""
    event_object: IntArray
    """(N,) object row of the event, -1 = none."""
    event_cache: IntArray
    """(N, 4) serial, centre cell x, y, count of the event's cache; serial 0 = none."""
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
