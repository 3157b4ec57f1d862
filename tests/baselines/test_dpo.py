"""DPO: going to remembered objects, the stages of going to a point, and the choice between objects."""

import math

import numpy as np
import pytest

from baselines.dpo import DPOPolicy
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


def test_an_object_within_20_cm_is_not_chosen(robot):
    robot.seen.window({(1, 0): 7})  # centre at (10.3, 10.1)
    robot.keep(10.11, 10.1)
    robot.act()
    assert robot.stage is VectorState.IDLE
    robot.keep(10.09, 10.1)
    robot.act()
    assert robot.stage is VectorState.VECTOR


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
    assert robot.record.n_known == 0


def test_starting_within_tolerance_is_an_arrival_unless_the_quirk_is_on():
    for quirk, activity in ((False, Activity.WAIT_PICKUP), (True, Activity.ACQUIRE)):
        robot = Robot(quirks=Quirks(finisher_tolerance_mismatch=quirk))
        robot.policy = DPOPolicy(object_tolerance_m=0.5)
        robot.policy.reset(robot.seen.spec, np.random.default_rng(5))
        robot.seen.window({(2, 0): 7})
        robot.seen.ground("object")
        robot.act()
        assert robot.activity is activity
