"""Worlds made at random, and what must hold in every tick of any of them.

`random_world(random)` draws a scenario, a stack of wrappers and who drives; equal numbers give equal worlds.
`visit(world)` walks through it tick by tick, looks at everything, gives it wrong calls on the way, takes it back to a
snapshot, and walks through it once more without any of that: both walks must show the same, bit for bit.
"""

import copy
import hashlib
import traceback
from collections import Counter
from dataclasses import dataclass, field
from random import Random
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.rng import Stream, stream_rng
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import build_stack
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.world import World
from tests.support.busy import BusyPolicy
from tests.support.drivers import Beyond, Corners, Driven, Driver, Uniform, Wall
from tests.support.invariants import look_at, look_at_record
from tests.support.misuse import misuse, misuse_before_reset
from tests.support.random_scenarios import random_scenario, random_wrappers

SCRIPTED = {
    "crw": "none",
    "dpo": "none",
    "cpfa": "none",
    "stochm": "static",
    "stochx": "dynamic",
    "ppo_warehouse_small": "none",
}
"""Policy -> the caches that it is made for."""
DRIVERS = ("uniform", "corners", "beyond", "wall", "busy", *SCRIPTED)
MOST_TRIALS = 200
"""Drawn scenarios, of which many are refused; one in a few is valid."""


@dataclass(frozen=True)
class RandomWorld:
    """All that a visit depends on."""

    scenario: ScenarioConfig
    wrappers: tuple[WrapperConfig, ...]
    driver: str
    seed: int
    by_dicts: bool
    """Whether the first walk uses dictionaries and the second arrays, or the other way round."""
    detour_at: int
    """Tick of a snapshot, from which the walk goes on twice."""

    def describe(self) -> str:
        """One line for people."""
        config = self.scenario
        kinds = ", ".join(wrapper.name for wrapper in self.wrappers) or "no wrappers"
        company = f"{config.robots.neighbours_seen} neighbours seen, messages of {config.robots.message_size}"
        return (
            f"{config.name}, {config.arena.width_m:g} x {config.arena.height_m:g} m, {config.robots.n_robots} robots, "
            f"{config.objects.n_objects} objects, {config.objects.placement}, {len(config.arena.obstacles)} obstacles, "
            f"{company}, caches {config.caches}, {config.physics}, {config.horizon_ticks} ticks, {kinds}, driven by "
            f"{self.driver}, seed {self.seed}"
        )


@dataclass
class Visit:
    """What was seen."""

    figures: Counter[str] = field(default_factory=Counter)
    """How many ticks, robot-ticks, wrong calls, snapshots."""
    fault: str = ""
    """What is wrong, with a traceback; empty if nothing is."""
    deepest: float = 0.0
    """Deepest overlap of two robots, as a share of a diameter."""


def random_world(random: Random, *, most_ticks: int = 400) -> RandomWorld:
    """Draw a world of at most `most_ticks` ticks and its visit; what configurations refuse is drawn again."""
    for _ in range(MOST_TRIALS):
        driver = random.choice(DRIVERS)
        try:
            world = _drawn(random, driver, most_ticks)
            build_stack(world.scenario, world.wrappers).reset_batch(world.seed)  # refuses clusters without room
        except ConfigError:
            continue
        return world
    raise AssertionError(f"{MOST_TRIALS} drawn worlds were refused")


def _drawn(random: Random, driver: str, most_ticks: int) -> RandomWorld:
    """Draw a world; raises ConfigError where what was drawn does not fit together."""
    config = random_scenario(random, SCRIPTED.get(driver), most_ticks)
    wrappers = random_wrappers(random, config)
    seed = random.choice((0, 1, 2**63 - 1, random.randrange(2**31)))
    return RandomWorld(
        scenario=config,
        wrappers=wrappers,
        driver=driver,
        seed=seed,
        by_dicts=random.random() < 0.5,
        detour_at=random.randrange(config.horizon_ticks),
    )


def visit(world: RandomWorld) -> Visit:
    """Walk through a world twice; whatever is wrong is in `fault`."""
    seen = Visit()
    try:
        first = _walk(world, seen, by_dicts=world.by_dicts, is_disturbed=True)
        second = _walk(world, seen, by_dicts=not world.by_dicts, is_disturbed=False)
        for tick, (one, other) in enumerate(zip(first, second, strict=True)):
            assert one == other, f"the same run, without wrong calls and snapshots, differs from tick {tick} on"
    except Exception:  # noqa: BLE001 - whatever it is, it is a fault
        seen.fault = f"{world.describe()}\n{traceback.format_exc()}"
    return seen


def _walk(world: RandomWorld, seen: Visit, *, by_dicts: bool, is_disturbed: bool) -> list[bytes]:
    """Walk through a world; returns a digest of all that could be seen in each tick."""
    stack = build_stack(world.scenario, world.wrappers)
    assert RunSpec.from_mapping(_spec(world).to_mapping()) == _spec(world), "a specification comes back from its text"
    chance, may_go_back = Random(world.seed), is_disturbed and world.scenario.physics == "compiled"
    if is_disturbed:
        seen.figures["wrong calls"] += misuse_before_reset(stack)
    walker = _Walker(world, stack, by_dicts=by_dicts, is_looked_at=is_disturbed)
    while not walker.is_over:
        if is_disturbed and chance.random() < 0.05:
            seen.figures["wrong calls"] += misuse(stack, chance)
        if may_go_back and stack.unwrapped.tick == world.detour_at:
            snapshot, other = stack.snapshot(), copy.deepcopy(walker.driver)
            there = walker.go_on(min(10, world.scenario.horizon_ticks - world.detour_at))
            walker.return_to(snapshot, other)
            again = walker.go_on(len(there))
            assert there == again, f"the run does not go on from the snapshot of tick {world.detour_at} as it did"
            seen.figures["snapshots"] += 1
        if not walker.is_over:
            walker.go_on(1)
    look_at_record(stack, walker.first_counters)
    seen.deepest = max(seen.deepest, walker.deepest)
    seen.figures["ticks"] += stack.unwrapped.tick
    seen.figures["robot-ticks"] += stack.unwrapped.tick * world.scenario.robots.n_robots
    return walker.digests


def _spec(world: RandomWorld) -> RunSpec:
    return RunSpec(world=World(world.scenario, world.wrappers), policy="random", seed=world.seed)


def _driver(name: str) -> Driver:
    made: dict[str, Driver] = {"uniform": Uniform(), "corners": Corners(), "beyond": Beyond(), "wall": Wall()}
    return made.get(name) or Driven(BusyPolicy() if name == "busy" else load_policy(name))


class _Walker:
    """One walk: the stack, who drives it, and digests of what was seen.

    Only one of two walks is looked at: the other must have the same digests, of the same world.
    """

    def __init__(self, world: RandomWorld, stack: RunRecorder, *, by_dicts: bool, is_looked_at: bool) -> None:
        self.driver, self._is_looked_at = _driver(world.driver), is_looked_at
        self.digests: list[bytes] = []
        self.deepest = 0.0
        self._stack, self._env, self._by_dicts = stack, stack.unwrapped, by_dicts
        env = self._env
        n_columns = env.layout.size
        self._row = {agent: row for row, agent in enumerate(env.possible_agents)}
        self._obs = np.zeros((world.scenario.robots.n_robots, n_columns), np.float32)
        if by_dicts:
            self._take(stack.reset(seed=world.seed)[0])
        else:
            self._obs[:] = stack.reset_batch(world.seed)
        self._agents = list(env.possible_agents)
        self.first_counters = env.events.counters.copy()
        self.driver.reset(env, stream_rng(world.seed, Stream.POLICY))
        self.is_over = False
        self._objects = b""
        self._look()

    def _look(self) -> None:
        """Check what holds after every tick."""
        deepest, self._objects = look_at(self._env, self._obs, self._objects)
        self.deepest = max(self.deepest, deepest)

    def _take(self, rows: dict[str, np.ndarray]) -> None:
        """Keep the rows of agents; those that have left have zeros."""
        self._obs[:] = 0.0
        for agent, row in rows.items():
            # As `contains` of its space does, but for the bounds, which are looked at in all rows at once.
            assert (row.dtype, row.shape) == (np.float32, self._obs.shape[1:]), f"{agent} sees {row.dtype} {row.shape}"
            self._obs[self._row[agent]] = row
        some = next(iter(rows), None)
        assert some is None or self._env.observation_space(some).contains(rows[some]), f"{some} sees beyond its space"

    def return_to(self, snapshot: Any, driver: Driver) -> None:
        """Take the stack back."""
        self.driver, self.is_over = driver, False
        if self._by_dicts:
            self._take(self._stack.restore(snapshot))
        else:
            self._obs[:] = self._stack.restore_batch(snapshot)
        self._agents = list(self._env.agents) if self._by_dicts else _left(self._env)
        del self.digests[self._env.tick :]

    def go_on(self, ticks: int) -> list[bytes]:
        """Let some ticks pass; returns their digests."""
        first = len(self.digests)
        for _ in range(ticks):
            if self.is_over:
                break
            actions = self.driver.act(self._env, self._obs)
            shown = self._by_dict(actions) if self._by_dicts else self._by_array(actions)
            if self._is_looked_at:
                self._look()
            self.digests.append(self._digest(shown))
        return self.digests[first:]

    def _by_array(self, actions: np.ndarray) -> list[Any]:
        obs, rewards, terminated, truncated = self._stack.step_batch(actions)
        self._obs[:] = obs
        self.is_over = truncated or bool(terminated.all())
        rows = [self._row[agent] for agent in self._agents]
        shown = [rewards[rows].tolist(), terminated[rows].tolist(), [truncated] * len(rows)]
        assert np.isfinite(rewards).all(), "rewards are numbers"
        self._agents = _left(self._env)
        return shown

    def _by_dict(self, actions: np.ndarray) -> list[Any]:
        agents, rows = self._agents, self._row
        # Arrays of three columns say zeros; a single agent's action must be in its space.
        silent = self._env.swarm_spec.action_size - actions.shape[1]
        actions = np.pad(actions, ((0, 0), (0, silent))) if silent else actions
        told = self._stack.step({agent: actions[rows[agent]] for agent in agents})
        for part in told:
            assert list(part) == agents, "every agent is told of, and nobody else"
        obs, rewards, terminations, truncations, infos = told
        self._take(obs)
        active = self._env.active
        assert all(info == {"active": bool(active[rows[agent]])} for agent, info in infos.items())
        left = [agent for agent in agents if not terminations[agent] and not truncations[agent]]
        assert self._env.agents == left, "those are left who were neither terminated nor truncated"
        assert np.isfinite(list(rewards.values())).all(), "rewards are numbers"
        self._agents, self.is_over = left, not left
        return [list(rewards.values()), list(terminations.values()), list(truncations.values())]

    def _digest(self, shown: list[Any]) -> bytes:
        env, obs = self._env, self._obs
        happened = hashlib.sha256(repr(shown).encode())
        swarm, objects, caches = env.swarm, env.objects, env.caches
        of_robots = swarm.position, swarm.heading, swarm.carried_object, swarm.active, swarm.present
        of_objects = objects.cell, objects.status, objects.cache_slot, caches.cell, caches.count, caches.alive
        for array in (obs, *of_robots, *of_objects):
            happened.update(array.tobytes())
        happened.update(env.events.counters.tobytes() + env.events.interference_sum.tobytes())
        return happened.digest()


def _left(env: Any) -> list[str]:
    return [agent for agent, gone in zip(env.possible_agents, env.terminated.tolist(), strict=True) if not gone]
