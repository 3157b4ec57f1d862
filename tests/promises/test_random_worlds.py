"""In worlds made at random everything holds that is promised of a run, and wrong calls change nothing.

A short look in every test run; `scripts/fuzz worlds` visits as many as fit into a time.
"""

from random import Random

import pytest

from tests.support.random_worlds import random_world, visit

pytestmark = pytest.mark.compiled


@pytest.mark.parametrize("first", range(0, 18, 6))
def test_everything_holds_in_random_worlds(first):
    for number in range(first, first + 6):
        seen = visit(random_world(Random(number), most_ticks=40))
        assert not seen.fault, f"world {number}: {seen.fault}"
        assert seen.figures["ticks"] > 0


def test_the_same_number_gives_the_same_world():
    assert random_world(Random(5)) == random_world(Random(5))
    assert random_world(Random(5)) != random_world(Random(6))
