"""Where objects appear: uniform over free cells, one per cell, and a waiting list for those without a place."""

import numpy as np
import pytest
from scipy.stats import chisquare

from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_NEST, CELL_OBJECT, ObjectStatus
from swarm_forage_env.contract.types import IntArray
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import Box
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.world.allocation import new_objects
from swarm_forage_env.world.kernels.placement import (
    DRAWS,
    UNLIMITED,
    count_objects,
    place_displaced,
    scatter,
)
from swarm_forage_env.world.placement import draw_ahead, draw_source, give_back, new_draws, place_all, place_objects
from swarm_forage_env.world.state import ObjectState, Requests, Source, listed, make_list
from tests.reference.object_placement import choose_cell, random_source, scatter_slowly, waiting_by_the_word

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


def furnished(config: ScenarioConfig, seed: int = 0) -> tuple[ObjectState, Source, np.random.Generator]:
    objects = new_objects(config)
    rng = stream_rng(seed, Stream.PLACEMENT)
    source = draw_source(config, objects.floor, rng)
    place_all(objects, source, config.arena.distributable_cells, rng)
    return objects, source, rng


def assert_consistent(objects: ObjectState) -> None:
    free = np.flatnonzero(objects.status == ObjectStatus.FREE)
    x, y = objects.cell[free].T
    np.testing.assert_array_equal(objects.floor[y, x], CELL_OBJECT + free)
    assert np.count_nonzero(objects.floor >= CELL_OBJECT) == len(free)
    not_lying = np.flatnonzero(objects.status == ObjectStatus.WAITING)
    assert sorted(waiting(objects)) == not_lying.tolist()
    assert np.all(objects.cell[not_lying] == -1)


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_presets_place_every_object_on_its_own_free_cell(name):
    config = scenario(name)
    before = new_objects(config).floor
    objects, source, _ = furnished(config)
    assert np.all(objects.status == ObjectStatus.FREE)
    assert waiting(objects) == []
    assert_consistent(objects)
    x, y = objects.cell.T
    assert len({*zip(x.tolist(), y.tolist(), strict=True)}) == config.objects.n_objects
    assert np.all(before[y, x] == CELL_EMPTY)
    x_low, y_low, x_high, y_high = config.arena.distributable_cells
    assert np.all((x >= x_low) & (x < x_high) & (y >= y_low) & (y < y_high))
    inside = [(x >= box[0]) & (x < box[2]) & (y >= box[1]) & (y < box[3]) for box in source.regions.tolist()]
    assert np.all(np.any(inside, axis=0))
    np.testing.assert_array_equal(objects.floor == CELL_NEST, before == CELL_NEST)


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


def test_groups_then_regions_are_equally_likely():
    regions = np.array([(0, 0, 4, 4), (5, 0, 9, 4), (10, 0, 14, 4), (15, 0, 25, 10)], np.int32)
    source = Source(regions, np.array([8, 8, 8, 16], np.int32), np.array([0, 3, 4], np.int32))
    objects = bare_objects(1, 30, 12)
    rng = np.random.default_rng(2)
    counts = np.zeros(4, int)
    for _ in range(6_000):
        place_objects([0], objects, source, (0, 0, 30, 12), rng)
        counts[np.searchsorted([5, 10, 15], objects.cell[0, 0], side="right")] += 1
        lift(objects, 0)
    assert chisquare(counts, [1_000, 1_000, 1_000, 3_000]).pvalue > SIGNIFICANCE


def test_a_region_at_capacity_is_skipped_dropped_objects_included():
    regions = np.array([(0, 0, 5, 5), (6, 0, 11, 5)], np.int32)
    source = Source(regions, np.array([3, 3], np.int32), np.array([0, 2], np.int32))
    objects = bare_objects(6, 12, 6)
    objects.floor[2, 2], objects.floor[3, 3] = CELL_OBJECT + 4, CELL_OBJECT + 5  # laid there by robots
    objects.cell[[4, 5]] = (2, 2), (3, 3)
    objects.status[[4, 5]] = ObjectStatus.FREE
    make_list(objects.waiting, [])
    place_objects([0, 1, 2, 3], objects, source, (0, 0, 12, 6), np.random.default_rng(0))
    assert count_objects(objects.floor, 0, 0, 5, 5) == 3
    assert count_objects(objects.floor, 6, 0, 11, 5) == 3
    lift(objects, 4)  # frees a slot although cells were free all along
    place_objects([4], objects, source, (0, 0, 12, 6), np.random.default_rng(0))
    assert count_objects(objects.floor, 0, 0, 5, 5) == 3
    assert waiting(objects) == []


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
