"""The world as compiled functions see it: the arrays of `world.state` and the constants of a run, in named tuples.

N, M, K are the numbers of robots, objects and cache slots, as in `world.state`.
"""

from typing import NamedTuple, TypeAlias

from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray, ObsArray
from swarm_forage_env.world.kernels.interact import InteractionState, Rules

Memory: TypeAlias = tuple[IntArray, IntArray, FloatArray]
"""Pairs of robots in touch: number of partners (N,), partners (N, slots), common speeds (N, slots) in m/s."""


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


class Sensors(NamedTuple):
    """Buffers and constants of all sensors."""

    obs: ObsArray
    """(N, D), rewritten in every tick."""
    near: BoolArray
    """(N,) whether any proximity beam may have hit something in the last sweep."""
    bins: tuple[float, IntArray, IntArray]
    """Present robots by place as of the last sweep: cell size in m, first_in_bin, next_in_bin."""
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
    """Cells along x, along y, objects."""
    shares: ObsArray
    """(M + 1,) what the window shows: 0 for no object, (row + 1) / M for each."""
    obstacles: FloatArray
    """(B, 4) boxes on the floor: x low, y low, x high, y high in m."""
    cache_half_side: int
    reads_light: bool
    light_of_carriers_only: bool
    reads_ground: bool
    reads_line_of_sight: bool
    behind_counts: bool
    """Quirk `obstacle_behind_counts`."""
    half_windows: IntArray
    """(N,) cells that a robot sees on either side of its own."""
    kinds: ObsArray
    """(N, C) what robots observe of their kind; (0, C) where they do not differ."""
    kind_start: int
    """First column of that."""
    blanks: IntArray
    """(B, 4) what stays zero, as `kernels.kinds.blank` takes it."""


class Wandering(NamedTuple):
    """How objects move by themselves."""

    probability: float
    """Per object and tick; 0 = they lie still."""
    area: tuple[int, int, int, int]
    """Cells on which they may lie, half-open box."""
    self_conflict: bool
    """Quirk `motion_self_conflict`."""


class World(NamedTuple):
    """Everything that a tick reads and writes."""

    state: InteractionState
    rules: Rules
    heading: FloatArray
    facing: FloatArray
    wheel_speed: FloatArray
    present: BoolArray
    twist: FloatArray
    """(N + 1, 3) velocity x, y in m/s and turn rate in rad/s, for the bodies; the last row stays zero."""
    command: FloatArray
    """(N, 2) scratch."""
    drive_limits: FloatArray
    """Wheel scale, centre-speed limit, difference limit in m/s, wheel base in m."""
    speeds: FloatArray
    """(N,) factor on the wheels' speeds of each robot, by its kind."""
    dt_s: float
    touch_m: float
    """Distance of centres within which two robots touch."""
    pressing: tuple[Memory, Memory]
    """Pairs in touch as of the last tick, by turns in the first (before even ticks) or in the second."""
    sensors: Sensors
    interfering: BoolArray
    interference_sum: FloatArray
    wandering: Wandering
    n_static_caches: int
    """Caches that are there again when they were used up; 0 where there are none or they are dynamic."""
    has_caches: bool
