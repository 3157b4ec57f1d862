"""Small arenas arranged by hand: every object in the depot, every robot in the yard, until a test moves them.

The stage is the small warehouse, 160 x 80 cells of 0.2 m: nest in the cells x 8 .. 23, y 8 .. 71, objects allowed in
the cells x 24 .. 136, y 12 .. 68, source strip x 120 .. 135, y 12 .. 67.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from swarm_forage_env.contract.codes import (
    CELL_CACHE,
    CELL_EMPTY,
    CELL_NEST,
    CELL_OBJECT,
    CELL_OBSTACLE,
    Counter,
    Event,
    Grip,
    ObjectStatus,
)
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.caches import create_cache
from swarm_forage_env.world.state import listed, make_list
from swarm_forage_env.wrappers.base import SwarmWrapper

NEST_CELL = (16, 40)
OPEN_CELL = (60, 40)
CORNER_CACHE = (40, 20)
"""Centre of a cache clear of the nest, within the proximity distance of the open cell."""
CORNERS = [(-0.07, -0.07), (0.07, 0.07)]
"""Offsets in one cell at which two robots stand without touching."""


def tidy_world(*, n_robots: int = 4, n_objects: int = 8, caches: str = "none", **overrides: Any) -> ForageEnv:
    """A small warehouse after reset, with objects in the depot, robots in the yard and no cache standing."""
    options: dict[str, Any] = {"respawn_scale": 0.0, **overrides}
    env = ForageEnv(scenario("warehouse_small", n_robots=n_robots, n_objects=n_objects, caches=caches, **options))
    env.reset_batch(0)
    clear(env)
    for row in range(n_objects):
        lay(env, row, depot(row))
    for robot in range(n_robots):
        put(env, robot, *cell_centre((30 + 3 * robot, 74)))
    return env


def begin(wrapper: SwarmWrapper, seed: int = 0) -> None:
    """Reset a wrapper alone: the world that it wraps was arranged by hand and stays."""
    wrapper.on_reset(seed)
    wrapper._last_obs = wrapper.unwrapped.arena.obs


def clear(env: ForageEnv) -> None:
    """Take all objects and caches out of the world; the test has to lay down every object before it goes on."""
    objects, caches = env.objects, env.caches
    objects.floor[(objects.floor >= CELL_OBJECT) | (objects.floor <= CELL_CACHE)] = CELL_EMPTY
    caches.alive[:], caches.count[:], caches.serial[:] = False, 0, 0
    objects.status[:], objects.cache_slot[:], objects.carriers[:], objects.cell[:] = ObjectStatus.WAITING, -1, 0, -1
    make_list(objects.waiting, [])
    env.events.counters[:] = 0


def depot(row: int) -> tuple[int, int]:
    """Cell of an object that plays no part: far from all others, on the source strip."""
    return (121 + 4 * (row % 4), 14 + 4 * (row // 4))


def cell_centre(cell: tuple[int, int]) -> tuple[float, float]:
    """Centre of a cell in metres."""
    return (2 * cell[0] + 1) / 10, (2 * cell[1] + 1) / 10


def put(env: ForageEnv, robot: int, x: float, y: float, heading: float = 0.0) -> None:
    """Put a robot and its body at a pose."""
    swarm = env.swarm
    swarm.position[robot], swarm.heading[robot] = (x, y), heading
    swarm.facing[robot] = np.cos(heading), np.sin(heading)
    env.arena._physics.place(robot, x, y, heading)
    env.arena.has_changed = True


def stand(env: ForageEnv, robot: int, cell: tuple[int, int]) -> None:
    """Put a robot on the centre of a cell."""
    put(env, robot, *cell_centre(cell))


def lift(env: ForageEnv, row: int) -> None:
    """Take a free or waiting object off the floor or out of the waiting list."""
    objects = env.objects
    if objects.status[row] == ObjectStatus.FREE and objects.cell[row, 0] >= 0:
        objects.floor[objects.cell[row, 1], objects.cell[row, 0]] = CELL_EMPTY
    make_list(objects.waiting, [other for other in listed(objects.waiting).tolist() if other != row])
    objects.cell[row] = -1


def lay(env: ForageEnv, row: int, cell: tuple[int, int]) -> None:
    """Put an object on a cell."""
    lift(env, row)
    objects = env.objects
    objects.floor[cell[1], cell[0]] = CELL_OBJECT + row
    objects.cell[row], objects.status[row] = cell, ObjectStatus.FREE


def load(env: ForageEnv, robot: int, row: int) -> None:
    """Give an object to a robot, as if picked up from the floor."""
    lift(env, row)
    env.objects.status[row] = ObjectStatus.CARRIED
    env.objects.carriers[row] += 1
    env.swarm.carried_object[robot] = row


def build_cache(env: ForageEnv, rows: Sequence[int], centre: tuple[int, int]) -> int:
    """Create a cache of free objects; returns its slot."""
    return create_cache(
        np.array(rows, np.int32), centre, env.scenario.cache_side_cells, env.objects, env.caches, env.events
    )


def act(env: ForageEnv, grips: Mapping[int, float]) -> list[Event]:
    """Step once with standing wheels and these gripper commands (others hold or, empty, release); return the events."""
    actions = np.zeros((len(env.active), 3), np.float32)
    actions[:, 2] = np.where(env.swarm.carried_object >= 0, Grip.GRASP, Grip.RELEASE)
    for robot, grip in grips.items():
        actions[robot, 2] = grip
    env.step_batch(actions)
    return [Event(code) for code in env.events.code.tolist()]


def events_of(env: ForageEnv, grip: float, ticks: int, robot: int = 0) -> list[Event]:
    """Step some ticks in which one robot sends the same gripper command; return its events."""
    return [act(env, {robot: grip})[robot] for _ in range(ticks)]


def kill(env: ForageEnv, row: int) -> None:
    """Let a robot die."""
    present = env.swarm.present.copy()
    present[row] = False
    env.set_population(active=env.active & present, present=present)


def count(env: ForageEnv, counter: Counter) -> int:
    """Return a cumulative counter."""
    return int(env.events.counters[counter])


def snapshot(env: ForageEnv) -> dict[str, np.ndarray]:
    """Copies of every array of the world, for bitwise comparison."""
    world: dict[str, np.ndarray] = {"tick": np.array(env.tick)}
    for name in ("swarm", "objects", "caches", "events"):
        state = getattr(env, name)
        world |= {f"{name}.{field}": array.copy() for field, array in state._asdict().items()}
    return world


def assert_same_world(before: Mapping[str, np.ndarray], after: Mapping[str, np.ndarray]) -> None:
    """Compare two snapshots bit for bit."""
    assert before.keys() == after.keys()
    for name, value in before.items():
        np.testing.assert_array_equal(after[name], value, err_msg=name)


def assert_conserved(env: ForageEnv) -> None:
    """Every object is in exactly one place, and floor, caches and robots agree about it."""
    objects, caches, swarm = env.objects, env.caches, env.swarm
    status = objects.status
    assert set(status.tolist()) <= set(ObjectStatus)
    floor = objects.floor
    # Floor: exactly the free objects, each on its own cell.
    y, x = np.nonzero(floor >= CELL_OBJECT)
    rows = floor[y, x] - CELL_OBJECT
    assert sorted(rows.tolist()) == np.flatnonzero(status == ObjectStatus.FREE).tolist()
    assert np.array_equal(objects.cell[rows], np.array((x, y)).T), "an object lies where it says that it does"
    x_low, y_low, x_high, y_high = env.scenario.arena.distributable_cells
    low, high = np.array([x_low, y_low]), np.array([x_high, y_high])
    assert np.all((objects.cell[rows] >= low) & (objects.cell[rows] < high))
    # Obstacles, nest and caches: every special code where it belongs, and nowhere else.
    painted = np.where(floor >= CELL_OBJECT, CELL_EMPTY, floor)
    expected = np.full_like(floor, CELL_EMPTY)
    for left, bottom, right, top in env.scenario.obstacle_cells:
        expected[bottom:top, left:right] = CELL_OBSTACLE
    for left, bottom, right, top in env.scenario.arena.all_nest_cells:
        expected[bottom:top, left:right] = CELL_NEST
    half = env.scenario.cache_side_cells // 2
    for slot in np.flatnonzero(caches.alive).tolist():
        x, y = caches.cell[slot].tolist()
        square = expected[y - half : y + half + 1, x - half : x + half + 1]
        assert np.all(square == CELL_EMPTY), "cache square overlaps nest, obstacle or another cache"
        square[:] = CELL_CACHE - slot
    assert np.array_equal(painted, expected), f"cells (y, x) {np.argwhere(painted != expected)[:5].tolist()}"
    # Caches: contents and counts.
    cached = status == ObjectStatus.CACHED
    assert np.array_equal(cached, objects.cache_slot >= 0), "an object is in a cache where it says that it is"
    contents = np.bincount(objects.cache_slot[cached], minlength=len(caches.alive))
    assert np.array_equal(contents, caches.count), f"caches hold {contents}, and count {caches.count}"
    assert np.all(caches.count[caches.alive] >= 2)
    assert np.all(caches.count[~caches.alive] == 0)
    assert np.array_equal(objects.cell[cached], caches.cell[objects.cache_slot[cached]]), "objects lie at their cache"
    serials = caches.serial[caches.alive]
    assert len(np.unique(serials)) == len(serials)
    assert caches.serial.max(initial=0) <= env.events.counters[Counter.CACHES_CREATED]
    # Robots: one object each, carried by nobody else; only robots in the world carry.
    carried = swarm.carried_object[swarm.carried_object >= 0]
    assert sorted(carried.tolist()) == np.flatnonzero(status == ObjectStatus.CARRIED).tolist()
    assert np.all(swarm.carried_object[~swarm.present] < 0)
    assert np.all(objects.carriers[carried] >= 1)
    # Waiting list.
    assert sorted(listed(objects.waiting).tolist()) == np.flatnonzero(status == ObjectStatus.WAITING).tolist()
