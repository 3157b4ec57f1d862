"""Cache memory: what is remembered, what is forgotten when, and what is left alone."""

import pytest

from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.memories import caches_of
from tests.support.task_robot import TaskRobot

CENTRE = (72, 40)
"""Centre cell of a cache of 31 x 31 cells: x 57 .. 87, y 25 .. 55, which is 11.4 .. 17.6 m by 5.0 .. 11.2 m."""
CACHE_SEEN = (7, CENTRE, 12)


def stand(robot: TaskRobot, cell: tuple[int, int], *caches) -> None:
    robot.seen.pose((cell[0] + 0.5) * 0.2, (cell[1] + 0.5) * 0.2)
    robot.seen.caches(*caches)
    robot.act()


def test_a_cache_is_remembered_with_place_count_and_decaying_density():
    robot = TaskRobot()
    stand(robot, (56, 40), CACHE_SEEN)
    assert caches_of(robot.policy, 0) == {7: (72, 40, 12, pytest.approx(1 - 1e-5))}
    stand(robot, (40, 40))
    stand(robot, (40, 40))
    assert caches_of(robot.policy, 0) == {7: (72, 40, 12, pytest.approx((1 - 1e-5) ** 3, abs=1e-12))}
    stand(robot, (56, 40), (7, CENTRE, 11))
    assert caches_of(robot.policy, 0) == {7: (72, 40, 11, pytest.approx(1 - 1e-5))}
    assert robot.record.n_caches == 1


@pytest.mark.parametrize(
    ("cell", "forgets"),
    [
        ((55, 40), True),
        ((54, 40), False),
        ((89, 40), True),
        ((90, 40), False),
        ((72, 23), True),
        ((72, 22), False),
        ((72, 57), True),
        ((72, 58), False),
        ((54, 22), False),
    ],
)
def test_a_cache_whose_square_should_be_in_the_window_but_is_not_seen_is_forgotten(cell, forgets):
    robot = TaskRobot()
    stand(robot, (56, 40), CACHE_SEEN)
    stand(robot, cell)
    assert (caches_of(robot.policy, 0) == {}) == forgets


@pytest.mark.parametrize(
    ("cell", "forgets"),
    [
        ((8, 70), False),
        ((9, 70), True),
        ((19, 70), True),
        ((20, 70), False),
        ((100, 2), False),
        ((100, 3), True),
        ((100, 13), True),
        ((100, 14), False),
        ((72, 23), False),
    ],
)
def test_quirk_cache_forget_unit_mismatch_compares_metres_with_cells_in_either_axis(cell, forgets):
    robot = TaskRobot(quirks=Quirks(cache_forget_unit_mismatch=True))
    stand(robot, (56, 40), CACHE_SEEN)
    stand(robot, cell)
    assert (caches_of(robot.policy, 0) == {}) == forgets


@pytest.mark.parametrize("at_every_sight", [False, True])
def test_quirk_last_cache_at_every_sight(at_every_sight):
    robot = TaskRobot(quirks=Quirks(last_cache_at_every_sight=at_every_sight))
    stand(robot, (56, 40), CACHE_SEEN)
    assert not robot.record.knows_last_cache, "seen once"
    stand(robot, (56, 40), CACHE_SEEN, (8, (30, 40), 5))
    assert robot.record.knows_last_cache == at_every_sight
    robot.record.knows_last_cache = False
    stand(robot, (56, 40), CACHE_SEEN, (8, (30, 40), 5))
    assert not robot.record.knows_last_cache, "two are known"
