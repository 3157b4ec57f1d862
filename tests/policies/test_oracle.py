"""The oracle: its rules one by one, in worlds of a few robots and objects, and that it is no contestant."""

from types import SimpleNamespace

import numpy as np
import pytest

from swarm_forage_env import CheckError, check_policy, scenario
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Grip, ObjectStatus
from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.policies.oracle import OraclePolicy

FREE, CARRIED = ObjectStatus.FREE, ObjectStatus.CARRIED
EAST, WEST = 0.0, np.pi


def commands(robots, objects):
    """What the oracle commands (N, 3) in the small warehouse, whose nest ends in the east at x = 4.8 m.

    Args:
        robots: (x, y, heading, carried object or -1) of each.
        objects: (cell x, cell y, status) of each.
    """
    x, y, heading, carried = np.array(robots).T
    cells = np.array([entry[:2] for entry in objects], np.int32)
    status = np.array([entry[2] for entry in objects], np.int8)
    everyone = np.ones(len(robots), np.bool_)
    swarm = SimpleNamespace(
        position=np.column_stack((x, y)), heading=heading, carried_object=carried.astype(np.int32), present=everyone
    )
    policy = OraclePolicy()
    policy.reset(SwarmSpec.of(scenario("warehouse_small", n_robots=len(robots))), np.random.default_rng(0))
    policy.see_world(SimpleNamespace(swarm=swarm, objects=SimpleNamespace(cell=cells, status=status)))
    return policy.act(np.zeros((len(robots), 1), np.float32), everyone).copy(), policy


def turn_of(command):
    """1 = left, -1 = right, 0 = straight on."""
    return np.sign(np.round(command[1] - command[0], 6))


def test_an_empty_robot_drives_straight_to_the_nearest_free_object():
    (command,), _ = commands([(10.1, 8.1, EAST, -1)], [(60, 40, FREE), (55, 40, CARRIED), (20, 40, FREE)])
    np.testing.assert_allclose(command, (0.5, 0.5, Grip.GRASP), atol=1e-6)


def test_a_robot_with_an_object_drives_straight_home():
    (command,), _ = commands([(10.0, 8.0, WEST, 0)], [(-1, -1, CARRIED)])
    np.testing.assert_allclose(command, (0.5, 0.5, Grip.DELIVER), atol=1e-6)


def test_whoever_is_nearest_has_an_object_and_the_others_take_the_next():
    robots = [(10.0, 8.1, EAST, -1), (11.0, 8.1, EAST, -1), (12.0, 8.1, EAST, -1)]
    _, policy = commands(robots, [(65, 40, FREE), (80, 40, FREE)])
    np.testing.assert_array_equal(policy._chosen, [-1, 1, 0])


def test_what_another_robot_has_chosen_is_left_to_it():
    robots = [(10.0, 8.1, EAST, -1), (12.0, 8.1, EAST, 1)]
    _, policy = commands(robots, [(65, 40, FREE), (-1, -1, CARRIED), (80, 40, FREE)])
    policy._world.swarm.carried_object[1] = -1
    policy.act(np.zeros((2, 1), np.float32), np.ones(2, np.bool_))
    np.testing.assert_array_equal(policy._chosen, [0, 2])


def test_robots_that_meet_pass_each_other_on_the_right():
    found, _ = commands([(10.0, 8.1, EAST, -1), (10.6, 8.1, WEST, 1)], [(80, 40, FREE), (-1, -1, CARRIED)])
    assert [turn_of(command) for command in found] == [-1, -1]


def test_robots_beside_the_way_or_ahead_in_a_column_are_not_in_the_way():
    objects = [(80, 40, FREE), (81, 40, FREE)]
    beside, _ = commands([(10.0, 8.1, EAST, -1), (10.4, 8.5, EAST, 0)], objects)
    ahead, _ = commands([(10.0, 8.1, EAST, -1), (10.6, 8.1, EAST, -1)], objects)
    assert turn_of(beside[0]) == turn_of(ahead[0]) == 0


def test_without_a_world_it_says_where_it_works():
    policy = OraclePolicy()
    policy.reset(SwarmSpec.of(scenario("warehouse_small", n_robots=2)), np.random.default_rng(0))
    with pytest.raises(ConfigError, match="a run that gives the oracle its world"):
        policy.act(np.zeros((2, 111), np.float32), np.ones(2, np.bool_))


def test_it_is_no_contestant():
    with pytest.raises(CheckError, match="reads the world"):
        check_policy("oracle")
