"""Obstacle, nest, object and cache from readings: thresholds, and what they mean in the world."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.contract.detection import (
    BEAM_ANGLES_RAD,
    is_obstacle_vector,
    ring_is_empty,
    ring_sum,
    sees_cache,
    sees_nest,
    sees_object,
    sees_obstacle,
)
from tests.support.stage import cell_centre, lay, put, tidy_world

ring = npst.arrays(np.float32, 24, elements=st.floats(0, 1, width=32))


def vector_of(readings) -> complex:
    """Sum of the readings as polar vectors, in complex numbers."""
    return complex(sum(np.float64(readings) * np.exp(1j * BEAM_ANGLES_RAD)))


@given(readings=ring)
def test_ring_sum_adds_polar_vectors(readings):
    assert ring_sum(readings) == pytest.approx((vector_of(readings).real, vector_of(readings).imag), abs=1e-9)


def test_a_ring_is_empty_when_all_its_readings_are_zero():
    readings = np.zeros(24, np.float32)
    assert ring_is_empty(readings)
    for k in range(24):
        readings[k] = np.finfo(np.float32).smallest_subnormal
        assert not ring_is_empty(readings)
        readings[k] = 0.0


@pytest.mark.parametrize(
    ("length", "angle", "described", "program"),
    [
        (0.0, 0.0, False, False),
        (0.0999, 0.0, False, False),
        (0.1001, -1.5, True, True),
        (0.1001, 2.60, True, True),
        (0.5, 2.62, False, True),
        (0.001, -2.60, False, False),
        (0.001, -2.62, False, True),
    ],
)
def test_obstacle_thresholds(length, angle, described, program):
    vector = (length * math.cos(angle), length * math.sin(angle))
    assert [is_obstacle_vector(*vector, behind_counts) for behind_counts in (False, True)] == [described, program]


@pytest.mark.parametrize(
    ("greys", "seen"),
    [
        ((0.7, 0.7, 0.7, 0.7), "nest"),
        ((0.7, 0.7, 0.7, 1.0), "nest"),
        ((0.6, 0.8, 0.7, 1.0), "nest"),
        ((0.7, 0.7, 1.0, 1.0), ""),
        ((0.59, 0.7, 0.7, 1.0), ""),
        ((0.7, 0.81, 0.7, 1.0), ""),
        ((0.0, 0.0, 0.0, 0.0), "object"),
        ((0.05, 0.0, 0.05, 0.0), "object"),
        ((0.0, 0.0, 0.0, 1.0), ""),
        ((0.06, 0.0, 0.0, 0.0), ""),
        ((0.4, 0.4, 0.4, 0.4), "cache"),
        ((0.3, 0.5, 0.4, 0.0), "cache"),
        ((0.4, 0.4, 1.0, 1.0), ""),
        ((0.29, 0.4, 0.4, 1.0), ""),
        ((0.51, 0.4, 0.4, 1.0), ""),
        ((1.0, 1.0, 1.0, 1.0), ""),
    ],
)
def test_ground_bands(greys, seen):
    row = np.array(greys, np.float32)
    assert {"nest": sees_nest(row), "object": sees_object(row), "cache": sees_cache(row)} == {
        name: name == seen for name in ("nest", "object", "cache")
    }


# In the world


def sensed(env, name, robot=0):
    """A slice of what a robot observes after standing for one tick."""
    actions = np.zeros((len(env.active), 3), np.float32)
    actions[:, 2] = Grip.RELEASE
    obs = env.step_batch(actions)[0]
    return obs[robot, env.layout[name]].copy()


@pytest.fixture(scope="module")
def stage():
    return tidy_world(n_robots=3)


@pytest.mark.parametrize(
    ("ahead", "left", "seen"),
    [
        (-0.036, 0.0, True),
        (0.038, 0.0, False),
        (-0.038, 0.0, False),
        (0.0, 0.089, False),
        (0.036, -0.088, True),
    ],
)
@pytest.mark.parametrize("heading", [0.0, math.pi / 2])
def test_an_object_is_seen_within_3_7_cm_along_the_heading(stage, ahead, left, seen, heading):
    lay(stage, 0, (60, 40))
    x, y = cell_centre((60, 40))
    cos, sin = math.cos(heading), math.sin(heading)
    put(stage, 0, x + cos * ahead - sin * left, y + sin * ahead + cos * left, heading)
    assert sees_object(sensed(stage, "ground")) == seen


@pytest.mark.parametrize(("apart", "obstacle"), [(0.28, False), (0.26, True)])
def test_facing_robots_see_each_other_from_27_cm(stage, apart, obstacle):
    put(stage, 0, 16.0, 8.0, 0.0)
    put(stage, 1, 16.0 + apart, 8.0, math.pi)
    put(stage, 2, 20.0, 8.0)
    assert [sees_obstacle(sensed(stage, "proximity", robot), False) for robot in (0, 1)] == [obstacle, obstacle]
    assert stage.events.interfering.tolist() == [obstacle, obstacle, False]
