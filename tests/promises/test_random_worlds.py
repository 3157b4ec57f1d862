"""In worlds made at random everything holds that is promised of a run, and wrong calls change nothing.

A short look in every test run; CASES=1000 visits as many.
"""

import copy
import hashlib
import os
from collections.abc import Callable
from random import Random
from typing import Any, NamedTuple

import numpy as np
import pytest
from scipy.spatial import cKDTree

from swarm_forage_env import check_env
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.contract.codes import Counter, ObjectStatus
from swarm_forage_env.contract.policy import ActionError
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import build_stack
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.config import CACHE_KINDS, PHYSICS_ENGINES, RewardConfig, ScenarioConfig
from swarm_forage_env.scenarios.floor import PLACEMENTS, WHEEL_SCALE_MPS
from swarm_forage_env.scenarios.obstacles import MIN_SIDE_M, distances_m
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, QUIRK_NAMES, Quirks
from swarm_forage_env.world.snapshots import SnapshotError
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.handling import HandlingCostConfig
from swarm_forage_env.wrappers.noise import NOISE_GROUPS, ActuatorNoiseConfig, SensorNoiseConfig
from swarm_forage_env.wrappers.population import PopulationConfig
from swarm_forage_env.wrappers.recorder import COUNTED, TOTALS, RunRecorder
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from swarm_forage_env.wrappers.world import World
from tests.support.crowded_runs import BusyPolicy
from tests.support.stage import assert_conserved

CASES = int(os.environ.get("CASES", "18"))
MADE_FOR = dict.fromkeys(("crw", "dpo", "cpfa", "ppo_warehouse_small"), "none") | {
    "stochm": "static",
    "stochx": "dynamic",
}
"""Policy -> its caches."""
BEYOND = np.array([-3e38, 3e38, -2.0, 1e-45, -1e-45, -0.0, 1.0000001, -0.25, 0.5], np.float32)
"""Numbers far outside of [-1, 1], which are clipped, and numbers next to zero."""
NUMBERS: dict[str, Callable[[np.random.Generator, tuple[int, int]], np.ndarray]] = {
    "uniform": lambda rng, shape: rng.uniform(-1.0, 1.0, shape),
    "corners": lambda rng, shape: np.repeat(rng.choice([-1.0, 0.0, 1.0], (1, shape[1])), shape[0], axis=0),
    "beyond": lambda rng, shape: rng.choice(BEYOND, shape),
}
"""Who drives without a policy -> actions of this shape."""


# Worlds


class RandomWorld(NamedTuple):
    """All that a visit depends on."""

    scenario: ScenarioConfig
    wrappers: tuple[WrapperConfig, ...]
    driver: str
    seed: int


OTHERS: dict[str, Callable[[Random], Any]] = {
    "placement": lambda r: r.choice(PLACEMENTS),
    "quirks": lambda r: r.choice((AUTHORS_PROGRAM, Quirks(**{name: r.random() < 0.5 for name in QUIRK_NAMES}))),
    "physics_substeps": lambda r: r.choice(((0.25,) * 4, (0.1,) * 10)),
    "pickup_ticks": lambda r: r.randint(1, 30),
    "drop_ticks": lambda r: r.randint(1, 30),
    "walk_probability": lambda r: r.choice((0.001, 0.05, 1.0)),
    "start_margin_m": lambda r: r.uniform(0.4, 2.8),
    "distance_share": lambda r: r.uniform(0.01, 0.6),
    "static_size": lambda r: r.randint(2, 6),
    "respawn_scale": lambda r: r.choice((0.0, 0.05, 10.0)),
    "radius_m": lambda r: r.uniform(0.06, 0.15),
    "wheel_base_m": lambda r: r.uniform(0.05, 0.3),
    "max_speed_mps": lambda r: r.uniform(0.01, 0.4),
    "max_wheel_difference_mps": lambda r: r.uniform(0.01, 0.8),
    "performance": lambda r: r.choice(("first_picked", "1/interference_fraction", "cache_load")),
    "reward": lambda r: RewardConfig(nest_progress=1.0, interference=-0.1, tick=-0.01, team=r.random() < 0.5),
    "neighbours_seen": lambda r: r.choice((1, 3, 64)),
    "neighbour_range_m": lambda r: r.choice((0.05, 2.0, 40.0)),
    "message_size": lambda r: r.choice((1, 2, 64)),
    "message_range_m": lambda r: r.choice((0.05, 2.0, 40.0)),
}
"""Field of a scenario that is changed now and then -> its value."""


def random_scenario(r: Random, caches: str | None) -> ScenarioConfig:
    """A scenario of at most 40 ticks; raises ConfigError where what was drawn does not fit together."""
    interval_ticks, n_intervals, dt_s = r.randint(5, 10), r.randint(1, 4), r.choice((0.2, 0.2, 0.05, 0.5))
    given: dict[str, Any] = {
        "n_robots": r.choice((1, 2, r.randint(3, 30), r.randint(30, 150))),
        "n_objects": round(10 ** r.uniform(0.0, 2.7)),
        "caches": caches or r.choice(CACHE_KINDS),
        "physics": r.choice(PHYSICS_ENGINES),
        "side_share": r.choice((0.03, 0.05, 0.2, 0.5)),
        "dt_s": dt_s,
        "interval_s": interval_ticks * dt_s,
        "horizon_s": n_intervals * interval_ticks * dt_s,
    }
    if r.random() < 0.8:  # a floor of 6 to 24 m, now and then long and narrow, with a nest anywhere in it
        cells = r.sample([r.randint(30, 120), r.choice((r.randint(30, 120), 30))], 2)
        size = [r.randint(1, n // 2) for n in cells]
        low = [r.randint(0, n - extent) for n, extent in zip(cells, size, strict=True)]
        centre = tuple((2 * edge + extent) / 10 for edge, extent in zip(low, size, strict=True))
        given |= {"width_m": cells[0] / 5, "height_m": cells[1] / 5, "nest_centre_m": centre}
        given["nest_size_m"] = size[0] / 5, size[1] / 5
    config = scenario(r.choice(SCENARIO_NAMES), **given, **{k: of(r) for k, of in OTHERS.items() if r.random() < 0.3})
    if r.random() < 0.2:
        config = with_overrides(config, further_nests=boxes(r, config, 1))
    if r.random() < 0.3:
        config = with_overrides(config, obstacles=boxes(r, config, 6))
    return with_overrides(config, **places(r, config)) if r.random() < 0.15 else config


def boxes(r: Random, config: ScenarioConfig, most: int) -> tuple[tuple[float, ...], ...]:
    """Boxes anywhere but in nests: thin walls and blocks, on lines between cells and off them."""
    extents, found = (config.arena.width_m, config.arena.height_m), []
    for _ in range(r.randint(1, most)):
        sides = [r.choice((MIN_SIDE_M, r.uniform(MIN_SIDE_M, 0.6 * extent))) for extent in extents]
        low = [r.uniform(0.0, extent - side) for extent, side in zip(extents, sides, strict=True)]
        x, y, dx, dy = (value if r.random() < 0.5 else max(0.2, round(5 * value) / 5) for value in (*low, *sides))
        box = x, y, min(x + dx, extents[0]), min(y + dy, extents[1])
        is_clear = all(
            x >= nest[2] or box[2] <= nest[0] or y >= nest[3] or box[3] <= nest[1] for nest in config.arena.nest_boxes_m
        )
        if is_clear and min(box[2] - x, box[3] - y) >= MIN_SIDE_M:
            found.append(box)
    return tuple(found)


def places(r: Random, config: ScenarioConfig) -> dict[str, Any]:
    """Places of one's own, clear of nests and obstacles."""
    x_low, y_low, x_end, y_end = config.arena.distributable_cells
    taken = (*config.arena.all_nest_cells, *config.obstacle_cells)
    free = [
        ((x + r.uniform(0.01, 0.99)) / 5, (y + 0.5) / 5)
        for x in range(x_low, x_end)
        for y in range(y_low, y_end)
        if not any(box[0] <= x < box[2] and box[1] <= y < box[3] for box in taken)
    ]
    chosen = tuple(r.sample(free, min(len(free), r.randint(1, 60))))
    return {"placement": "positions", "object_positions_m": chosen, "n_objects": r.randint(1, max(1, len(chosen)))}


def random_wrappers(r: Random, n_robots: int) -> tuple[WrapperConfig, ...]:
    """A stack, in any order."""
    are_born, rate = n_robots > 1 and r.random() < 0.5, 10 ** r.uniform(-3.0, -0.5)
    made = (
        SensorNoiseConfig(sigma=10 ** r.uniform(-3.0, 2.0), groups=tuple(r.sample(NOISE_GROUPS, r.randint(1, 3)))),
        PopulationConfig(
            death_per_tick=r.choice((0.0, rate)),
            birth_per_tick=rate if are_born else 0.0,
            malfunction_per_tick=r.choice((0.0, 3 * rate)),
            repair_per_tick=r.choice((0.0, rate)),
            initial_robots=r.randint(1, n_robots - 1) if are_born else None,
            max_robots=r.choice((None, r.randint(1, n_robots))),
            deaths=r.choice(("terminate", "absorbing")),
        ),
        ThrottleConfig(waveform=waveform(r, 1.0), carriers=r.random() < 0.5),
        ActuatorNoiseConfig(sigma=r.choice((0.1, 100.0, waveform(r, 0.2)))),
        HandlingCostConfig(waveform=waveform(r, 40.0)),
    )
    return tuple(r.sample(made, r.choice((0, 1, 2, 5))))


def waveform(r: Random, peak: float) -> Waveform:
    """A waveform of any kind."""
    half, period_s = r.uniform(0.0, 0.5 * peak), r.uniform(0.1, 60.0)
    periodic = Waveform(kind=r.choice(("sine", "square", "sawtooth")), amplitude=half, offset=half, period_s=period_s)
    step = Waveform(kind="step", amplitude=half, offset=half, start_s=period_s)
    return r.choice((periodic, step, Waveform(kind="table", times_s=(0.0, period_s), values=(half, 2 * half))))


def random_world(number: int) -> RandomWorld:
    """The world of this number; what configurations refuse, clusters without room among it, is drawn again."""
    r = Random(number)
    while True:
        driver = r.choice((*NUMBERS, "busy", *MADE_FOR))
        try:
            config = random_scenario(r, MADE_FOR.get(driver))
            world = RandomWorld(config, random_wrappers(r, config.robots.n_robots), driver, r.choice((0, 2**63 - 1)))
            build_stack(config, world.wrappers).reset_batch(world.seed)
        except ConfigError:
            continue
        return world


# What holds after every tick, and at the end


def look_at(env: ForageEnv, obs: np.ndarray) -> None:
    """Check the world and what is seen of it."""
    swarm, config = env.swarm, env.scenario
    radius = config.robots.radius_m
    assert obs.dtype == np.float32
    assert np.abs(obs).max() <= 1.0, "observations are numbers in [-1, 1]"
    assert not obs[~swarm.present].any(), "who is not there sees nothing"
    assert env.state_space.contains(env.state())
    assert not np.any(swarm.active & ~swarm.present)
    position = swarm.position[swarm.present]
    x_low, y_low, x_high, y_high = config.arena.interior_m
    inside = np.hstack((position - (x_low, y_low), (x_high, y_high) - position))
    assert inside.min(initial=np.inf) >= radius - 1e-9, "robots stay in the arena"
    assert distances_m(config.arena.obstacles, position).min(initial=np.inf) >= radius - 1e-9, "and out of obstacles"
    assert_conserved(env)
    if len(position) > 1:
        nearest = cKDTree(position).query(position, k=2)[0][:, 1].min()
        # A contact is met one substep late; a crowd undoes that later, within twice the 6 % of lone pairs.
        speed = min(config.robots.max_speed_mps, WHEEL_SCALE_MPS)
        late_m = 4 * speed * config.dt_s / len(config.physics_substeps)
        assert 2 * radius - nearest <= 0.12 * 2 * radius + late_m, "one robot is on top of another"


def look_at_record(recorder: RunRecorder, first: np.ndarray) -> None:
    """Check that columns add up and agree with the world; `first` = counters after the reset."""
    env, columns = recorder.unwrapped, recorder.columns()
    counters, ticks = env.events.counters - first, env.scenario.interval_ticks
    assert all(np.isfinite(values).all() for values in columns.values())
    for name, counter in COUNTED.items():
        total = columns[name].sum() * (1 if name in TOTALS else ticks)
        assert total == pytest.approx(counters[counter], rel=1e-6), name
        assert columns[name].min() >= 0, name
    totals = {name: int(columns[name].sum()) for name in TOTALS}
    taken = totals["free_pickups"] + totals["cache_pickups"]
    put = totals["collected"] + totals["cache_drops"] + totals["floor_drops"]
    assert taken - put == np.count_nonzero(env.objects.status == ObjectStatus.CARRIED)
    standing = totals["caches_created"] - totals["caches_depleted"] + first[Counter.CACHES_CREATED]
    assert standing == np.count_nonzero(env.caches.alive)
    assert totals["first_picked"] <= taken
    assert totals["displaced_drops"] <= totals["floor_drops"]
    assert np.all(columns["n_carrying"] <= columns["n_active"])
    assert np.all(columns["n_active"] <= columns["n_present"])
    assert totals["avoidances"] <= totals["interference_ticks"]
    at_work = sum(columns[name] for name in ("n_searching", "n_homing", "n_handling", "n_at_caches"))
    np.testing.assert_allclose(at_work + columns["interference_ticks"] / ticks, columns["n_active"])


# Walks


def wrong_calls(stack: RunRecorder) -> dict[str, Callable[[], Any]]:
    """Calls that must fail with a message of ours and change nothing."""
    env, n = stack.unwrapped, stack.unwrapped.scenario.robots.n_robots
    good, here = np.zeros((n, 3), np.float32), np.ones(n, np.bool_)
    return {
        "a row is missing": lambda: stack.step_batch(good[1:]),
        "a column too many": lambda: stack.step_batch(np.zeros((n, 99), np.float32)),
        "text": lambda: stack.step_batch([["a"] * 3] * n),
        "nothing": lambda: stack.step_batch(None),
        "no numbers": lambda: stack.step_batch(good, wheel_gain=np.full((n, 2), np.nan)),
        "a stranger": lambda: stack.step({"robot_x": good[0]}),
        "a list": lambda: stack.step([good[0]]),
        "a negative seed": lambda: stack.reset_batch(-1),
        "an option": lambda: stack.reset(seed=1, options={"speed": 1}),
        "no snapshot": lambda: stack.restore_batch(b"snapshot"),
        "another population": lambda: env.set_population(active=here[1:], present=here),
        "at work and away": lambda: env.set_population(active=here, present=~here),
        "handling in no time": lambda: env.set_handling_ticks(pickup=0, drop=1),
    }


def refused(call: Callable[[], Any]) -> None:
    with pytest.raises((ActionError, ConfigError, SnapshotError, RuntimeError, ValueError), match=r"^[A-Z]") as told:
        call()
    assert "swarm_forage_env" in str(told.traceback[-1].path), "the error is ours"


class Driver:
    """Actions of a policy, or anything."""

    def __init__(self, name: str, env: ForageEnv, seed: int) -> None:
        self.numbers, self.rng = NUMBERS.get(name), stream_rng(seed, Stream.POLICY)
        if self.numbers is None:
            self.policy = BusyPolicy() if name == "busy" else load_policy(name)
            self.policy.reset(env.swarm_spec, self.rng)

    def act(self, env: ForageEnv, obs: np.ndarray) -> np.ndarray:
        if self.numbers is None:
            return self.policy.act(obs, env.active)
        return self.numbers(self.rng, (env.swarm_spec.n_robots, env.swarm_spec.action_size)).astype(np.float32)


def walk(world: RandomWorld, *, is_disturbed: bool) -> list[bytes]:
    """What is seen in each tick; disturbed by looks, wrong calls, and a detour from a snapshot and back to it."""
    stack, chance = build_stack(world.scenario, world.wrappers), Random(world.seed)
    env = stack.unwrapped
    if is_disturbed:
        for call in (lambda: stack.step_batch(None), env.state, stack.snapshot, stack.columns, lambda: stack.step({})):
            refused(call)
    obs, seen, is_over, expected = stack.reset_batch(world.seed).copy(), [], False, (0, [])
    driver, first = Driver(world.driver, env, world.seed), env.events.counters.copy()
    detour_at = chance.randrange(world.scenario.horizon_ticks) if world.scenario.physics == "compiled" else -1

    def go_on(driver: Driver, obs: np.ndarray) -> tuple[np.ndarray, bytes, bool]:
        told = stack.step_batch(driver.act(env, obs))
        obs, swarm, objects = told[0].copy(), env.swarm, env.objects
        parts = (*told[:3], swarm.position, swarm.heading, swarm.carried_object, objects.cell, objects.status)
        digest = hashlib.sha256(b"".join(np.ascontiguousarray(part).tobytes() for part in parts))
        digest.update(env.events.counters.tobytes() + env.events.interference_sum.tobytes())
        return obs, digest.digest(), told[3] or bool(told[2].all())

    while not is_over:
        if is_disturbed:
            look_at(env, obs)
            if chance.random() < 0.1:
                refused(chance.choice([*wrong_calls(stack).values()]))
            if env.tick == detour_at:
                snapshot, (at, other, there, ended) = stack.snapshot(), (obs, copy.deepcopy(driver), [], False)
                while not ended and len(there) < 10:
                    at, digest, ended = go_on(other, at)
                    there.append(digest)
                expected = len(seen), there
                obs = stack.restore_batch(snapshot).copy()
        obs, digest, is_over = go_on(driver, obs)
        seen.append(digest)
    look_at_record(stack, first)
    start, there = expected
    assert seen[start : start + len(there)] == there, "a run goes on from a snapshot as it did"
    return seen


@pytest.mark.parametrize("number", range(CASES))
def test_everything_holds_in_random_worlds(number):
    world = random_world(number)
    spec = RunSpec(world=World(world.scenario, world.wrappers), policy="random", seed=world.seed)
    assert RunSpec.from_mapping(spec.to_mapping()) == spec
    check_env(build_stack(world.scenario, world.wrappers), ticks=10)
    assert walk(world, is_disturbed=True) == walk(world, is_disturbed=False)
