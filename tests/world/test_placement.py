"""Where objects, clusters and static caches are placed, and how free objects walk."""

import copy
import itertools
import math

import numpy as np
import pytest
from scipy.stats import binomtest, chisquare

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY, CELL_NEST, CELL_OBJECT, Counter, ObjectStatus
from swarm_forage_env.contract.types import IntArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import Box, distributable_box
from swarm_forage_env.scenarios.obstacles import distances_m
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, SEARCH_AND_RESCUE_OBJECTS, scenario
from swarm_forage_env.scenarios.quirks import Quirks
from swarm_forage_env.world.allocation import new_objects
from swarm_forage_env.world.clusters import (
    ClusterLaw,
    cluster_law,
    draw_clusters,
    draw_program_sizes,
    draw_sizes,
    footprint,
)
from swarm_forage_env.world.kernels.placement import DRAWS, UNLIMITED, place_displaced, scatter
from swarm_forage_env.world.kernels.walk import crosses_open_border, walk
from swarm_forage_env.world.placement import (
    draw_ahead,
    draw_source,
    give_back,
    new_draws,
    place_objects,
    static_cache_centres,
)
from swarm_forage_env.world.state import ObjectState, Requests, Source, listed, make_list
from tests.reference.objects import choose_cell, random_source, scatter_slowly, waiting_by_the_word, walk_slowly
from tests.support.stage import assert_conserved, cell_centre

SIGNIFICANCE = 0.001
"""Seeds are fixed, so a test that passes once passes always; this is what it passed."""


def bare_objects(n_objects: int, nx: int, ny: int) -> ObjectState:
    return ObjectState.empty(np.full((ny, nx), CELL_EMPTY, np.int32), n_objects)


def waiting(objects: ObjectState) -> list[int]:
    return listed(objects.waiting).tolist()


def one_region(box: Box, capacity: int = UNLIMITED) -> Source:
    return Source(np.array([box], np.int32), np.array([capacity], np.int32), np.array([0, 1], np.int32))


def lift(objects: ObjectState, row: int) -> None:
    x, y = objects.cell[row]
    objects.floor[y, x] = CELL_EMPTY
    objects.status[row] = ObjectStatus.CARRIED
    objects.cell[row] = -1
    objects.carriers[row] += 1


def assert_consistent(objects: ObjectState) -> None:
    free = np.flatnonzero(objects.status == ObjectStatus.FREE)
    x, y = objects.cell[free].T
    np.testing.assert_array_equal(objects.floor[y, x], CELL_OBJECT + free)
    assert np.count_nonzero(objects.floor >= CELL_OBJECT) == len(free)
    not_lying = np.flatnonzero(objects.status == ObjectStatus.WAITING)
    assert sorted(waiting(objects)) == not_lying.tolist()
    assert np.all(objects.cell[not_lying] == -1)


@pytest.mark.parametrize(
    ("name", "fields"),
    [
        *((name, {}) for name in SCENARIO_NAMES),
        ("search_and_rescue", {"side_m": 16, "caches": "static"}),
        ("search_and_rescue", {"side_m": 128, "caches": "static"}),
    ],
)
def test_every_object_lies_in_a_region_within_its_capacity(name, fields):
    env = ForageEnv(scenario(name, **fields))
    env.reset_batch(0)
    assert_conserved(env)
    free, source = env.objects.status == ObjectStatus.FREE, env.arena._arrays.source
    assert np.all(free | (env.objects.status == ObjectStatus.CACHED))
    x, y = env.objects.cell[free].T
    inside = [(x >= box[0]) & (x < box[2]) & (y >= box[1]) & (y < box[3]) for box in source.regions.tolist()]
    assert np.all(np.any(inside, axis=0))
    assert np.all(np.sum(inside, axis=1) <= source.capacity)


@pytest.mark.parametrize("share_free", [0.9, 0.02], ids=["by trying", "by listing"])
def test_every_free_cell_is_equally_likely(share_free):
    rng = np.random.default_rng(11)
    objects = bare_objects(1, 40, 30)
    objects.floor[rng.random(objects.floor.shape) >= share_free] = CELL_NEST
    area, box = (2, 3, 38, 28), (0, 0, 40, 25)
    free = np.zeros(objects.floor.shape, bool)
    free[3:25, 2:38] = objects.floor[3:25, 2:38] == CELL_EMPTY
    counts = np.zeros(objects.floor.shape, int)
    source = one_region(box)
    for _ in range(20 * np.count_nonzero(free)):
        place_objects([0], objects, source, area, rng)
        x, y = objects.cell[0]
        counts[y, x] += 1
        lift(objects, 0)
    assert counts[~free].sum() == 0
    assert chisquare(counts[free]).pvalue > SIGNIFICANCE


def test_a_heap_lies_far_from_the_nest_and_moves_on_when_it_is_empty():
    fields = {"n_robots": 3, "n_objects": 12, "width_m": 20.0, "height_m": 16.0, "nest_size_m": (2.0, 2.0)}
    env = ForageEnv(scenario("warehouse_small", placement="heap", nest_centre_m=(10.0, 8.0), **fields))
    env.reset_batch(seed=4)
    objects, heaps = env.objects, [tuple(env.arena._arrays.source.regions[0].tolist())]
    for _ in range(40):
        row = int(np.flatnonzero(objects.status == ObjectStatus.FREE)[0])
        lift(objects, row)
        deliver(env, row)
        assert_consistent(objects)
        heap = tuple(env.arena._arrays.source.regions[0].tolist())
        lying = objects.cell[objects.status == ObjectStatus.FREE]
        assert np.all((lying >= heap[:2]) & (lying < heap[2:])), "objects lie in the heap only"
        assert (len(lying) == 9) == (heap != heaps[-1]), "a new heap has all that are not under way, others only fewer"
        heaps += [heap] * (heap != heaps[-1])
    assert len(heaps) == 5
    for x_low, y_low, x_high, y_high in heaps:
        assert (x_high - x_low, y_high - y_low) == (3, 3)
        assert math.dist(((x_low + x_high) / 10, (y_low + y_high) / 10), (10.0, 8.0)) >= 0.3 * 16.0


def deliver(env: ForageEnv, row: int) -> None:
    """Do what a tick does in the end with an object that was delivered."""
    make_list(env.arena._requests.displaced, [row])
    env.arena._replace_displaced()


@pytest.mark.parametrize(
    ("fields", "told"),
    [
        ({"n_objects": 50}, "more objects than robots"),
        ({"n_objects": 5000}, "Found no room for a heap of 4950 objects"),
    ],
)
def test_impossible_heaps_are_refused(fields, told):
    with pytest.raises(ConfigError, match=told):
        ForageEnv(scenario("warehouse_small", n_robots=50, placement="heap", **fields)).reset(seed=0)


@pytest.mark.parametrize("capacity", [UNLIMITED, 13], ids=["room for all", "too few places"])
def test_the_tick_places_as_python_does(capacity):
    """From the same generator, whoever places; what waits, or what is too much at once, is left to Python."""
    area, source = (0, 0, 12, 9), one_region((2, 1, 9, 8), capacity)
    slow, fast = bare_objects(40, 12, 9), bare_objects(40, 12, 9)
    slow_rng, fast_rng, chance = (np.random.default_rng(seed) for seed in (5, 5, 6))
    for objects in (slow, fast):
        make_list(objects.waiting, [])
        objects.status[:] = ObjectStatus.CARRIED
    draws, requests, n_fast = new_draws(), Requests.empty(40, 1, 1), 0
    displaced = requests.displaced
    draw_ahead(draws, fast_rng)
    for _ in range(300):
        lying = np.flatnonzero(slow.status == ObjectStatus.FREE)
        for row in chance.permutation(lying)[: chance.integers(4)].tolist():
            lift(slow, row)
            lift(fast, row)
        carried = chance.permutation(np.flatnonzero(slow.status == ObjectStatus.CARRIED))[: chance.integers(4)]
        place_objects(carried, slow, source, area, slow_rng)
        make_list(displaced, carried)
        place_displaced(requests, fast, source, area, draws)
        n_fast += len(carried) > 0 and displaced[-1] == 0
        if displaced[-1]:
            give_back(draws, fast_rng)
            place_objects(carried, fast, source, area, fast_rng)
            draw_ahead(draws, fast_rng)
        for name, values in slow._asdict().items():
            np.testing.assert_array_equal(getattr(fast, name), values, err_msg=name)
    give_back(draws, fast_rng)
    assert slow_rng.random() == fast_rng.random()
    assert n_fast > 50
    assert (len(waiting(slow)) > 0) == (capacity != UNLIMITED)


@pytest.mark.parametrize("seed", range(3))
def test_waiting_list_follows_the_rule_word_by_word(seed):
    rng = np.random.default_rng(seed)
    source, area, floor = random_source(rng)
    objects = bare_objects(100, floor.shape[1], floor.shape[0])
    objects.floor[:] = floor
    objects.status[:] = ObjectStatus.CARRIED
    make_list(objects.waiting, [])
    outside = list(range(100))
    n_waiting = []
    for _ in range(30):
        rows = [outside.pop(0) for _ in range(min(len(outside), int(rng.integers(1, 16))))]
        twin_floor, twin_waiting = objects.floor.copy(), waiting(objects)

        def place(row: int, twin_floor: IntArray = twin_floor) -> bool:
            cell = choose_cell(twin_floor, source, area, rng.random(DRAWS))
            if cell is not None:
                twin_floor[cell[1], cell[0]] = CELL_OBJECT + row
            return cell is not None

        place_objects(rows, objects, source, area, rng)
        assert waiting(objects) == waiting_by_the_word(rows, twin_waiting, place)
        assert_consistent(objects)
        n_waiting.append(len(waiting(objects)))
        for row in rng.permutation(np.flatnonzero(objects.status == ObjectStatus.FREE))[: rng.integers(15)].tolist():
            lift(objects, row)
            outside.append(row)
    assert np.diff(n_waiting).min() < 0 < np.diff(n_waiting).max()  # the list grew and shrank


@pytest.mark.parametrize("seed", range(6))
def test_scatter_agrees_with_its_slow_twin(seed):
    rng = np.random.default_rng(seed)
    source, area, floor = random_source(rng)
    rows = rng.permutation(45).astype(np.int32)
    draws = rng.random((45, DRAWS))
    slow_floor, cell = floor.copy(), np.full((45, 2), -1, np.int32)
    n_placed = scatter(rows, floor, cell, source.regions, source.capacity, source.group_start, area, draws)
    placed = scatter_slowly(rows, slow_floor, source, area, draws)
    assert n_placed == len(placed) > 5
    np.testing.assert_array_equal(floor, slow_floor)
    assert {row: tuple(cell[row].tolist()) for row in placed} == placed


# Power-law clusters: how many, how large, where


LAW_TABLE = {
    16: (3, 4, {8}, 10),
    32: (4, 5, {16}, 17),
    48: (4, 5, {16}, 23),
    64: (4, 5, {16}, 28),
    80: (4, 6, {16, 32}, 34),
    96: (5, 6, {32}, 39),
    112: (5, 6, {32}, 44),
    128: (5, 7, {32, 64}, 49),
}
"""Side in metres: k_min, k_max, sizes and number of clusters in the authors' program."""
PROGRAM = Quirks(large_clusters_likelier=True)


def painted(config: ScenarioConfig) -> ObjectState:
    """Return the objects of a world whose static caches stand already."""
    objects = new_objects(config)
    half = config.cache_side_cells // 2
    for slot, (x, y) in enumerate(static_cache_centres(config)):
        objects.floor[y - half : y + half + 1, x - half : x + half + 1] = CELL_CACHE - slot
    return objects


@pytest.mark.parametrize("side", LAW_TABLE)
def test_cluster_law_table(side):
    k_min, k_max, sizes, n_clusters = LAW_TABLE[side]
    law = cluster_law(side)
    assert law == ClusterLaw(k_min, k_max, n_clusters)
    drawn = np.concatenate([draw_program_sizes(law, np.random.default_rng(seed)) for seed in range(20)])
    assert set(drawn.tolist()) == sizes


@pytest.mark.parametrize(("k_min", "k_max"), [(4, 6), (3, 8)])
def test_larger_sizes_are_more_likely_in_the_program(k_min, k_max):
    n_clusters = 20_000
    sizes = draw_program_sizes(ClusterLaw(k_min, k_max, n_clusters), np.random.default_rng(1))
    exponents = np.arange(k_min, k_max)
    observed = [np.count_nonzero(sizes == 2**k) for k in exponents]
    expected = n_clusters * ((exponents + 1) ** 3 - exponents**3) / (k_max**3 - k_min**3)
    assert np.all(np.diff(expected) > 0)
    assert sum(observed) == n_clusters
    assert chisquare(observed, expected).pvalue > 0.001


def test_twice_as_large_is_half_as_likely():
    law = ClusterLaw(4, 6, 34)
    sizes = draw_sizes(law, 400_000, np.random.default_rng(1))
    observed = [np.count_nonzero(sizes == size) for size in (8, 16, 32, 64)]
    assert len(sizes) - sum(observed) <= 1  # the last one is cut
    expected = np.array([8, 4, 2, 1]) / 15 * sum(observed)
    assert chisquare(observed, expected).pvalue > 0.001


@pytest.mark.parametrize("side", [16, 48, 128])
@pytest.mark.parametrize(("quirks", "caches"), [(Quirks(), "static"), (PROGRAM, "none")], ids=["described", "program"])
def test_clusters_keep_off_nest_caches_and_each_other(side, quirks, caches):
    config = scenario("search_and_rescue", side_m=side, caches=caches, quirks=quirks)
    floor = (painted(config) if caches == "static" else new_objects(config)).floor
    x_low, y_low, x_high, y_high = config.arena.distributable_cells
    for seed in range(5):
        boxes, sizes = draw_clusters(config, floor, np.random.default_rng(seed))
        assert len(boxes) == len(sizes)
        if quirks == PROGRAM:
            assert len(boxes) == LAW_TABLE[side][3]
        for box, size in zip(boxes.tolist(), sizes.tolist(), strict=True):
            assert (box[2] - box[0], box[3] - box[1]) == footprint(size)
            assert x_low <= box[0] < box[2] <= x_high
            assert y_low <= box[1] < box[3] <= y_high
            assert np.all(floor[box[1] : box[3], box[0] : box[2]] == CELL_EMPTY)
        for a, b in itertools.combinations(boxes.tolist(), 2):
            assert a[2] < b[0] or b[2] < a[0] or a[3] < b[1] or b[3] < a[1]  # at least one cell between them


@pytest.mark.parametrize("side", LAW_TABLE)
def test_preset_counts_always_fit(side):
    quirks = PROGRAM if side in (16, 48, 80) else Quirks()
    config = scenario("search_and_rescue", side_m=side, quirks=quirks)
    floor = new_objects(config).floor
    for seed in range(10):
        source = draw_source(config, floor, stream_rng(seed, Stream.PLACEMENT))
        assert source.capacity.sum() >= SEARCH_AND_RESCUE_OBJECTS[side]


# Static caches


@pytest.mark.parametrize(
    ("name", "fields", "centres_m"),
    [
        ("warehouse_small", {}, [(14.5, 8.1)]),  # half way between nest and strip
        # Half way from 16.0 to 25.6 m and to 6.4 m, on the centre of a cell.
        ("warehouse_dual", {}, [(20.9, 8.1), (11.3, 8.1)]),
        ("warehouse_medium", {}, [(12.1, 24.1), (36.1, 24.1), (24.1, 12.1), (24.1, 36.1)]),
        # East at 0.675 X = cell 162 a half side of 23 cells would reach 4 into the nest, cells 96 .. 143.
        ("warehouse_quad", {}, [(14.5, 24.1), (33.5, 24.1), (24.1, 14.5), (24.1, 33.5)]),
        *(
            (
                "search_and_rescue",
                {"side_m": side},
                [
                    (side / 4 + 0.1, side / 2 + 0.1),
                    (3 * side / 4 + 0.1, side / 2 + 0.1),
                    (side / 2 + 0.1, side / 4 + 0.1),
                    (side / 2 + 0.1, 3 * side / 4 + 0.1),
                ],
            )
            for side in SEARCH_AND_RESCUE_OBJECTS
        ),
    ],
)
def test_static_caches_by_hand(name, fields, centres_m):
    centres = static_cache_centres(scenario(name, **fields))
    assert [cell_centre(centre) for centre in centres] == [pytest.approx(centre_m) for centre_m in centres_m]


@pytest.mark.parametrize(
    ("name", "overrides", "told"),
    [
        ("warehouse_medium", {"nest_centre_m": (12.0, 24.0)}, "clear of nest, .* got a square of .* m; move nest"),
        ("warehouse_medium", {"side_share": 0.5}, "clear of .* and each other, .*; lower side_share, move nest"),
        (
            "warehouse_medium",
            {"width_m": 16.0, "nest_centre_m": (8.0, 24.0), "nest_size_m": (2.0, 2.0), "n_robots": 5},
            "static caches inside the arena",
        ),
        (  # A last object stays on the centre of its cache; the eastern one has to stand beyond a nest in the east.
            "warehouse_quad",
            {"width_m": 11.2, "height_m": 13.0, "nest_centre_m": (9.2, 4.6), "nest_size_m": (1.2, 4.4),
             "side_share": 0.03, "start_margin_m": 0.5, "n_robots": 2, "n_objects": 9},
            r"centres between 15 % and 85 % .* got one at \(9\.9, 6\.5\) m",
        ),
    ],
)  # fmt: skip
def test_squares_without_room_are_refused(name, overrides, told):
    config = scenario(name, **overrides)
    with pytest.raises(ConfigError, match=f"Expected .*{told}"):
        static_cache_centres(config)


# Among obstacles, and at positions of one's own


@pytest.mark.parametrize(
    ("placement", "caches"), [("single_source", "dynamic"), ("random", "none"), ("power_law", "none")]
)
def test_robots_objects_and_caches_start_clear_of_boxes(placement, caches):
    boxes = ((24.0, 3.0, 25.0, 13.0), (10.0, 5.0, 12.0, 11.0), (17.1, 2.0, 17.53, 9.0))
    config = scenario(
        "warehouse_small", n_robots=60, n_objects=120, placement=placement, caches=caches, obstacles=boxes,
        walk_probability=0.5,
    )  # fmt: skip
    env = ForageEnv(config)
    env.reset_batch(0)
    assert distances_m(boxes, env.swarm.position).min() >= config.robots.radius_m
    assert np.count_nonzero(env.objects.status == ObjectStatus.FREE) == 120
    for _ in range(5):
        env.step_batch(np.zeros((60, 3), np.float32))
        assert_conserved(env)
    assert env.events.counters[Counter.OBJECTS_MOVED] > 100


def test_objects_appear_at_positions_of_ones_own_and_nowhere_else():
    places = ((20.1, 8.1), (20.1, 8.9), (21.0, 8.3), (9.05, 5.55))
    config = scenario("warehouse_small", n_robots=2, n_objects=3, placement="positions", object_positions_m=places)
    env, seen = ForageEnv(config), set()
    cells = {(math.floor(x * 5), math.floor(y * 5)) for x, y in places}
    for seed in range(12):
        env.reset_batch(seed)
        lying = set(map(tuple, env.objects.cell.tolist()))
        assert len(lying) == 3
        assert lying <= cells
        seen |= lying
    assert seen == cells


# Random walk of free objects


def lying(cells: list[tuple[int, int]], nx: int, ny: int) -> ObjectState:
    """Return objects lying on the given cells of an otherwise empty floor."""
    objects = bare_objects(len(cells), nx, ny)
    make_list(objects.waiting, [])
    for row, (x, y) in enumerate(cells):
        objects.floor[y, x], objects.cell[row], objects.status[row] = CELL_OBJECT + row, (x, y), ObjectStatus.FREE
    return objects


def crowded_floor(rng: np.random.Generator) -> tuple[ObjectState, Box]:
    """Return 200 objects, a quarter of them not free, between nest and cache cells."""
    nx, ny = 60, 40
    cells = [(int(k) % nx, int(k) // nx) for k in rng.permutation(nx * ny)[:200]]
    objects = lying(cells, nx, ny)
    for row in range(0, 200, 4):
        x, y = objects.cell[row]
        objects.floor[y, x] = CELL_EMPTY
        objects.status[row] = (ObjectStatus.CARRIED, ObjectStatus.CACHED, ObjectStatus.WAITING)[row % 3]
        objects.cell[row] = (30, 20) if objects.status[row] == ObjectStatus.CACHED else (-1, -1)
    litter = (objects.floor == CELL_EMPTY) & (rng.random(objects.floor.shape) < 0.3)
    objects.floor[litter] = rng.choice([CELL_NEST, CELL_CACHE, CELL_CACHE - 1], np.count_nonzero(litter))
    return objects, distributable_box(nx, ny)


def walked(objects: ObjectState, area: Box, p: float, rng: np.random.Generator, *, self_conflict: bool = False) -> int:
    chance = rng.random(len(objects.status))
    return walk(objects.floor, objects.status, objects.cell, chance, p, area, self_conflict)


@pytest.mark.parametrize("self_conflict", [False, True])
@pytest.mark.parametrize("probability", [0.1, 1.0])
def test_walk_agrees_with_its_slow_twin(probability, self_conflict):
    rng = np.random.default_rng(8)
    objects, area = crowded_floor(rng)
    twin = copy.deepcopy(objects)
    for tick in range(40):
        chance = np.random.default_rng(tick).random(200)
        moved = walked(objects, area, probability, np.random.default_rng(tick), self_conflict=self_conflict)
        assert moved == walk_slowly(twin, area, probability, chance, self_conflict)
        np.testing.assert_array_equal(objects.floor, twin.floor)
        np.testing.assert_array_equal(objects.cell, twin.cell)


def test_the_number_that_triggers_a_move_does_not_bias_its_direction():
    rng = np.random.default_rng(6)
    counts = np.zeros((3, 3), int)
    for _ in range(40_000):
        objects = lying([(1, 1)], 3, 3)
        if walked(objects, (0, 0, 3, 3), 0.05, rng):
            counts += objects.floor == CELL_OBJECT
    counts = np.delete(counts.ravel(), 4)
    assert binomtest(int(counts.sum()), 40_000, 0.05).pvalue > SIGNIFICANCE
    assert chisquare(counts).pvalue > SIGNIFICANCE


@pytest.mark.parametrize(
    ("x", "y", "dx", "dy", "crosses"),
    [
        (5, 10, 1, 0, True),  # the border after cell 5
        (6, 10, -1, 0, True),  # the same from the other side
        (5, 10, -1, 0, False),
        (5, 10, 0, 1, False),  # beside the open border, not across it
        (5, 10, 1, 1, True),  # one open border is enough for a diagonal step
        (10, 40, 1, 1, True),
        (10, 41, -1, -1, True),
        (10, 11, 1, 1, False),
        (155, 10, 1, 0, True),
        (160, 10, 1, 0, False),
        (640, 643, 1, 1, False),  # beyond the study's grids no border is open
    ],
)
def test_self_conflict_lets_objects_across_open_borders_only(x, y, dx, dy, crosses):
    assert crosses_open_border(x, y, dx, dy) == crosses
