"""Cache memory: what is remembered, what is forgotten when, and what is left alone."""

import pytest

from baselines.cache_memory import is_listed, shun_cache, stop_shunning_caches
from swarm_forage_env.scenarios.quirks import Quirks
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
    assert robot.policy.remembered_caches(0) == {7: (72, 40, 12, pytest.approx(1 - 1e-5))}
    stand(robot, (40, 40))
    stand(robot, (40, 40))
    assert robot.policy.remembered_caches(0) == {7: (72, 40, 12, pytest.approx((1 - 1e-5) ** 3, abs=1e-12))}
    stand(robot, (56, 40), (7, CENTRE, 11))
    assert robot.policy.remembered_caches(0) == {7: (72, 40, 11, pytest.approx(1 - 1e-5))}
    assert robot.policy.n_caches.tolist() == [1]


def test_a_new_cache_on_the_same_cell_replaces_the_old_one_with_all_that_was_held_against_it():
    robot = TaskRobot()
    stand(robot, (56, 40), CACHE_SEEN)
    robot.memory.caches[0].has_refused = True
    stand(robot, (56, 40), CACHE_SEEN)
    assert robot.memory.caches[0].has_refused
    stand(robot, (56, 40), (8, CENTRE, 3))
    assert list(robot.policy.remembered_caches(0)) == [8]
    assert not robot.memory.caches[0].has_refused


def test_objects_on_the_square_of_a_cache_are_forgotten():
    robot = TaskRobot()
    for row, cell in enumerate([(57, 25), (87, 55), (72, 40), (56, 40), (88, 40), (72, 56)]):
        robot.know_object(row, cell)
    stand(robot, (20, 20), CACHE_SEEN)
    assert set(robot.memory.objects.row[: robot.record.n_known].tolist()) == {3, 4, 5}


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
    assert (robot.policy.remembered_caches(0) == {}) == forgets


@pytest.mark.parametrize(
    ("reach", "cell", "forgets"),
    [
        (1, (55, 40), False),
        (1, (56, 40), True),
        (1, (72, 57), False),
        (1, (72, 56), True),
        (0, (56, 40), False),
        (0, (57, 40), True),
        (-1, (72, 40), False),
    ],
)
def test_robots_of_a_kind_forget_only_caches_that_they_could_see(reach, cell, forgets):
    robot = TaskRobot(cache_reach_cells=(reach,))
    stand(robot, (60, 40), CACHE_SEEN)
    stand(robot, cell)
    assert (robot.policy.remembered_caches(0) == {}) == forgets


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
    assert (robot.policy.remembered_caches(0) == {}) == forgets


def test_a_listed_cache_is_not_forgotten_under_the_quirk():
    robot = TaskRobot(quirks=Quirks(cache_forget_unit_mismatch=True))
    stand(robot, (10, 40), CACHE_SEEN)
    stand(robot, (10, 40), CACHE_SEEN)
    assert list(robot.policy.remembered_caches(0)) == [7]


def test_the_place_of_the_last_cache_is_kept():
    robot = TaskRobot()
    stand(robot, (56, 40), CACHE_SEEN, (8, (30, 40), 5))
    stand(robot, (30, 40))
    assert list(robot.policy.remembered_caches(0)) == [7]
    assert not robot.record.knows_last_cache, "another cache is still known"
    stand(robot, (72, 40))
    assert robot.record.knows_last_cache
    assert (robot.record.last_cache_x_m, robot.record.last_cache_y_m) == pytest.approx((14.5, 8.1))


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


def test_a_full_memory_gives_up_the_cache_unseen_for_longest():
    robot = TaskRobot()
    room = len(robot.memory.caches)
    assert room == 2 * 5 * 2, "twice the 6.2 m squares that fit into 32 x 16 m"
    for k in range(room):
        robot.record.clock = 10 + k
        robot.know_cache(k + 1, (20 + 3 * k, 40), 5)
    robot.record.clock = 3
    robot.know_cache(9, (20 + 3 * 8, 40), 5)  # seen, by its clock, before all others
    robot.record.clock = 100
    robot.know_cache(50, (110, 40), 5)
    serials = set(robot.policy.remembered_caches(0))
    assert serials == set(range(1, room + 1)) - {9} | {50}


def test_caches_are_left_alone_by_identity_and_each_is_listed_once():
    robot = TaskRobot()
    serials = robot.memory.shunned_caches[0]
    assert len(serials) == len(robot.memory.caches)
    for serial in (7, 9, 7, 0):
        shun_cache(robot.record, serials, serial)
    assert serials[:3].tolist() == [9, 7, 0]
    assert [is_listed(serial, serials) for serial in (7, 8, 9, 0)] == [True, False, True, False]
    stop_shunning_caches(robot.memory.shunned_caches)
    assert not is_listed(7, serials)


def test_no_cache_is_no_entry():
    robot = TaskRobot()
    shun_cache(robot.record, robot.memory.shunned_caches[0], 0)
    assert not robot.record.shunned_cache_in_task
    shun_cache(robot.record, robot.memory.shunned_caches[0], 4)
    assert robot.record.shunned_cache_in_task


def test_a_full_list_of_caches_to_be_left_alone_loses_the_first():
    robot = TaskRobot()
    serials = robot.memory.shunned_caches[1]
    for serial in range(1, len(serials) + 2):
        shun_cache(robot.record, serials, serial)
    assert serials.tolist() == list(range(len(serials) + 1, 1, -1))
