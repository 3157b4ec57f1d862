"""The constants of a swarm come from its scenario alone, and environments give the same ones."""

import itertools

import pytest

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.config import CACHE_KINDS
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario


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
