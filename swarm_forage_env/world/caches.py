"""Caches as areas of the floor: static ones that are restored at random times, dynamic ones that robots create.

What robots do with caches (adding, taking, the last pair dissolving) is in `kernels.interact`.
"""

import math

import numpy as np

from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY, CELL_OBJECT, Counter, ObjectStatus, Task
from swarm_forage_env.contract.types import BoolArray, CodeArray, IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M, Box, overlap_cells, square_box
from swarm_forage_env.world.placement import static_cache_centres
from swarm_forage_env.world.state import CacheState, ObjectState, Source, StepEvents, SwarmState, listed, make_list

MAX_PASSES = 100
"""Attempts to push a new dynamic cache clear of nest, sources and caches before the place is given up."""


def n_cache_slots(config: ScenarioConfig) -> int:
    """Number of cache slots: as many disjoint cache squares as the arena can hold; 0 without caches."""
    if config.caches == "none":
        return 0
    nx, ny = config.arena.n_cells
    return (nx // config.cache_side_cells) * (ny // config.cache_side_cells)


def _inside(cells: IntArray, box: Box) -> BoolArray:
    """Which cells (M, 2) lie in a box."""
    x, y = cells[:, 0], cells[:, 1]
    return (x >= box[0]) & (x < box[2]) & (y >= box[1]) & (y < box[3])


def create_cache(
    rows: IntArray,
    centre_cell: tuple[int, int],
    side_cells: int,
    objects: ObjectState,
    caches: CacheState,
    events: StepEvents,
) -> int:
    """Make a cache of free or waiting objects `rows`, all moved to its centre; returns the slot.

    The square must hold no nest, no obstacle, no other cache, and no free object that is not in `rows`.
    """
    slot = int(np.flatnonzero(~caches.alive)[0])
    lying = rows[objects.status[rows] == ObjectStatus.FREE]
    objects.floor[objects.cell[lying, 1], objects.cell[lying, 0]] = CELL_EMPTY
    x_low, y_low, x_high, y_high = square_box(centre_cell, side_cells)
    objects.floor[y_low:y_high, x_low:x_high] = CELL_CACHE - slot
    objects.status[rows] = ObjectStatus.CACHED
    objects.cell[rows] = centre_cell
    objects.cache_slot[rows] = slot
    waiting = listed(objects.waiting)
    make_list(objects.waiting, waiting[~np.isin(waiting, rows)])
    events.counters[Counter.CACHES_CREATED] += 1
    caches.alive[slot] = True
    caches.cell[slot] = centre_cell
    caches.serial[slot] = events.counters[Counter.CACHES_CREATED]
    caches.count[slot] = len(rows)
    return slot


def create_static_caches(
    config: ScenarioConfig,
    objects: ObjectState,
    caches: CacheState,
    events: StepEvents,
    *,
    supply: ObjectStatus = ObjectStatus.FREE,
) -> None:
    """Create every missing static cache.

    Each takes the first `static_size` objects in row order that have the status `supply` and lie outside all static
    cache squares, and also the free objects on its own square. With fewer than two objects no cache is created.
    """
    side = config.cache_side_cells
    boxes = [square_box(centre, side) for centre in static_cache_centres(config)]
    standing = {tuple(cell) for cell in caches.cell[caches.alive].tolist()}
    for centre, box in zip(static_cache_centres(config), boxes, strict=True):
        if centre in standing:
            continue
        eligible = objects.status == supply
        for other in boxes:
            eligible &= ~_inside(objects.cell, other)
        taken = np.flatnonzero(eligible)[: config.cache.static_size]
        absorbed = np.flatnonzero((objects.status == ObjectStatus.FREE) & _inside(objects.cell, box))
        rows = np.union1d(taken, absorbed).astype(np.int32)
        if len(rows) >= 2:
            create_cache(rows, centre, side, objects, caches, events)


def restoration_probability(n_harvesters: int, n_collectors: int, scale: float) -> float:
    """Probability per tick that missing static caches are restored.

    1 - exp(-s n_h / n_c), or 1 - exp(-s n_h) without collectors (authors' restoration law of static caches).
    """
    ratio = n_harvesters / n_collectors if n_collectors else float(n_harvesters)
    return -math.expm1(-scale * ratio)  # numpy's depends on the processor


def count_cache_users(swarm: SwarmState, tasks: CodeArray | None) -> tuple[int, int]:
    """Harvesters and collectors among the active robots: by task, or by where their cargo came from."""
    if tasks is not None:
        harvesting, collecting = tasks == Task.HARVESTER, tasks == Task.COLLECTOR
    else:
        carrying = swarm.carried_object >= 0
        harvesting, collecting = carrying & ~swarm.cargo_from_cache, carrying & swarm.cargo_from_cache
    return int(np.count_nonzero(harvesting & swarm.active)), int(np.count_nonzero(collecting & swarm.active))


def restore_static_caches(
    config: ScenarioConfig,
    swarm: SwarmState,
    objects: ObjectState,
    caches: CacheState,
    events: StepEvents,
    tasks: CodeArray | None,
    rng: np.random.Generator,
) -> None:
    """With the probability of `restoration_probability`, restore all missing static caches from free objects."""
    if np.count_nonzero(caches.alive) == len(static_cache_centres(config)):
        return
    n_harvesters, n_collectors = count_cache_users(swarm, tasks)
    if rng.random() < restoration_probability(n_harvesters, n_collectors, config.cache.respawn_scale):
        create_static_caches(config, objects, caches, events)


def protected_boxes(config: ScenarioConfig, source: Source) -> list[Box]:
    """Source regions and clusters, whose objects create no caches; none with random placement.

    Under the quirk `dynamic_cache_merges_all` the region of the random placement is protected, too, so that no cache
    ever forms there.
    """
    if config.objects.placement == "random" and not config.quirks.dynamic_cache_merges_all:
        return []
    return [(box[0], box[1], box[2], box[3]) for box in source.regions.tolist()]


def cache_members(first: int, config: ScenarioConfig, objects: ObjectState, protected: list[Box]) -> IntArray:
    """Free, unprotected objects within `min_dist_m` of the object `first`, itself included; empty if it is protected.

    Under the quirk `dynamic_cache_merges_all` neither the distance nor the first object itself matters: all unprotected
    objects join.
    """
    usable = objects.status == ObjectStatus.FREE
    for box in protected:
        usable &= ~_inside(objects.cell, box)
    if not config.quirks.dynamic_cache_merges_all:
        if not usable[first]:
            return np.empty(0, np.int32)
        # In cells squared distances are whole; in metres, rounding would decide about an object exactly at the limit.
        offset = objects.cell - objects.cell[first]
        usable &= (offset * offset).sum(axis=1) <= (config.min_dist_m / CELL_M) ** 2 + 1e-6
    return np.flatnonzero(usable).astype(np.int32)


def clear_centre(
    centre_cell: tuple[int, int], config: ScenarioConfig, taken: list[Box], rng: np.random.Generator
) -> tuple[int, int] | None:
    """Push a cache centre clear of the boxes `taken`, or None after `MAX_PASSES` passes.

    Each pass wraps the centre back to at least D from the border and shifts it by one cell in x and in y, with random
    signs, for every box that its square overlaps; a pass without overlap accepts. The centre also keeps to the
    cells on which objects may lie, because the last object of a cache is left there (only caches with a side below
    15 % of the arena can come near those limits).
    """
    x_low, y_low, x_end, y_end = config.cache_centre_cells
    x, y = centre_cell
    for _ in range(MAX_PASSES):
        x, y = min(max(x, x_low), x_end - 1), min(max(y, y_low), y_end - 1)
        overlapped = 0
        for box in taken:
            if overlap_cells(square_box((x, y), config.cache_side_cells), box):
                overlapped += 1
                x += 1 if rng.random() < 0.5 else -1
                y += 1 if rng.random() < 0.5 else -1
        if not overlapped:
            return x, y
    return None


def place_for_cache(
    mean_cell: tuple[int, int],
    config: ScenarioConfig,
    protected: list[Box],
    standing: list[Box],
    rng: np.random.Generator,
) -> tuple[int, int] | None:
    """Centre for a cache of objects with mean `mean_cell`: clear of nest, obstacles, `protected` and `standing` caches.

    None where there is no such place.

    Power-law clusters are only avoided where possible (study: strict constraints on new caches in scenario 1, loose
    ones in scenario 2): if they leave no room, the passes start again without them. The
    objects of a cluster under the square join; the cluster then takes objects on the cells left to it.
    """
    fixed = [*config.arena.all_nest_cells, *config.obstacle_cells]
    centre = clear_centre(mean_cell, config, [*fixed, *protected, *standing], rng)
    loose = config.objects.placement == "power_law" and not config.quirks.dynamic_cache_avoids_clusters
    if centre is None and loose:
        centre = clear_centre(mean_cell, config, [*fixed, *standing], rng)
    return centre


def create_dynamic_caches(
    robots: IntArray,
    config: ScenarioConfig,
    source: Source,
    swarm_cells: IntArray,
    objects: ObjectState,
    caches: CacheState,
    events: StepEvents,
    rng: np.random.Generator,
) -> None:
    """Try to form a dynamic cache around each object just laid down by a CREATE_CACHE drop.

    Args:
        robots: Rows of the robots that dropped.
        config: The scenario.
        source: Current source regions and clusters.
        swarm_cells: (N, 2) cell of each robot, where its object lies.
        objects: Edited.
        caches: Edited.
        events: Edited: counters.
        rng: Generator of the cache stream.
    """
    protected = protected_boxes(config, source)
    for robot in robots.tolist():
        x, y = swarm_cells[robot]
        first = int(objects.floor[y, x]) - CELL_OBJECT
        if first < 0:
            continue  # an earlier creator of this tick has already drawn the object into its cache
        members = cache_members(first, config, objects, protected)
        if len(members) < 2:
            continue
        mean = np.floor(objects.cell[members].mean(axis=0) + 0.5)
        side = config.cache_side_cells
        standing = [square_box((int(cx), int(cy)), side) for cx, cy in caches.cell[caches.alive].tolist()]
        centre = place_for_cache((int(mean[0]), int(mean[1])), config, protected, standing, rng)
        if centre is None:
            continue
        on_square = (objects.status == ObjectStatus.FREE) & _inside(objects.cell, square_box(centre, side))
        rows = np.union1d(members, np.flatnonzero(on_square)).astype(np.int32)
        create_cache(rows, centre, side, objects, caches, events)
