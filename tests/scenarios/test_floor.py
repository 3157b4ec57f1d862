"""Source regions and the cells objects may lie on."""

import pytest

from swarm_forage_env.scenarios.floor import (
    PLACEMENTS,
    capacity,
    distributable_box,
    overlap_cells,
    source_boxes,
)


@pytest.mark.parametrize(
    ("nx", "ny", "box"),
    [
        (160, 80, (24, 12, 137, 69)),
        (240, 240, (36, 36, 205, 205)),
        (640, 640, (96, 96, 545, 545)),
        (10, 10, (1, 1, 9, 9)),
    ],
)
def test_distributable_cells_are_15_to_85_percent_with_both_ends(nx, ny, box):
    assert distributable_box(nx, ny) == box


@pytest.mark.parametrize(
    ("placement", "size", "boxes"),
    [
        ("single_source", (160, 80), ((120, 12, 136, 68),)),  # x 24.0 .. 27.2 m, y 2.4 .. 13.6 m
        ("dual_source", (160, 80), ((120, 12, 136, 68), (24, 12, 40, 68))),
        ("random", (240, 240), ((36, 36, 204, 204),)),  # 7.2 .. 40.8 m on both axes
        ("quad_source", (240, 240), ((180, 36, 204, 204), (36, 36, 60, 204), (36, 36, 204, 60), (36, 180, 204, 204))),
        ("power_law", (80, 80), ((12, 12, 69, 69),)),
    ],
)
def test_sources_by_hand(placement, size, boxes):
    assert source_boxes(placement, *size) == boxes


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_capacity_is_the_number_of_source_cells_off_the_nest(placement):
    nest, area, boxes = (20, 4, 60, 40), distributable_box(70, 50), source_boxes(placement, 70, 50)
    cells = {
        (x, y) for low_x, low_y, high_x, high_y in boxes for x in range(low_x, high_x) for y in range(low_y, high_y)
    }
    assert capacity(boxes, 70, 50, [nest]) == len([1 for x, y in cells if not (20 <= x < 60 and 4 <= y < 40)])
    assert capacity(boxes, 70, 50, []) == len(cells)
    assert all(overlap_cells(box, area) == overlap_cells(box, box) > 0 for box in boxes)
