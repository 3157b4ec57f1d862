"""Who is stuck: robots of a fake policy that drive, stand, tremble, wait by rule or are away."""

import dataclasses
import math
from typing import ClassVar

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Grip
from swarm_forage_env.inspect.stuck import StillnessWatch, StuckRobot, find_stuck, find_stuck_under
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.kernels.interact import FLOOR_PICKUP
from swarm_forage_env.wrappers.base import SwarmWrapper, WrapperConfig
from swarm_forage_env.wrappers.population import PopulationConfig
from swarm_forage_env.wrappers.world import World

FAST = 0.5
"""A wheel command of 10 cm/s."""
A_ROBOT = StuckRobot(
    robot=0,
    from_s=0.0,
    to_s=0.0,
    place_m=(0.0, 0.0),
    carrying=False,
    interfering=False,
    wheels_mps=(0.0, 0.0),
    neighbour_m=math.inf,
    task="",
    state="",
)


class Puppets:
    """Robot k does at time t what `commands(t)[k]` says: (left, right, gripper)."""

    def __init__(self, commands) -> None:
        self.commands = commands

    def reset(self, spec, rng) -> None:
        self.spec, self.ticks = spec, 0

    def act(self, obs, active) -> np.ndarray:
        self.ticks += 1
        return np.array(self.commands(self.ticks * self.spec.dt_s), np.float32)


class TalkingPuppets(Puppets):
    """They also tell their task and state."""

    task = np.array([2, 3], np.int8)

    def describe_robot(self, row: int) -> str:
        return f"puppet {row}"


def spec_of(n_robots: int, seconds: float = 200.0, wrappers=(), **fields) -> RunSpec:
    world = scenario("warehouse_small", n_robots=n_robots, n_objects=8, horizon_s=seconds)
    return RunSpec(world=World(world, wrappers), policy="puppets", **fields)


def circle(robot: int = 0) -> tuple[float, float, float]:
    return (0.6 * FAST, FAST, Grip.RELEASE)


STAND = (0.0, 0.0, Grip.RELEASE)
SPIN = (-FAST, FAST, Grip.RELEASE)


def find(commands, n_robots: int = 2, *, window_s: float = 50.0, policy=Puppets, **fields) -> tuple[StuckRobot, ...]:
    return find_stuck_under(policy(commands), spec_of(n_robots, **fields), window_s=window_s)


def test_robots_that_drive_are_not_stuck():
    assert find(lambda _: [circle(), circle()]) == ()


def test_one_that_stands_is_found_with_its_time_and_place():
    (one,) = find(lambda _: [circle(), STAND], seed=3)
    assert (one.robot, one.from_s, one.to_s) == (1, 0.0, 195.0)
    assert one.wheels_mps == (0.0, 0.0)
    assert 0.0 < one.place_m[0] < 32.0
    assert not one.carrying
    assert (one.task, one.state) == ("", "")


def test_turning_on_the_spot_is_no_way_out():
    (one,) = find(lambda _: [SPIN, circle()])
    assert one.robot == 0
    assert one.wheels_mps == pytest.approx((-0.1, 0.1))


def test_a_stretch_has_a_beginning_and_an_end():
    stands = find(lambda t: [STAND if 40.0 <= t < 120.0 else circle(), circle()])
    assert [one.robot for one in stands] == [0]
    assert 35.0 <= stands[0].from_s <= 45.0
    assert 115.0 <= stands[0].to_s <= 125.0


def test_less_than_the_window_is_no_stretch():
    commands = lambda t: [STAND if 40.0 <= t < 85.0 else circle(), circle()]  # noqa: E731 - one line says it best
    assert find(commands, window_s=60.0) == ()
    assert len(find(commands, window_s=30.0)) == 1


def test_a_policy_may_tell_task_and_state():
    one, other = find(lambda _: [STAND, STAND], policy=TalkingPuppets)
    assert (one.task, one.state) == ("harvester", "puppet 0")
    assert (other.task, other.state) == ("collector", "puppet 1")
    assert one.neighbour_m == other.neighbour_m == pytest.approx(math.dist(one.place_m, other.place_m))


def test_robots_in_repair_are_not_stuck():
    away = PopulationConfig(malfunction_per_tick=1.0, repair_per_tick=0.0)
    assert find(lambda _: [STAND, STAND], wrappers=(away,)) == ()


class Holding(SwarmWrapper):
    """Robot 0 is always in the middle of a pick-up."""

    def after_step(self, tasks, terminated, truncated) -> None:
        self.unwrapped.swarm.pending_kind[0] = FLOOR_PICKUP


@dataclasses.dataclass(frozen=True, kw_only=True, slots=True)
class HoldingConfig(WrapperConfig):
    """Makes `Holding`."""

    name: ClassVar[str] = "holding"
    stack_position: ClassVar[int] = 0

    def wrap(self, env) -> Holding:
        return Holding(env)


def test_robots_that_the_world_keeps_waiting_are_not_stuck():
    (one,) = find(lambda _: [STAND, STAND], wrappers=(HoldingConfig(),))
    assert one.robot == 1


def test_shipped_policies_tell_their_state():
    world = scenario("warehouse_small", n_robots=4, n_objects=8, horizon_s=200.0, caches="dynamic")
    for policy in ("crw", "dpo", "stochx"):
        found = find_stuck(RunSpec(world=World(world), policy=policy), window_s=10.0, moved_m=50.0)
        assert len(found) == 4, "nobody gets out of the arena"
        assert all(one.state.startswith("acquire") for one in found)
        assert {bool(one.task) for one in found} == {policy == "stochx"}


def test_windows_and_distances_are_positive():
    with pytest.raises(ValueError, match="Expected window_s > 0"):
        find(lambda _: [STAND, STAND], window_s=0.0)


def test_a_window_longer_than_the_run_is_refused():
    with pytest.raises(ValueError, match="Expected a window of at most"):
        find(lambda _: [STAND, STAND], window_s=100_000.0)


class TestWatch:
    """The watch alone, one robot on a line, a window of four samples and 1 m."""

    def watch(self, places, counts=None) -> list[tuple[float, float]]:
        watch = StillnessWatch(1, 4, 1.0, lambda robot: dataclasses.replace(A_ROBOT, robot=robot))
        for time, x in enumerate(places):
            is_counted = np.array([counts is None or counts[time]])
            watch.look(float(time), np.array([[x, 0.0]]), is_counted)
        return [(one.from_s, one.to_s) for one in [*watch.closed, *watch.open.values()]]

    def test_still_all_along(self):
        assert self.watch([0.0] * 8) == [(0.0, 7.0)]

    def test_trembling_within_the_distance(self):
        assert self.watch([0.0, 0.9, -0.9, 0.0, 0.9]) == [(0.0, 3.0)]

    def test_there_and_back_is_a_move(self):
        assert self.watch([0.0, 0.0, 1.5, 0.0, 0.0, 0.0]) == []

    def test_a_slow_drift_is_a_move(self):
        assert self.watch([0.4 * k for k in range(10)]) == []

    def test_what_is_not_counted_begins_anew(self):
        counts = [True] * 3 + [False] + [True] * 5
        assert self.watch([0.0] * 9, counts) == [(4.0, 8.0)]
