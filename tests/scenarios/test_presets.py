"""The presets against the paper's tables."""

import math

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.overrides import robots_at_density, with_overrides
from swarm_forage_env.scenarios.presets import (
    DENSITY,
    SCENARIO_NAMES,
    SEARCH_AND_RESCUE_OBJECTS,
    scenario,
    search_and_rescue,
    warehouse_dual,
    warehouse_medium,
    warehouse_quad,
    warehouse_small,
)
from swarm_forage_env.scenarios.quirks import Quirks

OF_THE_STUDY = ("warehouse_small", "warehouse_medium", "warehouse_dual", "warehouse_quad", "search_and_rescue")
SIDES = (16, 32, 48, 64, 80, 96, 112, 128)
ROBOTS = (12, 51, 115, 204, 320, 460, 627, 819)
OBJECTS = (80, 272, 368, 448, 544, 1248, 1408, 1568)
CACHE_SIDES_M = (3.0, 6.2, 9.4, 12.6, 15.8, 19.0, 22.2, 25.4)


@pytest.mark.parametrize("name", SCENARIO_NAMES)
def test_a_preset_has_the_name_that_it_is_found_by(name):
    assert scenario(name).name == name


@pytest.mark.parametrize("name", OF_THE_STUDY)
def test_settings_common_to_all_presets_of_the_study(name):
    config = scenario(name)
    assert (config.horizon_ticks, config.interval_ticks) == (50_000, 1_000)
    assert config.caches == "none"
    assert config.quirks == Quirks()
    assert (config.cache.static_size, config.cache.respawn_scale) == (2, 0.05)
    assert config.robots.start_margin_m == 2.8
    assert config.robots.max_speed_mps == 0.10


def test_small_warehouse():
    config = warehouse_small()
    assert (config.arena.width_m, config.arena.height_m) == (32.0, 16.0)
    assert config.arena.n_cells == (160, 80)
    assert config.arena.nest_box_m == (1.6, 1.6, 4.8, 14.4)
    assert config.arena.interior_m == pytest.approx((0.2, 0.2, 31.6, 15.8))
    assert (config.robots.n_robots, config.objects.n_objects) == (50, 200)
    assert (config.objects.placement, config.objects.walk_probability) == ("single_source", 0.0)
    assert (config.reward.delivery, config.reward.first_pickup) == (1.0, 0.1)
    assert config.performance == "collected"
    assert config.cache_side_cells == 31
    assert config.min_dist_m == pytest.approx(3.2)
    assert config.cache_proximity_m == pytest.approx(12.8)


def test_small_warehouse_has_three_lights_along_its_nest():
    lights = warehouse_small().arena.lights_m
    assert [light[:2] for light in lights] == [pytest.approx((3.2, y)) for y in (4.8, 8.0, 11.2)]
    assert {round(light[2], 3) for light in lights} == {4.757}
    assert warehouse_small().arena.light_intensity == pytest.approx(22.627, abs=1e-3)


def test_lights_follow_the_longer_side_of_the_nest():
    arena = warehouse_small(nest_size_m=(6.0, 2.0), nest_centre_m=(6.0, 8.0)).arena
    assert [light[:2] for light in arena.lights_m] == [pytest.approx((x, 8.0)) for x in (4.5, 6.0, 7.5)]


def test_medium_warehouse():
    config = warehouse_medium()
    assert (config.arena.width_m, config.arena.height_m) == (48.0, 48.0)
    assert config.arena.nest_box_m == (19.2, 19.2, 28.8, 28.8)
    assert config.arena.lights_m == (pytest.approx((24.0, 24.0, math.sqrt(48.0))),)
    assert config.arena.light_intensity == pytest.approx(48.0)
    assert (config.robots.n_robots, config.objects.n_objects) == (200, 800)
    assert (config.objects.placement, config.objects.walk_probability) == ("random", 0.0)
    assert (config.reward.delivery, config.reward.first_pickup) == (1.0, 0.1)
    assert config.performance == "collected"
    assert config.min_dist_m == pytest.approx(9.6)
    assert config.cache_proximity_m == pytest.approx(19.2)


def test_dual_source_is_the_small_warehouse_with_the_nest_between_two_sources():
    config, small = warehouse_dual(), warehouse_small()
    assert config.arena.nest_box_m == (14.4, 1.6, 17.6, 14.4)  # 16 -+ 1.6 m, 8 -+ 6.4 m
    assert config.objects.placement == "dual_source"
    lights = config.arena.lights_m
    assert [light[:2] for light in lights] == [pytest.approx((16.0, y)) for y in (4.8, 8.0, 11.2)]
    same = {"nest_centre_m": small.arena.nest_centre_m, "placement": "single_source", "name": "warehouse_small"}
    assert with_overrides(config, **same) == small


def test_quad_source_is_the_medium_warehouse_with_other_places():
    config, medium = warehouse_quad(), warehouse_medium()
    assert config.arena.nest_box_m == (19.2, 19.2, 28.8, 28.8)
    assert config.arena.lights_m == (pytest.approx((24.0, 24.0, math.sqrt(48.0))),)
    assert with_overrides(config, placement="random", name="warehouse_medium") == medium


@pytest.mark.parametrize("n_objects", [200, 512])
def test_small_warehouse_holds_the_objects_of_every_set(n_objects):
    assert warehouse_small(n_objects=n_objects).objects.n_objects == n_objects


@pytest.mark.parametrize("n_robots", [1, 512])
def test_medium_warehouse_holds_the_swarms_and_objects_of_the_size_sweep(n_robots):
    assert warehouse_medium(n_robots=n_robots, n_objects=2048).robots.n_robots == n_robots


def test_search_and_rescue_defaults():
    config = search_and_rescue()
    assert (config.arena.width_m, config.arena.height_m) == (48.0, 48.0)
    assert (config.robots.n_robots, config.objects.n_objects) == (115, 368)
    assert (config.objects.placement, config.objects.walk_probability) == ("power_law", 0.001)
    assert (config.reward.delivery, config.reward.first_pickup) == (0.0, 1.0)
    assert config.performance == "first_picked"


@pytest.mark.parametrize(
    ("side", "n_robots", "n_objects", "cache_side_m"), list(zip(SIDES, ROBOTS, OBJECTS, CACHE_SIDES_M, strict=True))
)
def test_search_and_rescue_series(side, n_robots, n_objects, cache_side_m):
    config = search_and_rescue(side_m=side)
    assert (config.arena.width_m, config.arena.height_m) == (side, side)
    assert config.robots.n_robots == robots_at_density(side * side, DENSITY) == n_robots
    assert config.objects.n_objects == SEARCH_AND_RESCUE_OBJECTS[side] == n_objects
    assert config.arena.nest_centre_m == (side / 2, side / 2)
    assert config.arena.nest_size_m == pytest.approx((side / 5, side / 5))
    assert config.cache_side_cells * 0.2 == pytest.approx(cache_side_m)
    assert config.cache_side_nominal_m == pytest.approx(0.2 * side)
    assert config.cache_proximity_m == pytest.approx(0.4 * side)


@pytest.mark.parametrize(("n_robots", "side"), [(1, 16), (12, 16), (13, 32), (115, 48), (116, 64), (819, 128)])
def test_robots_pick_the_smallest_side_that_holds_them(n_robots, side):
    config = scenario("search_and_rescue", n_robots=n_robots)
    assert (config.robots.n_robots, config.arena.width_m) == (n_robots, side)


def test_unknown_scenario_names_the_nearest():
    with pytest.raises(ConfigError, match=r"Unknown scenario 'warehouse_smal'\. Did you mean 'warehouse_small'\?"):
        scenario("warehouse_smal")
