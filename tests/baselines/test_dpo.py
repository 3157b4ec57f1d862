"""DPO: going to remembered objects, the stages of going to a point, and the choice between objects."""

import math

import numpy as np
import pytest

from baselines.dpo import DPOPolicy
from baselines.machines import restart_acquiring
from baselines.memory import OneMemory, remember
from baselines.object_choice import MemoryParameters, object_utility
from baselines.parameters import kernel_constants
from baselines.robots import Activity, VectorState
from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.observations import Observations, make_spec

GOAL = (10.5, 10.1)
"""Centre of the object two cells ahead of the robot, which stands at (10.1, 10.1)."""


class Robot:
    """A single robot under DPO that faces +x, at (10.1, 10.1)."""

    def __init__(self, parameters=None, **changes):
        self.seen = Observations(make_spec(**changes))
        self.seen.pose(10.1, 10.1)
        self.policy = DPOPolicy(**(parameters or {}))
        self.policy.reset(self.seen.spec, np.random.default_rng(5))

    def act(self, ticks: int = 1, active: bool = True) -> np.ndarray:
        for _ in range(ticks):
            action = self.policy.act(self.seen.array, np.array([active]))[0].copy()
        return action

    @property
    def record(self) -> np.record:
        return self.policy._robots[0]

    @property
    def activity(self) -> Activity:
        return Activity(int(self.policy.activity[0]))

    @property
    def stage(self) -> VectorState:
        return VectorState(int(self.record.vector_state))

    def go(self) -> None:
        """See the object 7 two cells ahead and start going to it."""
        self.seen.window({(2, 0): 7})
        self.act()
        assert self.stage is VectorState.VECTOR

    def keep(self, x: float, y: float) -> None:
        """Believe to be elsewhere, while the window stays as it is."""
        self.seen.believed_position(x, y)


@pytest.fixture
def robot() -> Robot:
    return Robot()


def utility(anchor_x: float, pheromone: float = 1.0) -> float:
    parameters = MemoryParameters()
    c = kernel_constants(parameters, make_spec(), **parameters.derived())[0]
    return object_utility(anchor_x, 8.0, 24.0, 8.0, pheromone, c)


def test_utility_of_the_worked_example():
    assert utility(25.0) == pytest.approx(59.26, abs=0.005)
    assert utility(26.0) == pytest.approx(30.99, abs=0.005)


def test_utility_grows_with_the_density():
    assert utility(25.0, 1.0) / utility(25.0, 0.5) == pytest.approx(math.exp(0.5))


def test_explores_while_nothing_is_known(robot):
    assert robot.act() == pytest.approx([0.45, 0.45, Grip.RELEASE])
    assert robot.stage is VectorState.IDLE


def test_goes_to_the_centre_of_an_object_as_soon_as_it_is_seen(robot):
    robot.seen.window({(2, 0): 7})
    assert robot.act() == pytest.approx([0.4, 0.4, Grip.RELEASE], abs=1e-6)
    assert (robot.record.goal_x_m, robot.record.goal_y_m) == pytest.approx(GOAL)
    assert robot.record.target == 7


def test_goes_to_the_object_of_highest_utility(robot):
    robot.seen.window({(-2, 0): 3, (2, 0): 7, (2, 2): 8})
    robot.act()
    assert robot.record.target == 7  # nearest corner, seen from the robot, for its distance from the nest


def test_older_memories_count_less(robot):
    robot.seen.window({(-2, 0): 3, (2, 0): 7})
    robot.act()
    assert robot.record.target == 7
    robot.policy._memory.seen[0, robot.policy._memory.entry[0, 7] - 1] -= 50_000
    robot.seen.window({})
    robot.seen.pose(20.1, 10.1)
    robot.keep(10.05, 10.1)  # between the two, as it believes, but without seeing them
    restart_acquiring(robot.record)
    robot.act()
    assert robot.record.target == 3


def test_the_object_known_first_wins_a_tie(robot):
    memory = OneMemory(*(part[0] for part in robot.policy._memory))
    robot.seen.pose(24.1, 14.1)
    robot.keep(24.0, 8.0)
    for row, cell_y in ((8, 60), (7, 20)):  # 4 m above and below the line through robot and nest
        remember(robot.record, memory, row, 100, cell_y)
    robot.act()
    assert robot.record.target == 8


def test_an_object_within_20_cm_is_not_chosen(robot):
    robot.seen.window({(1, 0): 7})  # centre at (10.3, 10.1)
    robot.keep(10.11, 10.1)
    robot.act()
    assert robot.stage is VectorState.IDLE
    robot.keep(10.09, 10.1)
    robot.act()
    assert robot.stage is VectorState.VECTOR


def test_an_excluded_object_does_not_restart_the_exploration_lock(robot):
    robot.seen.window({(0, 0): 7})
    robot.seen.ground("object")
    robot.act(50)
    assert robot.activity is Activity.ACQUIRE
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP


def test_arrival_on_an_object_asks_for_it_standing_still(robot):
    robot.go()
    robot.keep(GOAL[0] - 0.019, GOAL[1])
    robot.seen.ground("object")
    assert robot.act() == pytest.approx([0.0, 0.0, Grip.GRASP])
    assert robot.activity is Activity.WAIT_PICKUP


def test_just_outside_tolerance_it_creeps_on(robot):
    robot.go()
    robot.keep(GOAL[0] - 0.0201, GOAL[1])
    robot.seen.ground("object")
    assert robot.act() == pytest.approx([0.05, 0.05, Grip.RELEASE], abs=1e-6)


def test_arrival_without_an_object_under_it_means_looking_further(robot):
    robot.go()
    robot.keep(*GOAL)
    robot.act()
    assert robot.activity is Activity.ACQUIRE
    assert robot.stage is VectorState.IDLE
    assert robot.record.explore_ticks == 1


def test_a_target_that_is_forgotten_is_given_up_in_the_same_tick(robot):
    robot.go()
    robot.seen.window({})
    robot.act()
    assert robot.stage is VectorState.IDLE
    assert robot.policy.n_known[0] == 0


def test_an_obstacle_is_avoided_then_recovered_from_for_10_ticks(robot):
    robot.go()
    robot.keep(9.0, 10.1)  # far enough not to slow down
    robot.act()
    robot.seen.obstacle(math.pi / 2)
    assert robot.act() == pytest.approx([0.5, -0.5, Grip.RELEASE])  # 8 cm/s to the right: a turn on the spot
    assert robot.stage is VectorState.AVOIDANCE
    robot.seen.obstacle(None)
    for tick in range(10):
        action = robot.act()
        if tick < 9:
            assert robot.stage is VectorState.RECOVERY
            assert action == pytest.approx([0.35, 0.35, Grip.RELEASE], abs=1e-6)
    assert robot.stage is VectorState.VECTOR
    assert action == pytest.approx([0.5, 0.5, Grip.RELEASE], abs=1e-6)  # recovery and arrival, limited to 10 cm/s
    assert robot.act() == pytest.approx([0.4, 0.4, Grip.RELEASE], abs=1e-6)


def test_an_obstacle_during_recovery_starts_it_over(robot):
    robot.go()
    robot.keep(9.0, 10.1)
    robot.act()
    robot.seen.obstacle(math.pi / 2)
    robot.act()
    robot.seen.obstacle(None)
    robot.act(6)
    robot.seen.obstacle(math.pi / 2)
    robot.act()
    assert robot.stage is VectorState.AVOIDANCE
    assert robot.record.recovery_ticks == 0
    robot.seen.obstacle(None)
    robot.act(9)
    assert robot.stage is VectorState.RECOVERY
    robot.act()
    assert robot.stage is VectorState.VECTOR


def test_a_spinning_robot_adds_a_wander_force_while_avoiding():
    robot = Robot(quirks=Quirks(obstacle_behind_counts=True))
    robot.go()
    robot.keep(9.0, 10.1)
    robot.act()
    robot.seen.obstacle(math.pi)
    moving = robot.act()
    robot.seen.set("wheel_speed", (0.5, -0.5))
    wandering_before = robot.record.wander_deg
    spinning = robot.act()
    assert moving == pytest.approx([0.4, 0.4, Grip.RELEASE], abs=1e-6)
    assert spinning == pytest.approx([0.5, 0.5, Grip.RELEASE], abs=1e-6)
    assert robot.record.wander_deg != wandering_before


def test_obstacles_are_ignored_near_the_goal(robot):
    robot.go()
    robot.keep(GOAL[0] - 0.1, GOAL[1])
    robot.act()
    robot.seen.obstacle(0.0)
    assert robot.act() == pytest.approx([0.2, 0.2, Grip.RELEASE], abs=1e-6)
    assert robot.stage is VectorState.VECTOR


def test_near_the_goal_obstacles_are_avoided_if_approach_ignores_obstacles_is_off():
    robot = Robot(parameters={"approach_ignores_obstacles": False})
    robot.go()
    robot.keep(GOAL[0] - 0.1, GOAL[1])
    robot.act()
    robot.seen.obstacle(0.0)
    robot.act()
    assert robot.stage is VectorState.AVOIDANCE


def test_an_obstacle_wins_over_arriving(robot):
    robot.go()
    robot.seen.ground("object")
    robot.seen.obstacle(math.pi / 2)
    robot.keep(*GOAL)  # from afar at once: the last arrival force was outside the slowing radius
    robot.act()
    assert robot.stage is VectorState.AVOIDANCE
    assert robot.activity is Activity.ACQUIRE


def test_a_failed_pick_up_goes_back_to_acquiring(robot):
    robot.go()
    robot.keep(*GOAL)
    robot.seen.ground("object")
    robot.act()
    robot.seen.ground("floor")
    robot.seen.event(Event.VANISHED)
    robot.act()
    assert robot.activity is Activity.ACQUIRE


def test_a_missed_pick_up_event_still_forgets_the_object(robot):
    robot.go()
    robot.keep(*GOAL)
    robot.seen.ground("object")
    robot.act()
    robot.seen.carry(7)
    robot.seen.event(Event.PICKED_UP)
    robot.act(active=False)  # in repair when it happened
    robot.seen.event(Event.NONE)
    robot.seen.pose(14.0, 10.1)
    robot.seen.window({})
    robot.act()
    assert robot.activity is Activity.HOMING
    assert robot.policy.n_known[0] == 0


def test_memory_is_kept_up_to_date_while_homing(robot):
    robot.seen.carry(3)
    robot.act()
    robot.seen.window({(1, 1): 9})
    robot.act()
    assert robot.activity is Activity.HOMING
    assert set(robot.policy.remembered(0)) == {9}


def test_starting_within_tolerance_is_an_arrival_unless_the_quirk_is_on():
    for quirk, activity in ((False, Activity.WAIT_PICKUP), (True, Activity.ACQUIRE)):
        robot = Robot(quirks=Quirks(finisher_tolerance_mismatch=quirk))
        robot.policy = DPOPolicy(object_tolerance_m=0.5)
        robot.policy.reset(robot.seen.spec, np.random.default_rng(5))
        robot.seen.window({(2, 0): 7})
        robot.seen.ground("object")
        robot.act()
        assert robot.activity is activity
