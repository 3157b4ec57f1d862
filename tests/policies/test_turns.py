"""Turned worlds: rows that are turned are those of a world that really is, and what follows from it."""

import itertools

import numpy as np
import pytest

from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.frames import TURNS, turned_columns
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.kernels.frames import N_FRAMES, N_UPRIGHT
from swarm_forage_env.scenarios.presets import scenario
from tests.support.stage import build_cache, clear, lay, load, put

COMPACT = InterfaceConfig(
    observation="compact", actions="discrete", automatic_gripper=True, decision_ticks=5, site_memory=True
)
FULL = InterfaceConfig(site_memory=True)
SIZE_M = np.array([20.0, 12.0])
NEST_M = np.array([3.0, 5.0]), np.array([2.0, 6.0])
ROBOTS = ((4.03, 7.11, 0.4), (4.21, 7.23, 2.9), (9.33, 4.47, -1.3), (9.77, 4.81, 1.9), (11.13, 6.27, 2.2))
"""x, y in m and heading: two at the border of the nest, two near each other and objects, one at a cache."""
OBJECTS = ((47, 23), (46, 24), (50, 25), (48, 21))
"""Cells of the first four; one is carried, four lie in a cache, the others where nobody looks."""
N_OBJECTS = 12


def place(turn: int, x: float, y: float) -> np.ndarray:
    """Where a place in m comes to lie."""
    return TURNS[turn] @ (np.array([x, y]) - SIZE_M / 2) + np.abs(TURNS[turn]) @ SIZE_M / 2


def cell(turn: int, x: int, y: int) -> tuple[int, int]:
    at = np.floor(place(turn, (x + 0.5) / 5, (y + 0.5) / 5) * 5)
    return int(at[0]), int(at[1])


def heading(turn: int, angle: float) -> float:
    x, y = TURNS[turn] @ np.array([np.cos(angle), np.sin(angle)])
    return float(np.arctan2(y, x))


def world(turn: int) -> ForageEnv:
    """A world with nest, robots, objects and a cache where the turn puts them."""
    swap = np.abs(TURNS[turn])
    width_m, height_m = (swap @ SIZE_M).tolist()
    env = ForageEnv(
        scenario(
            "warehouse_medium", n_robots=len(ROBOTS), n_objects=N_OBJECTS, width_m=width_m, height_m=height_m,
            nest_centre_m=tuple(np.round(place(turn, *NEST_M[0]), 6).tolist()),
            nest_size_m=tuple((swap @ NEST_M[1]).tolist()), caches="dynamic", side_share=0.1, neighbours_seen=3,
            neighbour_range_m=3.0, physics="compiled",
        )
    )  # fmt: skip
    env.reset_batch(0)
    clear(env)
    far = itertools.product((70, 73, 76), (20, 24, 28))
    for row in range(N_OBJECTS):
        lay(env, row, cell(turn, *OBJECTS[row] if row < len(OBJECTS) else next(far)))
    for row, at in enumerate(itertools.product((56, 58), (32, 34)), start=6):
        lay(env, row, cell(turn, *at))
    assert build_cache(env, range(6, 10), cell(turn, 57, 33)) >= 0
    for robot, (x, y, angle) in enumerate(ROBOTS):
        put(env, robot, *place(turn, x, y), heading(turn, angle))
    load(env, 1, 5)
    env.arena.observe()
    return env


def rows(env: ForageEnv, config: InterfaceConfig) -> tuple[np.ndarray, LearnerInterface]:
    interface = LearnerInterface(config.for_scenario(env.scenario), env.swarm_spec)
    return interface.observe(env.last_obs), interface


def turned(seen: np.ndarray, turn: int, interface: LearnerInterface) -> np.ndarray:
    """What robots see in the turned world, by what they see in the one as it is."""
    source, sign = turned_columns(turn, interface.layout)
    return seen[:, source] * sign


@pytest.mark.parametrize("config", [COMPACT, FULL], ids=["compact", "full"])
@pytest.mark.parametrize("turn", range(N_FRAMES))
def test_turned_rows_are_those_of_a_turned_world(turn, config):
    seen, interface = rows(world(0), config)
    assert (seen != 0).any(axis=0).mean() > 0.4  # of the columns say something
    seen = turned(seen, turn, interface)
    there, _ = rows(world(turn), config)
    for part in interface.layout:
        columns = slice(part.start, part.stop)
        np.testing.assert_allclose(seen[:, columns], there[:, columns], atol=2e-6, err_msg=part.name)


@pytest.mark.parametrize("config", [COMPACT, FULL], ids=["compact", "full"])
@pytest.mark.parametrize("turn", range(N_FRAMES))
def test_robots_do_in_the_world_what_they_chose_in_the_turned_one(turn, config):
    one, other = world(0), world(turn)
    (_, own), (_, theirs) = rows(one, config), rows(other, config)
    rng = np.random.default_rng(0)
    for _ in range(4):
        chosen = rng.integers(0, 6, len(ROBOTS)) if config is COMPACT else rng.uniform(-1, 1, (len(ROBOTS), 3))
        for _ in range(5):
            commands = own.command(chosen, one.last_obs).copy()
            commands[:, :2] = commands[:, 1::-1] if turn >= N_UPRIGHT else commands[:, :2]
            one.step_batch(commands)
            other.step_batch(theirs.command(chosen, other.last_obs).copy())
    expected = np.array([place(turn, *at) for at in one.swarm.position])
    np.testing.assert_allclose(other.swarm.position, expected, atol=5e-4)  # two push each other, in some order
    (seen, interface), (there, _) = rows(one, config), rows(other, config)
    wheels = interface.layout["wheel_speed"]
    np.testing.assert_allclose(turned(seen, turn, interface)[:, wheels], there[:, wheels], atol=1e-6)
    moved = np.abs(one.swarm.position - np.array([robot[:2] for robot in ROBOTS])).max()
    assert moved > 0.05
