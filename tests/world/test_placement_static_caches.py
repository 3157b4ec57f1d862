"""Where static caches stand."""

import itertools

import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.floor import overlap_cells
from swarm_forage_env.scenarios.presets import SEARCH_AND_RESCUE_OBJECTS, scenario
from swarm_forage_env.world.placement import static_cache_centres

CACHE_SIDES = {16: 15, 32: 31, 48: 47, 64: 63, 80: 79, 96: 95, 112: 111, 128: 127}
"""Side of the arena in metres: side of a cache in cells."""


def metres(centres):
    return [pytest.approx(((2 * x + 1) / 10, (2 * y + 1) / 10)) for x, y in centres]


def test_single_source_has_one_half_way_between_nest_and_strip():
    assert metres(static_cache_centres(scenario("warehouse_small"))) == [(14.5, 8.1)]


def test_random_placement_has_four_at_the_quarters():
    centres = static_cache_centres(scenario("warehouse_medium"))
    assert metres(centres) == [(12.1, 24.1), (36.1, 24.1), (24.1, 12.1), (24.1, 36.1)]


@pytest.mark.parametrize("side", SEARCH_AND_RESCUE_OBJECTS)
def test_search_and_rescue_has_four_at_the_quarters(side):
    config = scenario("search_and_rescue", side_m=side)
    quarter = side / 4
    assert [
        (quarter + 0.1, 2 * quarter + 0.1),
        (3 * quarter + 0.1, 2 * quarter + 0.1),
        (2 * quarter + 0.1, quarter + 0.1),
        (2 * quarter + 0.1, 3 * quarter + 0.1),
    ] == metres(static_cache_centres(config))
    assert config.cache_side_cells == CACHE_SIDES[side]


def test_dual_source_has_one_on_either_side_of_the_nest():
    config = scenario("warehouse_dual")  # half way from 16.0 to 25.6 m and to 6.4 m, on the centre of a cell
    assert metres(static_cache_centres(config)) == [(20.9, 8.1), (11.3, 8.1)]


def test_quad_source_stands_clear_of_the_nest():
    config = scenario("warehouse_quad")
    west, east, south, north = static_cache_centres(config)
    assert (west, south) == ((72, 120), (120, 72))  # 0.30 X
    # 0.675 X = cell 162 would reach 4 cells into the nest (cells 96 .. 143) with a half side of 23.
    assert (east, north) == ((167, 120), (120, 167))


@pytest.mark.parametrize(
    "config",
    [
        scenario("warehouse_small"),
        scenario("warehouse_medium"),
        scenario("warehouse_quad"),
        scenario("warehouse_dual"),
        *(scenario("search_and_rescue", side_m=side) for side in SEARCH_AND_RESCUE_OBJECTS),
    ],
    ids=lambda config: f"{config.objects.placement}-{config.arena.width_m:g}",
)
def test_squares_share_no_cell_with_nest_or_each_other(config):
    half = config.cache_side_cells // 2
    squares = [(x - half, y - half, x + half + 1, y + half + 1) for x, y in static_cache_centres(config)]
    for a, b in itertools.combinations([*squares, config.arena.nest_cells], 2):
        assert overlap_cells(a, b) == 0
    nx, ny = config.arena.n_cells
    assert all(overlap_cells(square, (0, 0, nx, ny)) == config.cache_side_cells**2 for square in squares)


@pytest.mark.parametrize(
    ("overrides", "way_out"),
    [({"nest_centre_m": (12.0, 24.0)}, "move nest"), ({"side_share": 0.5}, "lower side_share, move nest")],
    ids=["on the nest", "over each other"],
)
def test_squares_that_cannot_be_told_apart_are_refused(overrides, way_out):
    config = scenario("warehouse_medium", **overrides)
    with pytest.raises(
        ConfigError, match=rf"clear of nest, obstacles and each other, got a square of .* m; {way_out} or obstacles"
    ):
        static_cache_centres(config)


def test_squares_outside_the_arena_are_refused():
    config = scenario("warehouse_medium", width_m=16.0, nest_centre_m=(8.0, 24.0), nest_size_m=(2.0, 2.0), n_robots=5)
    with pytest.raises(ConfigError, match="Expected static caches inside the arena"):
        static_cache_centres(config)


def test_a_centre_where_no_object_may_lie_is_refused():
    """The last object of a cache stays on its centre; here the eastern one has to stand beyond a nest in the east."""
    small = {
        "width_m": 11.2,
        "height_m": 13.0,
        "side_share": 0.03,
        "start_margin_m": 0.5,
        "n_robots": 2,
        "n_objects": 9,
    }
    config = scenario("warehouse_quad", nest_centre_m=(9.2, 4.6), nest_size_m=(1.2, 4.4), **small)
    with pytest.raises(ConfigError, match=r"centres between 15 % and 85 % .* got one at \(9\.9, 6\.5\) m"):
        static_cache_centres(config)
