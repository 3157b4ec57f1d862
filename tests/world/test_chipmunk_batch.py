"""Rows of the batch in which Chipmunk is read and written."""

import itertools

import numpy as np

from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.chipmunk import ChipmunkBodies
from swarm_forage_env.world.state import SwarmState
from tests.support.engines import drive_at


def test_batch_rows_are_the_bodies_in_order():
    rng = np.random.default_rng(0)
    cells = np.array(list(itertools.product(range(6), range(5))))
    swarm = SwarmState.empty(30)
    swarm.position[:], swarm.heading[:] = rng.permutation(cells) * 0.3 + (4.0, 4.0), rng.uniform(-3, 3, 30)
    physics = ChipmunkBodies(scenario("warehouse_small", n_robots=30), swarm.position, swarm.heading)
    assert len(physics.twist) == 31, "the space's own static body comes last"
    physics.park(3)
    swarm.present[3] = False
    for _ in range(20):
        swarm.heading[:] += rng.uniform(-0.5, 0.5, 30)
        drive_at(physics, swarm, swarm.heading, 0.10)
        physics.twist[:] = 0.0
    bodies = [disc.body for disc in physics._shapes]
    expected = np.array([(*body.position, body.angle) for body in bodies])
    np.testing.assert_array_equal(physics.poses()[:-1], expected)
    np.testing.assert_array_equal(swarm.position[swarm.present], expected[swarm.present, :2])
