"""Steering forces and drive: the worked numbers of the robot model, and the statistics of the random walk."""

import math

import numpy as np
import pytest

from baselines.crw import CRWPolicy
from baselines.motion import drive, phototaxis, wander, wander_freely
from baselines.parameters import ControllerParameters, kernel_constants
from baselines.robots import new_robots
from swarm_forage_env.contract.detection import BEAM_ANGLES_RAD
from tests.support.observations import Observations, make_spec

TASK = make_spec()
C = kernel_constants(ControllerParameters(), TASK)[0]


def polar(force: tuple[float, float]) -> tuple[float, float]:
    """Length in cm/s and angle in degrees."""
    return 100.0 * math.hypot(*force), math.degrees(math.atan2(force[1], force[0]))


def wheels(length_cmps: float, angle_deg: float) -> np.ndarray:
    """Wheel speeds in cm/s for a force."""
    action = np.zeros(3, np.float32)
    angle = math.radians(angle_deg)
    drive(0.01 * length_cmps * math.cos(angle), 0.01 * length_cmps * math.sin(angle), C, action)
    return 20.0 * action[:2]


@pytest.mark.parametrize(
    ("length", "angle", "expected"),
    [
        (9.0, 10.0, (3.0, 15.0)),
        (9.0, -10.0, (15.0, 3.0)),
        (17.0, 0.0, (10.0, 10.0)),
        (9.0, 20.0, (-10.0, 10.0)),
        (9.0, -20.0, (10.0, -10.0)),
        (0.5, 180.0, (-10.0, 10.0)),
        (0.0, 0.0, (0.0, 0.0)),
    ],
)
def test_drive_turns_softly_up_to_15_degrees_and_on_the_spot_beyond(length, angle, expected):
    assert wheels(length, angle) == pytest.approx(expected, abs=1e-5)


def test_phototaxis_follows_the_light_and_goes_straight_in_the_dark():
    readings = np.maximum(0.0, np.cos(BEAM_ANGLES_RAD - math.radians(40.0))).astype(np.float32)
    assert polar(phototaxis(readings, C)) == pytest.approx((8.0, 40.0), abs=1e-4)
    assert phototaxis(np.zeros(24, np.float32), C) == (0.08, 0.0)


def test_turns_of_a_free_walk_have_the_expected_spread_and_bound():
    n_robots, ticks = 600, 900
    task = make_spec(n_robots)
    observations = Observations(task)
    policy = CRWPolicy()
    policy.reset(task, np.random.default_rng(11))
    turns = np.empty((ticks, n_robots))
    for tick in range(ticks):
        left, right = 0.2 * policy.act(observations.array, np.ones(n_robots, bool))[:, :2].T.astype(float)
        np.testing.assert_allclose((left + right) / 2 * task.dt_s, 0.018, atol=1e-7)
        turns[tick] = np.degrees((right - left) / task.wheel_base_m * task.dt_s)  # exact arcs of one tick
    settled = turns[20:]
    assert settled.std() == pytest.approx(2.56, abs=0.02)
    assert 0.982 * 5.15 < np.abs(settled).max() < 0.982 * 5.21
    assert settled.mean() == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    ("changes", "has_series"),
    [
        ({}, True),
        ({"wander_circle_distance": 10.0, "wander_max_change_deg": 11.0, "soft_turn_deg": 12.0}, True),
        ({"wander_circle_distance": 11.0}, False),
    ],
)
def test_wandering_freely_is_wandering_to_the_last_bit(changes, has_series):
    constants = kernel_constants(ControllerParameters(**changes), TASK)[0]
    free, other = new_robots(2)
    quick, slow = np.zeros(3, np.float32), np.zeros(3, np.float32)
    rng = np.random.default_rng(6)
    n_quick = 0
    extremes = [0.0, 0.5, 1.0 - 2.0**-53]
    for u in np.where(rng.random(2000) < 0.1, rng.choice(extremes, 2000), rng.random(2000)).tolist():
        before = free.wander_deg
        if wander_freely(free, constants, u, quick):
            n_quick += 1
        else:
            assert free.wander_deg == before
            drive(*wander(free, constants, u), constants, quick)
        drive(*wander(other, constants, u), constants, slow)
        assert tuple(quick[:2]) == tuple(slow[:2])
        most = constants.wander_max_change_deg
        assert free.wander_deg == other.wander_deg == math.fmod(before + most * (2.0 * u - 1.0), most)
    assert (n_quick > 1600) == has_series
