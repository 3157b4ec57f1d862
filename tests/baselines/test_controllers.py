"""CRW, DPO and CPFA by hand: their states, the stages of going to a point, the choice between objects, searches."""

import math

import numpy as np
import pytest
from scipy import stats

from baselines.cpfa import CPFAParameters, CPFAPolicy, Stage, aim_at_wall, normal, poisson_cdf, search_turn_rad
from baselines.crw import CRWPolicy
from baselines.dpo import DPOPolicy
from baselines.object_choice import MemoryParameters, object_utility
from baselines.parameters import kernel_constants
from baselines.robots import Activity, VectorState, new_robots, sense
from swarm_forage_env.contract.codes import Event, Grip
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.observations import Observations, make_spec


class Robot:
    """A single robot under a controller that faces +x, at (10.1, 10.1)."""

    def __init__(self, policy, **changes):
        self.seen = Observations(make_spec(**changes))
        self.seen.pose(10.1, 10.1)
        self.policy = policy
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
    def vector(self) -> VectorState:
        return VectorState(int(self.record.vector_state))

    @property
    def goal(self) -> tuple[float, float]:
        return float(self.record["goal_x_m"]), float(self.record["goal_y_m"])


@pytest.fixture
def walker() -> Robot:
    return Robot(CRWPolicy())


@pytest.fixture
def robot() -> Robot:
    return Robot(DPOPolicy())


# CRW


def test_objects_are_ignored_for_the_first_50_ticks(walker):
    walker.seen.ground("object")
    walker.act(50)
    assert walker.activity is Activity.ACQUIRE
    walker.act()
    assert walker.activity is Activity.WAIT_PICKUP


def test_carries_towards_the_light_at_8_cm_per_second(walker):
    walker.seen.carry(4)
    walker.seen.light(0.0)
    assert walker.act() == pytest.approx([0.4, 0.4, Grip.GRASP], abs=1e-6)
    walker.seen.light(math.pi / 2)
    assert walker.act() == pytest.approx([-0.5, 0.5, Grip.GRASP])


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


# DPO


def utility(anchor_x: float, pheromone: float = 1.0) -> float:
    parameters = MemoryParameters()
    c = kernel_constants(parameters, make_spec(), **parameters.derived())[0]
    return object_utility(anchor_x, 8.0, 24.0, 8.0, pheromone, c)


def test_utility_of_the_worked_example():
    assert utility(25.0) == pytest.approx(59.26, abs=0.005)
    assert utility(26.0) == pytest.approx(30.99, abs=0.005)


def test_an_object_within_20_cm_is_not_chosen(robot):
    robot.seen.window({(1, 0): 7})  # centre at (10.3, 10.1)
    robot.seen.believed_position(10.11, 10.1)
    robot.act()
    assert robot.vector is VectorState.IDLE
    robot.seen.believed_position(10.09, 10.1)
    robot.act()
    assert robot.vector is VectorState.VECTOR


def test_an_obstacle_is_avoided_then_recovered_from_for_10_ticks(robot):
    robot.seen.window({(2, 0): 7})
    robot.act()
    assert robot.vector is VectorState.VECTOR
    robot.seen.believed_position(9.0, 10.1)  # far enough not to slow down
    robot.act()
    robot.seen.obstacle(math.pi / 2)
    assert robot.act() == pytest.approx([0.5, -0.5, Grip.RELEASE])  # 8 cm/s to the right: a turn on the spot
    assert robot.vector is VectorState.AVOIDANCE
    robot.seen.obstacle(None)
    for tick in range(10):
        action = robot.act()
        if tick < 9:
            assert robot.vector is VectorState.RECOVERY
            assert action == pytest.approx([0.35, 0.35, Grip.RELEASE], abs=1e-6)
    assert robot.vector is VectorState.VECTOR
    assert action == pytest.approx([0.5, 0.5, Grip.RELEASE], abs=1e-6)  # recovery and arrival, limited to 10 cm/s
    assert robot.act() == pytest.approx([0.4, 0.4, Grip.RELEASE], abs=1e-6)


def test_starting_within_tolerance_is_an_arrival_unless_the_quirk_is_on():
    for quirk, activity in ((False, Activity.WAIT_PICKUP), (True, Activity.ACQUIRE)):
        robot = Robot(DPOPolicy(object_tolerance_m=0.5), quirks=Quirks(finisher_tolerance_mismatch=quirk))
        robot.seen.window({(2, 0): 7})
        robot.seen.ground("object")
        robot.act()
        assert robot.activity is activity


# CPFA


@pytest.mark.parametrize("rate", [0.0, 4.0, 20.0])
def test_the_poisson_distribution_is_that_of_scipy(rate):
    for count in range(25):
        assert poisson_cdf(count, rate) == pytest.approx(stats.poisson.cdf(count, rate), rel=1e-12)


def constants_of(**parameters):
    return kernel_constants(CPFAParameters(**parameters), make_spec(), search_step_ticks=5)[0]


def test_an_informed_search_begins_in_any_direction_and_becomes_like_the_other():
    c = constants_of(uninformed_turn_rad=0.5, informed_decay_per_tick=0.1)
    assert search_turn_rad(True, 0, c) == pytest.approx(4.0 * math.pi)
    assert search_turn_rad(True, 10, c) == pytest.approx(0.5 + (4.0 * math.pi - 0.5) / math.e)
    assert search_turn_rad(True, 1000, c) == pytest.approx(0.5)
    assert {search_turn_rad(False, ticks, c) for ticks in (0, 10, 1000)} == {0.5}


def test_turns_are_normally_distributed():
    draws = np.random.default_rng(1).random((2000, 2))
    assert stats.kstest([normal(u, v) for u, v in draws], "norm").pvalue > 0.01
    assert normal(0.0, 0.3) == 0.0
    assert math.isfinite(normal(np.nextafter(1.0, 0.0), 0.0))


@pytest.mark.parametrize(
    ("degrees", "goal"),
    [
        (0.0, (31.5, 5.0)),
        (180.0, (0.5, 5.0)),
        (90.0, (10.0, 15.5)),
        (-90.0, (10.0, 0.5)),
        (45.0, (20.5, 15.5)),
        (135.0, (0.5, 14.5)),
    ],
)
def test_a_new_direction_ends_before_the_wall(degrees, goal):
    seen, robot = Observations(make_spec()), new_robots(1)[0]
    seen.pose(10.0, 5.0)
    c = constants_of(wall_margin_m=0.5)
    aim_at_wall(robot, sense(seen.array[0], c), math.radians(degrees), c)
    assert (robot.goal_x_m, robot.goal_y_m) == pytest.approx(goal, abs=1e-5)


def test_it_returns_to_where_it_found_many():
    """No search begins and none is given up by chance, unless told."""
    robot = Robot(CPFAPolicy(search_per_tick=0.0, give_up_per_tick=0.0, site_fidelity_rate=2.0))
    seen, site = robot.seen, (20.0, 8.0)
    robot.act()
    seen.pose(*robot.goal)
    robot.act()
    seen.pose(*site)
    seen.ground("object")
    robot.act()
    assert robot.activity is Activity.WAIT_PICKUP
    seen.ground("floor")
    seen.window({(k % 5 - 2, k // 5 - 2): k for k in range(10)})
    seen.event(Event.PICKED_UP)
    seen.carry(50)
    robot.act()
    seen.event(Event.NONE)
    seen.window({})
    assert robot.record["n_nearby"] == 10
    assert robot.policy.describe_memories().place_m.tolist() == [pytest.approx(site, abs=1e-5)]
    seen.ground("nest")
    seen.pose(3.2, 8.0)
    robot.act(2)
    assert robot.activity is Activity.WAIT_DROP
    seen.event(Event.DELIVERED)
    seen.carry(None)
    robot.act()
    seen.event(Event.NONE)
    seen.ground("floor")
    assert robot.record["stage"] == Stage.TRAVEL
    assert robot.goal == pytest.approx(site, abs=1e-5)
    robot.policy._constants["search_per_tick"] = 1.0
    robot.act(20)
    assert robot.record["stage"] == Stage.TRAVEL, "only trips in a new direction end by chance"
    seen.pose(*robot.goal)
    robot.act()
    assert robot.record["stage"] == Stage.SEARCH
    assert robot.record["is_informed"]
    told = robot.policy.describe_robots()
    assert told.words[told.activity[0]] == "searching"
