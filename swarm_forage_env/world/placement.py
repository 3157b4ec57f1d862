"""Where robots start and where objects appear: the source of a run, first and later placements; static caches.

Every object lies on its own free cell: inside the distributable box, empty, neither nest, obstacle nor cache.
"""

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import KDTree

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import CELL_EMPTY, ObjectStatus
from swarm_forage_env.contract.types import BoolArray, FloatArray, IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, Box, overlap_cells, square_box
from swarm_forage_env.scenarios.obstacles import distances_m
from swarm_forage_env.world.clusters import draw_clusters
from swarm_forage_env.world.kernels.placement import DRAWS, UNLIMITED, scatter
from swarm_forage_env.world.state import ObjectState, PlacementDraws, Source, listed, make_list

_CHUNK = 8192
"""Objects whose random numbers are held in memory at once."""
_AHEAD = 64
"""Objects for which random numbers are drawn ahead of time."""

_TRIALS = 1000
"""Redraws of start positions, and of a heap's place, before giving up, as in the study."""
FAR_SHARE = 0.3
"""Least distance of a heap from a nest, between their middles, as a share of the arena's shorter side (our choice)."""


def draw_start_poses(config: ScenarioConfig, rng: np.random.Generator) -> tuple[FloatArray, FloatArray]:
    """Draw start positions (N, 2) m and headings (N,) rad in (-pi, pi].

    Positions are uniform at least `start_margin_m` from the arena border; robots that overlap an obstacle are drawn
    again, and of two overlapping robots the one with the higher row. Robots may start inside the nest.

    Raises:
        ConfigError: no layout without overlap was found.
    """
    n_robots, margin = config.robots.n_robots, config.robots.start_margin_m
    low = np.array([margin, margin])
    high = np.array([config.arena.width_m - margin, config.arena.height_m - margin])
    position = rng.uniform(low, high, (n_robots, 2))
    tree = KDTree(position)  # of the first positions: later, only robots that were drawn again can overlap anybody
    is_moved = np.zeros(n_robots, np.bool_)
    pairs = tree.query_pairs(2 * config.robots.radius_m, output_type="ndarray")
    for _ in range(_TRIALS):
        blocked = np.flatnonzero(distances_m(config.arena.obstacles, position) < config.robots.radius_m)
        if len(pairs) == 0 and len(blocked) == 0:
            return position, -rng.uniform(-np.pi, np.pi, n_robots)
        again = np.union1d(pairs.max(axis=1), blocked)
        position[again] = rng.uniform(low, high, (len(again), 2))
        is_moved[again] = True
        pairs = _overlaps_of_moved(position, is_moved, tree, 2 * config.robots.radius_m)
    raise ConfigError(
        f"Found no start positions without overlap for {n_robots} robots in {_TRIALS} trials; "
        "use fewer robots, a larger arena or a smaller robots.start_margin_m."
    )


def _overlaps_of_moved(position: FloatArray, is_moved: BoolArray, tree: KDTree, diameter_m: float) -> NDArray[np.intp]:
    """Return the pairs (P, 2) of overlapping robots of which one has moved; the tree holds those that have not."""
    moved = np.flatnonzero(is_moved)
    own = KDTree(position[moved])
    among = moved[own.query_pairs(diameter_m, output_type="ndarray")]
    found = own.sparse_distance_matrix(tree, diameter_m, output_type="ndarray")
    others = np.column_stack((moved[found["i"]], found["j"]))
    return np.concatenate((among, others[~is_moved[found["j"]]]))


def draw_source(config: ScenarioConfig, floor: IntArray, rng: np.random.Generator) -> Source:
    """Return the source regions of a run; only those of power-law clusters and heaps are random.

    Args:
        config: The scenario.
        floor: (ny, nx) floor codes with nest, obstacles and static caches painted; clusters keep off these.
        rng: Generator of the placement stream.

    Raises:
        ConfigError: the clusters drawn hold fewer objects than the scenario has, or clusters or a heap find no room.
    """
    if config.objects.placement == "heap":
        source = Source(np.zeros((1, 4), np.int32), np.zeros(1, np.int32), np.array([0, 1], np.int32))
        move_heap(config, floor, source, rng)
        return source
    if config.objects.placement != "power_law":
        regions = np.array(config.source_cells, np.int32)
        n_regions = len(regions)
        return Source(regions, np.full(n_regions, UNLIMITED, np.int32), np.array([0, n_regions], np.int32))
    regions, capacity = draw_clusters(config, floor, rng)
    total = int(capacity.sum())
    if total < config.objects.n_objects:
        raise ConfigError(
            f"Expected at most {total} objects for the {len(capacity)} power-law clusters drawn in "
            f"{config.arena.width_m} x {config.arena.height_m} m, got {config.objects.n_objects}; ask for fewer "
            "objects or a larger arena."
        )
    order = np.argsort(capacity, kind="stable")
    regions, capacity = regions[order], capacity[order].astype(np.int32)
    group_start = np.concatenate(([0], np.flatnonzero(np.diff(capacity)) + 1, [len(capacity)]))
    return Source(regions, capacity, group_start.astype(np.int32))


def move_heap(config: ScenarioConfig, floor: IntArray, source: Source, rng: np.random.Generator) -> None:
    """Open a heap somewhere else: a square, just large enough, on empty floor and at least `FAR_SHARE` from every nest.

    It holds all objects but one for each robot: so many may be under way when the one before is empty.

    Args:
        config: The scenario.
        floor: (ny, nx) floor codes.
        source: Of one region; edited in place. Objects that are placed go there until its capacity is zero.
        rng: Generator of the placement stream.

    Raises:
        ConfigError: no such square was found.
    """
    n_in_heap = config.objects.n_objects - config.robots.n_robots
    side = math.ceil(math.sqrt(n_in_heap))
    x_low, y_low, x_end, y_end = config.arena.distributable_cells
    far_m = FAR_SHARE * min(config.arena.width_m, config.arena.height_m)
    last = max(x_low, x_end - side), max(y_low, y_end - side)
    for x, y in rng.integers((x_low, y_low), last, (_TRIALS, 2), endpoint=True).tolist():
        middle = CELL_M * (x + side / 2), CELL_M * (y + side / 2)
        is_far = min(math.dist(middle, nest) for nest in config.arena.nest_centres_m) >= far_m
        is_inside = x + side <= x_end and y + side <= y_end
        if is_far and is_inside and np.all(floor[y : y + side, x : x + side] == CELL_EMPTY):
            source.regions[0] = x, y, x + side, y + side
            source.capacity[0] = n_in_heap
            return
    raise ConfigError(
        f"Found no room for a heap of {n_in_heap} objects, {far_m:.1f} m from a nest, in {_TRIALS} trials; ask "
        "for fewer objects or a larger arena."
    )


def place_objects(
    rows: Sequence[int] | IntArray,
    objects: ObjectState,
    source: Source,
    distributable_box: Box,
    rng: np.random.Generator,
) -> None:
    """Place objects, at the start or again, one after the other, each on a random free cell of the source.

    First a random group of regions is drawn, then a random region in it, both in cyclic order past full ones, then one
    of its free cells, uniformly (study). A placed object is free, and its count of carriers starts at zero. An object
    for which there is no cell waits. Whenever objects are placed, all waiting ones are tried, too, longest wait first.

    Args:
        rows: Object rows that do not lie on the floor and do not wait.
        objects: Edited in place.
        source: Regions of this run.
        distributable_box: Cells on which objects may lie, half-open.
        rng: Generator of the placement stream.
    """
    if len(rows) == 0:
        return
    newest = np.asarray(rows, np.int32)
    # Trying in this order until the first failure is the same as trying the whole waiting list after every new object:
    # if there is no cell for one object, there is none for the later ones, and if all are placed, the list is empty.
    queue = np.concatenate((newest[:1], listed(objects.waiting), newest[1:]))
    n_placed = _place_until_full(queue, objects, source, distributable_box, rng)
    if n_placed == 0:
        queue = np.concatenate((listed(objects.waiting), newest))
    make_list(objects.waiting, queue[n_placed:])


def new_draws() -> PlacementDraws:
    """Return room for the numbers of the next objects, without any."""
    return PlacementDraws(np.zeros((_AHEAD, DRAWS)), np.full(1, _AHEAD, np.int32))


def draw_ahead(draws: PlacementDraws, rng: np.random.Generator) -> None:
    """Draw the numbers of the next objects, as `place_objects` would draw them one by one."""
    rng.random(out=draws.rows)
    draws.n_used[0] = 0


def give_back(draws: PlacementDraws, rng: np.random.Generator) -> None:
    """Let the generator draw again what was drawn ahead and is not used."""
    bits: Any = rng.bit_generator
    bits.advance(-draws.rows[draws.n_used[0] :].size)
    draws.n_used[0] = len(draws.rows)


def place_all(objects: ObjectState, source: Source, distributable_box: Box, rng: np.random.Generator) -> None:
    """Place every waiting object at the start of a run, or as many as the source is made for.

    Args:
        objects: Edited in place.
        source: Regions of this run.
        distributable_box: Cells on which objects may lie, half-open.
        rng: Generator of the placement stream.

    Raises:
        ConfigError: the source has too few free cells; the message says how many objects fit.
    """
    queue = listed(objects.waiting).copy()
    n_wanted = min(len(queue), int(source.capacity.sum(dtype=np.int64)))
    n_placed = _place_until_full(queue, objects, source, distributable_box, rng)
    make_list(objects.waiting, queue[n_placed:])
    if n_placed < n_wanted:
        n_objects = len(objects.status)
        raise ConfigError(
            f"Expected at most {n_objects - len(queue) + n_placed} objects (one per free cell of the source, up to its "
            f"capacity), got {n_objects}; ask for fewer objects or a larger arena."
        )


def _place_until_full(
    queue: IntArray, objects: ObjectState, source: Source, distributable_box: Box, rng: np.random.Generator
) -> int:
    """Place rows in order until there is no cell; the other rows then wait. Returns how many were placed."""
    n_placed = 0
    for start in range(0, len(queue), _CHUNK):
        chunk = queue[start : start + _CHUNK]
        n_placed += scatter(
            chunk,
            objects.floor,
            objects.cell,
            source.regions,
            source.capacity,
            source.group_start,
            distributable_box,
            rng.random((len(chunk), DRAWS)),
        )
        if n_placed < start + len(chunk):
            break
    placed, waiting = queue[:n_placed], queue[n_placed:]
    objects.status[placed] = ObjectStatus.FREE
    objects.carriers[placed] = 0
    objects.status[waiting] = ObjectStatus.WAITING
    objects.cell[waiting] = -1
    objects.cache_slot[queue] = -1
    return n_placed


def static_cache_centres(config: ScenarioConfig) -> tuple[tuple[int, int], ...]:
    """Return the centre cells (x, y) of the static caches of a scenario.

    Locations are the study's: half way between nest and each region for one or two sources; west, east, south and
    north of the nest for four; at the quarters of the arena for the rest. The quad source is moved outwards where
    its squares would reach into the nest (our choice: a floor cell is either nest or cache). Of several nests the
    first counts.

    Raises:
        ConfigError: a cache square leaves the arena, reaches into nest or obstacles or overlaps another, or its centre,
            on which the last object of a cache stays, is where no object may lie.
    """
    nx, ny = config.arena.n_cells
    nest = config.arena.nest_cells
    half = config.cache_half_side_cells
    boxes = config.source_cells
    centres: tuple[tuple[int, int], ...]
    if config.objects.placement in ("single_source", "dual_source"):
        centres = tuple(
            ((nest[0] + nest[2] + box[0] + box[2]) // 4, (nest[1] + nest[3] + box[1] + box[3]) // 4) for box in boxes
        )
    elif config.objects.placement == "quad_source":
        _, left, bottom, _ = boxes
        region_x, region_y = (bottom[0] + bottom[2]) // 2, (left[1] + left[3]) // 2
        centres = (
            (min(30 * nx // 100, nest[0] - half - 1), region_y),
            (max(675 * nx // 1000, nest[2] + half), region_y),
            (region_x, min(30 * ny // 100, nest[1] - half - 1)),
            (region_x, max(675 * ny // 1000, nest[3] + half)),
        )
    else:
        centres = ((nx // 4, ny // 2), (3 * nx // 4, ny // 2), (nx // 2, ny // 4), (nx // 2, 3 * ny // 4))
    _check_cache_squares(config, centres)
    return centres


def _check_cache_squares(config: ScenarioConfig, centres: tuple[tuple[int, int], ...]) -> None:
    nx, ny = config.arena.n_cells
    taken: list[Box] = [*config.arena.all_nest_cells, *config.obstacle_cells]
    for x, y in centres:
        square = square_box((x, y), config.cache_side_cells)
        inside = square[0] >= 0 and square[1] >= 0 and square[2] <= nx and square[3] <= ny
        if not inside or any(overlap_cells(square, other) for other in taken):
            side_m = config.cache_side_cells * CELL_M
            smaller_fits = not any(overlap_cells((x, y, x + 1, y + 1), other) for other in taken)
            raise ConfigError(
                f"Expected static caches inside the arena, clear of nest, obstacles and each other, got a square of "
                f"{side_m:.1f} m centred at ({(x + 0.5) * CELL_M:.1f}, {(y + 0.5) * CELL_M:.1f}) m; "
                f"{'lower side_share, ' if smaller_fits else ''}move nest or obstacles, or do without static caches."
            )
        if not overlap_cells((x, y, x + 1, y + 1), config.arena.distributable_cells):
            raise ConfigError(
                f"Expected static caches with centres between 15 % and 85 % of each axis, where objects may lie, got "
                f"one at ({(x + 0.5) * CELL_M:.1f}, {(y + 0.5) * CELL_M:.1f}) m; choose a smaller nest or move it."
            )
        taken.append(square)
