"""Memory of objects, against a dictionary whose every density decays in every tick; memory of caches, by hand."""

import numpy as np
import pytest

from baselines.dpo import DPOPolicy
from baselines.memory import with_room
from swarm_forage_env.scenarios.quirks import Quirks
from tests.reference.controllers import ObjectDictionary, visible_objects
from tests.support.observations import Observations, make_spec
from tests.support.task_robot import TaskRobot, caches_of, objects_of

CENTRE = (72, 40)
"""Centre cell of a cache of 31 x 31 cells: x 57 .. 87, y 25 .. 55, which is 11.4 .. 17.6 m by 5.0 .. 11.2 m."""
CACHE_SEEN = (7, CENTRE, 12)


def new_policy(task) -> DPOPolicy:
    policy = DPOPolicy()
    policy.reset(task, np.random.default_rng(0))
    return policy


def test_lists_grow_and_lose_nothing():
    lists = np.arange(6).reshape(2, 3)
    assert with_room(lists, np.array([1, 2]), 1) is lists
    assert with_room(lists, np.array([3, 0]), 1).tolist() == [[0, 1, 2, 0], [3, 4, 5, 0]]
    assert with_room(lists, np.array([3, 0]), 9, at_most=5).shape == (2, 5)


def test_memory_equals_the_naive_rule(monkeypatch):
    """Robots walk over a patch on which objects move, vanish, come back; some ticks are slept through."""
    monkeypatch.setattr("baselines.memory._MOST_LISTS", 4)  # objects share lists, as thousands of them do
    rng = np.random.default_rng(0)
    n_robots, n_objects, side, ticks = 4, 40, 14, 400
    task = make_spec(n_robots, n_objects=n_objects)
    observations = Observations(task)
    policy = new_policy(task)
    twins = [ObjectDictionary() for _ in range(n_robots)]
    places = rng.choice(side * side, n_objects, replace=False)
    present = rng.random(n_objects) < 0.7
    robots = rng.integers(0, side, (n_robots, 2))
    for _ in range(ticks):
        robots = np.clip(robots + rng.integers(-1, 2, robots.shape) * (rng.random((n_robots, 1)) < 0.3), 0, side - 1)
        if rng.random() < 0.4:
            moved = rng.integers(n_objects)
            present[moved] = rng.random() < 0.7
            free = np.setdiff1d(np.arange(side * side), places)
            places[moved] = rng.choice(free)
        active = rng.random(n_robots) < 0.9
        for i, (cell_x, cell_y) in enumerate(robots):
            observations.pose((100 + cell_x + 0.5) * 0.2, (20 + cell_y + 0.5) * 0.2, robots=i)
            objects = {
                (int(place % side - cell_x), int(place // side - cell_y)): row
                for row, place in enumerate(places)
                if present[row]
            }
            observations.window({at: row for at, row in objects.items() if max(map(abs, at)) <= 2}, robots=i)
        policy.act(observations.array, active)
        for i in np.flatnonzero(active):
            senses = {name: observations.get(name, i).astype(float) for name in ("los_cell", "los_object")}
            twins[i].update(*visible_objects(task, senses))
        for i, twin in enumerate(twins):
            known = objects_of(policy, i)
            assert policy._robots["n_known"][i] == len(twin.known), "each once"
            assert {row: entry[:2] for row, entry in known.items()} == {
                row: cell for row, (cell, _) in twin.known.items()
            }
            for row, entry in known.items():
                assert entry[2] == pytest.approx(twin.known[row][1], abs=1e-12)
    assert policy._robots["n_known"].min() > 5


# Caches


def stand(robot: TaskRobot, cell: tuple[int, int], *caches) -> None:
    robot.seen.pose((cell[0] + 0.5) * 0.2, (cell[1] + 0.5) * 0.2)
    robot.seen.caches(*caches)
    robot.act()


@pytest.mark.parametrize(
    ("cell", "forgets"),
    [
        ((55, 40), True),
        ((54, 40), False),
        ((90, 40), False),
        ((72, 57), True),
        ((72, 58), False),
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
        ((20, 70), False),
        ((100, 13), True),
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
