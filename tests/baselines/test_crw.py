"""CRW, state by state."""

import math

import numpy as np
import pytest

from baselines.crw import CRWPolicy
from baselines.robots import Activity
from swarm_forage_env.contract.codes import Event, Grip
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

    def bring_to(self, activity: Activity) -> None:
        """Walk through the states in order up to one."""
        self.act(50)
        for step in (self.find, self.take, self.enter_nest, self.reach_depth, self.deliver):
            if self.activity is activity:
                return
            step()
        assert self.activity is activity

    def find(self) -> None:
        self.seen.ground("object")
        self.act()

    def take(self) -> None:
        self.seen.ground("floor")
        self.seen.event(Event.PICKED_UP)
        self.seen.carry(4)
        self.act()
        self.seen.event(Event.NONE)

    def enter_nest(self) -> None:
        self.seen.ground("nest")
        self.seen.pose(4.7, 8.0)
        self.act()

    def reach_depth(self) -> None:
        self.seen.pose(3.2, 8.0)
        self.act()

    def deliver(self) -> None:
        self.seen.event(Event.DELIVERED)
        self.seen.carry(None)
        self.act()
        self.seen.event(Event.NONE)


@pytest.fixture
def robot() -> Robot:
    return Robot()


@pytest.fixture
def leaver() -> Robot:
    """A robot that walks out of the nest after a delivery."""
    return Robot(quirks=Quirks(nest_left_at_random=True))


def test_starts_exploring_at_9_cm_per_second_with_an_empty_gripper(robot):
    action = robot.act()
    assert robot.activity is Activity.ACQUIRE
    assert action == pytest.approx([0.45, 0.45, Grip.RELEASE])


def test_objects_are_ignored_for_the_first_50_ticks(robot):
    robot.seen.ground("object")
    robot.act(50)
    assert robot.activity is Activity.ACQUIRE
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP


def test_stands_still_and_asks_in_the_tick_of_detection(robot):
    robot.act(50)
    robot.seen.ground("object")
    assert robot.act() == pytest.approx([0.0, 0.0, Grip.GRASP])
    assert robot.act(20) == pytest.approx([0.0, 0.0, Grip.GRASP])


@pytest.mark.parametrize("event", [Event.NOTHING_HERE, Event.VANISHED])
def test_a_lost_object_means_exploring_with_a_new_lock(robot, event):
    robot.bring_to(Activity.WAIT_PICKUP)
    robot.seen.event(event)
    robot.act()
    robot.seen.event(Event.NONE)
    robot.act(49)
    assert robot.activity is Activity.ACQUIRE
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP


def test_carries_towards_the_light_at_8_cm_per_second(robot):
    robot.bring_to(Activity.HOMING)
    robot.seen.light(0.0)
    assert robot.act() == pytest.approx([0.4, 0.4, Grip.GRASP], abs=1e-6)
    robot.seen.light(math.pi / 2)
    assert robot.act() == pytest.approx([-0.5, 0.5, Grip.GRASP])


def test_homing_adds_avoidance_to_phototaxis(robot):
    robot.bring_to(Activity.HOMING)
    robot.seen.light(0.0)
    robot.seen.obstacle(math.pi / 2)  # to the left: the sum points 45 degrees to the right
    assert robot.act() == pytest.approx([0.5, -0.5, Grip.GRASP])


def test_a_homing_robot_that_only_turns_for_longer_than_half_a_turn_takes_drives_on(robot):
    robot.bring_to(Activity.HOMING)
    robot.seen.light(math.radians(20.0))  # sensed 20 degrees to the left however long it turns
    for _ in range(13):
        assert robot.act() == pytest.approx([-0.5, 0.5, Grip.GRASP])
    left, right, _ = robot.act()
    assert left + right == pytest.approx(1.0, abs=0.02), "8 cm/s to the light and 9 cm/s ahead: at full speed"
    assert left < right, "in an arc"
    assert robot.act() == pytest.approx([-0.5, 0.5, Grip.GRASP]), "and patience begins anew"


def test_waiting_is_not_turning(robot):
    robot.bring_to(Activity.WAIT_PICKUP)
    robot.act(20)
    robot.seen.light(math.radians(20.0))
    robot.take()
    assert robot.act() == pytest.approx([-0.5, 0.5, Grip.GRASP])


def test_exploring_avoids_obstacles(robot):
    robot.seen.obstacle(-math.pi / 2)
    assert robot.act() == pytest.approx([-0.5, 0.5, Grip.RELEASE])


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


def test_inside_the_nest_wander_and_phototaxis_add_up_to_the_speed_limit(robot):
    robot.bring_to(Activity.HOMING_IN_NEST)
    robot.seen.pose(4.75, 8.0)
    robot.seen.light(0.0)
    left, right, _ = robot.act()
    assert robot.activity is Activity.HOMING_IN_NEST
    assert (left + right) / 2 * 20.0 == pytest.approx(10.0, abs=1e-5)


def test_waits_until_it_sees_the_nest_again_before_dropping(robot):
    robot.bring_to(Activity.HOMING_IN_NEST)
    robot.seen.ground("floor")
    robot.seen.pose(3.2, 8.0)
    robot.act()
    assert robot.activity is Activity.HOMING_IN_NEST


def test_asks_to_deliver_standing_still(robot):
    robot.bring_to(Activity.WAIT_DROP)
    assert robot.act(3) == pytest.approx([0.0, 0.0, Grip.DELIVER])


@pytest.mark.parametrize("event", [Event.NOTHING_HERE, Event.VANISHED])
def test_a_refused_delivery_resumes_homing(robot, event):
    robot.bring_to(Activity.WAIT_DROP)
    robot.seen.ground("floor")
    robot.seen.event(event)
    action = robot.act()
    assert robot.activity is Activity.HOMING
    assert action[2] == Grip.GRASP


def test_looks_for_the_next_object_at_once_after_a_delivery(robot):
    robot.bring_to(Activity.WAIT_DROP)
    robot.deliver()
    assert robot.activity is Activity.ACQUIRE
    robot.seen.ground("object")
    robot.act(49)
    assert robot.activity is Activity.ACQUIRE, "with a new lock"
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP


def test_quirk_nest_left_at_random_wanders_out_then_explores_with_a_new_lock(leaver):
    robot = leaver
    robot.bring_to(Activity.LEAVE_NEST)
    left, right, grip = robot.act(5)
    assert (left + right) / 2 * 20.0 == pytest.approx(9.0, abs=1e-5)
    assert grip == pytest.approx(Grip.RELEASE)
    robot.seen.ground("object")
    robot.act(50)
    assert robot.activity is Activity.ACQUIRE
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP


@pytest.mark.parametrize("activity", [Activity.HOMING, Activity.HOMING_IN_NEST])
def test_a_robot_whose_cargo_is_gone_explores_again(robot, activity):
    robot.bring_to(activity)
    robot.seen.carry(None)
    robot.seen.event(Event.DROPPED)
    robot.act()
    assert robot.activity is Activity.ACQUIRE


def test_a_robot_that_lost_its_cargo_while_waiting_outside_the_nest_explores(robot):
    robot.bring_to(Activity.WAIT_DROP)
    robot.seen.ground("floor")
    robot.seen.carry(None)
    robot.act()
    assert robot.activity is Activity.ACQUIRE


@pytest.mark.parametrize("activity", [Activity.ACQUIRE, Activity.WAIT_PICKUP, Activity.LEAVE_NEST])
def test_a_robot_that_finds_itself_carrying_goes_home(leaver, activity):
    robot = leaver
    robot.bring_to(activity)
    robot.seen.pose(4.7, 8.0)
    robot.seen.carry(9)
    robot.act()
    assert robot.activity in (Activity.HOMING, Activity.HOMING_IN_NEST)


def test_an_inactive_robot_is_frozen(robot):
    robot.seen.ground("object")
    robot.act(30)
    before = robot.policy.activity, robot.policy._robots.copy()
    assert robot.act(100, active=False) == pytest.approx([0.0, 0.0, Grip.RELEASE])
    assert robot.policy._robots == before[1]
    robot.act(20)
    assert robot.activity is Activity.ACQUIRE
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP


def test_an_inactive_robot_does_not_shift_the_chances_of_others():
    task = make_spec(3)
    actions = []
    for middle_active in (True, False):
        seen = Observations(task)
        policy = CRWPolicy()
        policy.reset(task, np.random.default_rng(4))
        active = np.array([True, middle_active, True])
        actions.append([policy.act(seen.array, active)[[0, 2]].copy() for _ in range(30)])
    np.testing.assert_array_equal(actions[0], actions[1])


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
