"""How deep robots are pushed into each other, by how a tick is divided: the reason for the default substeps.

Both engines move bodies and resolve contacts afterwards, so a contact is met one substep late. All overlaps are shares
of a robot's diameter when a tick ends, the only moment at which anything looks at poses.
"""

import copy
import math

import numpy as np
import pytest
from scipy.spatial import cKDTree
from scipy.spatial.distance import pdist

from swarm_forage_env.scenarios.config import PHYSICS_ENGINES, ScenarioConfig
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.state import SwarmState
from tests.support.engines import DIAMETER_M, drive_at, make_bodies

TOLERATED = 0.06
BASE = scenario("warehouse_small")
DEFAULT = BASE.physics_substeps
MIDDLE = (16.0, 8.0)

pytestmark = pytest.mark.slow


@pytest.fixture(params=PHYSICS_ENGINES, scope="module")
def base(request) -> ScenarioConfig:
    """The small warehouse with each engine."""
    return with_overrides(BASE, physics=request.param)


def divided(config: ScenarioConfig, substeps: tuple[float, ...]) -> ScenarioConfig:
    """The configuration with a tick divided like that, also where the constructor would refuse it."""
    config = copy.copy(config)
    object.__setattr__(config, "physics_substeps", substeps)
    return config


def equal(n_substeps: int) -> tuple[float, ...]:
    """A tick divided into equal parts."""
    return (1.0 / n_substeps,) * n_substeps


def deepest(swarm: SwarmState) -> float:
    """Deepest overlap of any two robots."""
    return float(1.0 - pdist(swarm.position).min() / DIAMETER_M)


def head_on_overlap(base: ScenarioConfig, substeps: tuple[float, ...]) -> float:
    """Deepest overlap of two robots that drive at each other, over many starting gaps and sideways offsets."""
    config = divided(with_overrides(base, n_robots=2), substeps)
    heading = np.array([0.0, math.pi])
    worst = 0.0
    for offset in np.linspace(0.0, 0.95, 12) * DIAMETER_M:
        for gap in np.linspace(0.0, 0.04, 41):
            ahead = math.sqrt(DIAMETER_M**2 - offset**2) + gap
            swarm = SwarmState.empty(2)
            swarm.position[:] = MIDDLE, (MIDDLE[0] + ahead, MIDDLE[1] + offset)
            physics = make_bodies(config, swarm)
            for _ in range(8):
                drive_at(physics, swarm, heading, 0.10)
                worst = max(worst, deepest(swarm))
    return worst


@pytest.fixture(scope="module")
def table(base) -> dict[int, float]:
    """Overlap head-on by number of equal substeps."""
    return {n_substeps: head_on_overlap(base, equal(n_substeps)) for n_substeps in (1, 2, 3, 4, 5, 10)}


def test_overlap_shrinks_with_the_number_of_substeps(table):
    print("\nequal substeps  deepest overlap head-on")  # noqa: T201 - the table that the choice rests on
    for n_substeps, overlap in table.items():
        print(f"{n_substeps:>14}  {overlap:.1%}")  # noqa: T201 - as above
    overlaps = list(table.values())
    assert overlaps == sorted(overlaps, reverse=True)
    assert overlaps[-1] < 0.5 * overlaps[1]


def test_four_is_the_smallest_number_of_equal_substeps_that_is_tolerable(table):
    assert [n_substeps for n_substeps, overlap in table.items() if overlap < TOLERATED] == [4, 5, 10]
    assert equal(4) == DEFAULT


def jam(base: ScenarioConfig, substeps: tuple[float, ...], n_robots: int, ticks: int = 600) -> float:
    """Mean of the deepest overlap per tick of a swarm that drives into the upper right corner, once it is there.

    Robots start as near as they can without overlap and their headings follow the corner. The walls hold in any case.
    """
    x_low, y_low, x_high, y_high = BASE.arena.interior_m
    corner = np.array([x_high, y_high])
    spacing = DIAMETER_M + 0.005
    grid = corner - DIAMETER_M / 2 - 0.005 - spacing * np.array([(x, y) for x in range(60) for y in range(60)])
    nearest = np.argsort(np.hypot(*(grid - corner).T), kind="stable")[:n_robots]
    swarm = SwarmState.empty(n_robots)
    swarm.position[:] = grid[nearest]
    physics = make_bodies(divided(with_overrides(base, n_robots=n_robots), substeps), swarm)
    overlaps = []
    room = np.array([x_low, y_low, -x_high, -y_high]) + DIAMETER_M / 2
    for tick in range(ticks):
        towards = corner - swarm.position
        drive_at(physics, swarm, np.arctan2(towards[:, 1], towards[:, 0]), 0.10)
        assert np.all(np.hstack((swarm.position, -swarm.position)) >= room - 1e-12), "nobody leaves the floor"
        if tick >= ticks // 2:
            apart = cKDTree(swarm.position).query(swarm.position, k=2)[0][:, 1].min()
            overlaps.append(1.0 - apart / DIAMETER_M)
    return float(np.mean(overlaps))


@pytest.mark.parametrize("n_robots", [50, 200, 512])
def test_a_swarm_that_pushes_into_a_corner_overlaps_little(base, n_robots):
    assert jam(base, DEFAULT, n_robots) < 2 * TOLERATED


@pytest.mark.parametrize("substeps", [(1.0,), equal(2), equal(3), (0.5, 0.2, 0.15, 0.15), (0.7, 0.15, 0.15)])
def test_fewer_or_unequal_substeps_pile_robots_up(substeps):
    """Why the configuration refuses them: an overlap seen in a short substep is undone too fast in a long one."""
    assert jam(BASE, substeps, 512, ticks=300) > 0.3
