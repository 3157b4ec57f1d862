"""The presets against the paper's tables, and arenas of constant density by hand."""

import math

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.floor import source_boxes
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, chosen_scenario, scenario
from swarm_forage_env.scenarios.quirks import Quirks
from swarm_forage_env.world.placement import static_cache_centres

WAREHOUSES = ("warehouse_small", "warehouse_medium", "warehouse_dual", "warehouse_quad")
SIDES = (16, 32, 48, 64, 80, 96, 112, 128)
ROBOTS = (12, 51, 115, 204, 320, 460, 627, 819)
OBJECTS = (80, 272, 368, 448, 544, 1248, 1408, 1568)
CACHE_SIDES_M = (3.0, 6.2, 9.4, 12.6, 15.8, 19.0, 22.2, 25.4)


@pytest.mark.parametrize("name", [*WAREHOUSES, "search_and_rescue"])
def test_settings_common_to_all_presets_of_the_study(name):
    config = scenario(name)
    assert (config.name, config.caches, config.quirks) == (name, "none", Quirks())
    assert (config.horizon_ticks, config.interval_ticks) == (50_000, 1_000)
    assert (config.cache.static_size, config.cache.respawn_scale) == (2, 0.05)
    assert (config.robots.start_margin_m, config.robots.max_speed_mps) == (2.8, 0.10)
    is_rescue = name == "search_and_rescue"
    assert (config.reward.delivery, config.reward.first_pickup) == ((0.0, 1.0) if is_rescue else (1.0, 0.1))
    assert config.performance == ("first_picked" if is_rescue else "collected")
    assert config.objects.walk_probability == (0.001 if is_rescue else 0.0)


@pytest.mark.parametrize(
    ("name", "nest_m", "placement", "sizes", "distances_m"),
    [
        ("warehouse_small", (1.6, 1.6, 4.8, 14.4), "single_source", (50, 200), (3.2, 12.8)),
        ("warehouse_dual", (14.4, 1.6, 17.6, 14.4), "dual_source", (50, 200), (3.2, 12.8)),
        ("warehouse_medium", (19.2, 19.2, 28.8, 28.8), "random", (200, 800), (9.6, 19.2)),
        ("warehouse_quad", (19.2, 19.2, 28.8, 28.8), "quad_source", (200, 800), (9.6, 19.2)),
    ],
)
def test_warehouses(name, nest_m, placement, sizes, distances_m):
    config = scenario(name)
    is_small = placement in ("single_source", "dual_source")
    assert (config.arena.width_m, config.arena.height_m) == ((32.0, 16.0) if is_small else (48.0, 48.0))
    assert config.arena.nest_box_m == nest_m
    assert (config.robots.n_robots, config.objects.n_objects) == sizes
    assert config.objects.placement == placement
    assert (config.min_dist_m, config.cache_proximity_m) == pytest.approx(distances_m)
    middle_x = (nest_m[0] + nest_m[2]) / 2
    lights = [(middle_x, y) for y in (4.8, 8.0, 11.2)] if is_small else [(24.0, 24.0)]
    height, intensity = (4.757, 22.627) if is_small else (math.sqrt(48.0), 48.0)
    assert config.arena.lights_m == tuple(pytest.approx((*place, height), abs=1e-3) for place in lights)
    assert config.arena.light_intensity == pytest.approx(intensity, abs=1e-3)


def test_the_small_warehouse_by_hand():
    config = scenario("warehouse_small")
    assert config.arena.n_cells == (160, 80)
    assert config.arena.interior_m == pytest.approx((0.2, 0.2, 31.6, 15.8))
    assert config.cache_side_cells == 31
    wide = with_overrides(config, nest_size_m=(6.0, 2.0), nest_centre_m=(6.0, 8.0)).arena
    assert [light[:2] for light in wide.lights_m] == [pytest.approx((x, 8.0)) for x in (4.5, 6.0, 7.5)]


@pytest.mark.parametrize(
    ("side", "n_robots", "n_objects", "cache_side_m"), list(zip(SIDES, ROBOTS, OBJECTS, CACHE_SIDES_M, strict=True))
)
def test_search_and_rescue_series(side, n_robots, n_objects, cache_side_m):
    config = scenario("search_and_rescue", side_m=side)
    assert (config.arena.width_m, config.arena.height_m) == (side, side)
    assert (config.robots.n_robots, config.objects.n_objects) == (n_robots, n_objects)
    assert config.arena.nest_box_m == pytest.approx((0.4 * side, 0.4 * side, 0.6 * side, 0.6 * side))
    assert config.cache_side_cells * 0.2 == pytest.approx(cache_side_m)
    assert config.cache_proximity_m == pytest.approx(0.4 * side)
    assert scenario("search_and_rescue", n_robots=n_robots).arena.width_m == side, "the smallest that holds them"
    if side < 128:
        assert scenario("search_and_rescue", n_robots=n_robots + 1).arena.width_m == side + 16


def test_what_is_no_scenario_is_refused():
    assert scenario("search_and_rescue").arena.width_m == 48.0
    for words, given, fields in (
        (r"Unknown scenario 'warehouse_smal'\. Did you mean 'warehouse_small'\?", "warehouse_smal", {}),
        ("side_m with search_and_rescue only", "classroom", {"side_m": 16}),
        ("for another side give n_objects too", "search_and_rescue", {"side_m": 20}),
        ("at most 819 robots in search_and_rescue", "search_and_rescue", {"n_robots": 820}),
        ("n_robots to be a whole number", "search_and_rescue", {"n_robots": "x"}),
        ("density .* > 0", "warehouse_small", {"density": 0}),
        ("either density, which chooses the arena, or width_m", "classroom", {"density": 0.1, "width_m": 9.0}),
    ):  # fmt: skip
        with pytest.raises(ConfigError, match=words):
            scenario(given, **fields)


# Density


@pytest.mark.parametrize(
    ("name", "n_robots", "density", "size", "n_objects"),
    [
        # 200 / 0.05 = 4,000 m^2 = 2 a^2 with a = 44.72 m, so 224 rows of 0.2 m and twice as many columns; objects stay
        # 200 on 512 m^2.
        ("warehouse_small", 200, 0.05, (89.6, 44.8), 1568),
        # 50 / 0.1 = 500 m^2 = 2 a^2 with a = 15.81 m: 80 rows make 16 m, 79 make 15.8 m and hold 49.9 robots.
        ("warehouse_small", 50, 0.1, (32.0, 16.0), 200),
        # 4,000 m^2 = a^2 with a = 63.25 m.
        ("warehouse_quad", 200, 0.05, (63.4, 63.4), 1396),
        # 1 robot per 25 m^2: 100 robots in exactly 50 x 50 m.
        ("warehouse_medium", 100, 0.04, (50.0, 50.0), 868),
        # Search and rescue keeps to its sides: 64 m hold 204 robots at 5 %, and 48 m hold 230 at 10 %.
        ("search_and_rescue", 200, 0.05, (64.0, 64.0), 448),
        ("search_and_rescue", 230, 0.10, (48.0, 48.0), 368),
        ("search_and_rescue", 231, 0.10, (64.0, 64.0), 448),
    ],
)
def test_the_arena_is_the_smallest_that_holds_the_swarm(name, n_robots, density, size, n_objects):
    config = scenario(name, n_robots=n_robots, density=density)
    assert (config.arena.width_m, config.arena.height_m) == size
    assert (config.robots.n_robots, config.objects.n_objects) == (n_robots, n_objects)
    assert chosen_scenario(scenario(name), {"n_robots": n_robots, "density": density}) == config
    assert scenario(name, n_robots=n_robots, density=density, n_objects=77).objects.n_objects == 77


@pytest.mark.parametrize("name", SCENARIO_NAMES)
@pytest.mark.parametrize("n_robots", [50, 800])
def test_proportions_sources_and_static_caches_fit_in_every_size(name, n_robots):
    base, config = scenario(name, caches="static"), scenario(name, n_robots=n_robots, density=0.05, caches="static")
    factor = config.arena.width_m / base.arena.width_m
    assert config.arena.height_m == pytest.approx(base.arena.height_m * factor)
    for edge, expected in zip(config.arena.nest_box_m, base.arena.nest_box_m, strict=True):
        assert abs(edge - expected * factor) <= 0.1 + 1e-9, "half a cell"
    if name != "search_and_rescue":
        area_m2, units = config.arena.width_m * config.arena.height_m, math.gcd(*config.arena.n_cells)
        assert area_m2 * (1 - 1 / units) ** 2 < n_robots / 0.05 <= area_m2 + 1e-9
    strips = source_boxes(config.objects.placement, *config.arena.n_cells)
    assert all(low_x < high_x and low_y < high_y for low_x, low_y, high_x, high_y in strips)
    assert len(static_cache_centres(config)) == len(static_cache_centres(base))  # raises where squares overlap
