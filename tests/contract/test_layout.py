"""Observation layout and constants of a swarm."""

import itertools

import numpy as np
import pytest

from swarm_forage_env.contract.layout import SERIAL_SCALE, observation_layout
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import CACHE_KINDS
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario

SIZES = {
    "proximity": 24,
    "light": 24,
    "ground": 4,
    "wheel_speed": 2,
    "position": 2,
    "heading": 2,
    "carrying": 1,
    "interacting": 1,
    "active": 1,
    "cargo": 1,
    "event_object": 1,
    "event": 1,
    "event_cache": 4,
    "los_cell": 2,
    "los_object": 25,
    "los_cache": 16,
}


@pytest.fixture(scope="module")
def layout():
    return observation_layout(32.0, 16.0, 200)


def test_slices_are_the_documented_ones_in_order(layout):
    assert {part.name: part.size for part in layout} == SIZES
    assert layout.names == tuple(SIZES)
    columns = np.concatenate([np.arange(layout.size)[layout[part.name]] for part in layout])
    np.testing.assert_array_equal(columns, np.arange(sum(SIZES.values())))


def test_scales_are_natural_units(layout):
    for part in layout:
        assert len(part.scale) == part.size
    assert layout.part("position").scale == (16.0, 8.0)
    assert layout.part("wheel_speed").scale == (0.20, 0.20)
    assert layout.part("cargo").scale == (200.0,)
    assert layout.part("event").scale == (16.0,)
    assert layout.part("event_cache").scale == (SERIAL_SCALE, 16.0, 8.0, 200.0)


def test_unknown_slice_lists_the_known_ones(layout):
    with pytest.raises(KeyError, match=r"'lidar'.*proximity, light"):
        layout["lidar"]


def test_serial_numbers_survive_float32():
    serials = np.array([1, 2, 12_345_678, 2**24 - 1])
    np.testing.assert_array_equal(np.float32(serials / SERIAL_SCALE).astype(np.float64) * SERIAL_SCALE, serials)


@pytest.mark.parametrize(("name", "caches"), [*zip(SCENARIO_NAMES, itertools.cycle(CACHE_KINDS), strict=False)])
def test_a_scenario_tells_what_its_environment_tells(name, caches):
    config = scenario(name, n_robots=3, n_objects=20, caches=caches)
    env = ForageEnv(config)
    assert SwarmSpec.of(config) == env.swarm_spec
    assert SwarmSpec.of(config).layout is env.layout
    assert SwarmSpec.of(config, horizon_s=7 * config.dt_s) == ForageEnv(config, max_cycles=7).swarm_spec


def test_sizes_by_hand():
    spec = SwarmSpec.of(scenario("warehouse_small", horizon_s=200.0))
    assert (spec.n_robots, spec.n_objects, spec.horizon_s, spec.caches) == (50, 200, 200.0, "none")
    assert (spec.arena_size_m, spec.cell_m, spec.wheel_scale_mps) == ((32.0, 16.0), 0.2, 0.2)
    assert spec.nest_centre_m == pytest.approx((3.2, 8.0))
    assert spec.nest_size_m == pytest.approx((3.2, 12.8))
    assert spec.cache_side_nominal_m == pytest.approx(6.4)
    assert spec.cache_side_m == pytest.approx(6.2)  # an odd number of cells of 0.2 m
    assert spec.cache_half_side_cells == 15
