"""Obstacles, further nests and positions of objects: what is refused, and which cells and areas they take."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.obstacles import blocked_cells, covered_area_m2, distances_m, stretched
from swarm_forage_env.scenarios.presets import at_density, scenario

WALL = (14.0, 4.0, 14.4, 12.0)
PILLAR = (18.0, 7.5, 19.0, 8.5)
EAST = (28.0, 6.0, 30.0, 10.0)


def own(*places, **others):
    return {"placement": "positions", "object_positions_m": places, "n_objects": 1, **others}


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"obstacles": WALL}, "arena.obstacles[0] to be a list, got 14.0"),
        ({"obstacles": (WALL, (1.0, 2.0, 3.0))}, "arena.obstacles[1] to have 4 entries"),
        ({"obstacles": ((14.0, 4.0, "a", 12.0),)}, "arena.obstacles[0][2]"),
        ({"obstacles": ((14.4, 4.0, 14.0, 12.0),)}, "x low < x high"),
        ({"obstacles": ((14.0, 4.0, 14.1, 12.0),)}, "at least 0.2 m apart"),
        ({"obstacles": ((30.0, 4.0, 33.0, 12.0),)}, "inside the 32.0 x 16.0 m arena"),
        ({"obstacles": ((6.0, -1.0, 7.0, 12.0),)}, "inside the 32.0 x 16.0 m arena"),
        ({"obstacles": ((4.0, 4.0, 6.0, 5.0),)}, "clear of the nest (1.6, 1.6, 4.8, 14.4)"),
        ({"obstacles": (WALL,) * 201}, "at most 200"),
        ({"obstacles": ((24.0, 0.0, 28.0, 16.0),)}, "at most 0 objects"),
        ({"obstacles": ((24.0, 0.0, 27.0, 16.0),)}, "at most 56 objects"),
        ({"obstacles": ((4.8, 0.0, 23.0, 16.0),), "n_robots": 50_000}, "26.4 x 10.4 m less 191.0 m^2 for obstacles"),
        ({"further_nests": ((4.0, 4.0, 6.0, 5.0),)}, "clear of the nest (1.6, 1.6, 4.8, 14.4)"),
        ({"further_nests": (EAST, (29.0, 7.0, 31.0, 8.0))}, "arena.further_nests[1] clear of the nest (28.0"),
        ({"further_nests": (EAST,), "obstacles": (EAST,)}, "arena.obstacles[0] clear of the nest (28.0"),
        ({"placement": "positions"}, "got 0 positions"),
        ({"object_positions_m": ((20.0, 8.0),)}, "got 1 positions with 'single_source'"),
        (own((20.0, 8.0), n_objects=200), "at most 1 objects"),
        (own((30.0, 8.0)), "between 15 % and 85 %"),
        (own((14.2, 8.0), obstacles=(WALL,)), "clear of nest and obstacles, got (14.2, 8.0)"),
    ],
)
def test_nonsense_is_refused(overrides, words):
    with pytest.raises(ConfigError) as caught:
        scenario("warehouse_small", **overrides)
    assert words in str(caught.value)


def test_boxes_keep_their_share_of_an_arena_at_another_density():
    grown = at_density(scenario("warehouse_small", obstacles=(WALL,), further_nests=(EAST,)), 0.05, n_robots=200).arena
    np.testing.assert_allclose(grown.obstacles[0], np.array(WALL) * 2.8)
    assert grown.nest_boxes_m[1] == pytest.approx(tuple(edge * 2.8 for edge in EAST), abs=0.11)
    rescue = scenario("search_and_rescue", obstacles=((10.0, 10.0, 12.0, 11.0),))
    np.testing.assert_allclose(
        at_density(rescue, 0.05, n_robots=819).arena.obstacles[0], np.array((10, 10, 12, 11)) / 0.375
    )
    with pytest.raises(ConfigError, match="either density, which chooses the arena, or obstacles"):
        scenario("warehouse_small", density=0.05, obstacles=(WALL,))


def test_a_side_that_would_be_too_short_is_widened_about_its_middle():
    (box,) = stretched([(0.0, 4.0, 0.2, 8.0)], (0.5, 0.5), (8.0, 4.0))
    assert box == (0.0, 2.0, 0.2, 4.0)
    (box,) = stretched([WALL], (0.25, 1.0), (8.0, 16.0))
    assert box == pytest.approx((3.45, 4.0, 3.65, 12.0))


@pytest.mark.parametrize(
    ("box", "radius"), [(PILLAR, 0.15), ((10.1, 3.37, 10.34, 4.0), 0.085), ((0.0, 0.0, 0.2, 16.0), 0.15)]
)
def test_objects_keep_off_cells_that_a_box_covers_or_no_robot_can_stand_on(box, radius):
    x_low, y_low, x_high, y_high = blocked_cells(box, 160, 80, radius)
    centres = np.stack(np.meshgrid(np.arange(160) + 0.5, np.arange(80) + 0.5), axis=-1) * 0.2
    low, high = np.array(box[:2]), np.array(box[2:])
    is_covered = np.all((centres + 0.1 > low + 1e-6) & (centres - 0.1 < high - 1e-6), axis=2)
    is_near = np.all((centres > low - radius) & (centres < high + radius), axis=2)
    expected = np.zeros((80, 160), np.bool_)
    expected[y_low:y_high, x_low:x_high] = True
    np.testing.assert_array_equal(is_covered | is_near, expected)


def test_covered_area_and_distances_are_those_of_many_points():
    boxes = (WALL, PILLAR, (18.5, 8.0, 20.0, 9.0), (2.0, 2.0, 5.0, 3.0))
    area = (2.8, 2.8, 29.2, 13.2)
    points = np.random.default_rng(0).uniform(area[:2], area[2:], (40_000, 2))
    is_covered = np.zeros(len(points), np.bool_)
    nearest = np.full(len(points), np.inf)
    for box in boxes:
        low, high = np.array(box[:2]), np.array(box[2:])
        is_covered |= np.all((points > low - 0.1) & (points < high + 0.1), axis=1)
        nearest = np.minimum(nearest, np.linalg.norm(points - np.clip(points, low, high), axis=1))
    share = covered_area_m2(area, boxes, 0.1) / ((area[2] - area[0]) * (area[3] - area[1]))
    assert share == pytest.approx(is_covered.mean(), abs=0.003)
    np.testing.assert_allclose(distances_m(boxes, points), nearest)
    assert np.all(distances_m((), points[:3]) == np.inf)
