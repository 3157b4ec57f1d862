"""In worlds made at random everything holds that is promised of a run, and wrong calls change nothing.

A short look in every test run; CASES=1000 visits as many.
"""

import os
from collections import Counter
from random import Random

import pytest

from swarm_forage_env._internal.fields import ConfigError
from tests.support.random_scenarios import random_scenario
from tests.support.random_worlds import random_world, visit

CASES = int(os.environ.get("CASES", "18"))


@pytest.mark.parametrize("first", range(0, CASES, 6))
def test_everything_holds_in_random_worlds(first):
    for number in range(first, first + 6):
        seen = visit(random_world(Random(number), most_ticks=40))
        assert not seen.fault, f"world {number}: {seen.fault}"
        assert seen.figures["ticks"] > 0


def test_the_same_number_gives_the_same_world():
    assert random_world(Random(5)) == random_world(Random(5))
    assert random_world(Random(5)) != random_world(Random(6))


def test_every_kind_of_world_is_drawn():
    found: Counter[str] = Counter()
    for number in range(300):
        random = Random(number)
        try:
            config = random_scenario(random, None, 40)
        except ConfigError:
            continue
        found["valid"] += 1
        found["obstacles"] += bool(config.arena.obstacles)
        found["neighbours"] += config.robots.neighbours_seen > 0
        found["messages"] += config.robots.message_size > 0
        found[config.objects.placement] += 1
        found[config.caches] += 1
    assert found["valid"] > 60
    robots = ("neighbours", "messages")
    assert min(found[name] for name in (*robots, "obstacles", "positions")) > 3
    assert min(found[name] for name in ("power_law", "quad_source", "none", "static", "dynamic")) > 3
