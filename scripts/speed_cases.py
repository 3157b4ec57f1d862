"""What `scripts/compare_speed.py` times, for this version of the package and for older ones: public names only.

Run as a program it reads lines `CASE ENGINE` from standard input and answers each with the processor time that the case
took, in microseconds per robot-tick. A robot-tick is one robot for one control step of 0.2 s. Building the environment
counts, compiling does not: before a case is timed for the first time a few ticks of it are run.
"""

import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from swarm_forage_env import build_stack, parallel_env, parse_wrapper, plan_run, run_one, scenario

NO_EFFECT = 1e-9
"""Amplitude of adversities that do their full work, but leave the swarm what it is."""
WRAPPERS = (
    f"sensor_noise:sigma={NO_EFFECT}",
    "population:malfunction_per_tick=0.001,repair_per_tick=0.001005556",
    f"throttle:waveform=sine,amplitude={NO_EFFECT},offset={NO_EFFECT},period_s=10000",
    f"actuator_noise:sigma={NO_EFFECT}",
)
FIRST_TICKS = 500
"""Enough for every kernel to be compiled: someone has found an object by then."""


@dataclass(frozen=True)
class Case:
    """Something to time."""

    ticks: int
    spend: Callable[[str, int], tuple[float, int]]
    """(engine, ticks) -> seconds of processor time, robot-ticks."""

    def time(self, engine: str) -> float:
        """Return microseconds per robot-tick."""
        seconds, robot_ticks = self.spend(engine, self.ticks)
        return seconds / robot_ticks * 1e6


def world(name: str, engine: str, ticks: int, **fields: Any) -> Any:
    """Return a preset that lasts `ticks`, in one recording interval; older versions know no choice of engine."""
    seconds = ticks * 0.2
    if engine == "compiled":
        fields["physics"] = engine
    return scenario(name, horizon_s=seconds, interval_s=seconds, **fields)


def spent(act: Callable[[int], object], times: int) -> float:
    """Return the processor time of calling `act` with 0, 1, ..."""
    started = time.process_time()
    for number in range(times):
        act(number)
    return time.process_time() - started


def runs(policy: str, name: str, ticks: int, n_seeds: int = 1, **fields: Any) -> Case:
    """Runs of a scripted policy, as a study makes them."""

    def spend(engine: str, ticks: int) -> tuple[float, int]:
        specs = [plan_run(world(name, engine, ticks, **fields), policy, seed=seed) for seed in range(n_seeds)]
        robots = specs[0].scenario.robots.n_robots
        return spent(lambda number: run_one(specs[number]), n_seeds), n_seeds * ticks * robots

    return Case(ticks, spend)


def stepped(ticks: int, wrappers: tuple[str, ...] = ()) -> Case:
    """A recorded stack, step by step, with the same actions in every step, 200 robots."""

    def spend(engine: str, ticks: int) -> tuple[float, int]:
        stack = build_stack(world("warehouse_medium", engine, ticks), [parse_wrapper(text) for text in wrappers])
        stack.reset_batch(0)
        actions = np.full((200, 3), (0.6, 0.5, 0.0), np.float32)
        return spent(lambda _: stack.step_batch(actions), ticks), ticks * 200

    return Case(ticks, spend)


def dicts(ticks: int) -> Case:
    """The dict API with actions drawn beforehand, 200 robots."""

    def spend(engine: str, ticks: int) -> tuple[float, int]:
        env: Any = parallel_env(world("warehouse_medium", engine, ticks + 1))
        env.reset(seed=0)
        rng = np.random.default_rng(0)
        drawn = [{name: rng.uniform(-1, 1, 3).astype(np.float32) for name in env.agents} for _ in range(20)]
        return spent(lambda tick: env.step(drawn[tick % 20]), ticks), ticks * 200

    return Case(ticks, spend)


def vector_env(ticks: int, **options: Any) -> Case:
    """The vector environment of stable-baselines3 with random actions, 50 robots in each arena."""

    def spend(engine: str, ticks: int) -> tuple[float, int]:
        try:
            from swarm_forage_env.training.sb3 import SwarmVecEnv
        except ImportError:
            from swarm_forage_env.learning.sb3 import SwarmVecEnv  # type: ignore[import-not-found,no-redef] - older
        env: Any = SwarmVecEnv(world("warehouse_small", engine, 50_000), **options)
        env.seed(0)
        env.reset()
        drawn = np.random.default_rng(0).uniform(-1, 1, (100, env.num_envs, 3)).astype(np.float32)
        return spent(lambda tick: env.step(drawn[tick % 100]), ticks), ticks * env.num_envs

    return Case(ticks, spend)


def large_world(n_robots: int) -> dict[str, Any]:
    """Fields of a large `warehouse_medium`: a robot per 20 square metres, 0.35 objects per square metre."""
    side = 4.8 * round((n_robots / 0.05) ** 0.5 / 4.8)
    return {
        "width_m": side,
        "height_m": side,
        "nest_centre_m": (side / 2, side / 2),
        "nest_size_m": (0.2 * side, 0.2 * side),
        "n_robots": n_robots,
        "n_objects": int(0.35 * side * side),
    }


CASES = {
    "crw-1": runs("crw", "warehouse_small", 50_000, n_robots=1),
    "crw-50": runs("crw", "warehouse_small", 10_000),
    "crw-50-seeds": runs("crw", "warehouse_small", 5_000, n_seeds=16),
    "crw-200": runs("crw", "warehouse_medium", 4_000),
    "dpo-200": runs("dpo", "warehouse_medium", 4_000),
    "stochm-200": runs("stochm", "warehouse_medium", 4_000, caches="static"),
    "stochx-200": runs("stochx", "warehouse_medium", 4_000, caches="dynamic"),
    "stochx-200-whole": runs("stochx", "warehouse_medium", 50_000, caches="dynamic"),
    "crw-16384": runs("crw", "warehouse_medium", 300, **large_world(16_384)),
    "vec-50": vector_env(3_000),
    "vec-8x50": vector_env(500, n_arenas=8),
    "dict-200": dicts(500),
    "bare-200": stepped(3_000),
    "wrapped-200": stepped(3_000, WRAPPERS),
}


GOALS = {
    "crw-1": 10.0,
    "crw-50": 3.0,
    "crw-50-seeds": 5.0,
    "crw-200": 4.0,
    "dpo-200": 4.0,
    "stochx-200-whole": 3.0,
    "vec-50": 3.0,
    "dict-200": 1.2,
}
"""Ratio of version 0.1.0 to this version with compiled bodies that we want; our choice: see docs/speed.md."""


def main() -> None:
    """Answer one line after the other."""
    warm = set()
    for line in sys.stdin:
        name, engine = line.split()
        case = CASES[name]
        if (name, engine) not in warm:
            case.spend(engine, min(case.ticks, FIRST_TICKS))
            warm.add((name, engine))
        print(case.time(engine), flush=True)


if __name__ == "__main__":
    main()
