"""Source regions and the cells objects may lie on."""

import pytest

from swarm_forage_env.scenarios.floor import (
    CELL_M,
    PLACEMENTS,
    capacity,
    distributable_box,
    overlap_cells,
    source_boxes,
)
from swarm_forage_env.scenarios.presets import SEARCH_AND_RESCUE_OBJECTS, scenario


@pytest.mark.parametrize(
    ("nx", "ny", "box"),
    [
        (160, 80, (24, 12, 137, 69)),
        (240, 240, (36, 36, 205, 205)),
        (80, 80, (12, 12, 69, 69)),
        (640, 640, (96, 96, 545, 545)),
        (10, 10, (1, 1, 9, 9)),
    ],
)
def test_distributable_cells_are_15_to_85_percent_with_both_ends(nx, ny, box):
    assert distributable_box(nx, ny) == box


@pytest.mark.parametrize("side", SEARCH_AND_RESCUE_OBJECTS)
def test_search_and_rescue_sides(side):
    arena = scenario("search_and_rescue", side_m=side).arena
    n_cells = 5 * side
    low, high = 3 * n_cells // 20, 17 * n_cells // 20
    assert arena.n_cells == (n_cells, n_cells)
    assert arena.distributable_cells == (low, low, high + 1, high + 1)
    assert source_boxes("power_law", *arena.n_cells) == (arena.distributable_cells,)
    assert arena.nest_cells == (2 * side, 2 * side, 3 * side, 3 * side)


def test_small_warehouse_source_strip():
    config = scenario("warehouse_small")
    (box,) = source_boxes("single_source", *config.arena.n_cells)
    assert box == (120, 12, 136, 68)  # 16 x 56 cells: x 24.0 .. 27.2 m, y 2.4 .. 13.6 m
    assert tuple(edge * CELL_M for edge in box) == pytest.approx((24.0, 2.4, 27.2, 13.6))
    assert capacity(config.source_cells, *config.arena.n_cells, [config.arena.nest_cells]) == 16 * 56


def test_medium_warehouse_source():
    config = scenario("warehouse_medium")
    assert source_boxes("random", *config.arena.n_cells) == ((36, 36, 204, 204),)  # 7.2 .. 40.8 m on both axes
    assert capacity(config.source_cells, *config.arena.n_cells, [config.arena.nest_cells]) == 168 * 168 - 48 * 48


def test_dual_source():
    config = scenario("warehouse_dual")
    right, left = source_boxes("dual_source", *config.arena.n_cells)
    assert tuple(edge * CELL_M for edge in right) == pytest.approx((24.0, 2.4, 27.2, 13.6))
    assert tuple(edge * CELL_M for edge in left) == pytest.approx((4.8, 2.4, 8.0, 13.6))
    assert capacity(config.source_cells, *config.arena.n_cells, [config.arena.nest_cells]) == 2 * 16 * 56


def test_quad_source():
    config = scenario("warehouse_quad")
    right, left = (180, 36, 204, 204), (36, 36, 60, 204)  # 36 .. 40.8 and 7.2 .. 12 m
    bottom, top = (36, 36, 204, 60), (36, 180, 204, 204)
    assert source_boxes("quad_source", *config.arena.n_cells) == (right, left, bottom, top)


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_capacity_is_the_number_of_source_cells_off_the_nest(placement):
    nest = (20, 4, 60, 40)
    cells = {
        (x, y)
        for x_low, y_low, x_high, y_high in source_boxes(placement, 70, 50)
        for x in range(x_low, x_high)
        for y in range(y_low, y_high)
        if not (20 <= x < 60 and 4 <= y < 40)
    }
    assert capacity(source_boxes(placement, 70, 50), 70, 50, [nest]) == len(cells)


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_regions_lie_in_the_distributable_box(placement):
    area = distributable_box(97, 53)
    for box in source_boxes(placement, 97, 53):
        assert overlap_cells(box, area) == overlap_cells(box, box) > 0


@pytest.mark.parametrize(
    ("a", "b", "cells"),
    [
        ((0, 0, 4, 3), (0, 0, 4, 3), 12),
        ((0, 0, 4, 3), (3, 2, 9, 9), 1),
        ((0, 0, 4, 3), (4, 0, 8, 3), 0),  # neighbours share no cell
        ((0, 0, 4, 3), (10, 10, 12, 12), 0),
    ],
)
def test_overlap_cells(a, b, cells):
    assert overlap_cells(a, b) == overlap_cells(b, a) == cells
