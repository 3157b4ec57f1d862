"""How long runs take: measured per policy and world, never assumed.

`calibrate` measures before anything is run: each policy steps swarms of a few sizes for a moment, and the rest follows
in proportion. `MeasuredCost` learns from runs as they finish.
"""

import time
from collections import Counter, defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_stack, warm_up
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.scenarios.quirks import Quirks

MEASURE_S = 0.25
"""Processor seconds for which each measured swarm is stepped."""
SIZES_MEASURED = 3
"""Swarm sizes that are measured of each kind of run: the smallest, the largest, and between them evenly by order."""
FIRST_TICKS = 20
"""Ticks of the first measured stretch; each further one is twice as long."""

Kind: TypeAlias = tuple[str | bool | Quirks, ...]
"""Runs of a kind have the same code in every tick: scenario with its quirks, engine, caches, whether objects walk, the
policy and wrappers."""


_PLACE_OF_POLICY = 5
"""Where the policy stands in a `Kind`."""
_ALL = ""
"""Stands for all kinds together; no policy has this name."""


@dataclass(frozen=True, eq=False)
class Cost:
    """What runs of one kind take, by swarm size."""

    n_robots: FloatArray
    """(S,) measured sizes, rising."""
    start_s: FloatArray
    """(S,) processor seconds until the first tick."""
    tick_s: FloatArray
    """(S,) processor seconds per tick."""

    def seconds(self, spec: RunSpec) -> float:
        """Return the processor seconds of a run; between measured sizes in proportion."""
        n_robots = spec.scenario.robots.n_robots
        start_s, tick_s = (float(np.interp(n_robots, self.n_robots, part)) for part in (self.start_s, self.tick_s))
        return start_s + tick_s * spec.scenario.horizon_ticks


class MeasuredCost:
    """How long runs take, from those that have finished.

    A kind of which no run has finished takes what its policy takes elsewhere, per robot-tick; a policy of which none
    has finished what all others take.
    """

    def __init__(self) -> None:
        self._seconds: defaultdict[Any, float] = defaultdict(float)
        self._robot_ticks: defaultdict[Any, int] = defaultdict(int)

    def add(self, spec: RunSpec, seconds: float) -> None:
        """Learn how long a run took."""
        for key in (kind_of(spec), spec.policy, _ALL):
            self._seconds[key] += seconds
            self._robot_ticks[key] += spec.robot_ticks

    def seconds(self, specs: Iterable[RunSpec]) -> float | None:
        """Return how long runs will take together, one after the other; None if no run has finished."""
        if not self._robot_ticks[_ALL]:
            return None
        work: Counter[Kind] = Counter()
        for spec in specs:
            work[kind_of(spec)] += spec.robot_ticks
        return sum(robot_ticks * self._per_robot_tick(kind) for kind, robot_ticks in work.items())

    def _per_robot_tick(self, kind: Kind) -> float:
        policy = kind[_PLACE_OF_POLICY]
        known = next(key for key in (kind, policy, _ALL) if self._robot_ticks[key])
        return self._seconds[known] / self._robot_ticks[known]


def calibrate(specs: Iterable[RunSpec], *, tell: Callable[[str], None] | None = None) -> Mapping[Kind, Cost]:
    """Measure each kind of run for a moment, in this process.

    Args:
        specs: What is to be run.
        tell: Gets a line about each measured swarm before it is measured.
    """
    by_kind: dict[Kind, dict[int, RunSpec]] = {}
    for spec in specs:
        by_kind.setdefault(kind_of(spec), {}).setdefault(spec.scenario.robots.n_robots, spec)
    costs: dict[Kind, Cost] = {}
    for kind, by_size in by_kind.items():
        measured: list[tuple[float, float, float]] = []
        for n_robots in _some(sorted(by_size)):
            if tell is not None:
                tell(f"measuring {by_size[n_robots].policy}, N = {n_robots}")
            measured.append((float(n_robots), *_measured(by_size[n_robots])))
        costs[kind] = Cost(*np.array(measured).T)
    return costs


def kind_of(spec: RunSpec) -> Kind:
    """Return the kind of a run."""
    scenario = spec.scenario
    walks = scenario.objects.walk_probability > 0.0
    world = (scenario.name, scenario.quirks, scenario.physics, scenario.caches, walks)
    return (*world, spec.policy, *(config.name for config in spec.wrappers))


def _some(sizes: Sequence[int]) -> list[int]:
    places = np.linspace(0, len(sizes) - 1, min(SIZES_MEASURED, len(sizes)))
    return [sizes[round(place)] for place in places.tolist()]


def _measured(spec: RunSpec) -> tuple[float, float]:
    """Seconds until the first tick, and seconds per tick."""
    warm_up(spec)
    started = time.process_time()
    policy = load_policy(spec.policy, spec.parameters)
    recorder = build_stack(spec.scenario, spec.wrappers, reads=getattr(policy, "reads", None))
    live = LiveRun(recorder, policy, spec.seed)
    ready = time.process_time()
    ticks, to_tick = FIRST_TICKS, 0
    while time.process_time() - ready < MEASURE_S and not live.over:
        to_tick += ticks
        ticks *= 2
        live.advance(to_tick=to_tick)
    took = time.process_time() - ready
    recorder.close()
    return ready - started, took / max(1, live.forage_env.tick)
