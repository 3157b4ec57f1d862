"""Every slice of the observation against a slow twin; interference, by one rule; neighbours and messages."""

import collections
import itertools
import math
from typing import Any

import gymnasium
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm_forage_env import ConfigError, parallel_env
from swarm_forage_env.contract.codes import CELL_OBJECT, Counter, Event
from swarm_forage_env.contract.policy import ActionError, SwarmSpec
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.interface import InterfaceConfig, LearnerInterface
from swarm_forage_env.scenarios.obstacles import distances_m
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import Quirks
from swarm_forage_env.world.kernels.beams import proximity
from swarm_forage_env.world.kernels.bins import bin_robots, mark_cells, may_be_beside
from swarm_forage_env.world.kernels.floor import fading, quarter_turns
from tests.reference import sensing
from tests.support.foraging import NEAR
from tests.support.stage import OPEN_CELL, act, build_cache, cell_centre, put, tidy_world

MODELLED = ("proximity", "light", "ground", "wheel_speed", "position", "heading")
"""Slices that come out of sensor models; all others are exact to the last bit."""
CACHE_KINDS = ("none", "static", "dynamic")


def assert_matches_twin(env: ForageEnv, obs: np.ndarray) -> None:
    expected = sensing.observe(env)
    for part in env.layout:
        columns = slice(part.start, part.stop)
        if part.name in MODELLED:
            np.testing.assert_allclose(obs[:, columns], expected[:, columns], atol=1e-6, rtol=0, err_msg=part.name)
        else:
            np.testing.assert_array_equal(
                obs[:, columns], expected[:, columns].astype(np.float32), err_msg=part.name, strict=True
            )


def crowded_world(rng: np.random.Generator, caches: str) -> ForageEnv:
    """Forty robots, some of them away, packed so that many touch, over objects, nest, caches and walls."""
    env = ForageEnv(scenario("warehouse_small", n_robots=40, n_objects=60, caches=caches, side_share=0.05))
    env.reset_batch(int(rng.integers(1000)))
    x, y = rng.choice([(0.3, 0.3), (13.0, 6.5), (29.5, 13.5), (4.0, 7.0), (24.0, 5.0)])
    swarm = env.swarm
    swarm.position[:] = rng.uniform((x, y), (x + 2.0, y + 2.0), (40, 2))
    swarm.heading[:] = rng.uniform(-np.pi, np.pi, 40)
    swarm.facing[:] = np.column_stack((np.cos(swarm.heading), np.sin(swarm.heading)))
    swarm.wheel_speed[:] = rng.uniform(-0.25, 0.25, (40, 2))
    swarm.present[:] = rng.random(40) < 0.9
    swarm.active[:] = swarm.present & (rng.random(40) < 0.9)
    swarm.pending_kind[:] = rng.integers(0, 3, 40)
    return env


def random_events(env: ForageEnv, rng: np.random.Generator) -> None:
    """Events as the interactions could have left them."""
    n_robots, n_objects = len(env.active), env.scenario.objects.n_objects
    nx, ny = env.scenario.arena.n_cells
    events = env.events
    events.code[:] = rng.integers(0, max(Event) + 1, n_robots)
    events.event_object[:] = rng.integers(-1, n_objects, n_robots)
    events.event_cache[:] = rng.integers(0, (2**24, nx, ny, n_objects + 1), (n_robots, 4))
    events.event_cache[rng.random(n_robots) < 0.5] = 0


@pytest.mark.parametrize("caches", CACHE_KINDS)
@settings(max_examples=8)
@given(seed=st.integers(0, 2**32 - 1))
def test_every_slice_equals_its_twin_in_crowded_worlds(caches, seed):
    rng = np.random.default_rng(seed)
    env = crowded_world(rng, caches)
    if caches == "dynamic":
        build_two_caches(env)
    random_events(env, rng)
    assert_matches_twin(env, env.arena.observe())


def build_two_caches(env: ForageEnv) -> None:
    for rows, centre in (([0, 1], (60, 40)), ([2, 3, 4], (72, 40))):
        half = env.scenario.cache_side_cells // 2
        (x, y), floor = centre, env.objects.floor
        square = floor[y - half : y + half + 1, x - half : x + half + 1]
        build_cache(env, sorted({*rows, *(square[square >= CELL_OBJECT] - CELL_OBJECT).tolist()}), centre)


@pytest.mark.parametrize(("name", "caches"), [*zip(NEAR, itertools.cycle(CACHE_KINDS), strict=False)])
def test_every_slice_equals_its_twin_along_a_run(name, caches):
    env = ForageEnv(scenario(name, n_robots=12, caches=caches, **crowding(name)))
    assert_matches_twin(env, env.reset_batch(5))
    rng = np.random.default_rng(5)
    for tick in range(1, 61):
        obs = env.step_batch(rng.uniform(-1, 1, (12, 3)).astype(np.float32))[0]
        if tick % 6 == 0:
            assert_matches_twin(env, obs)


def crowding(name: str) -> dict[str, object]:
    """Enough objects that robots meet some."""
    return {"n_objects": 80} if name == "search_and_rescue" else {"n_objects": 300}


@pytest.mark.parametrize("seed", range(3))
def test_among_boxes_beams_and_interference_are_those_of_the_slow_twin(seed):
    block = (16.0, 8.0, 16.4, 8.6)
    env = tidy_world(n_robots=6, obstacles=(block, (20.0, 4.0, 20.4, 12.0)))
    rng = np.random.default_rng(seed)
    for robot in range(6):
        angle = rng.uniform(-math.pi, math.pi)
        while True:
            place = rng.uniform((15.8, 7.8), (16.6, 8.8))
            away = distances_m((block,), place[None])[0]
            if away > sensing.RADIUS_M and (
                robot == 0 or np.hypot(*(env.swarm.position[:robot] - place).T).min() > 2 * sensing.RADIUS_M
            ):
                break
        put(env, robot, *place, angle)
    obs = env.arena.observe()
    np.testing.assert_allclose(obs, sensing.observe(env), atol=2e-6)
    assert obs[:, env.layout["proximity"]].any()
    env.step_batch(np.zeros((6, 3), np.float32))
    assert env.events.interfering.tolist() == [sensing.interferes(env, robot) for robot in range(6)]


# Reading less


def test_light_fades_and_turns_as_the_library_says():
    scaled = np.linspace(0.0, 2.5, 251)
    np.testing.assert_allclose([fading(at) for at in scaled], np.exp(-2.0 * scaled), rtol=1e-9)
    angles = np.concatenate((np.linspace(0.0, 2.0 * np.pi, 720, endpoint=False), np.pi / 4 * np.arange(8) + 1e-12))
    turns = [quarter_turns(2.0 * np.cos(angle), 2.0 * np.sin(angle)) for angle in angles]
    np.testing.assert_allclose(np.exp(0.5j * np.pi * np.array(turns)), np.exp(1j * angles), atol=2e-10)
    assert quarter_turns(0.0, 0.0) == 0.0


@pytest.mark.parametrize("reads", [(), ("ground", "event")])
def test_reads_may_only_skip_slices_that_nobody_reads(reads):
    config = scenario("warehouse_small", n_robots=20, caches="static")
    full, partial = ForageEnv(config), ForageEnv(config, reads=reads)
    expected, obs = full.reset_batch(3), partial.reset_batch(3)
    rng = np.random.default_rng(3)
    for _ in range(40):
        for part in full.layout:
            columns = slice(part.start, part.stop)
            if part.name in reads or np.any(obs[:, columns]):
                np.testing.assert_array_equal(obs[:, columns], expected[:, columns], err_msg=part.name)
        actions = rng.uniform(-1, 1, (20, 3)).astype(np.float32)
        expected, obs = full.step_batch(actions)[0], partial.step_batch(actions)[0]
    np.testing.assert_array_equal(full.state(), partial.state())
    np.testing.assert_array_equal(full.events.counters, partial.events.counters)


# Bits of cells with robots, by which large swarms leave out cells where nobody is


N_MANY, SIDE_M, RADIUS_M, REACH_M = 1500, 40.0, 0.085, 0.1
CELL_M = 2 * RADIUS_M + REACH_M


@pytest.fixture
def many_robots():
    """Robots, some in pairs, in lines along the ends of words and in the corners; some are away."""
    rng = np.random.default_rng(5)
    position = rng.uniform(0.1, SIDE_M - 0.1, (N_MANY, 2))
    position[500:1000] = np.clip(position[:500] + rng.uniform(-0.2, 0.2, (500, 2)), 0.1, SIDE_M - 0.1)
    position[1000:1100, 0] = 32 * CELL_M * rng.integers(1, 4, 100) + rng.uniform(-0.3, 0.3, 100)
    angle = rng.uniform(-np.pi, np.pi, N_MANY)
    return position, np.column_stack((np.cos(angle), np.sin(angle))), rng.random(N_MANY) < 0.9


def seen_with(many_robots, n_bins, n_words):
    """Readings and who is near, as it is with so many bins and words."""
    position, facing, present = many_robots
    first_in_bin, next_in_bin = np.full(n_bins, -1, np.int32), np.full(N_MANY, -1, np.int32)
    occupied = np.full(n_words, 2**32 - 1, np.uint32)
    bin_robots(position, present, CELL_M, first_in_bin, next_in_bin)
    mark_cells(position, present, CELL_M, occupied)
    obs, near = np.zeros((N_MANY, 24), np.float32), np.zeros(N_MANY, np.bool_)
    bins, room = (CELL_M, first_in_bin, next_in_bin), np.array([0.0, 0.0, SIDE_M, SIDE_M])
    walls = room, np.zeros((0, 4))
    proximity(position, facing, present, bins, occupied, *walls, RADIUS_M, REACH_M, obs, 0, near, False)
    return obs, near


@pytest.mark.parametrize(("n_words", "n_bins"), [(2, 8192), (64, 64), (4096, 8192)])
def test_with_them_robots_see_what_they_see_without(many_robots, n_bins, n_words):
    (obs, near), (plain, plainly_near) = seen_with(many_robots, n_bins, n_words), seen_with(many_robots, n_bins, 1)
    assert 0.4 < near.mean() < 0.9
    np.testing.assert_array_equal(near, plainly_near)
    np.testing.assert_array_equal(obs, plain)


def test_who_is_alone_is_mostly_known_to_be(many_robots):
    position, _, _ = many_robots
    occupied = np.zeros(4096, np.uint32)
    alone = np.ones(N_MANY, np.bool_)
    alone[100:] = False
    mark_cells(position, alone, CELL_M, occupied)
    cells = (position[:100] / CELL_M).astype(int)
    assert np.mean([may_be_beside(int(x), int(y), occupied) for x, y in cells]) < 0.2


# Interference: which robots lose time to avoidance, measured by one rule from true readings


WORK = (Counter.SEARCHING, Counter.HANDLING, Counter.HOMING, Counter.AT_CACHES, Counter.INTERFERING)
"""What a robot at work can do, one at a time."""


@pytest.mark.parametrize("quirks", [Quirks(), Quirks(obstacle_behind_counts=True)], ids=["described", "program"])
def test_who_is_behind_interferes_in_the_program_only(quirks):
    env = tidy_world(quirks=quirks)
    put(env, 0, 16.0, 8.0)
    put(env, 1, 16.25, 8.0)  # turns its back to robot 0
    act(env, {})
    assert env.events.interfering.tolist() == [True, quirks.obstacle_behind_counts, False, False]


@pytest.mark.parametrize(("away_m", "near"), [(1.9, 2), (2.0, 1), (2.1, 0)], ids=["near", "at the border", "farther"])
def test_time_lost_near_a_cache_is_told_from_other_time(away_m, near):
    """Of a pair that stand along a circle around a cache, and of a robot at a wall, the pair alone may be near it."""
    env = tidy_world(caches="dynamic")
    build_cache(env, (0, 1), OPEN_CELL)
    x, y = cell_centre(OPEN_CELL)
    put(env, 0, 60.5 * 0.2 + away_m, y, math.pi / 2)
    put(env, 1, x + away_m, y + 0.25, -math.pi / 2)
    put(env, 2, 31.6 - 0.1, 8.0)
    put(env, 3, 6.0, 12.0)
    act(env, {})
    assert env.events.interfering.tolist() == [True, True, True, False]
    assert env.events.counters[Counter.INTERFERING_NEAR_CACHES] == near


def test_flags_and_sums_equal_those_of_the_slow_rule_on_slow_readings():
    """Sixty robots with 24 beams each against all others, in Python: it takes three seconds."""
    env = ForageEnv(scenario("warehouse_small", n_robots=60, n_objects=400, start_margin_m=6.5, caches="static"))
    env.reset_batch(2)
    present, active = np.arange(60) % 12 != 0, np.arange(60) % 6 != 0
    env.set_population(active=active, present=present)
    rng = np.random.default_rng(2)
    counted, share, before = collections.Counter[Counter](), 0.0, [False] * 60
    for _ in range(20):
        robots_do = [sensing.work(env.swarm, robot) for robot in range(60)]  # before the grippers of the tick move
        env.step_batch(rng.uniform(-1, 1, (60, 3)).astype(np.float32))
        expected = [sensing.interferes(env, robot) for robot in range(60)]
        assert env.events.interfering.tolist() == expected
        counted[Counter.INTERFERING] += sum(expected)
        counted[Counter.INTERFERING_NEAR_CACHES] += sum(
            flag and sensing.is_near_cache(env, robot) for robot, flag in enumerate(expected)
        )
        counted[Counter.AVOIDANCES] += sum(now and not then for now, then in zip(expected, before, strict=True))
        counted.update(robots_do[robot] for robot in range(60) if active[robot] and not expected[robot])
        share += sum(expected) / 50
        before = expected
    assert counted[Counter.INTERFERING] > counted[Counter.AVOIDANCES] > 10
    known = (*WORK, Counter.AVOIDANCES, Counter.INTERFERING_NEAR_CACHES)
    assert {counter: int(env.events.counters[counter]) for counter in known} == {
        counter: counted[counter] for counter in known
    }
    assert min(counted[counter] for counter in known) > 0, "the test knows each of them"
    assert counted[Counter.INTERFERING_NEAR_CACHES] < counted[Counter.INTERFERING]
    assert env.events.interference_sum[0] == pytest.approx(share)
    assert [int(env.events.counters[c]) for c in (Counter.ACTIVE, Counter.PRESENT)] == [20 * 50, 20 * 55]


# Neighbours and messages: what robots perceive of each other


N_FEW = 12
SMALL: dict[str, Any] = {
    "n_robots": N_FEW,
    "n_objects": 60,
    "width_m": 8.0,
    "height_m": 6.0,
    "nest_centre_m": (1.0, 3.0),
    "nest_size_m": (0.8, 2.0),
    "start_margin_m": 0.6,
    "physics": "compiled",
}
BOTH: dict[str, Any] = {"neighbours_seen": 3, "neighbour_range_m": 1.3, "message_size": 2, "message_range_m": 1.7}


def made(**fields: Any) -> ForageEnv:
    return ForageEnv(scenario("warehouse_small", **(SMALL | fields)))


def drawn(ticks: int, size: int = 5) -> np.ndarray:
    """Actions with which robots drive on, grasp and say something, some of it out of range."""
    actions = np.random.default_rng(0).uniform(-1.2, 1.2, (ticks, N_FEW, size)).astype(np.float32)
    actions[..., :3] = np.abs(actions[..., :3])
    return actions


def slice_of(env: ForageEnv, name: str) -> np.ndarray:
    return env.last_obs[:, env.layout[name]]


@pytest.mark.parametrize("physics", ["chipmunk", "compiled"])
def test_they_are_those_of_the_twins_and_change_nothing_else(physics):
    plain, env = made(physics=physics), made(physics=physics, **BOTH)
    assert env.layout.names == (*plain.layout.names, "neighbours", "messages")
    plain.reset_batch(seed=1)
    env.reset_batch(seed=1)
    assert not slice_of(env, "messages").any(), "nobody has said anything yet"
    rng, met = np.random.default_rng(1), set[float]()
    for tick, actions in enumerate(drawn(40)):
        if tick % 10 == 5:  # some are away, some in repair
            present = rng.random(N_FEW) < 0.8
            active = present & (rng.random(N_FEW) < 0.8)
            for each in (plain, env):
                each.set_population(active=active, present=present)
        plain.step_batch(np.ascontiguousarray(actions[:, :3]))
        env.step_batch(actions)
        np.testing.assert_array_equal(env.last_obs[:, : plain.layout.size], plain.last_obs)
        seen = [sensing.neighbours(env, robot) for robot in range(N_FEW)]
        heard = [sensing.heard(env, robot, actions[:, 3:]) for robot in range(N_FEW)]
        np.testing.assert_allclose(slice_of(env, "neighbours"), seen, atol=1e-6)
        np.testing.assert_allclose(slice_of(env, "messages"), heard, atol=1e-6)
        met.update(slice_of(env, "neighbours")[:, 3::4].sum(axis=1).tolist())
    assert met == {0.0, 1.0, 2.0, 3.0}


def test_cargo_is_seen_and_the_nearest_comes_first():
    env = made(**BOTH)
    env.reset_batch(seed=1)
    env.swarm.position[:] = np.column_stack([np.full(N_FEW, 7.0), 0.4 + 0.4 * np.arange(N_FEW)])
    env.swarm.position[:3] = (3.0, 3.0), (3.5, 3.0), (3.0, 3.4)
    env.swarm.facing[0] = 0.0, 1.0
    env.swarm.carried_object[1] = 5
    env.arena.observe()
    forward, left = 0.4 / 1.3, -0.5 / 1.3
    expected = [forward, 0.0, 0.0, 1.0, 0.0, left, 1.0, 1.0, 0.0, 0.0, 0.0, 0.0]
    np.testing.assert_allclose(slice_of(env, "neighbours")[0], expected, atol=1e-6)


def test_of_equally_near_robots_the_lower_row_comes_first():
    env = made(neighbours_seen=2)
    env.reset_batch(seed=1)
    env.swarm.position[:] = np.column_stack([np.full(N_FEW, 7.0), 0.4 + 0.4 * np.arange(N_FEW)])
    env.swarm.position[:4] = (3.0, 3.0), (3.5, 3.0), (2.5, 3.0), (3.0, 3.5)
    env.swarm.facing[0] = 1.0, 0.0
    env.arena.observe()
    np.testing.assert_allclose(slice_of(env, "neighbours")[0, [0, 1, 4, 5]], [0.25, 0.0, -0.25, 0.0], atol=1e-6)


def test_a_message_that_is_not_finite_is_refused():
    env = made(**BOTH)
    env.reset_batch(seed=1)
    actions = np.zeros((N_FEW, 5), np.float32)
    actions[4, 3] = np.nan
    with pytest.raises(ActionError, match="robot_4; the world was not stepped"):
        env.step_batch(actions)
    with pytest.raises(ActionError, match=r"\(n_robots, 3 \+ message_size\) = \(12, 5\), got \(12, 4\)"):
        env.step_batch(np.zeros((N_FEW, 4), np.float32))
    assert env.tick == 0


@pytest.mark.parametrize("observation", ["full", "compact"])
def test_learners_see_and_say_them_through_every_view(observation):
    fields: dict[str, Any] = {**SMALL, **BOTH, "interface": {"observation": observation}}
    dicts = parallel_env("warehouse_small", **fields)
    rows = gymnasium.make_vec("swarm_forage/warehouse_small-v0", **fields)
    joint = gymnasium.make("swarm_forage/warehouse_small-v0", **fields)
    size = {"full": 111, "compact": 23}[observation] + 12 + 3
    assert dicts.action_space("robot_0").shape == rows.single_action_space.shape == (5,)
    assert joint.action_space.shape == (N_FEW, 5)
    first = [np.stack(list(dicts.reset(seed=3)[0].values())), rows.reset(seed=3)[0], joint.reset(seed=3)[0]]
    actions = np.clip(drawn(1)[0], -1.0, 1.0)
    stepped = [
        np.stack(list(dicts.step(dict(zip(dicts.possible_agents, actions, strict=True)))[0].values())),
        rows.step(actions)[0],
        joint.step(actions)[0],
    ]
    for seen in (first, stepped):
        assert seen[0].shape == (N_FEW, size)
        np.testing.assert_array_equal(seen[0], seen[1])
        np.testing.assert_array_equal(seen[0], seen[2])
    assert stepped[0][:, -1].any()
    assert (stepped[0][:, -3:-1] != 0.0).any(), "what is heard are not only zeros"


def test_a_policy_says_what_it_needs():
    shown = InterfaceConfig(observation="compact").for_scenario(scenario("warehouse_small", **BOTH))
    assert (shown.neighbours_seen, shown.neighbour_range_m, shown.message_size) == (3, 1.3, 2)
    for fields, words in (
        ({}, r"got none; give the scenario neighbours_seen=3 and neighbour_range_m=1\.3"),
        ({**BOTH, "neighbour_range_m": 2.0}, r"forward, left / 2 m.*neighbour_range_m=1\.3"),
        ({**BOTH, "message_size": 1}, r"messages of 2 numbers, .* got 1; give the scenario message_size=2"),
    ):
        with pytest.raises(ConfigError, match=words):
            LearnerInterface(shown, SwarmSpec.of(scenario("warehouse_small", **fields)))
    with pytest.raises(ConfigError, match=r"a scenario with neighbours, because the policy reads .* neighbours_seen"):
        ForageEnv(scenario("warehouse_small"), reads=shown.reads)
    blind = InterfaceConfig(neighbours_seen=0, message_size=0).for_scenario(scenario("warehouse_small", **BOTH))
    assert blind.sensors == ()


def test_numbered_actions_carry_no_message():
    with pytest.raises(ConfigError, match=r"'continuous' for messages of 2 numbers, got 'discrete'.*message_size=0"):
        parallel_env("warehouse_small", **BOTH, interface={"actions": "discrete"})
    interface = {"actions": "discrete", "message_size": 0}
    env = parallel_env("warehouse_small", **SMALL, **BOTH, interface=interface)
    assert "messages" not in env.interface.layout.names
    env.reset(seed=1)
    env.step(dict.fromkeys(env.agents, 1))


def test_a_reset_keeps_the_spaces():
    env = parallel_env("warehouse_small", **SMALL, **BOTH, interface={})
    env.reset(options={"scenario": {"neighbour_range_m": 1.3, "message_range_m": 3.0}})
    with pytest.raises(ConfigError, match="message_size to stay 2, as spaces promise, got 3"):
        env.reset(options={"scenario": {"message_size": 3}})
    with pytest.raises(ConfigError, match=r"neighbour_range_m to stay 1\.3, .* got 4;"):
        env.reset(options={"scenario": {"neighbour_range_m": 4.0}})
    env.reset()
    assert env.forage_env.scenario.robots.neighbour_range_m == 1.3
    alone = parallel_env("warehouse_small", **SMALL, interface={})
    alone.reset(options={"scenario": {"neighbour_range_m": 4.0}})  # no column depends on it
