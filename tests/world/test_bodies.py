"""Bodies in both engines: free motion in closed form, contacts, walls, boxes; slow twins, and the oracle."""

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.config import PHYSICS_ENGINES
from swarm_forage_env.scenarios.obstacles import distances_m
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.bodies import PAIRS_PER_ROBOT
from swarm_forage_env.world.kernels.bodies import find_pairs, move_bodies, tell_poses
from swarm_forage_env.world.kernels.contact import press
from swarm_forage_env.world.kernels.drive import hold_inside, sinc_and_cosine
from swarm_forage_env.world.kernels.obstacles import hold_outside
from swarm_forage_env.world.kernels.tick import look
from swarm_forage_env.world.motion import TOUCH_SLACK_M
from tests.reference.bodies import held, held_outside, moved
from tests.reference.motion import WHEEL_BASE_M, free_motion, limited_wheels, pressed_velocities
from tests.support.engines import DIAMETER_M, RADIUS_M, bodies_at, drive_at, heap, in_each_engine
from tests.support.stage import put, tidy_world

MIDDLE = np.array([16.0, 8.0])
ROOM = (0.285036758, 0.285036758, 31.514963242, 15.714963242)
"""Where the centres of robots may be in the small warehouse, m."""
CORNER = np.array([31.6, 15.8])
"""Corner of its free floor, upper right."""
BLOCK = (16.0, 8.0, 16.4, 8.6)


# The twin


@pytest.mark.parametrize(
    ("seed", "first", "target", "boxes", "n_at_walls"),
    [
        (0, MIDDLE, MIDDLE, (), 0),
        (1, CORNER - 0.45, CORNER, (), 20),
        (0, (15.7, 8.2), (16.2, 8.2), ((16.0, 8.0, 16.3, 8.25), (16.3, 8.1, 16.9, 8.4)), 10),
    ],
    ids=["in the open", "in a corner", "at boxes"],
)
def test_compiled_bodies_are_their_slow_twin(seed, first, target, boxes, n_at_walls):
    rng = np.random.default_rng(seed)
    n_robots = 24
    places = first + heap(rng, n_robots)
    places -= np.maximum(0.0, places.max(axis=0) - (CORNER - 0.9 * RADIUS_M))  # two walls are touched, not more
    bodies, swarm = bodies_at(places, rng.uniform(-3, 3, n_robots), obstacles=boxes)
    swarm.present[:] = rng.random(n_robots) < 0.9
    before, n_contacts, n_walls = {}, 0, 0
    sizes = tuple(bodies.state.room.tolist()), (bodies.state.radius_m, 0.2, bodies.state.n_substeps)
    for tick in range(12):
        if tick % 3 == 0:
            bodies.twist[:-1] = rng.uniform(-0.05, 0.05, (n_robots, 3)) * (1.0, 1.0, 10.0)
            bodies.twist[:-1, :2] += 0.2 * (target - swarm.position)
        poses = [tuple(pose) for pose in bodies.poses()[:-1].tolist()]
        expected, before = moved(poses, bodies.twist[:-1].tolist(), swarm.present.tolist(), *sizes, before, boxes)
        n_contacts, n_walls = n_contacts + len(before), n_walls + sum(type(wall) is str for _, wall in before)
        bodies.look(swarm)
        assert move_bodies(bodies.state, bodies.twist, swarm.present, 0.2)
        np.testing.assert_allclose(bodies.poses()[:-1], expected, atol=1e-11)
        tell_poses(bodies.poses(), swarm.present, swarm.position, swarm.heading, swarm.facing)
    assert n_contacts > 150
    assert n_walls > n_at_walls or n_walls == n_at_walls == 0


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


def test_bodies_are_held_inside_the_room_and_out_of_boxes_like_their_slow_twins():
    rng = np.random.default_rng(0)
    boxes = np.array([(16.0, 8.0, 16.4, 8.6), (16.5, 8.0, 17.0, 9.0), (0.2, 0.0, 0.8, 0.6)])
    present = rng.random(400) < 0.9
    for low, high, hold, slowly in (
        ((-1.0, -1.0), (3.0, 3.0), lambda *poses: hold_inside(*poses, np.array(ROOM)), lambda place: held(place, ROOM)),
        (
            ROOM[:2],
            (1.2, 1.2),
            lambda *poses: hold_outside(*poses, boxes, np.array(ROOM), RADIUS_M),
            lambda place: complex(*held_outside(place, ROOM, RADIUS_M, boxes.tolist())),
        ),
    ):
        poses = np.zeros((401, 3))  # the last body is the static one
        poses[:200, :2] = rng.uniform((15.8, 7.8), (17.2, 9.2), (200, 2))
        poses[200:400, :2] = rng.uniform(low, high, (200, 2))
        expected, before = poses.copy(), poses.copy()
        for robot in np.flatnonzero(present):
            place = slowly(complex(*poses[robot, :2]))
            expected[robot, :2] = place.real, place.imag
        n_moved = hold(poses, present)
        np.testing.assert_allclose(poses, expected, rtol=0, atol=1e-12)
        assert n_moved == np.count_nonzero((poses != before).any(axis=1)) > 50


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


def tracks(physics, places, heading, speed, ticks=40, **overrides):
    bodies, swarm = bodies_at(places, heading, physics, **overrides)
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


@pytest.mark.parametrize(
    ("place", "headings", "boxes"),
    [
        *((place, (0.3, 2.0, -2.5), ()) for place in ((31.5, 15.7), (0.3, 8.0), (16.0, 0.3))),
        *(
            (place, (turn, turn + 0.3, turn - 0.6), (BLOCK,))
            for place, turn in (
                ((15.9, 8.3), 0.0),
                ((15.9, 7.965), 0.2),
                ((16.2, 7.9), math.pi / 2),
                ((16.5, 8.3), math.pi),
                ((16.2, 8.7), -1.8),
            )
        ),
    ],
)
def test_a_disc_at_a_wall_or_a_box_moves_as_in_chipmunk(place, headings, boxes):
    """From places where no tick ends so deep in a box that the disc is put back, which parts the engines a little."""
    for heading in headings:
        chipmunk, compiled = (
            tracks(physics, [place], [heading], [0.1], obstacles=boxes) for physics in ("chipmunk", "compiled")
        )
        np.testing.assert_allclose(compiled, chipmunk, atol=TOLERATED_M)
        free = np.array(place) + 0.8 * np.array((math.cos(heading), math.sin(heading)))
        assert not boxes or np.abs(compiled[-1, 0, :2] - free).max() > 0.01, "it touched the box"


CROWDED = {"width_m": 6.0, "height_m": 6.0, "nest_centre_m": (1.2, 3.0), "nest_size_m": (1.2, 4.8), "n_objects": 12}


@pytest.mark.slow
@pytest.mark.parametrize("policy", ["crw", "dpo"])
@pytest.mark.parametrize("fields", [{"n_robots": 64}, {"n_robots": 60, "start_margin_m": 0.6, **CROWDED}])
def test_both_engines_make_the_same_runs(policy, fields):
    """One in eight may part by rounding; with friction in one of them changed by a tenth, half of them do."""
    n_parted = 0
    for seed in range(8):
        worlds = [scenario("warehouse_small", horizon_s=200.0, physics=name, **fields) for name in PHYSICS_ENGINES]
        compiled, chipmunk = (run_one(plan_run(world, policy, seed=seed)) for world in worlds)
        n_parted += not compiled.equals(chipmunk)
    assert n_parted <= 1


# Turning


@pytest.mark.parametrize("angle", [0.0, 1e-9, -0.3, 0.4999, 0.51, -3.0])
def test_sine_and_cosine_are_those_of_the_library(angle):
    sinc, cosine = sinc_and_cosine(angle)
    assert (angle * sinc, cosine) == pytest.approx((math.sin(angle), math.cos(angle)), rel=1e-15, abs=1e-17)


def test_facing_stays_the_direction_of_the_heading_for_a_whole_run():
    bodies, swarm = bodies_at([(16.0, 8.0), (12.0, 8.0)], [3.0, -3.0])
    rng = np.random.default_rng(0)
    for _ in range(1_000):
        bodies.twist[:-1, 2] = rng.uniform(-3.0, 3.0, 2)  # turns of both lengths that kernels tell apart
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


# In either engine


@in_each_engine
@pytest.mark.parametrize(
    ("command", "substeps", "base_m"),
    [
        ((-0.5, -0.5), 4, WHEEL_BASE_M),
        ((-0.5, 0.5), 5, WHEEL_BASE_M),
        ((0.15, 0.75), 4, WHEEL_BASE_M),
        ((0.4, 0.39), 5, WHEEL_BASE_M),
        ((0.0, 1.0), 4, 0.02),  # two radians in a tick
    ],
)
def test_free_motion_is_the_closed_form(command, substeps, base_m, physics):
    env = tidy_world(n_robots=1, physics_substeps=(1 / substeps,) * substeps, wheel_base_m=base_m, physics=physics)
    put(env, 0, *MIDDLE, heading=2.5)
    wheels = limited_wheels(*(np.float32(value).item() for value in command))
    actions = np.array([[*command, 1.0]], np.float32)
    for tick in range(1, 101):
        env.step_batch(actions)
        x, y, heading = free_motion((*MIDDLE, 2.5), wheels, 0.2 * tick, base_m)
        assert -math.pi < env.swarm.heading[0] <= math.pi
    path = abs(sum(wheels)) / 2 * 0.2 * tick
    assert env.swarm.position[0] == pytest.approx((x, y), abs=1e-9 + 1e-6 * path)
    assert math.cos(env.swarm.heading[0] - heading) == pytest.approx(1.0, abs=1e-9)
    assert env.swarm.facing[0] == pytest.approx((math.cos(heading), math.sin(heading)), abs=1e-4)


DEEPEST_OVERLAP = 0.06
"""Share of a diameter that two robots may overlap when a tick ends."""


@in_each_engine
@pytest.mark.parametrize("at", [(0, 0), (1, 1)])  # two corners have all four walls
def test_a_crowd_does_not_push_anybody_through_a_wall(at, physics):
    low, high = np.array(ROOM[:2]), np.array(ROOM[2:])
    corner = low + at * (high - low)
    grid = corner + np.array(list(itertools.product(range(-6, 7), range(-6, 7)))) * (DIAMETER_M + 0.002)
    start = grid[np.all((grid > low) & (grid < high), axis=1)]
    bodies, swarm = bodies_at(start, np.zeros(len(start)), physics)
    for _ in range(150):
        towards = corner - swarm.position
        drive_at(bodies, swarm, np.arctan2(towards[:, 1], towards[:, 0]), 0.10)
        assert np.all((swarm.position >= low - 1e-12) & (swarm.position <= high + 1e-12))
        assert 1.0 - pdist(swarm.position).min() / DIAMETER_M < 2 * DEEPEST_OVERLAP


@in_each_engine
def test_a_crowd_that_pushes_from_both_sides_never_comes_through(physics):
    """Against the thinnest box there can be, and round its end, with everybody pushing to its middle."""
    box = (16.0, 7.8, 16.2, 8.4)
    rng = np.random.default_rng(1)
    places = np.concatenate([heap(rng, 12) + np.array((side, 8.1)) for side in (15.3, 16.9)])
    bodies, swarm = bodies_at(places, np.zeros(24), physics, obstacles=(box,))
    for _ in range(60):
        aim = np.array((16.1, 8.1)) - swarm.position
        drive_at(bodies, swarm, np.arctan2(aim[:, 1], aim[:, 0]), 0.1)
        assert distances_m((box,), swarm.position).min() >= RADIUS_M - 1e-9
    assert np.count_nonzero(distances_m((box,), swarm.position) < RADIUS_M + 0.002) >= 4, "they leaned on it"


@in_each_engine
def test_parked_bodies_are_out_of_the_way(physics):
    bodies, swarm = bodies_at([MIDDLE, (16.3, 8.0), (16.6, 8.0)], [0.0, 0.0, 0.0], physics)
    for row in (1, 2):
        bodies.park(row)
        swarm.present[row] = False
    standing = swarm.position[1:].copy()
    for _ in range(50):
        bodies.twist[0, 0] = 0.10
        bodies.advance(swarm)
    assert swarm.position[0] == pytest.approx((17.0, 8.0)), "drives through where the others were"
    np.testing.assert_array_equal(swarm.position[1:], standing)
    parked = bodies.poses()[1:3, :2]
    assert np.linalg.norm(parked[0] - parked[1]) >= 1.0 - 1e-9
    assert np.all(parked < -5.0)


# Contact: a pressing pair keeps its common speed


FULL = 0.5
"""Wheel command of the highest centre speed, 0.10 m/s."""


def facing_pair(physics: str = "compiled") -> ForageEnv:
    """Two robots that face each other, 20 cm apart, around the middle of the small warehouse."""
    env = tidy_world(n_robots=2, n_objects=1, physics=physics)
    stand_apart(env, 0.10)
    return env


def stand_apart(env: ForageEnv, x: float) -> None:
    put(env, 0, MIDDLE[0] - x, MIDDLE[1], 0.0)
    put(env, 1, MIDDLE[0] + x, MIDDLE[1], math.pi)
    env.arena.observe()


def drive(env: ForageEnv, *speeds: float, ticks: int = 1) -> np.ndarray:
    """Drive straight ahead with these wheel commands; returns the velocities of the last tick, (N, 2) in m/s."""
    actions = np.column_stack((speeds, speeds, np.ones(len(speeds)))).astype(np.float32)
    for _ in range(ticks):
        before = env.swarm.position.copy()
        env.step_batch(actions)
    return (env.swarm.position - before) / env.scenario.dt_s


@in_each_engine
def test_a_pair_that_meets_keeps_the_mean_speed_of_its_commands(physics):
    env = facing_pair(physics)
    drive(env, FULL, 0.3, ticks=3)
    for _ in range(20):
        np.testing.assert_allclose(drive(env, FULL, 0.3), [(0.02, 0.0), (0.02, 0.0)], atol=1e-6)
    wheels = [(0.10, 0.10), (0.06, 0.06)]
    np.testing.assert_allclose(env.swarm.wheel_speed, wheels, atol=1e-8, err_msg="wheels turn as commanded")


def test_a_reset_forgets_who_pressed():
    env = facing_pair()
    drive(env, FULL, 0.3, ticks=3)
    env.reset_batch(1)
    stand_apart(env, DIAMETER_M / 2)
    assert drive(env, 0.3, FULL)[0, 0] == pytest.approx(-0.02, abs=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_contact_is_its_slow_twin(seed):
    rng = np.random.default_rng(seed)
    n_robots = 30
    env = ForageEnv(scenario("warehouse_small", n_robots=n_robots))
    env.reset_batch(0)
    position, present = env.swarm.position, env.swarm.present
    position[:], present[:] = MIDDLE + heap(rng, n_robots), rng.random(n_robots) < 0.9
    arrays = env.arena._arrays
    near, bins, motion = arrays.sensors.near, arrays.sensors.bins, arrays.motion
    kept, memory = motion.touching, {}
    command = rng.uniform(-0.1, 0.1, (n_robots, 3))
    n_pressing = 0
    for _ in range(8):
        changed = rng.random(n_robots) < 0.3
        command[changed] = rng.uniform(-0.1, 0.1, (n_robots, 3))[changed]
        look(arrays)
        motion.twist[:-1] = command
        press(position, present, near, bins, motion.touch_m, *kept, motion.command, motion.twist)
        kept = kept[1], kept[0]
        expected, memory = pressed_velocities(
            [tuple(place) for place in position.tolist()],
            [(x, y) for x, y, _ in command.tolist()],
            present.tolist(),
            DIAMETER_M + TOUCH_SLACK_M,
            memory,
        )
        np.testing.assert_allclose(motion.twist[:-1, :2], expected, atol=1e-12)
        np.testing.assert_array_equal(motion.twist[:-1, 2], command[:, 2])
        n_pressing += len(memory)
        position += rng.normal(0.0, 1e-4, (n_robots, 2))
    assert n_pressing > 50
