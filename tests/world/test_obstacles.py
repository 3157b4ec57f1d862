"""Obstacles in the world: bodies, beams, objects, start poses and births keep out of them, in both engines."""

import math

import numpy as np
import pytest

from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.obstacles import distances_m
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.kernels.bodies import move_bodies
from swarm_forage_env.world.kernels.obstacles import hold_outside
from swarm_forage_env.world.state import SwarmState
from tests.reference.bodies import held_outside, moved
from tests.reference.sensing import RADIUS_M, interferes, observe, proximity
from tests.support.engines import drive_at, heap, make_bodies
from tests.support.stage import assert_conserved, put, tidy_world

BLOCK = (16.0, 8.0, 16.4, 8.6)
ROOM = (0.285036758, 0.285036758, 31.514963242, 15.714963242)


def bodies_at(places, heading, physics, obstacles):
    config = scenario("warehouse_small", n_robots=len(places), physics=physics, obstacles=obstacles)
    swarm = SwarmState.empty(len(places))
    swarm.position[:], swarm.heading[:] = places, heading
    swarm.facing[:] = np.column_stack((np.cos(heading), np.sin(heading)))
    return make_bodies(config, swarm), swarm


def tracks(physics, place, heading, obstacles, ticks=40):
    bodies, swarm = bodies_at([place], [heading], physics, obstacles)
    seen = []
    for _ in range(ticks):
        drive_at(bodies, swarm, np.array([heading]), 0.1)
        seen.append((*swarm.position[0], bodies.poses()[0, 2]))
    return np.array(seen)


@pytest.mark.parametrize(
    ("place", "turn"),
    [((15.9, 8.3), 0.0), ((15.9, 7.965), 0.2), ((16.2, 7.9), math.pi / 2), ((16.5, 8.3), math.pi), ((16.2, 8.7), -1.8)],
)
def test_a_disc_at_a_box_moves_as_in_chipmunk(place, turn):
    """From places where no tick ends so deep in the box that the disc is put back, which parts the engines a little."""
    for heading in (turn, turn + 0.3, turn - 0.6):
        chipmunk, compiled = (tracks(physics, place, heading, (BLOCK,)) for physics in ("chipmunk", "compiled"))
        np.testing.assert_allclose(compiled, chipmunk, atol=1e-9)
        free = np.array(place) + 0.8 * np.array((math.cos(heading), math.sin(heading)))
        assert np.abs(compiled[-1, :2] - free).max() > 0.01, "it touched the box"


def test_compiled_bodies_among_boxes_are_their_slow_twin():
    rng = np.random.default_rng(0)
    n_robots, boxes = 16, ((16.0, 8.0, 16.3, 8.25), (16.3, 8.1, 16.9, 8.4))
    bodies, swarm = bodies_at(
        np.array((15.7, 8.2)) + heap(rng, n_robots) * (1.0, 0.8), np.zeros(n_robots), "compiled", boxes
    )
    swarm.present[:] = rng.random(n_robots) < 0.9
    before, n_boxes = {}, 0
    sizes = tuple(bodies.state.room.tolist()), (bodies.state.radius_m, 0.2, bodies.state.n_substeps)
    for tick in range(12):
        if tick % 3 == 0:
            bodies.twist[:-1] = rng.uniform(-0.05, 0.05, (n_robots, 3)) * (1.0, 1.0, 10.0)
            bodies.twist[:-1, :2] += 0.2 * ((16.2, 8.2) - swarm.position)
        poses = [tuple(pose) for pose in bodies.poses()[:-1].tolist()]
        expected, before = moved(poses, bodies.twist[:-1].tolist(), swarm.present.tolist(), *sizes, before, boxes)
        n_boxes += sum(str(other).startswith("box") for _, other in before)
        bodies.look(swarm)
        assert move_bodies(bodies.state, bodies.twist, swarm.present, 0.2)
        np.testing.assert_allclose(bodies.poses()[:-1], expected, atol=1e-11)
        swarm.position[:] = bodies.poses()[:-1, :2]
    assert n_boxes > 10


def test_bodies_are_held_out_of_boxes_like_their_slow_twin():
    rng = np.random.default_rng(0)
    boxes = np.array([(16.0, 8.0, 16.4, 8.6), (16.5, 8.0, 17.0, 9.0), (0.2, 0.0, 0.8, 0.6)])
    poses = np.zeros((400, 3))
    poses[:200, :2] = rng.uniform((15.8, 7.8), (17.2, 9.2), (200, 2))
    poses[200:, :2] = rng.uniform(ROOM[:2], (1.2, 1.2), (200, 2))
    present = rng.random(400) < 0.9
    expected = [
        held_outside(complex(x, y), ROOM, RADIUS_M, boxes.tolist()) if there else (x, y)
        for (x, y), there in zip(poses[:, :2].tolist(), present, strict=True)
    ]
    before = poses[:, :2].copy()
    n_moved = hold_outside(poses, present, boxes, np.array(ROOM), RADIUS_M)
    np.testing.assert_allclose(poses[:, :2], expected, atol=1e-12)
    assert n_moved == np.count_nonzero(np.any(poses[:, :2] != before, axis=1)) > 100


@pytest.mark.parametrize("physics", ["chipmunk", "compiled"])
def test_a_crowd_that_pushes_from_both_sides_never_comes_through(physics):
    """Against the thinnest box there can be, and round its end, with everybody pushing to its middle."""
    box = (16.0, 7.8, 16.2, 8.4)
    rng = np.random.default_rng(1)
    places = np.concatenate([heap(rng, 12) + np.array((side, 8.1)) for side in (15.3, 16.9)])
    bodies, swarm = bodies_at(places, np.zeros(24), physics, (box,))
    for _ in range(60):
        aim = np.array((16.1, 8.1)) - swarm.position
        drive_at(bodies, swarm, np.arctan2(aim[:, 1], aim[:, 0]), 0.1)
        assert distances_m((box,), swarm.position).min() >= RADIUS_M - 1e-9
    assert np.count_nonzero(distances_m((box,), swarm.position) < RADIUS_M + 0.002) >= 4, "they leaned on it"


def walled_world(**overrides):
    return tidy_world(obstacles=(BLOCK, (20.0, 4.0, 20.4, 12.0)), physics="compiled", **overrides)


@pytest.mark.parametrize("seed", range(3))
def test_beams_and_interference_are_those_of_the_slow_twin(seed):
    env = walled_world(n_robots=6)
    rng = np.random.default_rng(seed)
    for robot in range(6):
        angle = rng.uniform(-math.pi, math.pi)
        while True:
            place = rng.uniform((15.8, 7.8), (16.6, 8.8))
            away = distances_m((BLOCK,), place[None])[0]
            if away > RADIUS_M and (
                robot == 0 or np.hypot(*(env.swarm.position[:robot] - place).T).min() > 2 * RADIUS_M
            ):
                break
        put(env, robot, *place, angle)
    obs = env.arena.observe()
    readings = obs[:, env.arena.layout["proximity"]]
    np.testing.assert_allclose(readings, [proximity(env, robot) for robot in range(6)], atol=2e-6)
    np.testing.assert_allclose(obs, observe(env), atol=2e-6)
    assert np.count_nonzero(readings) > 0
    env.step_batch(np.zeros((6, 3), np.float32))
    assert env.events.interfering.tolist() == [interferes(env, robot) for robot in range(6)]


def test_a_box_is_seen_like_a_wall_and_hides_nothing_from_camera_and_light():
    env = walled_world(n_robots=2)
    put(env, 0, 16.0 - RADIUS_M - 0.05, 8.3, 0.0)
    ahead = env.arena.observe()[0, env.arena.layout["proximity"]]
    assert ahead[0] == pytest.approx(
        0.0100527 / (0.05 / math.cos(math.radians(7.5)) + RADIUS_M * 0.00863 + 0.000163), rel=0.02
    )
    assert not ahead[6:18].any(), "nothing behind"
    bare = tidy_world(n_robots=2, physics="compiled")
    put(bare, 0, 16.0 - RADIUS_M - 0.05, 8.3, 0.0)
    for name in ("light", "los_object", "ground"):
        columns = env.arena.layout[name]
        np.testing.assert_array_equal(env.arena.observe()[0, columns], bare.arena.observe()[0, columns])


@pytest.mark.parametrize(
    ("placement", "caches"), [("single_source", "dynamic"), ("random", "none"), ("power_law", "none")]
)
def test_robots_objects_and_caches_start_clear_of_boxes(placement, caches):
    boxes = ((24.0, 3.0, 25.0, 13.0), (10.0, 5.0, 12.0, 11.0), (17.1, 2.0, 17.53, 9.0))
    config = scenario(
        "warehouse_small", n_robots=60, n_objects=120, placement=placement, caches=caches, obstacles=boxes,
        walk_probability=0.5, physics="compiled",
    )  # fmt: skip
    env = ForageEnv(config)
    for seed in range(1):
        env.reset_batch(seed)
        assert distances_m(boxes, env.swarm.position).min() >= RADIUS_M
        assert np.count_nonzero(env.objects.status == ObjectStatus.FREE) == 120
        for _ in range(5):
            env.step_batch(np.zeros((60, 3), np.float32))
            assert_conserved(env)
        assert env.events.counters[Counter.OBJECTS_MOVED] > 100


def test_objects_appear_at_positions_of_ones_own_and_nowhere_else():
    places = ((20.1, 8.1), (20.1, 8.9), (21.0, 8.3), (9.05, 5.55))
    config = scenario("warehouse_small", n_robots=2, n_objects=3, placement="positions", object_positions_m=places)
    env, seen = ForageEnv(config), set()
    cells = {(math.floor(x * 5), math.floor(y * 5)) for x, y in places}
    for seed in range(12):
        env.reset_batch(seed)
        lying = set(map(tuple, env.objects.cell.tolist()))
        assert len(lying) == 3
        assert lying <= cells
        seen |= lying
    assert seen == cells
