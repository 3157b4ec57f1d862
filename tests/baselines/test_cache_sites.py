"""Where caches are started: the allowed point nearest to the midpoint on the way to the nest, against a full search."""

import cmath
import math
from collections.abc import Callable, Iterator

import numpy as np
import pytest

from baselines.cache_sites import is_allowed, nearest_allowed, select_site
from baselines.task_policy import site_box_m
from baselines.tasks import DRAW_POINT_X, DRAW_POINT_Y, TASK_DRAWS
from swarm_forage_env.scenarios.quirks import Quirks
from tests.support.observations import make_spec
from tests.support.task_robot import TaskRobot

MEDIUM = {
    "arena_size_m": (48.0, 48.0),
    "nest_centre_m": (24.0, 24.0),
    "nest_size_m": (9.6, 9.6),
    "cache_side_m": 9.4,
    "cache_side_nominal_m": 9.6,
    "min_dist_m": 9.6,
    "cache_proximity_m": 19.2,
}


def choose(robot: TaskRobot, x: float, y: float, u: float = 0.0, v: float = 0.0) -> tuple[float, float] | None:
    """Site chosen by a robot at (x, y) with the draws u (direction) and v (length) of the offset."""
    draws = np.zeros(TASK_DRAWS)
    draws[[DRAW_POINT_X, DRAW_POINT_Y]] = u, v
    robot.seen.pose(x, y)
    found = select_site(robot.record, robot.senses, robot.constants, draws, robot.memory)
    return robot.goal if found else None


def test_half_way_to_the_nest_with_a_small_offset():
    robot = TaskRobot()
    assert choose(robot, 24.0, 8.0) == pytest.approx((13.6 + 0.1, 8.0), abs=1e-6)
    assert choose(robot, 24.0, 8.0, u=0.25, v=0.5) == pytest.approx((13.6, 8.3), abs=1e-6)
    assert robot.record.goal_tolerance_m == 0.8


def test_near_the_nest_the_site_is_pushed_out_to_the_proximity_distance():
    robot = TaskRobot(**MEDIUM)
    x, y = choose(robot, 30.0, 24.0)
    assert (x, y) == pytest.approx((33.6, 24.0), abs=1e-5)
    x, y = choose(robot, 30.0, 24.0, u=0.0, v=1.0)
    assert (x, y) == pytest.approx((33.65, 24.0), abs=1e-5)
    x, y = choose(robot, 30.0, 24.0, u=0.5, v=1.0)
    assert (x, y) == pytest.approx((33.65, 24.0), abs=1e-5), "an offset into the disc is turned round"
    x, y = choose(robot, 24.0, 24.0, u=0.25)
    assert (x, y) == pytest.approx((24.0, 33.6), abs=1e-5), "any direction from the very centre"
    assert choose(robot, 24.0, 43.4) == pytest.approx((24.1, 33.7), abs=1e-6), "19.4 m away, half way is allowed"


@pytest.mark.parametrize(
    ("changes", "box"),
    [
        ({}, (3.2, 3.2, 28.8, 12.8)),
        ({"quirks": Quirks(site_box_truncated=True)}, (3.0, 3.0, 28.0, 12.0)),
        (MEDIUM, (4.8, 4.8, 43.2, 43.2)),
        ({**MEDIUM, "quirks": Quirks(site_box_truncated=True)}, (4.0, 4.0, 43.0, 43.0)),
    ],
)
def test_quirk_site_box_truncated(changes, box):
    task = make_spec(**changes)
    assert site_box_m(task) == pytest.approx(box)
    constants = TaskRobot(**changes).constants
    sides = [constants[f"site_{side}_m"] for side in ("x_low", "y_low", "x_high", "y_high")]
    assert sides == pytest.approx(box)


@pytest.mark.parametrize("seed", [0, 1, 32, 83])  # in 32 and 83 the best point is where two discs meet, on either side
def test_no_allowed_point_is_nearer(seed):
    """Caches anywhere, even overlapping, as a memory of caches that are long gone may have them."""
    rng = np.random.default_rng(seed)
    robot = TaskRobot(**(MEDIUM if seed % 2 else {}))
    width_m, height_m = robot.seen.spec.arena_size_m
    for serial in range(1, int(rng.integers(1, 6))):
        robot.know_cache(serial, (int(rng.integers(width_m * 5)), int(rng.integers(height_m * 5))), 5)
        robot.memory.caches[serial - 1].has_refused = rng.random() < 0.3
    middle = rng.uniform((0.0, 0.0), (width_m, height_m))
    best = nearest_allowed(robot.record, *middle, 0.3, robot.constants, robot.memory)
    c, step = robot.constants, 0.1
    grid = [
        (x, y)
        for x in np.arange(c.site_x_low_m, c.site_x_high_m + 1e-9, step)
        for y in np.arange(c.site_y_low_m, c.site_y_high_m + 1e-9, step)
    ]
    near = robot.seen.spec.cache_side_nominal_m
    far = robot.seen.spec.cache_proximity_m + 0.8  # and where the robot stops short of its goal
    discs = [(robot.seen.spec.nest_centre_m, near)]
    for cache in robot.memory.caches[: robot.record.n_caches]:
        centre = ((cache.cell_x + 0.5) * 0.2, (cache.cell_y + 0.5) * 0.2)
        discs.append((centre, far if cache.has_refused else near))
    allowed = [point for point in grid if all(math.dist(point, disc) >= radius for disc, radius in discs)]
    nearest = min((math.dist(point, middle) for point in allowed), default=math.inf)
    if best.distance == math.inf:
        assert nearest == math.inf
        return
    assert is_allowed(robot.record, best.x, best.y, c, robot.memory)
    assert math.dist((best.x, best.y), middle) == pytest.approx(math.sqrt(best.distance))
    assert math.sqrt(best.distance) <= nearest + 1e-5
    assert nearest <= math.sqrt(best.distance) + 4 * step, "the grid must have a point near the best one"


# The scatter of the authors' program, against a slow twin: places as complex numbers, draws as an iterator


FAR = {"inside": 0.005, "border": 0.05}
"""Share of sites that lie anywhere allowed: the midpoint is allowed, or the best place is on a border."""
SCALE_M = {"inside": 0.0125, "border": 0.03}


def random_shares(share: float) -> Iterator[float]:
    """Random numbers that follow from one: those of Park and Miller, as in the C++ engine `minstd_rand`."""
    state = 1 + int(share * (2**31 - 3))
    while True:
        yield state / (2**31 - 1)
        state = state * 48271 % (2**31 - 1)


def scattered_site(
    best: complex,
    where: str,
    box: tuple[float, float, float, float],
    turn: float,
    draw: float,
    is_allowed: Callable[[complex], bool],
) -> complex:
    """Where the site lies: `turn` is the share of a full turn, `draw` decides how far; both in [0, 1)."""
    if draw < FAR[where]:
        low, high = complex(*box[:2]), complex(*box[2:])
        size = high - low
        along, across = random_shares(turn), random_shares(draw / FAR[where])
        tried = (low + complex(size.real * next(along), size.imag * next(across)) for _ in range(256))
        return next((place for place in tried if is_allowed(place)), best)
    rest = (draw - FAR[where]) / (1.0 - FAR[where])
    offset = cmath.rect(SCALE_M[where] / (1.0 - rest), cmath.tau * turn)
    tried = (best + offset * cmath.exp(2.4j * k) for k in range(16))
    return next((place for place in tried if is_allowed(place)), best)


def scattered(robot: TaskRobot, x: float, y: float, u: float, v: float) -> tuple[complex, complex]:
    """Site chosen by a robot at (x, y), and what the slow twin chooses."""
    c, memory = robot.constants, robot.memory
    goal = choose(robot, x, y, u, v)
    middle = 0.5 * (x + c.nests_m[0, 0]), 0.5 * (y + c.nests_m[0, 1])
    best = nearest_allowed(robot.record, *middle, 2 * math.pi * u, c, memory)
    expected = scattered_site(
        complex(best.x, best.y),
        "inside" if best.distance == 0.0 else "border",
        (c.site_x_low_m, c.site_y_low_m, c.site_x_high_m, c.site_y_high_m),
        u,
        v,
        lambda place: is_allowed(robot.record, place.real, place.imag, c, memory),
    )
    return complex(*goal), expected


def in_scatter(**changes: object) -> TaskRobot:
    return TaskRobot(quirks=Quirks(scattered_sites=True), **changes)


@pytest.mark.parametrize("seed", range(2))
def test_quirk_scattered_sites_as_the_slow_twin(seed):
    rng = np.random.default_rng(seed)
    robot = in_scatter(**(MEDIUM if seed % 2 else {}))
    width_m, height_m = robot.seen.spec.arena_size_m
    for serial in range(1, int(rng.integers(1, 4))):
        robot.know_cache(serial, (int(rng.integers(width_m * 5)), int(rng.integers(height_m * 5))), 5)
    for _ in range(60):
        x, y = rng.uniform((0.2, 0.2), (width_m - 0.2, height_m - 0.2))
        v = rng.random() * (1.0 if rng.random() < 0.5 else 0.05)
        found, expected = scattered(robot, x, y, rng.random(), v)
        assert abs(found - expected) < 2e-4, "positions are float32"
