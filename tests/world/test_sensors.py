"""Every slice of the observation against a slow twin, and the numbers of the sensor models."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from swarm_forage_env.contract.codes import CELL_OBJECT, Event, Grip
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.kernels.beams import proximity_reading
from swarm_forage_env.world.kernels.floor import fading, quarter_turns
from tests.reference import sensing
from tests.support.foraging import NEAR
from tests.support.stage import act, build_cache, cell_centre, lay, load, put, stand, tidy_world

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


def test_events_and_cargo_are_seen_in_the_step_that_brings_them():
    env = tidy_world(n_robots=3, caches="static")
    slot = build_cache(env, [4, 5, 6], (60, 40))
    stand(env, 0, (60, 40))
    stand(env, 1, (90, 30))
    lay(env, 0, (90, 30))
    load(env, 2, 1)
    stand(env, 2, (60, 42))
    act(env, {0: Grip.GRASP, 1: Grip.GRASP, 2: Grip.RELEASE})
    columns = env.layout
    obs = env.arena.observe()
    assert obs[:, columns["interacting"]].ravel().tolist() == [1, 1, 1]
    assert_matches_twin(env, obs)
    assert act(env, {0: Grip.GRASP, 1: Grip.GRASP, 2: Grip.RELEASE}) == [
        Event.PICKED_FROM_CACHE,
        Event.PICKED_UP,
        Event.JOINED_CACHE,
    ]
    assert_matches_twin(env, obs)
    assert obs[:, columns["interacting"]].ravel().tolist() == [0, 0, 0]
    assert obs[:, columns["carrying"]].ravel().tolist() == [1, 1, 0]
    assert obs[1, columns["cargo"]] == np.float32(1 / 8)
    assert obs[1, columns["event_object"]] == np.float32(1 / 8)
    # The drop comes first, so the cache held 4 when an object left it.
    assert obs[0, columns["event_cache"]][3] * 8 == 3
    assert obs[2, columns["event_cache"]][3] * 8 == 4
    assert obs[2, columns["event_cache"]][0] * 2**24 == env.caches.serial[slot]


@pytest.mark.parametrize(("gap", "value"), [(0.1, 0.1004), (0.05, 0.2004), (0.02, 0.4986), (0.01, 0.9891)])
def test_proximity_readings(gap, value):
    assert proximity_reading(gap) == pytest.approx(value, abs=5e-5)


def test_rows_of_absent_robots_are_zero_and_those_in_repair_are_not():
    env = tidy_world(n_robots=3)
    for robot in range(3):
        put(env, robot, *cell_centre((16, 40 + 2 * robot)))
    env.set_population(active=np.array([True, False, False]), present=np.array([True, True, False]))
    act(env, {})
    obs = env.arena.observe()
    np.testing.assert_array_equal(obs[2], np.zeros(env.layout.size))
    assert obs[:, env.layout["active"]].ravel().tolist() == [1, 0, 0]
    assert obs[1, env.layout["ground"]] == pytest.approx([179 / 255] * 4)
    assert_matches_twin(env, obs)


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
