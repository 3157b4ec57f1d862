"""Turned worlds: rows that are turned are those of a world that really is, and what follows from it."""

import itertools
from collections import Counter

import numpy as np
import pytest

from swarm_forage_env import parallel_env
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.own_functions import register_sensor
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.policies.turns import AS_IT_IS, TURNS, Turn, turn_of
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.views.arenas import ArenaBatch
from swarm_forage_env.views.learner_arena import LearnerArena
from swarm_forage_env.views.pettingzoo import ParallelLearnerEnv
from swarm_forage_env.views.plans import plan_arena
from tests.support.sampled import sampler
from tests.support.stage import build_cache, clear, lay, load, put

NAMED = {f"{turn.quarters} quarters{', mirrored' * turn.is_mirrored}": turn for turn in TURNS}
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


def place(turn: Turn, x: float, y: float) -> np.ndarray:
    """Where a place in m comes to lie."""
    return turn.matrix @ (np.array([x, y]) - SIZE_M / 2) + np.abs(turn.matrix) @ SIZE_M / 2


def cell(turn: Turn, x: int, y: int) -> tuple[int, int]:
    at = np.floor(place(turn, (x + 0.5) / 5, (y + 0.5) / 5) * 5)
    return int(at[0]), int(at[1])


def heading(turn: Turn, angle: float) -> float:
    x, y = turn.matrix @ np.array([np.cos(angle), np.sin(angle)])
    return float(np.arctan2(y, x))


def world(turn: Turn) -> ForageEnv:
    """A world with nest, robots, objects and a cache where the turn puts them."""
    swap = np.abs(turn.matrix)
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


@pytest.mark.parametrize("config", [COMPACT, FULL], ids=["compact", "full"])
@pytest.mark.parametrize("turn", NAMED.values(), ids=NAMED)
def test_turned_rows_are_those_of_a_turned_world(turn, config):
    seen, interface = rows(world(AS_IT_IS), config)
    assert (seen != 0).any(axis=0).mean() > 0.4  # of the columns say something
    turn.rows(seen, interface.layout)
    there, _ = rows(world(turn), config)
    for part in interface.layout:
        columns = slice(part.start, part.stop)
        np.testing.assert_allclose(seen[:, columns], there[:, columns], atol=2e-6, err_msg=part.name)


@pytest.mark.parametrize("turn", NAMED.values(), ids=NAMED)
def test_the_global_view_is_that_of_a_turned_world(turn):
    seen, there = (env.state() for env in (world(AS_IT_IS), world(turn)))
    np.testing.assert_allclose(turn.state(seen, len(ROBOTS)), there, atol=2e-6)


@pytest.mark.parametrize("config", [COMPACT, FULL], ids=["compact", "full"])
@pytest.mark.parametrize("turn", NAMED.values(), ids=NAMED)
def test_robots_do_in_the_world_what_they_chose_in_the_turned_one(turn, config):
    one, other = world(AS_IT_IS), world(turn)
    (_, own), (_, theirs) = rows(one, config), rows(other, config)
    rng = np.random.default_rng(0)
    for _ in range(4):
        chosen = rng.integers(0, 6, len(ROBOTS)) if config is COMPACT else rng.uniform(-1, 1, (len(ROBOTS), 3))
        for _ in range(5):
            one.step_batch(own.command(turn.actions(chosen), one.last_obs).copy())
            other.step_batch(theirs.command(chosen, other.last_obs).copy())
    expected = np.array([place(turn, *at) for at in one.swarm.position])
    np.testing.assert_allclose(other.swarm.position, expected, atol=5e-4)  # two push each other, in some order
    moved = np.abs(one.swarm.position - np.array([robot[:2] for robot in ROBOTS])).max()
    assert moved > 0.05


def test_half_a_turn_changes_the_sign_of_four_columns_of_the_compact_view():
    seen, interface = rows(world(AS_IT_IS), COMPACT)
    turned = seen.copy()
    Turn(quarters=2).rows(turned, interface.layout)
    changed = np.flatnonzero((turned != seen).any(axis=0))
    absolute = [column for name in ("position", "heading") for column in range(40)[interface.layout[name]]]
    assert changed.tolist() == absolute
    np.testing.assert_array_equal(turned[:, absolute], -seen[:, absolute])


def test_masks_follow_the_actions():
    mask = np.zeros((1, 11), np.bool_)
    mask[0, [2, 7]] = True  # arc left, release
    assert np.flatnonzero(Turn(is_mirrored=True).mask(mask)).tolist() == [3, 7]
    assert np.flatnonzero(Turn(quarters=1).mask(mask)).tolist() == [2, 7]


def test_all_turns_are_equally_likely_and_a_seed_decides():
    found = Counter(map(turn_of, range(1600)))
    assert set(found) == set(TURNS)
    assert min(found.values()) > 150
    assert [turn_of(seed) for seed in range(20)] == [turn_of(seed) for seed in range(20)]


PLAN = plan_arena(sampler=sampler(), interface=COMPACT, max_cycles=20, turned=True)
SEEDS = (3, 5, 8, 13)


def test_an_arena_shows_its_world_by_the_turn_of_its_seed():
    as_drawn = plan_arena(sampler=sampler(), interface=COMPACT, max_cycles=20)
    for seed in SEEDS:
        turned, plain = LearnerArena(PLAN), LearnerArena(as_drawn)
        turned.reset(seed)
        plain.reset(seed)
        assert (turned.turn, plain.turn) == (turn_of(seed), AS_IT_IS)
        assert turned.forage_env.scenario == plain.forage_env.scenario
        rng = np.random.default_rng(seed)
        for _ in range(3):
            chosen = rng.integers(0, 6, turned.n_robots)
            earned = np.zeros((2, turned.n_robots))
            turned.step(chosen, earned[0])
            plain.step(turned.turn.actions(chosen.astype(np.int32)), earned[1])
            expected = plain.observe()
            turned.turn.rows(expected, plain.interface.layout)
            np.testing.assert_array_equal(turned.observe(), expected)
            np.testing.assert_array_equal(*earned)


@pytest.mark.parametrize("interface", [COMPACT, InterfaceConfig()], ids=["compact", "as it is"])
def test_a_batch_is_bit_for_bit_its_arenas_alone(interface):
    """Of one world, where compiled calls could pass rows and actions on as they are."""
    plan = plan_arena(n_robots=4, n_objects=20, interface=interface, max_cycles=10, turned=True)
    batch, alone = ArenaBatch(plan, 4), [ArenaBatch(plan, 1) for _ in SEEDS]
    obs, _ = batch.reset(SEEDS, [None] * 4)
    own = [one.reset([seed], [None])[0] for one, seed in zip(alone, SEEDS, strict=True)]
    np.testing.assert_array_equal(obs, np.concatenate(own))
    rng = np.random.default_rng(0)
    for _ in range(12):  # and on into the next runs
        chosen = (
            rng.integers(0, 6, (4, 4)) if interface is COMPACT else rng.uniform(-1, 1, (4, 4, 3)).astype(np.float32)
        )
        step = batch.step(chosen.reshape(16, *chosen.shape[2:]))
        steps = [one.step(actions) for one, actions in zip(alone, chosen, strict=True)]
        np.testing.assert_array_equal(step.obs, np.concatenate([one.obs for one in steps]))
        np.testing.assert_array_equal(step.rewards, np.concatenate([one.rewards for one in steps]))
    assert len({arena.turn for arena in batch.arenas}) > 1


def test_a_snapshot_keeps_the_turn():
    one, other = LearnerArena(PLAN), LearnerArena(PLAN)
    one.reset(3)
    other.reset(next(seed for seed in range(20) if turn_of(seed) != turn_of(3)))
    other.restore(one.snapshot())
    assert other.turn == one.turn
    np.testing.assert_array_equal(other.observe(), one.observe())


def test_a_parallel_environment_is_turned_with_its_state():
    made = parallel_env(n_robots=3, n_objects=10, turned=True)
    assert isinstance(made, ParallelLearnerEnv)
    seed = next(seed for seed in range(20) if turn_of(seed) == Turn(quarters=2))
    rows, _ = made.reset(seed=seed)
    start = made.interface.layout.part("position").start
    np.testing.assert_array_equal(made.state()[:2], rows["robot_0"][start : start + 2])
    np.testing.assert_array_equal(made.state()[:4], -made.forage_env.state()[:4])


def test_own_sensors_are_refused():
    register_sensor("compass_of_ours", lambda world: np.zeros((3, 1)))
    with pytest.raises(ConfigError, match=r"own sensors.*compass_of_ours.*turned=False"):
        plan_arena(own_sensors=("compass_of_ours",), turned=True)
