"""Bits of cells with robots, by which large swarms leave out cells where nobody is."""

import numpy as np
import pytest

from swarm_forage_env.world.kernels.beams import proximity
from swarm_forage_env.world.kernels.bins import bin_robots, mark_cells, may_be_beside

N_ROBOTS, SIDE_M, RADIUS_M, REACH_M = 1500, 40.0, 0.085, 0.1
CELL_M = 2 * RADIUS_M + REACH_M


@pytest.fixture
def robots():
    """Robots, some in pairs, in lines along the ends of words and in the corners; some are away."""
    rng = np.random.default_rng(5)
    position = rng.uniform(0.1, SIDE_M - 0.1, (N_ROBOTS, 2))
    position[500:1000] = np.clip(position[:500] + rng.uniform(-0.2, 0.2, (500, 2)), 0.1, SIDE_M - 0.1)
    position[1000:1100, 0] = 32 * CELL_M * rng.integers(1, 4, 100) + rng.uniform(-0.3, 0.3, 100)
    angle = rng.uniform(-np.pi, np.pi, N_ROBOTS)
    return position, np.column_stack((np.cos(angle), np.sin(angle))), rng.random(N_ROBOTS) < 0.9


def seen(robots, n_bins, n_words):
    """Readings and who is near, as it is with so many bins and words."""
    position, facing, present = robots
    first_in_bin, next_in_bin = np.full(n_bins, -1, np.int32), np.full(N_ROBOTS, -1, np.int32)
    occupied = np.full(n_words, 2**32 - 1, np.uint32)
    bin_robots(position, present, CELL_M, first_in_bin, next_in_bin)
    mark_cells(position, present, CELL_M, occupied)
    obs, near = np.zeros((N_ROBOTS, 24), np.float32), np.zeros(N_ROBOTS, np.bool_)
    bins, room = (CELL_M, first_in_bin, next_in_bin), np.array([0.0, 0.0, SIDE_M, SIDE_M])
    walls = room, np.zeros((0, 4))
    proximity(position, facing, present, bins, occupied, *walls, RADIUS_M, REACH_M, obs, 0, near, False)
    return obs, near


@pytest.mark.parametrize(("n_words", "n_bins"), [(2, 8192), (64, 64), (4096, 8192)])
def test_with_them_robots_see_what_they_see_without(robots, n_bins, n_words):
    (obs, near), (plain, plainly_near) = seen(robots, n_bins, n_words), seen(robots, n_bins, 1)
    assert 0.4 < near.mean() < 0.9
    np.testing.assert_array_equal(near, plainly_near)
    np.testing.assert_array_equal(obs, plain)


def test_who_is_alone_is_mostly_known_to_be(robots):
    position, _, _ = robots
    occupied = np.zeros(4096, np.uint32)
    alone = np.ones(N_ROBOTS, np.bool_)
    alone[100:] = False
    mark_cells(position, alone, CELL_M, occupied)
    cells = (position[:100] / CELL_M).astype(int)
    assert np.mean([may_be_beside(int(x), int(y), occupied) for x, y in cells]) < 0.2
