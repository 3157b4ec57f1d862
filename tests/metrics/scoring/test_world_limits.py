"""The limit of a world: its value in the presets, no run beyond it, and worlds in which there is no estimate."""

import pytest

from metrics import CurveError, limit_of
from metrics.scoring.world_limits import share_of_limit
from swarm_forage_env import World, parse_wrapper, plan_run, run_one, scenario
from swarm_forage_env.scenarios.robots import RobotKind

PER_1000_S = {"warehouse_small": 125, "warehouse_medium": 1384, "warehouse_dual": 324, "warehouse_quad": 948}


@pytest.mark.parametrize("name", PER_1000_S)
def test_the_limits_of_the_warehouses(name):
    assert round(limit_of(name).deliveries / 10.0) == PER_1000_S[name]


def test_a_gap_ends_where_cell_and_nest_begin():
    # One cell, its near edge 2.8 m from the nest that ends at 4.8 m: a trip takes 2 * 2.8 / 0.1 + 0.4 s.
    world = scenario(
        "warehouse_small", n_robots=1, n_objects=1, placement="positions", object_positions_m=((7.7, 8.1),)
    )
    assert limit_of(world).deliveries == pytest.approx((10_000.0 + 28.0) / 56.4)


def test_places_in_a_nest_are_none_and_the_nearest_nest_counts():
    world = scenario("warehouse_small", further_nests=((24.0, 4.0, 25.0, 12.0),))
    assert limit_of(world).deliveries > 2.0 * limit_of("warehouse_small").deliveries


@pytest.mark.parametrize("policy", ["crw", "dpo", "oracle"])
@pytest.mark.parametrize("name", PER_1000_S)
def test_no_run_exceeds_the_limit(name, policy):
    world = scenario(name, n_robots=8, n_objects=120, horizon_s=600.0, interval_s=200.0)
    spec = plan_run(world, policy, seed=5)
    assert 0.0 <= share_of_limit(spec.world, float(run_one(spec).collected.sum())) <= 1.0


def test_where_objects_fill_the_source_no_run_exceeds_the_limit_either():
    world = scenario("warehouse_small", n_robots=8, n_objects=800, horizon_s=2000.0)
    spec = plan_run(world, "oracle", seed=5)
    assert 0.6 < share_of_limit(spec.world, float(run_one(spec).collected.sum())) <= 1.0


def test_first_pickups_are_held_against_all_objects_that_appear():
    world = World(scenario("warehouse_small", performance="first_picked"))
    assert share_of_limit(world, limit_of(world).first_pickups) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("world", "why"),
    [
        (scenario("search_and_rescue", walk_probability=0.0), "power-law clusters"),
        (scenario("warehouse_small", walk_probability=0.1), "objects that move"),
        (scenario("warehouse_small", caches="static"), "static caches"),
        (scenario("warehouse_small", robot_kinds=(RobotKind(name="slow", speed=0.5),)), "unequal speed"),
        (World(scenario("warehouse_small"), (parse_wrapper("sensor_noise:sigma=0.1"),)), "sensor_noise"),
    ],
)
def test_worlds_without_an_estimate_say_why(world, why):
    with pytest.raises(CurveError, match=why):
        limit_of(world)
    assert share_of_limit(world if isinstance(world, World) else World(world), 100.0) is None


def test_other_performances_have_no_limit():
    assert share_of_limit(World(scenario("warehouse_small", performance="n_carrying")), 100.0) is None
