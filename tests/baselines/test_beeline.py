"""The rules of Beeline, each in one tick of one robot."""

import numpy as np
import pytest

from baselines.beeline import BeelinePolicy
from swarm_forage_env import Grip, scenario
from swarm_forage_env.contract.policy import SwarmSpec

SPEC = SwarmSpec.of(scenario("warehouse_small", n_robots=1, n_objects=1))  # 32 x 16 m, nest up to x = 4.8 m
MIDDLE, EAST, FULL = (0.0, 0.0), (1.0, 0.0), 0.5


@pytest.fixture
def ticks():
    """A function that lets a robot act for some ticks, by what it sees, and returns (left, right, gripper)."""
    policy = BeelinePolicy()
    policy.reset(SPEC, np.random.default_rng(1))

    def act(n=1, **seen):
        obs = np.zeros((1, SPEC.layout.size), np.float32)
        for name, values in {"position": MIDDLE, "heading": EAST, **seen}.items():
            obs[:, SPEC.layout[name]] = values
        return [policy.act(obs, np.array([True]))[0].copy() for _ in range(n)][-1]

    act.robot = lambda: policy.robots[0]
    return act


def test_it_goes_home_straight_back_and_wider(ticks):
    left, right, grip = ticks(carrying=1.0, position=(0.5, 0.0), heading=(-1.0, 0.0))
    assert (left, right) == pytest.approx((FULL, FULL))  # the nest lies in the west
    assert grip == pytest.approx(Grip.DELIVER)
    left, right, _ = ticks(carrying=1.0, position=(-0.85, 0.9), heading=(0.0, -1.0))
    assert (left, right) == pytest.approx((FULL, FULL))  # the nearest point of the nest lies due south
    ticks()  # the first goal needs no find
    ticks(carrying=1.0, position=(0.5, 0.0))
    left, right, grip = ticks()
    assert (left, right, grip) == pytest.approx((FULL, FULL, Grip.GRASP))  # east, where it picked up
    np.testing.assert_allclose(ticks.robot()["goal_m"], (24.0, 8.0))
    for radius_m in (0.5, 1.5, 3.5):
        assert ticks.robot()["radius_m"] == radius_m
        goal = ticks.robot()["goal_m"]
        ticks(position=(goal[0] / 16.0 - 1.0, goal[1] / 8.0 - 1.0))  # arrived
        assert 0.0 < np.abs(ticks.robot()["goal_m"] - (24.0, 8.0)).max() <= radius_m


def test_it_turns_to_the_nearest_object_and_passes_on_the_right(ticks):
    north = np.zeros(25)
    north[[17, 24]] = 1.0  # one cell north, and the corner in the north-east
    left, right, _ = ticks(los_object=north)
    assert (left, right) == pytest.approx((-FULL, FULL))
    ahead = np.zeros(24)
    ahead[[0, 23]] = 0.5
    left, right, _ = ticks(carrying=1.0, heading=(-1.0, 0.0), proximity=ahead)
    assert left > right  # to the right of what lies on its way home


def test_it_loses_patience_for_a_while(ticks):
    ahead = np.zeros(24)
    ahead[[0, 23]] = 0.5
    seen = {"carrying": 1.0, "heading": (-1.0, 0.0)}
    ticks(n=200, proximity=ahead, **seen)
    ticks(n=200, **seen)  # it forgets
    ticks(n=301, proximity=ahead, **seen)
    assert ticks.robot()["detour"] == 0
    ticks(proximity=ahead, **seen)
    assert 0 < ticks.robot()["detour"] < 300
    left, right, _ = ticks(**seen)
    assert left == pytest.approx(-right)  # at a right angle to its way
    left, right, _ = ticks(n=300, **seen)
    assert (left, right) == pytest.approx((FULL, FULL))
