"""The limit of the warehouses: what a swarm that sees everything could deliver, by hand, and no run exceeds it."""

import pytest

from metrics import CurveError, limit_of
from metrics.scoring.limits import share_of_limit
from swarm_forage_env import World, parse_wrapper, plan_run, run_one, scenario

PER_1000_S = {"warehouse_small": 125, "warehouse_medium": 1384, "warehouse_dual": 324, "warehouse_quad": 948}


@pytest.mark.parametrize("name", PER_1000_S)
def test_the_limits_of_the_warehouses(name):
    assert round(limit_of(name).deliveries / 10.0) == PER_1000_S[name]


def with_objects_at(*x_m: float, n_robots: int):
    """A warehouse whose objects appear in a cell each, to the right of its nest, which ends at 4.8 m."""
    places = tuple((x, 8.1) for x in x_m)
    return scenario(
        "warehouse_small", n_robots=n_robots, n_objects=len(x_m), placement="positions", object_positions_m=places
    )


def test_a_gap_ends_where_cell_and_nest_begin():
    # One cell, its near edge 2.8 m from the nest: a trip takes 2 * 2.8 / 0.1 + 0.4 s, and E[d] / v is 28 s.
    limit = limit_of(with_objects_at(7.7, n_robots=1))
    assert limit.deliveries == pytest.approx((10_000.0 + 28.0) / 56.4)
    assert limit.first_pickups == pytest.approx(limit.deliveries + 1)


def test_near_objects_are_fetched_and_far_ones_left():
    # Gaps of 2.8 and 12.8 m, trips of 56.4 s and 256.4 s, half of the placements each; E[d] / v is 78 s. The share u
    # solves 2 (0.5 * 56.4 + (u - 0.5) 256.4) = 2 * 10,078 (1 - u), of D + 2 = 2 / (1 - u) placements.
    share = (20_156 + 200.0) / (20_156 + 2 * 256.4)
    limit = limit_of(with_objects_at(7.7, 17.7, n_robots=2))
    assert limit.deliveries == pytest.approx(2 * share / (1 - share))


def test_objects_that_fill_the_far_places_leave_the_near_ones():
    # One of both objects lies for ever on the far place: all trips go to the near half.
    assert limit_of(with_objects_at(7.7, 17.7, n_robots=1)).deliveries == pytest.approx(10_078 / 56.4)


def test_places_in_a_nest_are_none_and_the_nearest_nest_counts():
    world = scenario("warehouse_small", further_nests=((24.0, 4.0, 25.0, 12.0),))
    assert limit_of(world).deliveries > 2.0 * limit_of("warehouse_small").deliveries


@pytest.mark.parametrize(("name", "policy"), [("warehouse_small", "oracle"), ("warehouse_quad", "dpo")])
def test_no_run_exceeds_the_limit(name, policy):
    world = scenario(name, n_robots=8, n_objects=120, horizon_s=600.0, interval_s=200.0)
    spec = plan_run(world, policy, seed=5)
    assert 0.0 < share_of_limit(spec.world, float(run_one(spec)["collected"].sum())) <= 1.0


def test_where_objects_fill_the_source_no_run_exceeds_the_limit_either():
    world = scenario("warehouse_small", n_robots=8, n_objects=800, horizon_s=800.0)
    spec = plan_run(world, "oracle", seed=5)
    assert 0.6 < share_of_limit(spec.world, float(run_one(spec)["collected"].sum())) <= 1.0


def test_first_pickups_are_held_against_all_objects_that_appear():
    world = World(scenario("warehouse_small", performance="first_picked"))
    assert share_of_limit(world, limit_of(world).first_pickups) == pytest.approx(1.0)


@pytest.mark.parametrize(
    ("world", "why"),
    [
        (scenario("search_and_rescue", walk_probability=0.0), "placement .power_law."),
        (scenario("warehouse_small", walk_probability=0.1), "objects that move"),
        (scenario("warehouse_small", caches="static"), "static caches"),
        (World(scenario("warehouse_small"), (parse_wrapper("sensor_noise:sigma=0.1"),)), "sensor_noise"),
    ],
)
def test_worlds_without_an_estimate_say_why(world, why):
    with pytest.raises(CurveError, match=why):
        limit_of(world)
    assert share_of_limit(world if isinstance(world, World) else World(world), 100.0) is None


def test_other_performances_have_no_limit():
    assert share_of_limit(World(scenario("warehouse_small", performance="n_carrying")), 100.0) is None
