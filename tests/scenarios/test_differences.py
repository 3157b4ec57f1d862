"""What a scenario has that its preset has not."""

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
