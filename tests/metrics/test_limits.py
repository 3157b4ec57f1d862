"""The estimate of the limit: worked examples, and what it says where the answer is known otherwise."""

import numpy as np
import pytest

from metrics import CurveError, foraging_limit

TWO_ROBOTS = {"n_robots": 2, "n_objects": 1, "horizon_s": 990.0, "speed_mps": 0.1, "handling_s": 1.0}


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
