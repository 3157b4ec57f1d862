"""CPFA: its rules one by one, its stages, and the compiled controller beside the slow one."""

import math

import numpy as np
import pytest
from scipy import stats

from baselines.cpfa import (
    CPFA_DRAWS,
    CPFAParameters,
    CPFAPolicy,
    Stage,
    aim_at_wall,
    normal,
    poisson_cdf,
    search_turn_rad,
)
from baselines.parameters import kernel_constants
from baselines.robots import Activity, new_robots, sense
from swarm_forage_env.contract.codes import Event
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, Quirks
from tests.baselines.test_controller_twins import Fuzz
from tests.reference.cpfa import CPFARobot
from tests.support.observations import Observations, make_spec

SITE = (20.0, 8.0)
NEST = (3.2, 8.0)


@pytest.mark.parametrize("rate", [0.0, 0.3, 4.0, 20.0])
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


class Robot:
    """A single robot under CPFA, which never begins a search nor gives one up by chance unless told."""

    def __init__(self, spec=None, **parameters):
        self.seen = Observations(spec or make_spec())
        self.policy = CPFAPolicy(**{"search_per_tick": 0.0, "give_up_per_tick": 0.0, **parameters})
        self.policy.reset(self.seen.spec, np.random.default_rng(5))

    def act(self, ticks: int = 1) -> np.ndarray:
        for _ in range(ticks):
            action = self.policy.act(self.seen.array, np.ones(1, np.bool_))[0].copy()
        return action

    @property
    def record(self) -> np.record:
        return self.policy._robots[0]

    @property
    def stage(self) -> Stage:
        assert self.activity is Activity.ACQUIRE
        return Stage(int(self.record["stage"]))

    @property
    def activity(self) -> Activity:
        return Activity(int(self.policy.activity[0]))

    @property
    def goal(self) -> tuple[float, float]:
        return float(self.record["goal_x_m"]), float(self.record["goal_y_m"])

    @property
    def word(self) -> str:
        states = self.policy.describe_robots()
        return states.words[states.activity[0]]

    def arrive(self) -> None:
        self.seen.pose(*self.goal)
        self.act()

    def pick_up(self, n_nearby: int = 0) -> None:
        """Find an object at the site among others, and take it."""
        self.arrive()
        self.seen.pose(*SITE)
        self.seen.ground("object")
        self.act()
        assert self.activity is Activity.WAIT_PICKUP
        self.seen.ground("floor")
        self.seen.window({(k % 5 - 2, k // 5 - 2): k for k in range(n_nearby)})
        self.seen.event(Event.PICKED_UP)
        self.seen.carry(50)
        self.act()
        self.seen.event(Event.NONE)
        self.seen.window({})

    def deliver(self) -> None:
        self.seen.ground("nest")
        self.seen.pose(*NEST)
        self.act(2)
        assert self.activity is Activity.WAIT_DROP
        self.seen.event(Event.DELIVERED)
        self.seen.carry(None)
        self.act()
        self.seen.event(Event.NONE)
        self.seen.ground("floor")


def test_it_returns_to_where_it_found_many():
    robot = Robot(site_fidelity_rate=2.0)
    robot.act()
    robot.pick_up(n_nearby=10)
    assert robot.record["n_nearby"] == 10
    assert robot.policy.describe_memories().place_m.tolist() == [pytest.approx(SITE, abs=1e-5)]
    robot.deliver()
    assert robot.stage is Stage.TRAVEL
    assert robot.goal == pytest.approx(SITE, abs=1e-5)
    robot.policy._constants["search_per_tick"] = 1.0
    robot.act(20)
    assert robot.stage is Stage.TRAVEL, "only trips in a new direction end by chance"
    robot.arrive()
    assert robot.stage is Stage.SEARCH
    assert robot.record["is_informed"]


OFTEN = {"search_per_tick": 0.1, "give_up_per_tick": 0.02, "site_fidelity_rate": 0.5, "informed_decay_per_tick": 0.05}


@pytest.mark.parametrize("quirks", [Quirks(), AUTHORS_PROGRAM], ids=["as described", "authors' program"])
def test_compiled_controller_acts_like_the_slow_one(quirks):
    n_robots = 6
    spec = make_spec(n_robots, quirks=quirks)
    parameters = CPFAParameters(**OFTEN)
    fuzz, policy = Fuzz(spec, seed=1), CPFAPolicy(parameters)
    policy.reset(spec, np.random.default_rng(2))
    draws_again = np.random.default_rng(2)
    twins = [CPFARobot(spec, parameters=parameters) for _ in range(n_robots)]
    met: set[tuple[str, str, bool]] = set()
    for _ in range(1500):
        for i, twin in enumerate(twins):
            fuzz.perturb(i, twin.goal)
        active = fuzz.rng.random(n_robots) < 0.95
        actions = policy.act(fuzz.seen.array, active)
        draws = draws_again.random((n_robots, CPFA_DRAWS))
        for i in np.flatnonzero(active):
            assert actions[i, :3] == pytest.approx(twins[i].act(fuzz.seen.array[i], draws[i]), abs=2e-6)
        robots = policy._robots
        assert [Stage(int(code)).name.lower().replace("_", " ") for code in robots["stage"]] == [
            twin.stage for twin in twins
        ]
        assert robots["has_site"].tolist() == [twin.site is not None for twin in twins]
        met |= {(twin.stage, twin.vector, twin.informed) for twin in twins if twin.state == "acquire"}
    for informed in (False, True):
        assert met >= {("search", "idle", informed), ("search", "vector", informed), ("travel", "vector", informed)}
    assert {stage for stage, _, _ in met} >= {"give up", "search", "travel"}
