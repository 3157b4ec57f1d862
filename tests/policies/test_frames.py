"""Frames of their own: robots see the world turned and mirrored, each in another way, and act accordingly."""

import itertools
from itertools import groupby

import numpy as np
import pytest

from swarm_forage_env.contract.policy import SwarmSpec
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.frames import TURNS, turned_columns
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.kernels.frames import N_FRAMES, frame_of
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.plans import plan_arena
from tests.reference import learner
from tests.support.stage import build_cache, clear, lay, load, put


def test_robots_take_all_frames_alike_and_at_different_times():
    taken = np.array([[frame_of(robot, decision, 20) for decision in range(1000)] for robot in range(64)])
    counts = np.bincount(taken.ravel(), minlength=N_FRAMES)
    assert len(TURNS) == len(counts) == N_FRAMES
    assert counts.min() > 0.9 * counts.mean()
    changes = np.flatnonzero(np.diff(taken[0]))
    assert {(change + 1) % 20 for change in changes.tolist()} == {0}
    assert max(len(list(group)) for _, group in groupby(taken[1])) % 20 == 0
    assert len({tuple(row) for row in taken[:, ::20].tolist()}) == 64
    assert len({int(np.flatnonzero(np.diff(row))[0]) for row in taken}) > 10


def test_frames_are_those_of_the_slow_twin():
    for robot in (0, 1, 2, 511):
        for decision in (0, 1, 199, 200, 123_456_789):
            assert frame_of(robot, decision, 200) == learner.frame(robot, decision, 200)


@pytest.mark.parametrize("actions", ["discrete", "continuous"])
def test_robots_of_an_arena_see_and_act_as_their_slow_twins(actions):
    world = scenario("warehouse_small", n_robots=6, n_objects=300, physics="compiled")
    choices = {"observation": "compact", "actions": actions, "site_memory": True, "decision_ticks": 2}
    arena = LearnerArena(plan_arena(world, interface={**choices, "frame_decisions": 3}))
    env, rng = ForageEnv(world), np.random.default_rng(0)
    plain = LearnerInterface(InterfaceConfig(**choices), env.swarm_spec)
    for seed in range(3):
        arena.reset(seed)
        obs = env.reset_batch(seed)
        plain.forget()
        for decision in range(5):
            seen = learner.seen(plain.observe(obs), plain.layout, decision, 3)
            np.testing.assert_array_equal(arena.observe(), seen)
            wanted = rng.integers(11, size=6) if actions == "discrete" else rng.uniform(-1, 1, (6, 3))
            arena.step(wanted, np.zeros(6))
            for _ in range(2):
                obs, *_ = env.step_batch(learner.commands(plain.command(wanted, obs), decision, 3))
        np.testing.assert_array_equal(arena.env.last_obs, obs)


def test_frames_need_a_row_for_each_robot_and_the_number_of_the_decision():
    spec = SwarmSpec.of(scenario("warehouse_small", n_robots=6))
    own = LearnerInterface(InterfaceConfig(frame_decisions=3), spec)
    rows = np.zeros((7, spec.layout.size), np.float32)
    with pytest.raises(ValueError, match="of 6 robots, each with its row, got 7 rows"):
        own.observe(rows, decision=0)
    with pytest.raises(ValueError, match="got none; call observe"):
        own.observe(rows[:6])


def test_a_decision_that_the_end_of_a_run_cuts_short_counts():
    assert [InterfaceConfig(decision_ticks=5).decisions_in(ticks) for ticks in (0, 4, 5, 6, 10)] == [0, 1, 1, 2, 2]


# Rows that are turned are those of a world that really is

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


@pytest.mark.parametrize("turn", range(N_FRAMES))
def test_turned_rows_are_those_of_a_turned_world(turn):
    config = FULL if turn % 3 else COMPACT
    seen, interface = rows(world(0), config)
    assert (seen != 0).any(axis=0).mean() > 0.4  # of the columns say something
    seen = turned(seen, turn, interface)
    there, _ = rows(world(turn), config)
    for part in interface.layout:
        columns = slice(part.start, part.stop)
        np.testing.assert_allclose(seen[:, columns], there[:, columns], atol=2e-6, err_msg=part.name)
