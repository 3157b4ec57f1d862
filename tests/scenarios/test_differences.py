"""What a scenario has that its preset has not."""

from dataclasses import replace

import pytest

from swarm_forage_env.scenarios.differences import difference_words, differences
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario

WALL = ((10.0, 4.0, 11.0, 12.0),)


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_a_preset_of_any_size_differs_in_nothing(name):
    for sizes in ({}, {"n_robots": 5}):
        config = scenario(name, **sizes)
        assert (differences(config), difference_words(config)) == ({}, ())


@pytest.mark.parametrize(
    ("fields", "words"),
    [
        ({"n_objects": 1}, ("1 object",)),
        ({"obstacles": WALL}, ("obstacles 10,4,11,12",)),
        ({"nest_centre_m": (16.0, 8.0)}, ("nest 3.2 x 12.8 m at 16,8",)),
        ({"width_m": 40.0}, ("40 x 16 m", "nest 3.2 x 12.8 m at 3.2,8")),
        ({"density": 0.05, "n_robots": 200}, ("89.6 x 44.8 m", "1,568 objects")),
        ({"caches": "static"}, ("static caches",)),
        ({"physics": "chipmunk"}, ("physics chipmunk",)),
        ({"max_speed_mps": 0.05}, ("max speed 0.05 m/s",)),
        ({"quirks": "AUTHORS_PROGRAM"}, ("rules AUTHORS_PROGRAM",)),
        ({"scattered_sites": True}, ("quirks scattered_sites",)),
        ({"horizon_s": 400.0, "interval_s": 100.0, "performance": "n_active"}, ()),
    ],
)
def test_differences_are_told_in_words(fields, words):
    assert difference_words(scenario("warehouse_small", **fields)) == words


def test_long_values_are_told_apart_by_a_digest():
    several = [tuple((x, y, x + 1.0, y + 0.2) for x in (8.0, 12.0, 16.0, 20.0)) for y in (2.0, 4.0)]
    first, second = (difference_words(scenario("warehouse_small", obstacles=boxes))[0] for boxes in several)
    assert first.startswith("4 obstacles (")
    assert first != second
    assert difference_words(scenario("warehouse_small", obstacles=several[0]), digests=False) == ("4 obstacles",)


def test_a_few_boxes_are_shown_whole_however_many_digits_they_have():
    boxes = tuple((x, 4.25, x + 1.0, 12.75) for x in (8.125, 12.125, 16.125))
    assert difference_words(scenario("warehouse_small", obstacles=boxes), digests=False) == (
        "obstacles 8.125,4.25,9.125,12.75+12.125,4.25,13.125,12.75+16.125,4.25,17.125,12.75",
    )


def test_an_arena_that_follows_the_swarm_is_that_of_its_size():
    assert difference_words(scenario("search_and_rescue", n_robots=12)) == ()
    assert difference_words(scenario("search_and_rescue", side_m=32.0, n_robots=12))[0] == "32 x 32 m"


def test_of_a_name_of_ones_own_the_name_is_all():
    ruins = replace(scenario("warehouse_small"), name="ruins")
    assert difference_words(ruins) == ()
    assert "width_m" in differences(ruins)
