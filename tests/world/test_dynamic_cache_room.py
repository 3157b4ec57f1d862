"""Dynamic caches fit into every arena that a configuration accepts."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.scenarios.floor import square_box
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.caches import clear_centre, n_cache_slots

NARROW = {"width_m": 32.0, "nest_size_m": (3.2, 3.2), "start_margin_m": 0.5, "n_objects": 9}


@pytest.mark.parametrize(("height_m", "fitting_share"), [(9.4, 0.193), (8.0, 0.162), (6.0, 0.125)])
def test_arenas_too_narrow_for_dynamic_caches_are_refused_with_a_side_that_fits(height_m, fitting_share):
    arena = {**NARROW, "height_m": height_m, "nest_centre_m": (3.2, height_m / 2), "caches": "dynamic"}
    with pytest.raises(ConfigError, match=f"lower side_share to {fitting_share}, or"):
        scenario("warehouse_small", **arena)
    assert scenario("warehouse_small", **arena, side_share=fitting_share).cache_side_cells > 1
    assert scenario("warehouse_small", **{**arena, "caches": "none"}).arena.height_m == height_m


@settings(max_examples=200, deadline=None)
@given(
    nx=st.integers(10, 200),
    ny=st.integers(10, 200),
    share=st.floats(0.02, 0.5),
    at=st.tuples(st.integers(0, 200), st.integers(0, 200)),
)
def test_squares_of_dynamic_caches_are_inside_every_arena_that_is_accepted(nx, ny, share, at):
    size = {"width_m": nx / 5, "height_m": ny / 5, "nest_centre_m": (0.5, 0.5), "nest_size_m": (0.2, 0.2)}
    few = {"n_robots": 1, "n_objects": 1, "start_margin_m": 0.5, "placement": "random"}
    try:
        config = scenario("warehouse_small", **size, **few, side_share=share, caches="dynamic")
    except ConfigError as error:
        assert "cache" in str(error)  # noqa: PT017 - only some are refused
        return
    centre = clear_centre(at, config, [], np.random.default_rng(0))
    assert centre is not None
    x_low, y_low, x_high, y_high = square_box(centre, config.cache_side_cells)
    assert 0 <= x_low < x_high <= nx
    assert 0 <= y_low < y_high <= ny
    area = config.arena.distributable_cells
    assert area[0] <= centre[0] < area[2]
    assert area[1] <= centre[1] < area[3]
    assert n_cache_slots(config) >= 1
