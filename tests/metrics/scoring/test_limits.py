"""The estimate of the limit: worked examples, its value in the presets, no run beyond it, and what has no estimate."""

import numpy as np
import pytest

from metrics import CurveError, foraging_limit, limit_of
from metrics.scoring.limits import share_of_limit
from swarm_forage_env import World, parse_wrapper, plan_run, run_one, scenario

TWO_ROBOTS = {"n_robots": 2, "n_objects": 1, "horizon_s": 990.0, "speed_mps": 0.1, "handling_s": 1.0}
PER_1000_S = {"warehouse_small": 125, "warehouse_medium": 1384, "warehouse_dual": 324, "warehouse_quad": 948}


def test_one_gap_makes_all_trips_equal():
    # A trip takes 2 * 10 / 0.1 + 1 = 201 s; each robot has 990 s and the 100 s of the way out that it may save.
    found = foraging_limit([10.0], **TWO_ROBOTS)
    assert found.deliveries == pytest.approx(2 * 1090.0 / 201.0)
    assert found.first_pickups == pytest.approx(found.deliveries + 1)
    assert found.nearest_share == pytest.approx(found.deliveries / (found.deliveries + 1))


def test_near_objects_are_fetched_and_far_ones_left():
    # Trips of 21 s and 181 s, half of the placements each; E[d] / v = 50 s. With 20 objects the share u solves
    # 20 (0.5 * 21 + (u - 0.5) 181) = 1040 (1 - u): u = 2640 / 4660, of D + 20 = 20 / (1 - u) placements.
    found = foraging_limit([9.0, 1.0], **TWO_ROBOTS | {"n_robots": 1, "n_objects": 20})
    assert found.nearest_share == pytest.approx(2640 / 4660)
    assert found.deliveries == pytest.approx(20 * 2640 / 2020)


def test_the_equation_holds_for_any_distribution():
    rng = np.random.default_rng(5)
    gaps, weights = rng.gamma(2.0, 4.0, 300), rng.random(300)
    world = {"n_robots": 40, "n_objects": 150, "horizon_s": 3000.0, "speed_mps": 0.1, "handling_s": 0.4}
    found = foraging_limit(gaps, weights=weights, **world)
    order = np.argsort(gaps)
    share, placed = weights[order] / weights.sum(), found.deliveries + 150
    fetched = np.clip(found.deliveries / placed - np.concatenate(([0.0], np.cumsum(share)[:-1])), 0.0, share)
    spent = placed * fetched @ (2.0 * gaps[order] / 0.1 + 0.4)
    assert spent == pytest.approx(40 * (3000.0 + share @ gaps[order] / 0.1))


def test_objects_that_fill_the_far_places_leave_the_near_ones():
    # 3 of 4 objects lie for ever on 3 of the 4 places: all trips go to the nearest quarter, of 21 s each.
    world = TWO_ROBOTS | {"n_robots": 1, "n_objects": 4}
    found = foraging_limit([1.0, 9.0, 9.0, 9.0], **world, n_places=4)
    assert found.nearest_share == pytest.approx(0.25)
    assert found.deliveries == pytest.approx((990.0 + 70.0) / 21.0)
    assert found.deliveries > foraging_limit([1.0, 9.0, 9.0, 9.0], **world).deliveries


@pytest.mark.parametrize(
    ("gaps", "changes", "match"),
    [
        ([], {}, "finite gaps"),
        ([1.0, np.nan], {}, "finite gaps"),
        ([1.0], {"weights": [1.0, 2.0]}, "finite gaps"),
        ([-1.0], {}, "0 or more"),
        ([1.0], {"weights": [0.0]}, "0 or more"),
        ([1.0], {"speed_mps": 0.0}, "speed_mps > 0"),
        ([1.0], {"n_robots": 0}, "n_robots >= 1"),
        ([1.0], {"n_objects": 0}, "1 object or more"),
        ([1.0], {"n_places": 0.5}, "a place for each"),
    ],
)
def test_what_is_no_world_is_refused(gaps, changes, match):
    with pytest.raises(CurveError, match=match):
        foraging_limit(gaps, **TWO_ROBOTS | changes)


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
        (World(scenario("warehouse_small"), (parse_wrapper("sensor_noise:sigma=0.1"),)), "sensor_noise"),
    ],
)
def test_worlds_without_an_estimate_say_why(world, why):
    with pytest.raises(CurveError, match=why):
        limit_of(world)
    assert share_of_limit(world if isinstance(world, World) else World(world), 100.0) is None


def test_other_performances_have_no_limit():
    assert share_of_limit(World(scenario("warehouse_small", performance="n_carrying")), 100.0) is None
