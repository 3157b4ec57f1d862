"""Arenas of constant density: their sizes by hand, their nests, their objects, and what is refused."""

import math

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.floor import source_boxes
from swarm_forage_env.scenarios.overrides import robots_at_density, with_overrides
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, at_density, chosen_scenario, scenario
from swarm_forage_env.views.pettingzoo import parallel_env
from swarm_forage_env.world.placement import static_cache_centres


@pytest.mark.parametrize(
    ("area_m2", "density", "n_robots"),
    [(16 * 16, 0.05, 12), (32 * 32, 0.05, 51), (48 * 48, 0.05, 115), (128 * 128, 0.05, 819), (3.0, 0.05, 1)],
)
def test_robots_are_whole_and_at_least_one(area_m2, density, n_robots):
    assert robots_at_density(area_m2, density) == n_robots


@pytest.mark.parametrize(
    ("name", "n_robots", "density", "size"),
    [
        # 200 / 0.05 = 4,000 m^2 = 2 a^2 with a = 44.72 m, so 224 rows of 0.2 m and twice as many columns.
        ("warehouse_small", 200, 0.05, (89.6, 44.8)),
        # 50 / 0.1 = 500 m^2 = 2 a^2 with a = 15.81 m: 80 rows make 16 m, 79 make 15.8 m and hold 49.9 robots.
        ("warehouse_small", 50, 0.1, (32.0, 16.0)),
        ("warehouse_dual", 200, 0.05, (89.6, 44.8)),
        # 4,000 m^2 = a^2 with a = 63.25 m.
        ("warehouse_medium", 200, 0.05, (63.4, 63.4)),
        ("warehouse_quad", 200, 0.05, (63.4, 63.4)),
        # 1 robot per 25 m^2: 100 robots in exactly 50 x 50 m.
        ("warehouse_medium", 100, 0.04, (50.0, 50.0)),
        # Search and rescue keeps to its sides: 64 m hold 204 robots at 5 %, and 48 m hold 230 at 10 %.
        ("search_and_rescue", 200, 0.05, (64.0, 64.0)),
        ("search_and_rescue", 230, 0.10, (48.0, 48.0)),
        ("search_and_rescue", 231, 0.10, (64.0, 64.0)),
    ],
)
def test_the_arena_is_the_smallest_that_holds_the_swarm(name, n_robots, density, size):
    config = scenario(name, n_robots=n_robots, density=density)
    assert (config.arena.width_m, config.arena.height_m) == size
    assert config.robots.n_robots == n_robots
    assert n_robots / (size[0] * size[1]) <= density + 1e-12


@pytest.mark.parametrize("name", ["warehouse_small", "warehouse_medium", "warehouse_dual", "warehouse_quad"])
@pytest.mark.parametrize("n_robots", [40, 97, 333, 1024])
def test_proportions_are_kept_to_the_cell(name, n_robots):
    base, config = scenario(name), scenario(name, n_robots=n_robots, density=0.05)
    assert config.arena.width_m * base.arena.height_m == pytest.approx(config.arena.height_m * base.arena.width_m)
    factor = config.arena.width_m / base.arena.width_m
    for edge, expected in zip(config.arena.nest_box_m, base.arena.nest_box_m, strict=True):
        assert abs(edge - expected * factor) <= 0.1 + 1e-9, "half a cell"
    # One row or column less would be too few square metres.
    smaller = (config.arena.width_m - 0.2) * (config.arena.height_m - 0.2)
    assert smaller < n_robots / 0.05 <= config.arena.width_m * config.arena.height_m + 1e-9


def test_objects_stay_as_many_per_square_metre():
    # 200 objects on 512 m^2; 4,014.08 m^2 therefore have 1,568.
    assert scenario("warehouse_small", n_robots=200, density=0.05).objects.n_objects == 1568
    assert scenario("warehouse_small", n_robots=200, density=0.05, n_objects=77).objects.n_objects == 77
    assert scenario("search_and_rescue", n_robots=200, density=0.05).objects.n_objects == 448


def test_without_a_number_of_robots_it_is_that_of_the_preset():
    config = scenario("warehouse_small", density=0.05)
    assert (config.robots.n_robots, config.arena.width_m) == (50, 44.8)  # 1,000 m^2 = 2 a^2, a = 22.36 m
    assert scenario("search_and_rescue", density=0.05) == scenario("search_and_rescue")


def test_other_fields_and_complete_configurations():
    words = {"n_robots": 200, "density": 0.05, "caches": "static", "walk_probability": 0.01}
    named = scenario("warehouse_small", **words)
    assert (named.caches, named.objects.walk_probability) == ("static", 0.01)
    assert chosen_scenario("warehouse_small", words) == chosen_scenario(scenario("warehouse_small"), words) == named
    changed = with_overrides(scenario("warehouse_small"), caches="static", walk_probability=0.01)
    assert at_density(changed, 0.05, n_robots=200) == named
    assert parallel_env("warehouse_small", **words).unwrapped.scenario == named


@pytest.mark.parametrize("name", SCENARIO_NAMES)
@pytest.mark.parametrize("n_robots", [50, 333, 800])
def test_sources_and_static_caches_fit_in_every_size(name, n_robots):
    config = scenario(name, n_robots=n_robots, density=0.05, caches="static")
    strips = source_boxes(config.objects.placement, *config.arena.n_cells)
    assert all(low_x < high_x and low_y < high_y for low_x, low_y, high_x, high_y in strips)
    centres = static_cache_centres(config)  # raises where squares overlap
    assert len(centres) == len(static_cache_centres(scenario(name)))


@pytest.mark.parametrize(
    ("name", "fields", "message"),
    [
        ("warehouse_small", {"density": 0.0}, "density .robots per m.2; 0.05 is 5 %. to be a number .*got 0.0"),
        ("warehouse_small", {"density": 5}, "to be a number .*1.*got 5"),
        ("warehouse_small", {"density": math.nan}, "got nan"),
        ("warehouse_small", {"density": 0.05, "n_robots": 2.5}, "robots.n_robots to be a whole number"),
        ("warehouse_small", {"density": 0.05, "n_robots": 1}, "larger than twice robots.start_margin_m"),
        ("warehouse_small", {"density": 0.05, "width_m": 64.0}, "either density, .* or width_m; got both"),
        ("search_and_rescue", {"density": 0.05, "side_m": 64.0}, "either density, .* or side_m; got both"),
        ("search_and_rescue", {"density": 0.01, "n_robots": 500}, "at most 163 robots .* at 1 % density., got 500"),
        ("search_and_rescue", {"density": 0.01, "n_robots": 0}, "robots.n_robots to be a whole number >= 1, got 0"),
        ("warehouse_small", {"densty": 0.05}, "Unknown scenario field 'densty'"),
    ],
)
def test_nonsense_is_refused(name, fields, message):
    with pytest.raises(ConfigError, match=message):
        scenario(name, **fields)
