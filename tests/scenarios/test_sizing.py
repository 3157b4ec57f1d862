"""Arenas of constant density: their sizes by hand, their nests, their objects, and what is refused."""

import pytest

from swarm_forage_env.scenarios.floor import source_boxes
from swarm_forage_env.scenarios.overrides import robots_at_density
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
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


@pytest.mark.parametrize("name", SCENARIO_NAMES)
@pytest.mark.parametrize("n_robots", [50, 333, 800])
def test_sources_and_static_caches_fit_in_every_size(name, n_robots):
    config = scenario(name, n_robots=n_robots, density=0.05, caches="static")
    strips = source_boxes(config.objects.placement, *config.arena.n_cells)
    assert all(low_x < high_x and low_y < high_y for low_x, low_y, high_x, high_y in strips)
    centres = static_cache_centres(config)  # raises where squares overlap
    assert len(centres) == len(static_cache_centres(scenario(name)))
