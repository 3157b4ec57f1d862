"""Interference and performance lost, by hand."""

import numpy as np
import pytest

from metrics import fractional_loss, performance_lost, t_lost_fraction

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
