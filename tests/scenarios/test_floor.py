"""Floors: source regions, cells for objects, obstacles, several nests."""

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import CELL_NEST, Event, Grip
from swarm_forage_env.scenarios.floor import PLACEMENTS, distributable_box, free_area, overlap_cells, source_boxes
from swarm_forage_env.scenarios.obstacles import blocked_cells, distances_m, stretched
from swarm_forage_env.scenarios.presets import at_density, scenario
from tests.support.stage import load, put, tidy_world


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
        ("heap", (80, 80), ((12, 12, 69, 69),)),
    ],
)
def test_sources_by_hand(placement, size, boxes):
    assert source_boxes(placement, *size) == boxes


@pytest.mark.parametrize("placement", PLACEMENTS)
def test_the_free_area_is_the_number_of_source_cells_off_what_is_taken(placement):
    area, boxes = distributable_box(70, 50), source_boxes(placement, 70, 50)
    taken = ((20, 4, 60, 40), (50, 30, 66, 44))  # they overlap

    def covered(those):
        return {(x, y) for left, low, right, high in those for x in range(left, right) for y in range(low, high)}

    assert free_area(boxes, taken) == len(covered(boxes) - covered(taken))
    assert free_area(boxes, []) == len(covered(boxes))
    assert all(overlap_cells(box, area) == overlap_cells(box, box) > 0 for box in boxes)


# Obstacles, further nests and positions of objects


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
        (
            {"obstacles": ((4.8, 0.0, 23.0, 16.0),), "n_robots": 50_000},
            "at most 1470 robots in a start area of 26.4 x 10.4 m clear of obstacles",
        ),
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


@pytest.mark.parametrize("radius", [0.085, 0.15])
@pytest.mark.parametrize("box", [WALL, PILLAR, (10.1, 3.37, 10.34, 4.0), (0.0, 0.0, 0.2, 16.0)])
def test_objects_keep_off_cells_that_a_box_covers_or_no_robot_can_stand_on(box, radius):
    x_low, y_low, x_high, y_high = blocked_cells(box, 160, 80, radius)
    centres = np.stack(np.meshgrid(np.arange(160) + 0.5, np.arange(80) + 0.5), axis=-1) * 0.2
    low, high = np.array(box[:2]), np.array(box[2:])
    is_covered = np.all((centres + 0.1 > low + 1e-6) & (centres - 0.1 < high - 1e-6), axis=2)
    is_near = np.all((centres > low - radius) & (centres < high + radius), axis=2)
    expected = np.zeros((80, 160), np.bool_)
    expected[y_low:y_high, x_low:x_high] = True
    np.testing.assert_array_equal(is_covered | is_near, expected)


def test_distances_are_those_to_the_nearest_box():
    boxes = (WALL, PILLAR, (18.5, 8.0, 20.0, 9.0), (2.0, 2.0, 5.0, 3.0))
    points = np.random.default_rng(0).uniform((2.8, 2.8), (29.2, 13.2), (400, 2))
    nearest = [np.linalg.norm(points - np.clip(points, box[:2], box[2:]), axis=1) for box in boxes]
    np.testing.assert_allclose(distances_m(boxes, points), np.min(nearest, axis=0))
    assert np.all(distances_m((), points[:3]) == np.inf)


# Several nests


SQUARE = (16.0, 2.0, 18.0, 4.0)


def test_nests_are_whole_cells_with_lights_of_their_own():
    arena = scenario("warehouse_small", further_nests=(EAST, SQUARE, (10.05, 8.05, 10.26, 8.26))).arena
    assert arena.all_nest_cells[1:] == ((140, 30, 150, 50), (80, 10, 90, 20), (50, 40, 51, 41))
    assert arena.nest_boxes_m[1] == EAST
    assert arena.nest_centres_m == ((3.2, 8.0), (29.0, 8.0), (17.0, 3.0), (10.1, 8.1))
    height = (32.0 * 16.0) ** 0.25
    places = [(29.0, 7.0), (29.0, 8.0), (29.0, 9.0), (17.0, 3.0), (10.1, 8.1)]
    assert arena.lights_m[3:] == tuple(pytest.approx((x, y, height)) for x, y in places)
    assert arena.lights_m[:3] == scenario("warehouse_small").arena.lights_m


def test_every_nest_takes_deliveries_and_holds_no_objects():
    env = tidy_world(n_robots=2, further_nests=(EAST, SQUARE))
    for robot, (x, y) in enumerate(((29.0, 6.0), (17.0, 3.0))):
        put(env, robot, x, y)
        load(env, robot, robot)
    release = np.zeros((2, 3), np.float32)
    release[:, 2] = Grip.DELIVER
    for _ in range(20):
        env.step_batch(release)
        if env.arena.events.code.all():
            break
    assert env.arena.events.code.tolist() == [Event.DELIVERED, Event.DELIVERED]
    for x_low, y_low, x_high, y_high in env.scenario.arena.all_nest_cells:
        assert (env.arena.objects.floor[y_low:y_high, x_low:x_high] == CELL_NEST).all()
