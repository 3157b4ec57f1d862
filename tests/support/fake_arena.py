"""A ForageEnv without physics: a test sets the counters, for tests of wrappers and recorders."""

import numpy as np

from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.types import BoolArray, ObsArray
from swarm_forage_env.env import ForageEnv
from swarm_forage_env.layer import BatchStep
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.state import StepEvents, SwarmState


def small_scenario(**overrides) -> ScenarioConfig:
    """Four robots, three intervals of five ticks."""
    return scenario(
        "warehouse_small", **{"n_robots": 4, "n_objects": 8, "horizon_s": 3.0, "interval_s": 1.0, **overrides}
    )


class FakeArena(ForageEnv):
    """Tick t (from 1) delivers t objects, moves one object, and has one of four robots in interference.

    All robots die with tick `dies_at`. What it was stepped with is kept in `calls`.
    """

    def __init__(self, config: ScenarioConfig | None = None, *, dies_at: int = 10**9, **kwargs) -> None:
        super().__init__(config or small_scenario(), **kwargs)
        self.dies_at = dies_at
        self.calls: list[dict] = []
        self._fake_tick = 0
        self._start()

    def _start(self) -> None:
        n_robots = self.scenario.robots.n_robots
        self._fake_swarm = SwarmState.empty(n_robots)
        self._fake_events = StepEvents.empty(n_robots)

    swarm = property(lambda self: self._fake_swarm)
    events = property(lambda self: self._fake_events)
    active = property(lambda self: self._fake_swarm.active)
    last_obs = property(lambda self: self._obs())
    tick = property(lambda self: self._fake_tick)

    def set_population(self, *, active: BoolArray, present: BoolArray, terminated: BoolArray | None = None) -> None:
        self._fake_swarm.active[:] = active
        self._fake_swarm.present[:] = present

    def reset_batch(self, seed: int | None = None) -> ObsArray:
        self.seed_value = 4711 if seed is None else seed
        self.agents = list(self.possible_agents)
        self._fake_tick = 0
        self._start()
        return self._obs()

    def advance(self, actions, wheel_gain, tasks) -> BatchStep:
        self.calls.append({"wheel_gain": wheel_gain, "tasks": tasks})
        self._fake_tick += 1
        counters, swarm = self.events.counters, self.swarm
        counters[Counter.COLLECTED] += self.tick
        counters[Counter.OBJECTS_MOVED] += 1
        counters[Counter.ACTIVE] += swarm.active.sum()
        counters[Counter.PRESENT] += swarm.present.sum()
        counters[Counter.CARRYING] += np.count_nonzero(swarm.active & (swarm.carried_object >= 0))
        counters[Counter.INTERFERING] += 1
        counters[Counter.AVOIDANCES] += 1
        counters[Counter.SEARCHING] += swarm.active.sum() - 1
        self.events.interference_sum[0] += 0.25
        dead = np.full(len(swarm.active), self.tick >= self.dies_at)
        self._terminated[:] = dead
        return self._obs(), np.zeros(len(dead), np.float32), dead, self.tick >= self.max_cycles

    def _obs(self) -> ObsArray:
        return np.full((self.scenario.robots.n_robots, self.layout.size), self.tick / 100, np.float32)
