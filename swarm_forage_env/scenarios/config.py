"""Frozen, complete configurations that check their values when they are made.

A warehouse and a disaster zone are two configurations of the same environment. Presets are in `presets`.
"""

import dataclasses
import math
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, cast, get_args

from msgspec import Meta

from swarm_forage_env._internal.fields import (
    Amount,
    Checked,
    ConfigError,
    FileName,
    Number,
    Positive,
    Share,
    Whole,
    one_of,
)
from swarm_forage_env.scenarios.floor import (
    CELL_M,
    CELLS_PER_M,
    EAST_WALL_M,
    PLACEMENTS,
    POSITIONS,
    WALL_M,
    WHEEL_SCALE_MPS,
    Box,
    Rectangle,
    cache_centre_box,
    distributable_box,
    free_area,
    overlap_cells,
    source_boxes,
)
from swarm_forage_env.scenarios.obstacles import Boxes, blocked_cells, check_boxes
from swarm_forage_env.scenarios.performance import performance_of
from swarm_forage_env.scenarios.quirks import Quirks

CacheKind: TypeAlias = Literal["none", "static", "dynamic"]
CACHE_KINDS = get_args(CacheKind)
Physics: TypeAlias = Literal["compiled", "chipmunk"]
PHYSICS_ENGINES = get_args(Physics)
Place: TypeAlias = tuple[Positive, Positive]
"""x, y in m."""
MAX_DISC_SHARE = 0.4
"""Robot discs may cover at most this share of the start area; with more, random start poses cannot be drawn."""
MAX_HANDLING_TICKS = 1_000_000
"""Longest pick-up or drop (our choice: twenty runs of the paper, far below what a 32-bit tick holds)."""
HandlingTicks: TypeAlias = Annotated[int, Meta(ge=1, le=MAX_HANDLING_TICKS)]
MAX_CELLS = 2**30
"""Largest floor, 6.5 km square (our choice: its codes take 4 GiB, half of which a million robots at 5 % need)."""

MAX_SUBSTEPS = 100
"""Most substeps of a tick (our choice: overlap stops shrinking long before, and every one takes time)."""
MIN_SUBSTEPS = 4
"""Fewest substeps of a tick that settle a crowd. All must be equal: Chipmunk works out how fast to undo an overlap from
the length of one substep and moves bodies by it in the next, so that a longer one after a shorter throws them too far.
Mean of the deepest overlap per tick of 512 robots, packed into a corner, that all push into it, as a share of a
diameter: 4 equal ones at most 0.06; 3 equal ones 0.95 and (0.5, 0.2, 0.15, 0.15) 0.90, which is one robot on top of
another (60 solver rounds)."""


def _require(condition: bool, message: str) -> None:
    if not condition:
        raise ConfigError(message)


def _snapped(box: Rectangle) -> Box:
    """Cells nearest to a box, at least one along each axis; half-open."""
    x_low, y_low, x_high, y_high = (round(edge / CELL_M) for edge in box)
    return x_low, y_low, max(x_low + 1, x_high), max(y_low + 1, y_high)


def _lights_over(nest: Rectangle) -> tuple[tuple[float, float], ...]:
    """Where the lights of a nest hang, see `ArenaConfig.lights_m`."""
    x_low, y_low, x_high, y_high = nest
    size_x, size_y = x_high - x_low, y_high - y_low
    centre_x, centre_y = (x_low + x_high) / 2, (y_low + y_high) / 2
    if abs(size_x - size_y) < 1e-9:
        return ((centre_x, centre_y),)
    if size_y > size_x:
        return tuple((centre_x, y_low + share * size_y) for share in (0.25, 0.5, 0.75))
    return tuple((x_low + share * size_x, centre_y) for share in (0.25, 0.5, 0.75))


@dataclass(frozen=True, kw_only=True, slots=True)
class ArenaConfig(Checked):
    """A rectangular floor with walls and one nest or several. Origin at the lower left corner."""

    called: ClassVar[str] = "arena"

    width_m: Positive
    """Extent X along x, a multiple of the 0.2 m cell."""
    height_m: Positive
    """Extent Y along y, a multiple of the 0.2 m cell."""
    nest_centre_m: Place
    nest_size_m: Place
    """The nest is snapped to whole cells."""
    further_nests: Boxes = ()
    """Boxes (x low, y low, x high, y high) in m, snapped to whole cells, that are nests like the first one: they have
    lights and take deliveries. Static caches lie between the sources and the first nest."""
    obstacles: Boxes = ()
    """Boxes (x low, y low, x high, y high) in m that robots cannot enter (`scenarios.obstacles`)."""

    def check(self) -> None:
        """Refuse a floor that is too large, and nests and obstacles that do not fit on it."""
        for name, extent in (("width_m", self.width_m), ("height_m", self.height_m)):
            cells = extent / CELL_M
            _require(
                abs(cells - round(cells)) < 1e-6 and cells >= 10,
                f"Expected arena.{name} to be a multiple of {CELL_M} m and at least 2 m, got {extent}.",
            )
        nx, ny = self.n_cells
        _require(
            nx * ny <= MAX_CELLS,
            f"Expected an arena of at most {MAX_CELLS:,} cells of {CELL_M} m, whose floor takes up to 4 GiB of memory, "
            f"got {self.width_m} x {self.height_m} m; choose a smaller one, or fewer robots where a density sets it.",
        )
        x_low, y_low, x_high, y_high = self.nest_cells
        _require(
            0 <= x_low < x_high <= nx and 0 <= y_low < y_high <= ny,
            f"Expected a nest of at least one cell ({CELL_M} m) inside the {self.width_m} x {self.height_m} m arena, "
            f"got centre {self.nest_centre_m} and size {self.nest_size_m}.",
        )
        extent = self.width_m, self.height_m
        check_boxes("further_nests", self.further_nests, *extent, clear_of=(self.nest_box_m,), are_apart=True)
        check_boxes("obstacles", self.obstacles, *extent, clear_of=self.nest_boxes_m)

    @property
    def n_cells(self) -> tuple[int, int]:
        """Number of floor cells along x and y."""
        return round(self.width_m / CELL_M), round(self.height_m / CELL_M)

    @property
    def nest_cells(self) -> Box:
        """Cells of the first nest, half-open."""
        (cx, cy), (sx, sy) = self.nest_centre_m, self.nest_size_m
        x_low, y_low = round((cx - sx / 2) / CELL_M), round((cy - sy / 2) / CELL_M)
        return (x_low, y_low, x_low + round(sx / CELL_M), y_low + round(sy / CELL_M))

    @property
    def nest_box_m(self) -> Rectangle:
        """Closed rectangle of the first nest: x low, y low, x high, y high."""
        return self.nest_boxes_m[0]

    @property
    def all_nest_cells(self) -> tuple[Box, ...]:
        """Cells of every nest, half-open; those of the first come first."""
        return (self.nest_cells, *map(_snapped, self.further_nests))

    @property
    def nest_boxes_m(self) -> tuple[Rectangle, ...]:
        """Closed rectangles of all nests, x low, y low, x high, y high; that of the first comes first."""
        return tuple(cast("Rectangle", tuple(edge / CELLS_PER_M for edge in box)) for box in self.all_nest_cells)

    @property
    def nest_centres_m(self) -> tuple[tuple[float, float], ...]:
        """Centre of every nest, x, y; that of the first comes first."""
        further = (((box[0] + box[2]) / 2, (box[1] + box[3]) / 2) for box in self.nest_boxes_m[1:])
        return (self.nest_centre_m, *further)

    @property
    def distributable_cells(self) -> Box:
        """Cells on which objects may lie, half-open."""
        return distributable_box(*self.n_cells)

    @property
    def interior_m(self) -> tuple[float, float, float, float]:
        """Free interior between the walls: x low, y low, x high, y high."""
        return (WALL_M, WALL_M, self.width_m - EAST_WALL_M, self.height_m - WALL_M)

    @property
    def lights_m(self) -> tuple[tuple[float, float, float], ...]:
        """Nest lights (x, y, height): one over a square nest, three at 25, 50, 75 % along a rectangular one."""
        height = (self.width_m * self.height_m) ** 0.25
        return tuple((x, y, height) for nest in self.nest_boxes_m for x, y in _lights_over(nest))

    @property
    def light_intensity(self) -> float:
        """Distance scale of the nest lights, (X Y)^(1/2)."""
        return math.sqrt(self.width_m * self.height_m)


@dataclass(frozen=True, kw_only=True, slots=True)
class RobotConfig(Checked):
    """Differential-drive robots, all alike; defaults are those of the foot-bot used by the paper."""

    called: ClassVar[str] = "robots"

    n_robots: Whole
    radius_m: Positive = 0.085036758
    wheel_base_m: Positive = 0.14
    max_speed_mps: Positive = 0.10
    """Limit of the centre speed."""
    max_wheel_difference_mps: Positive = 0.20
    """Limit of right minus left wheel speed."""
    start_margin_m: Positive = 2.8
    """Robots start at uniform positions at least this far from the arena border."""
    neighbours_seen: Annotated[int, Meta(ge=0, le=64)] = 0
    """How many of the nearest robots a robot observes; 0 = none, as in the paper. Our choice: at most 256 columns."""
    neighbour_range_m: Positive = 2.0
    """How far it sees them, between centres (our choice: twice the side of its window on the floor)."""
    message_size: Annotated[int, Meta(ge=0, le=64)] = 0
    """Numbers that a robot may broadcast in every tick, at most 64; 0 = robots say nothing, as in the paper."""
    message_range_m: Positive = 2.0
    """How far a message is heard, between centres (our choice, as for neighbours)."""

    def check(self) -> None:
        """Refuse start poses inside of a wall."""
        least = EAST_WALL_M + self.radius_m
        _require(
            self.start_margin_m >= least,
            f"Expected robots.start_margin_m >= {least:.3f} (wall plus radius), got {self.start_margin_m}.",
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class ObjectConfig(Checked):
    """One-cell objects: how many, where they appear, whether they wander, how long handling one takes."""

    called: ClassVar[str] = "objects"

    n_objects: Whole
    placement: str
    """One of `floor.PLACEMENTS`, or `floor.POSITIONS`."""
    object_positions_m: tuple[Place, ...] = ()
    """With placement "positions": places (x, y) in m; an object lies on the cell around one of them."""
    walk_probability: Share = 0.0
    """Probability p_rw that a free object takes a one-cell step, per object and tick."""
    pickup_ticks: HandlingTicks = 1
    """Ticks from the start of a pick-up, from the floor or a cache, to its effect; the robot stands still."""
    drop_ticks: HandlingTicks = 1
    """The same for a drop in the nest, into a cache or at a cache site. Letting go over open floor acts at once."""

    @property
    def is_drawn(self) -> bool:
        """Whether the regions with objects are drawn in each run."""
        return self.placement in ("power_law", "heap")

    def check(self) -> None:
        """Refuse an unknown placement, and positions that it does not need or lacks."""
        one_of("objects.placement", self.placement, (*PLACEMENTS, POSITIONS))
        _require(
            bool(self.object_positions_m) == (self.placement == POSITIONS),
            f"Expected objects.object_positions_m with placement {POSITIONS!r}, and only with it, got "
            f"{len(self.object_positions_m)} positions with {self.placement!r}.",
        )


@dataclass(frozen=True, kw_only=True, slots=True)
class CacheConfig(Checked):
    """Caches: square floor areas that hold objects for robots to add to or take from."""

    called: ClassVar[str] = "cache"

    side_share: Annotated[float, Meta(gt=0.0, le=0.5)] = 0.2
    """Nominal side as a share of max(X, Y)."""
    distance_share: Positive = 0.2
    """min_dist as a share of min(X, Y): objects this close to a CREATE_CACHE drop join a dynamic cache."""
    static_size: Annotated[int, Meta(ge=2, le=MAX_CELLS)] = 2
    """Objects that a static cache is created with."""
    respawn_scale: Amount = 0.05
    """Scale s of the restoration probability of static caches."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RewardConfig(Checked):
    """Weights of the reward terms in `world.kernels.reward`; only learners use them. Zero switches a term off."""

    called: ClassVar[str] = "reward"

    delivery: Number = 1.0
    """Per object delivered to the nest."""
    first_pickup: Number = 0.1
    """Per pick-up of an object that no robot had carried since it was placed."""
    nest_progress: Number = 0.0
    """Per metre that a carrying robot comes closer to the centre of the nearest nest."""
    interference: Number = 0.0
    """Per tick in interference; give a negative weight for a penalty."""
    tick: Number = 0.0
    """Per tick of an active robot; give a negative weight for a cost of living."""
    team: bool = False
    """Every active robot receives the mean over active robots instead of its own reward."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScenarioConfig(Checked):
    """A complete scenario: everything that a run needs except the policy, the wrappers and the seed."""

    called: ClassVar[str] = "scenario"

    name: FileName
    arena: ArenaConfig
    robots: RobotConfig
    objects: ObjectConfig
    caches: CacheKind = "none"
    """Which caches there are: "none", "static" or "dynamic"."""
    cache: CacheConfig = field(default_factory=CacheConfig)
    reward: RewardConfig = field(default_factory=RewardConfig)
    performance: str = "collected"
    """What of a run is its performance: a recorded column ("n_carrying"), "1/" and a column of which less is better, or
    "task_balance", "cache_load" (`scenarios.performance`). It changes how a run is read, not the run."""
    dt_s: Positive = 0.2
    """Length of a control step (tick)."""
    horizon_s: Positive = 10_000.0
    interval_s: Positive = 200.0
    """Length of a recording interval."""
    physics: Physics = "compiled"
    """What moves the bodies and resolves contacts: "chipmunk" (`world.chipmunk`) or "compiled" (`world.bodies`), which
    has the same model of contact and is faster. Runs agree until heaps of several robots part them."""
    physics_substeps: Annotated[tuple[Share, ...], Meta(max_length=MAX_SUBSTEPS)] = (0.25,) * 4
    """Substeps of the engine as equal shares of a tick, `MIN_SUBSTEPS` to `MAX_SUBSTEPS`. Free motion is exact for any
    shares. A contact is resolved one substep late, so a substep limits how deep two robots are pushed into each other
    when a tick ends: 6 % of a diameter when they drive head-on (`tests/science/test_physics_convergence.py`)."""
    quirks: Quirks = field(default_factory=Quirks)

    def check(self) -> None:
        """Refuse a world that cannot be: its clock, its physics, and its room for robots, objects and caches."""
        performance_of(self.performance)  # refuses unknown names
        substeps = self.physics_substeps
        _require(
            len(substeps) >= MIN_SUBSTEPS and abs(sum(substeps) - 1.0) < 1e-9 and max(substeps) - min(substeps) < 1e-6,
            f"Expected scenario.physics_substeps to be at least {MIN_SUBSTEPS} equal shares of a tick that sum to 1 "
            f"(others squeeze robots in a crowd through each other), got {substeps}.",
        )
        for name in ("horizon_s", "interval_s"):
            ticks = getattr(self, name) / self.dt_s
            _require(
                abs(ticks - round(ticks)) < 1e-6 and round(ticks) >= 1,
                f"Expected {name} to be a whole number of ticks of {self.dt_s} s, got {getattr(self, name)}.",
            )
        _require(
            self.cache_side_cells >= 1,
            f"Expected cache.side_share to give caches of at least one cell ({CELL_M} m), got {self.cache.side_share} "
            f"of max(X, Y) = {max(self.arena.width_m, self.arena.height_m)} m.",
        )
        speed = min(self.robots.max_speed_mps, WHEEL_SCALE_MPS)
        _require(
            speed * self.dt_s <= self.robots.radius_m,
            f"Expected robots to drive at most their radius of {self.robots.radius_m} m per tick (or they pass through "
            f"each other), got {speed} m/s for dt_s = {self.dt_s} s; lower dt_s or max_speed_mps.",
        )
        self._check_room_for_robots()
        self._check_room_for_objects()
        if self.caches == "dynamic":
            self._check_room_for_caches()

    def _check_room_for_robots(self) -> None:
        margin, radius, n_robots = self.robots.start_margin_m, self.robots.radius_m, self.robots.n_robots
        width, height = self.arena.width_m - 2 * margin, self.arena.height_m - 2 * margin
        _require(
            width > 0 and height > 0,
            f"Expected an arena larger than twice robots.start_margin_m = {margin} m, got "
            f"{self.arena.width_m} x {self.arena.height_m} m; lower the margin or enlarge the arena.",
        )
        starts = margin, margin, self.arena.width_m - margin, self.arena.height_m - margin
        closed = [(box[0] - radius, box[1] - radius, box[2] + radius, box[3] + radius) for box in self.arena.obstacles]
        most = int(MAX_DISC_SHARE * free_area([starts], closed) / (math.pi * radius**2))
        besides = " clear of obstacles" if closed else ""
        _require(
            n_robots <= most,
            f"Expected at most {most} robots in a start area of {width:.1f} x {height:.1f} m{besides} (discs may cover "
            f"{MAX_DISC_SHARE:.0%} of it), got {n_robots}; use a larger arena or fewer robots.",
        )

    def _check_room_for_objects(self) -> None:
        n_objects, n_robots = self.objects.n_objects, self.robots.n_robots
        _require(
            self.objects.placement != "heap" or n_objects > n_robots,  # each robot may have one under way
            f"Expected more objects than robots for a heap, got {n_objects} for {n_robots}; ask for more objects.",
        )
        if self.objects.is_drawn:
            return  # at reset, which raises where there is no room for them
        taken = (*self.arena.all_nest_cells, *self.obstacle_cells)
        for place, cell in zip(self.objects.object_positions_m, self._cells_of_positions, strict=True):
            _require(
                bool(overlap_cells(cell, self.arena.distributable_cells))
                and not any(overlap_cells(cell, box) for box in taken),
                f"Expected objects.object_positions_m between 15 % and 85 % of each axis, clear of nest and obstacles, "
                f"got {place}.",
            )
        room = int(_free_area(self.source_cells, taken))
        besides = ", or move obstacles" if self.arena.obstacles else ""
        _require(
            self.objects.n_objects <= room,
            f"Expected at most {room} objects for placement {self.objects.placement!r} in "
            f"{self.arena.width_m} x {self.arena.height_m} m (one per free cell of the source), "
            f"got {self.objects.n_objects}; ask for fewer objects or a larger arena{besides}.",
        )

    def _check_room_for_caches(self) -> None:
        if min(self.cache_centre_cells[2:]) > self.cache_half_side_cells:
            return
        longer, shorter = max(self.arena.n_cells), min(self.arena.n_cells)
        most = max(side for side in range(1, shorter) if side + (side - 1) // 2 < shorter)
        raise ConfigError(
            f"Expected dynamic caches that fit into the arena of {self.arena.width_m:g} x {self.arena.height_m:g} m, "
            f"got a side of {self.cache_side_cells * CELL_M:.1f} m, which their centres also keep from the border; "
            f"lower side_share to {math.floor(1000 * most / longer) / 1000:g}, or choose a wider arena."
        )

    @property
    def obstacle_cells(self) -> tuple[Box, ...]:
        """Cells that obstacles keep free of objects, half-open."""
        return tuple(blocked_cells(box, *self.arena.n_cells, self.robots.radius_m) for box in self.arena.obstacles)

    @property
    def source_cells(self) -> tuple[Box, ...]:
        """Cells of the source regions, half-open; power-law clusters are drawn at reset (`floor.source_boxes`)."""
        return self._cells_of_positions or source_boxes(self.objects.placement, *self.arena.n_cells)

    @property
    def _cells_of_positions(self) -> tuple[Box, ...]:
        cells = (tuple(math.floor(at * CELLS_PER_M) for at in place) for place in self.objects.object_positions_m)
        return tuple((x, y, x + 1, y + 1) for x, y in cells)

    @property
    def horizon_ticks(self) -> int:
        """Length of a run in ticks."""
        return round(self.horizon_s / self.dt_s)

    @property
    def interval_ticks(self) -> int:
        """Length of a recording interval in ticks."""
        return round(self.interval_s / self.dt_s)

    @property
    def cache_side_nominal_m(self) -> float:
        """Nominal cache side; distances derive from it."""
        return self.cache.side_share * max(self.arena.width_m, self.arena.height_m)

    @property
    def cache_side_cells(self) -> int:
        """Side of a cache as built: the nominal one made an odd number of cells."""
        cells = round(self.cache_side_nominal_m / CELL_M)
        return cells if cells % 2 else cells - 1

    @property
    def cache_half_side_cells(self) -> int:
        """Cells of a cache on either side of its centre cell."""
        return self.cache_side_cells // 2

    @property
    def cache_centre_cells(self) -> Box:
        """Cells for centres of dynamic caches, half-open (`floor.cache_centre_box`)."""
        return cache_centre_box(*self.arena.n_cells, round(self.cache_side_nominal_m / CELL_M))

    @property
    def min_dist_m(self) -> float:
        """Objects within this distance of a CREATE_CACHE drop join a dynamic cache."""
        return self.cache.distance_share * min(self.arena.width_m, self.arena.height_m)

    @property
    def cache_proximity_m(self) -> float:
        """SITE and CREATE_CACHE drops are refused when a cache centre is within this distance."""
        return max(2 * self.cache_side_nominal_m, self.min_dist_m)


def whole_intervals(scenario: ScenarioConfig, horizon_ticks: int | None = None) -> int:
    """Return the number of recording intervals T of a run.

    Args:
        scenario: Gives the length of an interval, and of a run.
        horizon_ticks: Length of the run in ticks where it differs from the scenario's.

    Raises:
        ConfigError: the run is not a whole number of intervals, so its last one could not be compared.
    """
    ticks = scenario.horizon_ticks if horizon_ticks is None else horizon_ticks
    if ticks < 1 or ticks % scenario.interval_ticks:
        raise ConfigError(
            f"Expected a horizon of a whole number of intervals of {scenario.interval_s:g} s, got "
            f"{ticks * scenario.dt_s:g} s; choose a multiple, or another interval_s."
        )
    return ticks // scenario.interval_ticks


_free_area = lru_cache(maxsize=64)(free_area)


SECTIONS: dict[str, type] = {
    "arena": ArenaConfig,
    "robots": RobotConfig,
    "objects": ObjectConfig,
    "cache": CacheConfig,
    "reward": RewardConfig,
    "quirks": Quirks,
}
"""Sections of a ScenarioConfig and their classes."""


def to_mapping(config: Any) -> dict[str, Any]:
    """Return a configuration as nested dicts of plain values, ready for JSON or TOML; `read` reads it back."""
    return dataclasses.asdict(config)
