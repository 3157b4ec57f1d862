"""Interference and performance lost, by hand."""

import numpy as np
import pytest

from metrics import CurveError, cache_congestion, fractional_loss, performance_lost, t_lost_fraction

CROWDING = {1: (1.0, 0.1), 2: (1.8, 0.2), 4: (3.2, 0.3)}
"""Swarm size -> performance and interference fraction in one interval."""


def lost(n, **options):
    perf, fraction = CROWDING[n]
    return performance_lost([perf], [fraction], n, [1.0], [0.1], **options)


def test_fraction_of_robots_that_interfere():
    assert t_lost_fraction([0.0, 1.0, 4.0], 4) == pytest.approx([0.0, 0.25, 1.0], abs=1e-15)
    assert t_lost_fraction(np.ones((3, 2)), 2).shape == (3, 2)


def test_independent_robots_lose_nothing():
    for n in (2, 4, 50):
        value = performance_lost([n, n], [0.1, 0.1], n, [1, 1], [0.1, 0.1])
        assert value == pytest.approx([0.0, 0.0], abs=1e-12)
    assert performance_lost([1, 1], [0.1, 0.1], 1, [1, 1], [0.1, 0.1]) == pytest.approx([0.1, 0.1], abs=1e-12)


@pytest.mark.parametrize(("n", "expected"), [(1, 0.1), (2, 0.16), (4, 0.56)])
def test_crowding_swarm(n, expected):
    assert lost(n) == pytest.approx([expected], abs=1e-9)


def test_fractional_loss_is_loss_over_performance():
    assert fractional_loss([1.8], [0.2], 2, [1.0], [0.1]) == pytest.approx([0.16 / 1.8], abs=1e-12)


def test_no_performance():
    assert performance_lost([0.0], [0.5], 2, [1.0], [0.1]) == pytest.approx([-0.2], abs=1e-12)
    assert fractional_loss([0.0], [0.5], 2, [1.0], [0.1]) == [-np.inf]


FLOOR = {"floor": 100.0 * np.pi, "reach": 2.0}
"""A disc of four times pi is 4 % of the floor."""


@pytest.mark.parametrize(
    ("near", "lost_in_all", "n_caches", "expected"),
    [
        ([40.0], [100.0], [1.0], 0.36),
        ([4.0], [100.0], [1.0], 0.0),
        ([0.0], [100.0], [2.0], -0.08),
        ([40.0, 0.0], [100.0, 100.0], [1.0, 0.0], 0.18),  # 4 and 0 of 200 are expected
        ([4.0, 24.0], [100.0, 300.0], [1.0, 2.0], 0.0),  # 4 and 24 are expected: later, more robots and more caches
        ([100.0], [100.0], [50.0], 0.0),  # caches everywhere
        ([0.0], [0.0], [1.0], np.nan),  # no interference
        ([0.0], [100.0], [0.0], np.nan),  # no cache
    ],
)
def test_congestion_near_caches_is_what_their_share_of_the_floor_leaves(near, lost_in_all, n_caches, expected):
    assert cache_congestion(near, lost_in_all, n_caches, **FLOOR) == pytest.approx(expected, abs=1e-12, nan_ok=True)


def test_interference_spread_evenly_is_no_congestion():
    rng = np.random.default_rng(1)
    places, cache = rng.uniform(0.0, 20.0, (200_000, 2)), np.array([6.0, 9.0])
    near = (np.hypot(*(places - cache).T) <= 2.0).sum()
    assert cache_congestion([near], [len(places)], [1.0], floor=400.0, reach=2.0) == pytest.approx(0.0, abs=2e-3)


def test_congestion_refuses_what_cannot_be():
    with pytest.raises(CurveError, match="lost_near <= lost"):
        cache_congestion([2.0], [1.0], [1.0], **FLOOR)
    for word in FLOOR:
        with pytest.raises(CurveError, match=f"positive {word}"):
            cache_congestion([1.0], [1.0], [1.0], **{**FLOOR, word: 0.0})
