"""CRW, state by state."""

import math

import numpy as np
import pytest

from baselines.crw import CRWPolicy
from baselines.robots import Activity
from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.observations import Observations, make_spec


class Robot:
    """A single robot under CRW."""

    def __init__(self, **changes):
        self.seen = Observations(make_spec(**changes))
        self.policy = CRWPolicy()
        self.policy.reset(self.seen.spec, np.random.default_rng(5))

    def act(self, ticks: int = 1, active: bool = True) -> np.ndarray:
        for _ in range(ticks):
            action = self.policy.act(self.seen.array, np.array([active]))[0].copy()
        return action

    @property
    def activity(self) -> Activity:
        return Activity(int(self.policy.activity[0]))


@pytest.fixture
def robot() -> Robot:
    return Robot()


def test_objects_are_ignored_for_the_first_50_ticks(robot):
    robot.seen.ground("object")
    robot.act(50)
    assert robot.activity is Activity.ACQUIRE
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP


def test_carries_towards_the_light_at_8_cm_per_second(robot):
    robot.seen.carry(4)
    robot.seen.light(0.0)
    assert robot.act() == pytest.approx([0.4, 0.4, Grip.GRASP], abs=1e-6)
    robot.seen.light(math.pi / 2)
    assert robot.act() == pytest.approx([-0.5, 0.5, Grip.GRASP])


def test_drop_depth_is_uniform_between_a_centimetre_and_the_entry_distance():
    n_robots = 4000
    seen = Observations(make_spec(n_robots))
    policy = CRWPolicy()
    policy.reset(seen.spec, np.random.default_rng(8))
    active = np.ones(n_robots, bool)
    seen.carry(0)
    policy.act(seen.array, active)
    seen.ground("nest")
    seen.pose(4.7, 8.0)  # 1.5 m from the centre
    policy.act(seen.array, active)
    seen.pose(3.95, 8.0)  # half of it
    policy.act(seen.array, active)
    assert np.mean(policy.activity == Activity.WAIT_DROP) == pytest.approx(0.5, abs=0.03)
    seen.pose(3.2, 8.0)
    policy.act(seen.array, active)
    assert np.all(policy.activity == Activity.WAIT_DROP)


def test_quirk_nest_left_at_random_wanders_out_then_explores_with_a_new_lock():
    robot = Robot(quirks=Quirks(nest_left_at_random=True))
    robot.seen.carry(4)
    robot.seen.ground("nest")
    robot.seen.pose(3.2, 8.0)
    robot.act(2)
    assert robot.act() == pytest.approx([0.0, 0.0, Grip.DELIVER])
    robot.seen.carry(None)
    left, right, _ = robot.act()
    assert robot.activity is Activity.LEAVE_NEST
    assert (left + right) / 2 * 20.0 == pytest.approx(9.0, abs=1e-5)
    robot.seen.ground("object")
    robot.act(50)
    assert robot.activity is Activity.ACQUIRE
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP


def test_an_inactive_robot_is_frozen(robot):
    robot.seen.ground("object")
    robot.act(30)
    before = robot.policy._robots.copy()
    assert robot.act(100, active=False) == pytest.approx([0.0, 0.0, Grip.RELEASE])
    assert robot.policy._robots == before
    robot.act(21)
    assert robot.activity is Activity.WAIT_PICKUP


def test_quirk_explore_double_start_runs_the_strategy_twice_in_the_first_tick():
    quirky = Robot(quirks=Quirks(explore_double_start=True))
    first, second = quirky.act(), quirky.act()
    assert (first[0] + first[1]) / 2 * 20.0 == pytest.approx(10.0, abs=1e-5)  # two forces of 9 cm/s, limited
    assert (second[0] + second[1]) / 2 * 20.0 == pytest.approx(9.0, abs=1e-5)
    quirky.seen.ground("object")
    quirky.act(48)
    assert quirky.activity is Activity.ACQUIRE
    quirky.act()
    assert quirky.activity is Activity.WAIT_PICKUP
