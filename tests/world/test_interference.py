"""Interference: which robots lose time to avoidance, measured by one rule from true readings."""

import collections
import math

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Counter, Grip
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import Quirks
from tests.reference import sensing
from tests.support.stage import OPEN_CELL, act, build_cache, cell_centre, lay, put, stand, tidy_world

WORK = (Counter.SEARCHING, Counter.HANDLING, Counter.HOMING, Counter.AT_CACHES, Counter.INTERFERING)
"""What a robot at work can do, one at a time."""
PAIR = ((16.0, 8.0, 0.0), (16.25, 8.0, math.pi))
"""Places and headings of two robots that face each other."""


def met(env: ForageEnv, *rows: int) -> None:
    """Two robots within reach of each other, the others alone."""
    for robot in range(len(env.active)):
        put(env, robot, 6.0 + 2.0 * robot, 12.0)
    for robot, place in zip(rows, PAIR, strict=True):
        put(env, robot, *place)


def test_robots_that_meet_interfere_and_others_do_not():
    env = tidy_world()
    met(env, 1, 3)
    act(env, {})
    assert env.events.interfering.tolist() == [False, True, False, True]
    assert env.events.counters[Counter.INTERFERING] == 2
    assert env.events.interference_sum[0] == pytest.approx(2 / 4)


@pytest.mark.parametrize("quirks", [Quirks(), Quirks(obstacle_behind_counts=True)], ids=["described", "program"])
def test_who_is_behind_interferes_in_the_program_only(quirks):
    env = tidy_world(quirks=quirks)
    met(env, 0, 1)
    put(env, 1, 16.25, 8.0, 0.0)  # turns its back to robot 0
    act(env, {})
    assert env.events.interfering.tolist() == [True, quirks.obstacle_behind_counts, False, False]


def test_an_avoidance_begins_once_and_again_after_a_break():
    env = tidy_world()
    for places in ((), PAIR, PAIR, (), PAIR):
        for robot in range(4):
            put(env, robot, 6.0 + 2.0 * robot, 12.0)
        for robot, place in enumerate(places):
            put(env, robot, *place)
        act(env, {})
    assert env.events.counters[Counter.INTERFERING] == 6
    assert env.events.counters[Counter.AVOIDANCES] == 4


@pytest.mark.parametrize(("away_m", "near"), [(1.9, 1), (2.1, 0)], ids=["near", "farther"])
def test_time_lost_near_a_cache_is_told_from_other_time(away_m, near):
    """Of a pair that stand along a circle around a cache, and of a robot at a wall, the pair alone may be near it."""
    env = tidy_world(caches="dynamic")
    build_cache(env, (0, 1), OPEN_CELL)
    x, y = cell_centre(OPEN_CELL)
    put(env, 0, x + away_m, y, math.pi / 2)
    put(env, 1, x + away_m, y + 0.25, -math.pi / 2)
    put(env, 2, 31.6 - 0.1, 8.0)
    put(env, 3, 6.0, 12.0)
    act(env, {})
    assert env.events.interfering.tolist() == [True, True, True, False]
    assert env.events.counters[Counter.INTERFERING_NEAR_CACHES] == 2 * near


def test_time_of_robots_is_divided_by_what_they_do():
    """Robot 0 lays hands on an object for three ticks and carries it; robots 1 and 2 avoid each other; 3 searches."""
    env = tidy_world(pickup_ticks=3)
    met(env, 1, 2)
    lay(env, 0, (30, 20))
    stand(env, 0, (30, 20))
    for _ in range(6):
        act(env, {0: Grip.GRASP})
    counted = {counter: int(env.events.counters[counter]) for counter in WORK}
    # Seen before the grippers move: the request of the first tick counts from the second on.
    assert counted == {
        Counter.SEARCHING: 6 + 1,
        Counter.HANDLING: 3,
        Counter.HOMING: 2,
        Counter.AT_CACHES: 0,
        Counter.INTERFERING: 12,
    }


def test_flags_and_sums_equal_those_of_the_slow_rule_on_slow_readings():
    """Sixty robots with 24 beams each against all others, in Python: it takes three seconds."""
    env = ForageEnv(scenario("warehouse_small", n_robots=60, n_objects=400, start_margin_m=6.5, caches="static"))
    env.reset_batch(2)
    present, active = np.arange(60) % 12 != 0, np.arange(60) % 6 != 0
    env.set_population(active=active, present=present)
    rng = np.random.default_rng(2)
    counted, share, before = collections.Counter[Counter](), 0.0, [False] * 60
    for _ in range(20):
        robots_do = [sensing.work(env.swarm, robot) for robot in range(60)]  # before the grippers of the tick move
        env.step_batch(rng.uniform(-1, 1, (60, 3)).astype(np.float32))
        expected = [sensing.interferes(env, robot) for robot in range(60)]
        assert env.events.interfering.tolist() == expected
        counted[Counter.INTERFERING] += sum(expected)
        counted[Counter.INTERFERING_NEAR_CACHES] += sum(
            flag and sensing.is_near_cache(env, robot) for robot, flag in enumerate(expected)
        )
        counted[Counter.AVOIDANCES] += sum(now and not then for now, then in zip(expected, before, strict=True))
        counted.update(robots_do[robot] for robot in range(60) if active[robot] and not expected[robot])
        share += sum(expected) / 50
        before = expected
    assert counted[Counter.INTERFERING] > counted[Counter.AVOIDANCES] > 10
    known = (*WORK, Counter.AVOIDANCES, Counter.INTERFERING_NEAR_CACHES)
    assert {counter: int(env.events.counters[counter]) for counter in known} == {
        counter: counted[counter] for counter in known
    }
    assert min(counted[counter] for counter in known) > 0, "the test knows each of them"
    assert counted[Counter.INTERFERING_NEAR_CACHES] < counted[Counter.INTERFERING]
    assert env.events.interference_sum[0] == pytest.approx(share)
    assert [int(env.events.counters[c]) for c in (Counter.ACTIVE, Counter.PRESENT)] == [20 * 50, 20 * 55]
