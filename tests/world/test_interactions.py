"""Pick-ups and drops: examples by hand, and the kernel against a slow twin that tells every rule."""

from collections import Counter as Tally

import numpy as np
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_OBJECT, Counter, Event, Grip, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import Quirks
from swarm_forage_env.world.kernels import interact as kernel
from swarm_forage_env.world.state import listed
from tests.reference import interacting
from tests.reference.interacting import SlowCache, SlowWorld
from tests.support.stage import (
    CORNER_CACHE,
    CORNERS,
    NEST_CELL,
    OPEN_CELL,
    act,
    assert_conserved,
    build_cache,
    cell_centre,
    count,
    events_of,
    kill,
    lay,
    load,
    put,
    stand,
    tidy_world,
)

NONE, PICKED_UP, DELIVERED, VANISHED = Event.NONE, Event.PICKED_UP, Event.DELIVERED, Event.VANISHED


@pytest.mark.parametrize(
    ("band", "grips"),
    [
        (kernel.GRASP, (7.0, 1.0, 1e-6)),
        (kernel.RELEASE, (0.0, -0.125, -0.2499)),
        (kernel.DELIVER_ONLY, (-0.25, -0.375, -0.4999)),
        (kernel.SITE, (-0.5, -0.625, -0.7499)),
        (kernel.CREATE_CACHE, (-0.75, -1.0, -7.0)),
    ],
)
def test_bands(band, grips):
    assert {kernel.band_of(np.float32(grip)) for grip in grips} == {band}


def test_grasping_over_an_object_picks_it_up_one_tick_later():
    env = tidy_world()
    stand(env, 0, OPEN_CELL)
    lay(env, 5, OPEN_CELL)
    assert act(env, {0: Grip.GRASP}) == [NONE] * 4
    assert env.swarm.carried_object[0] == -1, "no effect yet"
    assert env.objects.status[5] == ObjectStatus.FREE
    assert act(env, {0: Grip.GRASP}) == [PICKED_UP, NONE, NONE, NONE]
    assert env.events.event_object[0] == 5
    assert env.events.event_cache[0].tolist() == [0, 0, 0, 0]
    assert env.swarm.carried_object[0] == 5
    assert not env.swarm.cargo_from_cache[0]
    assert env.objects.status[5] == ObjectStatus.CARRIED
    assert env.objects.floor[OPEN_CELL[::-1]] == CELL_EMPTY
    assert events_of(env, Grip.GRASP, 3) == [NONE, NONE, NONE], "a carrying robot that grasps holds"
    assert count(env, Counter.FREE_PICKUPS) == 1
    assert_conserved(env)


@pytest.mark.parametrize(
    ("grip", "place"),
    [
        (0.0, cell_centre(NEST_CELL)),
        (Grip.RELEASE, (1.6, 1.6)),  # its borders belong to the nest
        (Grip.DELIVER, (4.8, 14.4)),
        (Grip.SITE, (1.6, 14.4)),
        (Grip.CREATE_CACHE, (4.8, 1.6)),
    ],
)
def test_any_release_in_the_nest_delivers_one_tick_later(grip, place):
    env = tidy_world(caches="dynamic")
    put(env, 0, *place)
    load(env, 0, 2)
    assert act(env, {0: grip})[0] == NONE
    assert env.swarm.carried_object[0] == 2, "no effect yet"
    assert act(env, {0: grip})[0] == DELIVERED
    assert env.events.event_object[0] == 2
    assert env.swarm.carried_object[0] == -1
    assert count(env, Counter.COLLECTED) == 1
    # Re-placed in the same tick, in the source, as new.
    assert env.objects.status[2] == ObjectStatus.FREE
    x, y = env.objects.cell[2].tolist()
    assert 120 <= x < 136
    assert 12 <= y < 68
    assert env.objects.carriers[2] == 0
    assert_conserved(env)


def test_pick_ups_and_drops_of_several_ticks():
    env = tidy_world(pickup_ticks=3, drop_ticks=2)
    stand(env, 0, OPEN_CELL)
    lay(env, 0, OPEN_CELL)
    actions = np.zeros((4, 3), np.float32)
    actions[0] = 0.5, 0.5, Grip.GRASP
    shown, speeds = [], []
    for _ in range(5):
        obs = env.step_batch(actions)[0]
        shown.append(int(obs[0, env.layout["interacting"]][0]))
        speeds.append(round(100 * float(env.swarm.wheel_speed[0, 0]), 6))
    assert env.swarm.carried_object[0] == 0
    assert shown == [1, 1, 1, 0, 0]
    assert speeds == [10.0, 0.0, 0.0, 0.0, 10.0]
    stand(env, 0, NEST_CELL)
    assert events_of(env, Grip.DELIVER, 3) == [NONE, NONE, DELIVERED]
    with pytest.raises(ConfigError, match="pickup, in ticks, to be a whole number"):
        env.set_handling_ticks(pickup=1.5, drop=1)


@pytest.mark.parametrize(("rows", "tick"), [((0, 3), 3), ((1, 2), 1), ((3, 1), 5)])
def test_the_turn_goes_round(rows, tick):
    env = tidy_world(n_robots=5)
    lay(env, 0, OPEN_CELL)
    x, y = cell_centre(OPEN_CELL)
    for robot, (dx, dy) in zip(rows, CORNERS, strict=True):
        put(env, robot, x + dx, y + dy)
    env.arena.tick = 100 + tick
    act(env, dict.fromkeys(rows, Grip.GRASP))
    events = act(env, dict.fromkeys(rows, Grip.GRASP))
    first, second = sorted(rows, key=lambda robot: (robot - env.tick) % 5)
    assert (events[first], events[second]) == (PICKED_UP, VANISHED)


def test_a_dying_robot_drops_its_cargo_on_the_floor_or_into_the_cache():
    env = tidy_world(caches="dynamic")
    slot = build_cache(env, [6, 7], CORNER_CACHE)
    for robot, cell in enumerate((OPEN_CELL, CORNER_CACHE)):
        stand(env, robot, cell)
        load(env, robot, 3 + robot)
        kill(env, robot)
    assert env.objects.cache_slot[4] == slot
    assert env.objects.cell[3].tolist() == list(OPEN_CELL)
    assert env.swarm.carried_object[0] == -1
    assert_conserved(env)
    assert act(env, {0: Grip.GRASP}) == [NONE] * 4


# The kernel against a slow twin, in a crowd that asks for everything everywhere


N_ROBOTS, N_OBJECTS = 12, 30
PATCH = (21, 36, 33, 44)
"""Cells that everything happens on: an edge of the nest, open floor and room for two caches."""
BANDS = {
    0: "",
    kernel.GRASP: interacting.GRASP,
    kernel.RELEASE: interacting.RELEASE,
    kernel.DELIVER_ONLY: interacting.DELIVER,
    kernel.SITE: interacting.SITE,
    kernel.CREATE_CACHE: interacting.CREATE_CACHE,
}
KINDS = {
    kernel.DELIVER: "deliver",
    kernel.CACHE_DROP: "drop into cache",
    kernel.SITE_DROP: interacting.SITE,
    kernel.CREATE_DROP: interacting.CREATE_CACHE,
    kernel.FLOOR_PICKUP: "take from floor",
    kernel.CACHE_PICKUP: "take from cache",
}


def crowd(caches: str, quirks: Quirks) -> ForageEnv:
    config = scenario(
        "warehouse_small",
        n_robots=N_ROBOTS,
        n_objects=N_OBJECTS,
        caches=caches,
        side_share=0.02,
        distance_share=0.01,
        quirks=quirks,
    )
    env = ForageEnv(config)
    env.reset_batch(0)
    return env


def mirror(env: ForageEnv) -> SlowWorld:
    """The slow twin of a world as it is."""
    swarm, objects, caches, config = env.swarm, env.objects, env.caches, env.scenario
    pending = {}
    for robot in np.flatnonzero(swarm.pending_kind).tolist():
        kind, target = KINDS[int(swarm.pending_kind[robot])], int(swarm.pending_target[robot])
        pending[robot] = BANDS[int(swarm.pending_band[robot])], (kind, None if target < 0 else target)
    lying = np.flatnonzero(objects.status == ObjectStatus.FREE).tolist()
    return SlowWorld(
        nests=config.arena.nest_boxes_m,
        area=config.arena.distributable_cells,
        side_cells=config.cache_side_cells,
        proximity_m=config.cache_proximity_m,
        dynamic=config.caches == "dynamic",
        serialized=config.quirks.serialized_interactions,
        only_delivering_counts=config.quirks.only_delivering_counts,
        position=[(x, y) for x, y in swarm.position.tolist()],
        active=swarm.active.tolist(),
        cargo={robot: row for robot, row in enumerate(swarm.carried_object.tolist()) if row >= 0},
        pending=pending,
        until={robot: int(swarm.pending_until[robot]) for robot in pending},
        pickup_ticks=int(env.arena._requests.handling_ticks[0]),
        drop_ticks=int(env.arena._requests.handling_ticks[1]),
        floor={tuple(objects.cell[row].tolist()): row for row in lying},
        caches={
            int(caches.serial[slot]): SlowCache(
                tuple(caches.cell[slot].tolist()), set(np.flatnonzero(objects.cache_slot == slot).tolist())
            )
            for slot in np.flatnonzero(caches.alive).tolist()
        },
        carriers=dict(enumerate(objects.carriers.tolist())),
        from_cache=set(np.flatnonzero(swarm.cargo_from_cache).tolist()),
    )


def assert_same(env: ForageEnv, expected: SlowWorld) -> None:
    happened = {}
    for robot in np.flatnonzero(env.events.code).tolist():
        about = tuple(env.events.event_cache[robot].tolist())
        happened[robot] = Event(int(env.events.code[robot])), int(env.events.event_object[robot]), about
    assert happened == expected.events
    seen = mirror(env)
    for name in ("cargo", "pending", "until", "floor", "caches", "carriers", "from_cache"):
        assert getattr(seen, name) == getattr(expected, name), name
    assert set(np.flatnonzero(env.events.first_picked).tolist()) == expected.first_picked
    requests = env.arena._requests
    assert listed(requests.displaced).tolist() == expected.displaced
    assert listed(requests.creators).tolist() == expected.creators


def shuffle(env: ForageEnv, rng: np.random.Generator, grips: np.ndarray) -> None:
    """Move, reactivate and change the mind of some robots; keep objects on the patch and a cache standing."""
    swarm, objects = env.swarm, env.objects
    low, high = np.array(PATCH[:2]) / 5, np.array(PATCH[2:]) / 5
    moved = rng.random(N_ROBOTS) < 0.15
    swarm.position[:] = np.where(moved[:, None], rng.uniform(low, high, (N_ROBOTS, 2)), swarm.position)
    swarm.position[:] = np.clip(swarm.position, low, high - 1e-6)
    swarm.active[:] = rng.random(N_ROBOTS) < 0.9
    wish = np.where(swarm.carried_object < 0, 1.0, rng.choice([-0.125, -0.375, -0.625, -1.0], N_ROBOTS))
    wish = np.where(rng.random(N_ROBOTS) < 0.2, rng.uniform(-1, 1, N_ROBOTS), wish)
    grips[:] = np.where(rng.random(N_ROBOTS) < 0.3, wish, grips)
    for row in np.flatnonzero(objects.status == ObjectStatus.FREE).tolist():
        x, y = objects.cell[row].tolist()
        if PATCH[0] <= x < PATCH[2] and PATCH[1] <= y < PATCH[3]:
            continue
        to_x, to_y = rng.integers(PATCH[:2], PATCH[2:]).tolist()
        if to_x >= 24 and objects.floor[to_y, to_x] == CELL_EMPTY:
            objects.floor[y, x] = CELL_EMPTY
            objects.floor[to_y, to_x] = CELL_OBJECT + row
            objects.cell[row] = to_x, to_y
    if len(env.caches.alive) and np.count_nonzero(env.caches.alive) < 2 and rng.random() < 0.5:
        create_somewhere(env, rng)


def create_somewhere(env: ForageEnv, rng: np.random.Generator) -> None:
    half = env.scenario.cache_side_cells // 2
    x, y = rng.integers((PATCH[0], PATCH[1]), (PATCH[2], PATCH[3])).tolist()
    floor = env.objects.floor
    square = floor[y - half : y + half + 1, x - half : x + half + 1]
    rows = (np.unique(square[square >= CELL_OBJECT]) - CELL_OBJECT).tolist()
    if np.all(square >= CELL_EMPTY) and len(rows) >= 2:
        build_cache(env, rows, (x, y))


@pytest.mark.parametrize(
    ("caches", "quirks", "longest"),
    [
        ("none", Quirks(only_delivering_counts=True), 4),
        ("static", Quirks(serialized_interactions=True), 4),
        ("dynamic", Quirks(), 4),
        ("dynamic", Quirks(serialized_interactions=True), 1),
        ("dynamic", Quirks(only_delivering_counts=True), 1),
    ],
    ids=["no caches", "static, serialized", "dynamic", "dynamic, serialized", "dynamic, only delivering"],
)
def test_every_tick_equals_the_twin(caches, quirks, longest):
    """With `longest` above 1, picking up and dropping take 1 to that many ticks, drawn in every tick."""
    env = crowd(caches, quirks)
    rng = np.random.default_rng(7)
    grips = np.ones(N_ROBOTS, np.float32)
    actions = np.zeros((N_ROBOTS, 3), np.float32)
    seen, n_first = Tally[Event](), 0
    for tick in range(1, 600):
        shuffle(env, rng, grips)
        actions[:, 2] = grips
        chance = rng.random(N_ROBOTS)
        if longest > 1:
            pickup, drop = rng.integers(1, longest + 1, 2).tolist()
            env.set_handling_ticks(pickup=pickup, drop=drop)
        expected = mirror(env)
        expected.serve(actions[:, 2].tolist(), tick, chance.tolist())
        kernel.serve(env.arena._arrays.state, env.arena._arrays.rules, actions, tick, chance)
        assert_same(env, expected)
        env.arena._replace_displaced()
        assert_conserved(env)
        n_first += len(expected.first_picked)
        seen.update(Event(code) for code in env.events.code.tolist())
    possible = set(Event)
    if caches == "none":
        possible -= {Event.PICKED_FROM_CACHE, Event.JOINED_CACHE}
    if caches != "dynamic":
        possible -= {Event.CACHE_TOO_NEAR}
    assert set(seen) == possible
    assert min(seen.values()) >= 5, "every event is met often enough to mean something"
    counters = env.events.counters
    assert counters[Counter.COLLECTED] == seen[Event.DELIVERED]
    assert counters[Counter.FREE_PICKUPS] == seen[Event.PICKED_UP]
    assert counters[Counter.CACHE_PICKUPS] == seen[Event.PICKED_FROM_CACHE]
    assert counters[Counter.CACHE_DROPS] == seen[Event.JOINED_CACHE]
    assert counters[Counter.FLOOR_DROPS] == seen[Event.DROPPED] + seen[Event.DROPPED_ELSEWHERE]
    assert counters[Counter.DISPLACED_DROPS] == seen[Event.DROPPED_ELSEWHERE]
    assert counters[Counter.FIRST_PICKED] == n_first
    assert counters[Counter.CACHES_CREATED] - counters[Counter.CACHES_DEPLETED] == np.count_nonzero(env.caches.alive)
