"""Random walk of free objects."""

import copy

import numpy as np
import pytest
from scipy.stats import binomtest, chisquare

from swarm_forage_env.contract.codes import CELL_CACHE, CELL_EMPTY, CELL_NEST, CELL_OBJECT, ObjectStatus
from swarm_forage_env.scenarios.floor import Box, distributable_box
from swarm_forage_env.world.kernels.walk import can_step, crosses_open_border, walk
from swarm_forage_env.world.state import ObjectState
from tests.reference.objects import walk_slowly

SIGNIFICANCE = 0.001
"""Seeds are fixed, so a test that passes once passes always; this is what it passed."""


def world(cells: list[tuple[int, int]], nx: int, ny: int) -> ObjectState:
    """Return objects lying on the given cells of an otherwise empty floor."""
    n_objects = len(cells)
    floor = np.full((ny, nx), CELL_EMPTY, np.int32)
    for row, (x, y) in enumerate(cells):
        floor[y, x] = CELL_OBJECT + row
    return ObjectState(
        floor=floor,
        status=np.full(n_objects, ObjectStatus.FREE, np.int8),
        cell=np.array(cells, np.int32).reshape(n_objects, 2),
        cache_slot=np.full(n_objects, -1, np.int32),
        carriers=np.zeros(n_objects, np.int32),
        waiting=np.zeros(n_objects + 1, np.int32),
    )


def crowded_world(rng: np.random.Generator) -> tuple[ObjectState, Box]:
    """Return 200 objects, a quarter of them not free, between nest and cache cells."""
    nx, ny = 60, 40
    cells = [(int(k) % nx, int(k) // nx) for k in rng.permutation(nx * ny)[:200]]
    objects = world(cells, nx, ny)
    for row in range(0, 200, 4):
        x, y = objects.cell[row]
        objects.floor[y, x] = CELL_EMPTY
        objects.status[row] = (ObjectStatus.CARRIED, ObjectStatus.CACHED, ObjectStatus.WAITING)[row % 3]
        objects.cell[row] = (30, 20) if objects.status[row] == ObjectStatus.CACHED else (-1, -1)
    litter = (objects.floor == CELL_EMPTY) & (rng.random(objects.floor.shape) < 0.3)
    objects.floor[litter] = rng.choice([CELL_NEST, CELL_CACHE, CELL_CACHE - 1], np.count_nonzero(litter))
    return objects, distributable_box(nx, ny)


def step(objects: ObjectState, area: Box, p: float, rng: np.random.Generator, *, self_conflict: bool = False) -> int:
    chance = rng.random(len(objects.status))
    return walk(objects.floor, objects.status, objects.cell, chance, p, area, self_conflict)


@pytest.mark.parametrize("self_conflict", [False, True])
@pytest.mark.parametrize("probability", [0.1, 1.0])
def test_walk_agrees_with_its_slow_twin(probability, self_conflict):
    rng = np.random.default_rng(8)
    objects, area = crowded_world(rng)
    twin = copy.deepcopy(objects)
    for tick in range(40):
        chance = np.random.default_rng(tick).random(200)
        moved = step(objects, area, probability, np.random.default_rng(tick), self_conflict=self_conflict)
        assert moved == walk_slowly(twin, area, probability, chance, self_conflict)
        np.testing.assert_array_equal(objects.floor, twin.floor)
        np.testing.assert_array_equal(objects.cell, twin.cell)


@pytest.mark.parametrize(
    ("start", "n_choices"), [((2, 2), 8), ((0, 2), 5), ((4, 4), 3)], ids=["open", "edge", "corner"]
)
def test_every_free_neighbour_is_equally_likely(start, n_choices):
    rng = np.random.default_rng(5)
    counts = np.zeros((5, 5), int)
    for _ in range(400 * n_choices):
        objects = world([start], 5, 5)
        assert step(objects, (0, 0, 5, 5), 1.0, rng) == 1
        counts += objects.floor == CELL_OBJECT
    assert counts[start[1], start[0]] == 0
    reached = counts[counts > 0]
    assert len(reached) == n_choices
    assert chisquare(reached).pvalue > SIGNIFICANCE


def test_the_number_that_triggers_a_move_does_not_bias_its_direction():
    rng = np.random.default_rng(6)
    counts = np.zeros((3, 3), int)
    for _ in range(40_000):
        objects = world([(1, 1)], 3, 3)
        if step(objects, (0, 0, 3, 3), 0.05, rng):
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


@pytest.mark.parametrize(("side", "percent"), [(16, 67), (48, 61), (128, 10)])
def test_share_of_places_from_which_an_object_can_move_at_all(side, percent):
    n_cells = 5 * side
    area = distributable_box(n_cells, n_cells)
    floor = np.full((n_cells, n_cells), CELL_EMPTY, np.int32)
    # Columns and rows from which an axis-parallel step crosses an open border; a diagonal one needs either.
    axis = range(area[0], area[2])
    can_x = np.array([any(can_step(floor, area, k, area[1], dx, 0, True) for dx in (-1, 1)) for k in axis])
    can_y = np.array([any(can_step(floor, area, area[0], k, 0, dy, True) for dy in (-1, 1)) for k in axis])
    share = np.mean(can_x[np.newaxis, :] | can_y[:, np.newaxis])
    assert 100 * share == pytest.approx(percent, abs=0.7)
