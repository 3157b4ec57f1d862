"""Compiled bodies: their slow twin, Chipmunk as the oracle, order and symmetry, room for pairs."""

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.bodies import PAIRS_PER_ROBOT
from swarm_forage_env.world.kernels.bodies import find_pairs, move_bodies, tell_poses
from swarm_forage_env.world.kernels.drive import sinc_and_cosine
from swarm_forage_env.world.state import SwarmState
from tests.reference.bodies import moved
from tests.support.engines import drive_at, make_bodies
from tests.support.heaps import DIAMETER_M, RADIUS_M, heap

MIDDLE = np.array([16.0, 8.0])
CORNER = np.array([31.6, 15.8])
"""Corner of the free floor of the small warehouse, upper right."""


def bodies_at(places, heading, physics="compiled", **overrides):
    """Bodies of robots that are there, and their state."""
    config = scenario("warehouse_small", n_robots=len(places), physics=physics, **overrides)
    swarm = SwarmState.empty(len(places))
    swarm.position[:], swarm.heading[:] = places, heading
    swarm.facing[:] = np.column_stack((np.cos(heading), np.sin(heading)))
    return make_bodies(config, swarm), swarm


def poses_of(bodies):
    return [tuple(pose) for pose in bodies.poses()[:-1].tolist()]


# The twin


@pytest.mark.parametrize(("seed", "at_wall"), [(0, False), (1, True)])
def test_compiled_bodies_are_their_slow_twin(seed, at_wall):
    rng = np.random.default_rng(seed)
    n_robots = 24
    places = heap(rng, n_robots)
    places += CORNER - 0.9 * RADIUS_M - places.max(axis=0) if at_wall else MIDDLE
    bodies, swarm = bodies_at(places, rng.uniform(-3, 3, n_robots))
    swarm.present[:] = rng.random(n_robots) < 0.9
    before, n_contacts, n_walls = {}, 0, 0
    for tick in range(12):
        if tick % 3 == 0:
            bodies.twist[:-1] = rng.uniform(-0.05, 0.05, (n_robots, 3)) * (1.0, 1.0, 10.0)
            bodies.twist[:-1, :2] += 0.2 * ((CORNER if at_wall else MIDDLE) - swarm.position)
        expected, before = moved(
            poses_of(bodies), bodies.twist[:-1].tolist(), swarm.present.tolist(), *bodies_sizes(bodies), before
        )
        n_contacts, n_walls = n_contacts + len(before), n_walls + sum(type(wall) is str for _, wall in before)
        bodies.look(swarm)
        assert move_bodies(bodies.state, bodies.twist, swarm.present, 0.2)
        np.testing.assert_allclose(poses_of(bodies), expected, atol=1e-11)
        tell_poses(bodies.poses(), swarm.present, swarm.position, swarm.heading, swarm.facing)
    assert n_contacts > 150
    assert (n_walls > 20) == at_wall


def bodies_sizes(bodies):
    return tuple(bodies.state.room.tolist()), (bodies.state.radius_m, 0.2, bodies.state.n_substeps)


@pytest.mark.parametrize("speed", [0.1, 0.4])
def test_all_pairs_within_sight_are_found_in_order(speed):
    rng = np.random.default_rng(0)
    bodies, swarm = bodies_at(MIDDLE + rng.uniform(-2, 2, (150, 2)), np.zeros(150))
    swarm.present[:] = rng.random(150) < 0.9
    bodies.look(swarm)
    sight_m = 2 * RADIUS_M + 2 * speed * 0.2
    pairs = np.zeros((2_000, 2), np.int32)
    n_pairs = find_pairs(bodies.poses(), swarm.present, bodies.sensors.near, bodies.sensors.bins, sight_m, pairs)
    apart = np.linalg.norm(swarm.position[:, None] - swarm.position[None], axis=2)
    apart[~swarm.present], apart[:, ~swarm.present] = math.inf, math.inf
    np.testing.assert_array_equal(pairs[:n_pairs], np.argwhere(np.triu(apart <= sight_m, k=1)))
    assert n_pairs > 80


# The oracle

SCENES = {
    "head-on": ([(0.0, 0.0), (0.2, 0.0)], [0.0, math.pi], [0.1, 0.1]),
    "oblique": ([(0.0, 0.0), (0.2, 0.08)], [0.0, math.pi], [0.1, 0.07]),
    "from behind": ([(0.0, 0.0), (0.19, 0.03)], [0.0, 0.2], [0.1, 0.03]),
    "one stands": ([(0.0, 0.0), (0.2, 0.03)], [0.0, 0.0], [0.1, 0.0]),
    "three in a row": ([(0.0, 0.0), (0.18, 0.0), (0.36, 0.0)], [0.0, 0.0, math.pi], [0.1, 0.0, 0.06]),
}
TOLERATED_M = 1e-9
"""What both engines may differ in 40 ticks; the deepest overlap is 6 % of a diameter, 1 cm."""


def tracks(physics, places, heading, speed, ticks=40):
    bodies, swarm = bodies_at(places, heading, physics)
    seen = []
    for _ in range(ticks):
        drive_at(bodies, swarm, np.array(heading), np.array(speed))
        seen.append(np.column_stack((swarm.position, bodies.poses()[:-1, 2])))
    return np.array(seen)


@pytest.mark.parametrize(("name", "angle"), [*zip(SCENES, itertools.cycle((0.7, 0.0)), strict=False)])
def test_single_contacts_are_those_of_chipmunk(name, angle):
    places, heading, speed = SCENES[name]
    turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
    scene = (MIDDLE + np.array(places) @ turn, [one + angle for one in heading], speed)
    chipmunk, compiled = (tracks(physics, *scene) for physics in ("chipmunk", "compiled"))
    np.testing.assert_allclose(compiled, chipmunk, atol=TOLERATED_M)
    free = scene[0] + 8.0 * np.array(speed)[:, None] * np.column_stack((np.cos(scene[1]), np.sin(scene[1])))
    assert np.abs(compiled[-1, :, :2] - free).max() > 0.01, "they touched"


@pytest.mark.parametrize("heading", [0.3, 2.0, -2.5])
@pytest.mark.parametrize("place", [(31.5, 15.7), (0.3, 8.0), (16.0, 0.3)])
def test_a_disc_at_a_wall_moves_as_in_chipmunk(place, heading):
    chipmunk, compiled = (tracks(physics, [place], [heading], [0.1]) for physics in ("chipmunk", "compiled"))
    np.testing.assert_allclose(compiled, chipmunk, atol=TOLERATED_M)


# Order, symmetry, determinism


def run_heap(places, twists, present=None, place=MIDDLE):
    bodies, swarm = bodies_at(place + places, np.zeros(len(places)))
    if present is not None:
        swarm.present[:] = present
    for twist in twists:
        bodies.twist[:-1] = twist
        bodies.advance(swarm)
    return swarm.position - place


def test_absent_robots_touch_nobody_and_stay():
    places = np.array([(0.0, 0.0), (0.05, 0.0), (0.1, 0.02)])
    twists = np.tile([(0.05, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0)], (10, 1, 1))
    ended = run_heap(places, twists, present=[True, False, False])
    np.testing.assert_allclose(ended, places + np.array([(0.1, 0.0), (0.0, 0.0), (0.0, 0.0)]), atol=1e-12)


# Turning


@pytest.mark.parametrize("angle", [0.0, 1e-9, -0.3, 0.4999, 0.51, -3.0])
def test_sine_and_cosine_are_those_of_the_library(angle):
    sinc, cosine = sinc_and_cosine(angle)
    assert (angle * sinc, cosine) == pytest.approx((math.sin(angle), math.cos(angle)), rel=1e-15, abs=1e-17)


def test_facing_stays_the_direction_of_the_heading_for_a_whole_run():
    bodies, swarm = bodies_at([(16.0, 8.0), (12.0, 8.0)], [3.0, -3.0])
    rng = np.random.default_rng(0)
    for _ in range(1_000):
        bodies.twist[:-1, 2] = rng.uniform(-1.4, 1.4, 2)
        bodies.advance(swarm)
    expected = np.column_stack((np.cos(swarm.heading), np.sin(swarm.heading)))
    np.testing.assert_allclose(swarm.facing, expected, rtol=0, atol=1e-12)


# Nobody is missed, nothing overflows


def test_a_pile_gets_more_room_for_pairs_and_keeps_its_impulses():
    n_robots = 20
    rng = np.random.default_rng(0)
    piled, swarm = bodies_at(MIDDLE + rng.uniform(-0.05, 0.05, (n_robots, 2)), np.zeros(n_robots))
    roomy, same = bodies_at(swarm.position, np.zeros(n_robots))
    while len(roomy.state.pairs) < n_robots**2:
        roomy.make_room()
    assert n_robots * (n_robots - 1) // 2 > PAIRS_PER_ROBOT * n_robots
    for _ in range(15):
        for bodies, state in ((piled, swarm), (roomy, same)):
            bodies.twist[:-1] = (0.05, 0.0, 0.0)
            bodies.advance(state)
    np.testing.assert_array_equal(swarm.position, same.position)
    assert pdist(swarm.position).min() > 0.9 * DIAMETER_M, "they are pushed apart"
