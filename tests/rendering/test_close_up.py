"""Close-ups of hand-built states."""

import numpy as np
import pytest

from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.contract.layout import observation_layout
from swarm_forage_env.contract.policy import RememberedPlaces
from swarm_forage_env.rendering.close_up import render_close_up
from swarm_forage_env.rendering.view import PALETTE, THEMES
from swarm_forage_env.scenarios.floor import CELL_M
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.allocation import new_objects
from swarm_forage_env.world.state import CacheState, SwarmState

CONFIG = scenario("warehouse_small", n_robots=2, n_objects=3)
LAYOUT = observation_layout(32.0, 16.0, 3)
SCALE = 300 / 1.6
"""Pixels per metre."""


class Place:
    """Robot 0 in the middle of an empty floor, heading along +x; robot 1 far away."""

    def __init__(self):
        self.swarm = SwarmState.empty(2)
        self.swarm.position[:] = [(16.1, 8.1), (3.0, 3.0)]
        self.objects = new_objects(CONFIG)
        self.obs = np.zeros(LAYOUT.size, np.float32)

    def draw(self, **options):
        state = (self.swarm, self.objects, CacheState.empty(2))
        return render_close_up(CONFIG, *state, robot=0, obs=self.obs, layout=LAYOUT, **options)

    @staticmethod
    def pixel(picture, right_m, up_m):
        return tuple(int(value) for value in picture[int(150 - up_m * SCALE), int(150 + right_m * SCALE)])


@pytest.fixture
def place():
    return Place()


def test_the_robot_is_in_the_middle_in_true_size(place):
    picture = place.draw()
    assert picture.shape == (300, 300, 3)
    assert place.pixel(picture, -0.05, 0.0) == PALETTE.empty
    assert place.pixel(picture, 0.0, 0.35) == PALETTE.floor
    place.swarm.carried_object[0] = 1
    assert place.pixel(place.draw(), -0.06, 0.0) == PALETTE.carrying


def test_robots_are_where_they_are(place):
    place.swarm.position[1] = place.swarm.position[0] + (0.3, 0.2)
    assert place.pixel(place.draw(), 0.27, 0.2) == PALETTE.empty
    place.swarm.present[1] = False
    assert place.pixel(place.draw(), 0.27, 0.2) == PALETTE.floor


def test_a_reading_is_a_red_line_as_long_as_the_gap(place):
    left = 5  # the sensor at 82.5 degrees
    angle, radius = np.deg2rad(82.5), CONFIG.robots.radius_m
    at = [((radius + beyond) * np.cos(angle), (radius + beyond) * np.sin(angle)) for beyond in (0.025, 0.085)]
    quiet = place.draw()
    assert place.pixel(quiet, *at[0]) != pytest.approx(PALETTE.interference, abs=60)
    place.obs[LAYOUT["proximity"]][left] = 0.01 / 0.05
    picture = place.draw()
    assert place.pixel(picture, *at[0]) == pytest.approx(PALETTE.interference, abs=60)
    assert place.pixel(picture, *at[1]) != pytest.approx(PALETTE.interference, abs=60)


def test_objects_that_the_robot_sees_are_bright(place):
    place.objects.status[1] = ObjectStatus.FREE
    place.objects.cell[1] = (82, 40)  # two cells to the right of the robot's own
    pale = place.pixel(place.draw(), 0.4, 0.0)
    assert pale not in (PALETTE.floor, PALETTE.object)
    place.obs[LAYOUT["los_object"]][14] = 2 / 3  # row 1 of three
    assert place.pixel(place.draw(), 0.4, 0.0) == PALETTE.object


def remembered(objects=(), caches=()):
    """What a robot remembers in these cells."""
    return RememberedPlaces(*((np.reshape(cells, (-1, 2)) + 0.5) * CELL_M for cells in (objects, caches)))


def test_a_frame_is_around_a_remembered_object(place):
    memory = remembered(objects=[(82, 40), (150, 40)])  # two cells to the right of the robot's own; far away
    without, picture = place.draw(), place.draw(remembered=memory)
    for right, up in ((0.305, 0.0), (0.4, 0.095), (0.4, -0.095)):
        assert place.pixel(picture, right, up) == PALETTE.text
        assert place.pixel(without, right, up) != PALETTE.text
    assert place.pixel(picture, 0.4, 0.03) == place.pixel(without, 0.4, 0.03), "inside it is as it was"


def test_a_frame_is_around_a_remembered_cache(place):
    picture = place.draw(side_m=8.0, remembered=remembered(caches=[(80, 40)]))
    columns = np.flatnonzero((picture == PALETTE.text).all(axis=2).any(axis=0))
    assert np.ptp(columns) * 8.0 / 300 == pytest.approx((CONFIG.cache_side_cells + 1) * 0.2, abs=0.06)


def test_the_window_goes_around_five_cells(place):
    picture = place.draw()
    inner, beyond = place.pixel(picture, 0.5 - 0.006, 0.3), place.pixel(picture, 0.5 + 0.03, 0.3)
    assert inner[0] > 100
    assert beyond == PALETTE.floor


def test_a_light_close_up_has_the_light_colours(place):
    light = THEMES["light"]
    picture = place.draw(theme="light")
    assert place.pixel(picture, -0.05, 0.0) == light.empty
    assert place.pixel(picture, 0.0, 0.35) == light.floor
    assert place.pixel(place.draw(), 0.0, 0.35) == PALETTE.floor, "the dark one is as before"


def test_obstacles_have_the_colour_of_walls(place):
    boxed = with_overrides(CONFIG, obstacles=((16.3, 8.0, 16.6, 8.4),))
    state = (place.swarm, place.objects, CacheState.empty(2))
    picture = render_close_up(boxed, *state, robot=0, obs=place.obs, layout=LAYOUT)
    assert place.pixel(picture, 0.4, 0.2) == PALETTE.wall
    assert place.pixel(picture, 0.4, -0.2) == PALETTE.floor
