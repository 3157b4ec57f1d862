"""Bodies in both engines: free motion in closed form, contacts, walls, rows, parked bodies."""

import itertools
import math

import numpy as np
import pytest
from scipy.spatial.distance import pdist

from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.bodies import Bodies
from swarm_forage_env.world.chipmunk import ChipmunkBodies
from swarm_forage_env.world.kernels.drive import hold_inside
from swarm_forage_env.world.state import SwarmState
from tests.reference.motion import WHEEL_BASE_M, free_motion, held_inside, limited_wheels
from tests.support import engines
from tests.support.engines import drive_at, make_bodies
from tests.support.heaps import DIAMETER_M, RADIUS_M
from tests.support.stage import put, tidy_world

pytestmark = pytest.mark.usefixtures("each_engine")

DEEPEST_OVERLAP = 0.06
"""Share of a diameter that two robots may overlap when a tick ends."""
ROUNDING_M = 1e-12
MIDDLE = (16.0, 8.0)


def world(position, heading) -> tuple[ChipmunkBodies | Bodies, SwarmState, ScenarioConfig]:
    """Bodies of robots at these poses, and a state to write to."""
    config = scenario("warehouse_small", n_robots=len(heading), physics=engines.CHOSEN)
    swarm = SwarmState.empty(len(heading))
    swarm.position[:], swarm.heading[:] = position, heading
    return make_bodies(config, swarm), swarm, config


def drive_ahead(physics: ChipmunkBodies | Bodies, swarm: SwarmState) -> None:
    """One tick in which every robot drives where it faces."""
    drive_at(physics, swarm, swarm.heading, 0.10)


def deepest_overlap(swarm: SwarmState) -> float:
    """Deepest overlap of two robots as a share of a diameter, negative when apart."""
    return float(1.0 - pdist(swarm.position).min() / DIAMETER_M)


# Free motion


@pytest.mark.parametrize(
    ("command", "substeps"), [((-0.5, -0.5), 4), ((-0.5, 0.5), 5), ((0.15, 0.75), 4), ((0.4, 0.39), 5)]
)
def test_free_motion_is_the_closed_form(command, substeps):
    env = tidy_world(n_robots=1, physics_substeps=(1 / substeps,) * substeps)
    put(env, 0, *MIDDLE, heading=2.5)
    wheels = limited_wheels(*(np.float32(value).item() for value in command))
    actions = np.array([[*command, 1.0]], np.float32)
    ticks = 100
    for _ in range(ticks):
        env.step_batch(actions)
    x, y, heading = free_motion((*MIDDLE, 2.5), wheels, 0.2 * ticks)
    path = abs(sum(wheels)) / 2 * 0.2 * ticks
    assert env.swarm.position[0] == pytest.approx((x, y), abs=1e-9 + 1e-6 * path)
    assert math.cos(env.swarm.heading[0] - heading) == pytest.approx(1.0, abs=1e-9)


def test_heading_stays_in_range_and_facing_follows():
    env = tidy_world(n_robots=1)
    actions = np.array([[-0.5, 0.5, 1.0]], np.float32)
    headings = []
    for _ in range(60):
        env.step_batch(actions)
        headings.append(env.swarm.heading[0])
    assert min(headings) < -2.8
    assert max(headings) > 2.8
    assert all(-math.pi < heading <= math.pi for heading in headings)
    assert env.swarm.facing[0] == pytest.approx((math.cos(headings[-1]), math.sin(headings[-1])))
    per_tick = 0.20 / WHEEL_BASE_M * 0.2
    assert math.remainder(headings[-1] - 60 * per_tick, 2 * math.pi) == pytest.approx(0.0, abs=1e-6)


# Contacts


@pytest.mark.parametrize("offset", [0.0, 0.4 * DIAMETER_M, 0.9 * DIAMETER_M])
def test_two_robots_pushed_together_hardly_overlap(offset):
    angle = 1.1
    touching = math.sqrt(DIAMETER_M**2 - offset**2)
    for gap in np.linspace(0.0, 0.04, 6):
        across = np.array([touching + gap, offset])
        turn = np.array([[math.cos(angle), math.sin(angle)], [-math.sin(angle), math.cos(angle)]])
        physics, swarm, _ = world([MIDDLE, MIDDLE + across @ turn], [angle, angle + math.pi])
        for _ in range(12):
            drive_ahead(physics, swarm)
            assert deepest_overlap(swarm) < DEEPEST_OVERLAP


def test_a_robot_at_full_speed_is_stopped_by_one_that_pushes_back():
    physics, swarm, _ = world([MIDDLE, (16.3, 8.0)], [0.0, math.pi])
    for _ in range(50):
        drive_ahead(physics, swarm)
    assert swarm.position[:, 0].mean() == pytest.approx(16.15, abs=0.01)
    assert np.diff(swarm.position[:, 0])[0] == pytest.approx(DIAMETER_M, rel=DEEPEST_OVERLAP)


def room_to_walls(swarm: SwarmState) -> float:
    """Least distance of a body from the border of the free floor, m; negative outside. All in the small warehouse."""
    x_low, y_low, x_high, y_high = scenario("warehouse_small").arena.interior_m
    x, y = swarm.position.T
    return float(np.min([x - x_low, x_high - x, y - y_low, y_high - y])) - RADIUS_M


@pytest.mark.parametrize("corner", [(0.2, 0.2), (31.6, 15.8), (31.6, 8.0)])
def test_walls_hold(corner):
    x_low, y_low, x_high, y_high = scenario("warehouse_small").arena.interior_m
    start = np.clip(corner, (x_low + RADIUS_M + 0.01, y_low + RADIUS_M + 0.01), (x_high - 0.1, y_high - 0.1))
    for heading in np.linspace(-math.pi, math.pi, 9):
        physics, swarm, _ = world([start], [heading])
        for _ in range(15):
            drive_ahead(physics, swarm)
            assert room_to_walls(swarm) >= -ROUNDING_M, heading


@pytest.mark.parametrize("at", [(0, 0), (1, 1)])  # two corners have all four walls
def test_a_crowd_does_not_push_anybody_through_a_wall(at):
    x_low, y_low, x_high, y_high = scenario("warehouse_small").arena.interior_m
    corner = np.array([x_low + at[0] * (x_high - x_low), y_low + at[1] * (y_high - y_low)])
    grid = np.array(list(itertools.product(range(-6, 7), range(-6, 7)))) * (DIAMETER_M + 0.002)
    start = corner + grid
    inside = np.all((start > (x_low + 0.09, y_low + 0.09)) & (start < (x_high - 0.09, y_high - 0.09)), axis=1)
    start = start[inside]
    physics, swarm, _ = world(start, np.zeros(len(start)))
    deepest = []
    for _ in range(150):
        towards = corner - swarm.position
        swarm.heading[:] = np.arctan2(towards[:, 1], towards[:, 0])
        drive_ahead(physics, swarm)
        assert room_to_walls(swarm) >= -ROUNDING_M
        deepest.append(deepest_overlap(swarm))
    assert max(deepest) < 2 * DEEPEST_OVERLAP


# Rows


def test_parked_bodies_are_out_of_the_way():
    physics, swarm, _ = world([MIDDLE, (16.3, 8.0), (16.6, 8.0)], [0.0, 0.0, 0.0])
    for row in (1, 2):
        physics.park(row)
        swarm.present[row] = False
    standing = swarm.position[1:].copy()
    for _ in range(50):
        physics.twist[0, 0] = 0.10
        physics.advance(swarm)
    assert swarm.position[0] == pytest.approx((17.0, 8.0)), "drives through where the others were"
    np.testing.assert_array_equal(swarm.position[1:], standing)
    parked = physics.poses()[1:3, :2]
    assert np.linalg.norm(parked[0] - parked[1]) >= 1.0 - 1e-9
    assert np.all(parked < -5.0)


def test_bodies_are_held_inside_as_the_twin_says():
    rng = np.random.default_rng(5)
    room = np.array([0.3, 0.3, 4.0, 3.0])
    poses = rng.uniform(-1.0, 5.0, (200, 3))
    present = rng.random(199) < 0.8  # the last body is the static one
    before = poses.copy()
    expected = np.array(held_inside([(x, y) for x, y, _ in before[:-1].tolist()], tuple(room.tolist())))
    expected[~present] = before[:-1][~present, :2]
    n_moved = hold_inside(poses, present, room)
    np.testing.assert_array_equal(poses[:-1, :2], expected)
    np.testing.assert_array_equal(poses[:, 2], before[:, 2])
    np.testing.assert_array_equal(poses[-1], before[-1])
    assert n_moved == np.count_nonzero((expected != before[:-1, :2]).any(axis=1)) > 50
