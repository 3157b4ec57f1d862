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
from swarm_forage_env.scenarios.config import CACHE_KINDS, PHYSICS_ENGINES, RewardConfig, ScenarioConfig
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.scenarios.quirks import AUTHORS_PROGRAM, QUIRK_NAMES, Quirks
from swarm_forage_env.scenarios.regions import PLACEMENTS
from swarm_forage_env.study.run import build_stack
from swarm_forage_env.study.spec import RunSpec
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.handling import HandlingCostConfig
from swarm_forage_env.wrappers.noise import DISTRIBUTIONS, NOISE_GROUPS, ActuatorNoiseConfig, SensorNoiseConfig
from swarm_forage_env.wrappers.population import DEATHS, PopulationConfig
from swarm_forage_env.wrappers.recorder import RunRecorder
from swarm_forage_env.wrappers.throttle import ThrottleConfig
from swarm_forage_env.wrappers.waveform import Waveform
from tests.support.busy import BusyPolicy
from tests.support.drivers import Beyond, Corners, Driven, Driver, Uniform, Wall
from tests.support.invariants import look_at, look_at_record
from tests.support.misuse import misuse, misuse_before_reset

SCRIPTED = {"crw": "none", "dpo": "none", "stochm": "static", "stochx": "dynamic", "ppo_warehouse_small": "none"}
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
        return (
            f"{config.name}, {config.arena.width_m:g} x {config.arena.height_m:g} m, {config.robots.n_robots} robots, "
            f"{config.objects.n_objects} objects, caches {config.caches}, {config.physics}, {config.horizon_ticks} "
            f"ticks, {kinds}, driven by {self.driver}, seed {self.seed}"
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
            config = _scenario(random, driver, most_ticks)
            world = RandomWorld(
                scenario=config,
                wrappers=_wrappers(random, config),
                driver=driver,
                seed=random.choice((0, 1, 2**63 - 1, random.randrange(2**31))),
                by_dicts=random.random() < 0.5,
                detour_at=random.randrange(config.horizon_ticks),
            )
            build_stack(world.scenario, world.wrappers).reset_batch(world.seed)  # refuses clusters without room
        except ConfigError:
            continue
        return world
    raise AssertionError(f"{MOST_TRIALS} drawn worlds were refused")


def _scenario(random: Random, driver: str, most_ticks: int) -> ScenarioConfig:
    name = random.choice(SCENARIO_NAMES)
    given: dict[str, Any] = {
        "n_robots": random.choice((1, 2, *random.choices(range(3, 30), k=3), random.randint(30, 80), 150)),
        "n_objects": round(10 ** random.uniform(0.0, 2.7)),
        "caches": SCRIPTED.get(driver, random.choice(CACHE_KINDS)),
        "physics": random.choice(PHYSICS_ENGINES),
        "side_share": random.choice((0.03, 0.05, 0.2, random.uniform(0.01, 0.5))),
    }
    dt_s = random.choice((0.2, 0.2, 0.2, 0.05, 0.5))
    n_ticks = random.choice((random.randint(20, most_ticks), most_ticks))
    n_intervals = random.randint(1, 4)
    interval_ticks = max(1, n_ticks // n_intervals)
    given |= {"dt_s": dt_s, "interval_s": interval_ticks * dt_s, "horizon_s": n_intervals * interval_ticks * dt_s}
    if random.random() < 0.8:
        given |= _arena(random)
    for field_name, value in _others(random).items():
        if random.random() < 0.3:
            given[field_name] = value
    return scenario(name, **given)


def _arena(random: Random) -> dict[str, Any]:
    """A floor of 6 to 24 m, now and then a long and narrow one, with a nest anywhere in it."""
    cells = [random.randint(30, 120), random.choice((random.randint(30, 120), 30))]
    random.shuffle(cells)
    size = [random.randint(1, max(1, n // 2)) for n in cells]
    low = [random.randint(0, n - extent) for n, extent in zip(cells, size, strict=True)]
    return {
        "width_m": cells[0] / 5,
        "height_m": cells[1] / 5,
        "nest_size_m": (size[0] / 5, size[1] / 5),
        "nest_centre_m": ((2 * low[0] + size[0]) / 10, (2 * low[1] + size[1]) / 10),
    }


def _others(random: Random) -> dict[str, Any]:
    """Fields that are changed now and then."""
    chosen = {name: random.random() < 0.5 for name in QUIRK_NAMES}
    n_substeps = random.randint(4, 10)
    return {
        "placement": random.choice(PLACEMENTS),
        "quirks": random.choice((AUTHORS_PROGRAM, Quirks(**chosen))),
        "physics_substeps": (1.0 / n_substeps,) * n_substeps,
        "pickup_ticks": random.randint(1, 30),
        "drop_ticks": random.randint(1, 30),
        "walk_probability": random.choice((0.001, 0.05, 1.0)),
        "start_margin_m": random.uniform(0.4, 2.8),
        "distance_share": random.uniform(0.01, 0.6),
        "static_size": random.randint(2, 6),
        "respawn_scale": random.choice((0.0, 0.05, 10.0)),
        "radius_m": random.uniform(0.06, 0.15),
        "wheel_base_m": random.uniform(0.05, 0.3),
        "max_speed_mps": random.uniform(0.01, 0.4),
        "max_wheel_difference_mps": random.uniform(0.01, 0.8),
        "performance": random.choice(("first_picked", "n_carrying", "1/interference_fraction", "cache_load")),
        "reward": RewardConfig(
            delivery=random.uniform(-1.0, 1.0),
            nest_progress=random.choice((0.0, 1.0)),
            interference=random.choice((0.0, -0.1)),
            tick=random.choice((0.0, -0.01)),
            team=random.random() < 0.5,
        ),
    }


def _wrappers(random: Random, config: ScenarioConfig) -> tuple[WrapperConfig, ...]:
    """Draw a stack, in any order."""
    n_robots = config.robots.n_robots
    are_born = n_robots > 1 and random.random() < 0.5
    rate = 10 ** random.uniform(-3.0, -0.5)
    made: list[WrapperConfig] = [
        SensorNoiseConfig(
            sigma=_sigma(random),
            groups=tuple(random.sample(NOISE_GROUPS, random.randint(1, len(NOISE_GROUPS)))),
            distribution=random.choice(DISTRIBUTIONS),
        ),
        PopulationConfig(
            death_per_tick=random.choice((0.0, rate)),
            birth_per_tick=rate if are_born else 0.0,
            malfunction_per_tick=random.choice((0.0, rate, 3 * rate)),
            repair_per_tick=random.choice((0.0, rate)),
            initial_robots=random.randint(1, n_robots - 1) if are_born else None,
            max_robots=random.choice((None, random.randint(1, n_robots))),
            deaths=random.choice(DEATHS),
        ),
        ThrottleConfig(waveform=_waveform(random, 1.0), carriers=random.random() < 0.5),
        ActuatorNoiseConfig(sigma=_sigma(random), distribution=random.choice(DISTRIBUTIONS)),
        HandlingCostConfig(waveform=_waveform(random, 40.0)),
    ]
    return tuple(random.sample(made, random.choice((0, 0, 1, 2, 3, 5))))


def _waveform(random: Random, peak: float) -> Waveform:
    """A waveform of at most `peak`, of any kind."""
    half, period_s = random.uniform(0.0, 0.5 * peak), random.uniform(0.1, 60.0)
    periodic = random.choice(("sine", "square", "sawtooth"))
    return random.choice(
        (
            Waveform(kind="constant", amplitude=2 * half),
            Waveform(kind=periodic, amplitude=half, offset=half, period_s=period_s),
            Waveform(kind="step", amplitude=half, offset=half, start_s=period_s),
            Waveform(kind="table", times_s=(0.0, period_s), values=(half, 2 * half)),
        )
    )


def _sigma(random: Random) -> float | Waveform:
    return random.choice((0.0, 10 ** random.uniform(-3.0, 2.0), _waveform(random, 0.2)))


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
    stack = build_stack(world.scenario, world.wrappers, snapshots=is_disturbed)
    assert RunSpec.from_json(_spec(world).to_json()) == _spec(world), "a specification comes back from its text"
    chance = Random(world.seed)
    if is_disturbed:
        seen.figures["wrong calls"] += misuse_before_reset(stack)
    walker = _Walker(world, stack, by_dicts=by_dicts)
    while not walker.is_over:
        if is_disturbed and chance.random() < 0.05:
            seen.figures["wrong calls"] += misuse(stack, chance)
        if is_disturbed and stack.unwrapped.tick == world.detour_at:
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
    return RunSpec(scenario=world.scenario, wrappers=world.wrappers, policy="random", seed=world.seed)


def _driver(name: str) -> Driver:
    made: dict[str, Driver] = {"uniform": Uniform(), "corners": Corners(), "beyond": Beyond(), "wall": Wall()}
    return made.get(name) or Driven(BusyPolicy() if name == "busy" else load_policy(name))


class _Walker:
    """One walk: the stack, who drives it, and digests of what was seen."""

    def __init__(self, world: RandomWorld, stack: RunRecorder, *, by_dicts: bool) -> None:
        self.driver = _driver(world.driver)
        self.digests: list[bytes] = []
        self.deepest = 0.0
        self._stack, self._env, self._by_dicts = stack, stack.unwrapped, by_dicts
        env = self._env
        n_columns = env.layout.size
        self._obs = np.zeros((world.scenario.robots.n_robots, n_columns), np.float32)
        if by_dicts:
            self._take(stack.reset(seed=world.seed)[0])
        else:
            self._obs[:] = stack.reset_batch(world.seed)
        self._agents = list(env.possible_agents)
        self.first_counters = env.events.counters.copy()
        self.driver.reset(env, stream_rng(world.seed, Stream.POLICY))
        self.is_over = False
        self.deepest = look_at(env, self._obs)

    def _take(self, rows: dict[str, np.ndarray]) -> None:
        """Keep the rows of agents; those that have left have zeros."""
        self._obs[:] = 0.0
        for agent, row in rows.items():
            assert self._env.observation_space(agent).contains(row), f"{agent} sees what its space does not hold"
            self._obs[int(agent.removeprefix("robot_"))] = row

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
            self.deepest = max(self.deepest, look_at(self._env, self._obs))
            self.digests.append(self._digest(shown))
        return self.digests[first:]

    def _by_array(self, actions: np.ndarray) -> list[Any]:
        obs, rewards, terminated, truncated = self._stack.step_batch(actions)
        self._obs[:] = obs
        self.is_over = truncated or bool(terminated.all())
        rows = [int(agent.removeprefix("robot_")) for agent in self._agents]
        shown = [rewards[rows].tolist(), terminated[rows].tolist(), [truncated] * len(rows)]
        assert np.isfinite(rewards).all(), "rewards are numbers"
        self._agents = _left(self._env)
        return shown

    def _by_dict(self, actions: np.ndarray) -> list[Any]:
        agents, rows = self._agents, {agent: k for k, agent in enumerate(self._env.possible_agents)}
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
        for array in (obs, env.state(), env.swarm.position, env.swarm.heading, env.objects.cell, env.caches.count):
            happened.update(array.tobytes())
        happened.update(env.events.counters.tobytes() + env.events.interference_sum.tobytes())
        return happened.digest()


def _left(env: Any) -> list[str]:
    return [agent for agent, gone in zip(env.possible_agents, env.terminated.tolist(), strict=True) if not gone]
