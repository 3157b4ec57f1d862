"""The interaction kernel against a slow twin, in a crowd that asks for everything everywhere."""

from collections import Counter as Tally

import numpy as np
import pytest

from swarm_forage_env.contract.codes import CELL_EMPTY, CELL_OBJECT, Counter, Event, ObjectStatus
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import Quirks
from swarm_forage_env.world.kernels import interact as kernel
from swarm_forage_env.world.state import listed
from tests.reference import interacting
from tests.reference.interacting import SlowCache, SlowWorld
from tests.support.stage import assert_conserved, build_cache

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
    )


def assert_same(env: ForageEnv, expected: SlowWorld) -> None:
    happened = {}
    for robot in np.flatnonzero(env.events.code).tolist():
        about = tuple(env.events.event_cache[robot].tolist())
        happened[robot] = Event(int(env.events.code[robot])), int(env.events.event_object[robot]), about
    assert happened == expected.events
    seen = mirror(env)
    for name in ("cargo", "pending", "until", "floor", "caches", "carriers"):
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
    seen: Tally[Event] = Tally()
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
