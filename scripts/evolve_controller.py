"""Evolve numbers of a policy in the training worlds of the benchmark, by CMA-ES (pip install ".[evolve]").

    python scripts/evolve_controller.py cpfa search_per_tick=0.001:0.5:log uninformed_turn_rad=0:2
    python scripts/evolve_controller.py dpo wander_speed_mps=0.02:0.1 wander_max_change_deg=1:20:log@5

A number is named with the range in which it is looked for; "log" looks in equal ratios. The search begins at the number
behind "@", else at that of the policy. A set of numbers is worth its performance as a share of DPO's, averaged over the
worlds. All sets of a generation run with the same seed, which the next generation changes, so nothing is fitted to one
seed.
"""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from metrics.benchmark import load_protocol
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.plan import Plan, finished_runs
from swarm_forage_env.runs.spec import policy_spec
from swarm_forage_env.wrappers.world import World

YARDSTICK = "dpo"
"""The best of the paper's controllers in these worlds."""
FIRST_SEED = 100_000
"""Seed of the first generation; far from those of the benchmark."""
WIDTH = 0.25
"""Standard deviation of the first generation, as a share of each range; pycma advises about that much."""


@dataclass(frozen=True)
class Range:
    """A number that evolves, from 0 to 1 along its range."""

    name: str
    low: float
    high: float
    by_ratio: bool
    start: float | None = None
    """Where the search begins; None = at the number of the policy."""

    def number(self, share: float) -> float:
        """Return the number at a share of the range."""
        if self.by_ratio:
            return self.low * (self.high / self.low) ** share
        return self.low + share * (self.high - self.low)

    def share(self, number: float) -> float:
        """Return where in the range a number lies; at an end, if it lies outside."""
        number = min(max(number, self.low), self.high)
        if self.by_ratio:
            return math.log(number / self.low) / math.log(self.high / self.low)
        return (number - self.low) / (self.high - self.low)


def read_range(text: str) -> Range:
    """Return the range of a word such as `give_up_per_tick=1e-5:1e-2:log`."""
    name, _, rest = text.partition("=")
    ends, _, start = rest.partition("@")
    low, high, *how = ends.split(":") if ":" in ends else ("", "")
    try:
        found = Range(name, float(low), float(high), how == ["log"], float(start) if start else None)
    except ValueError:
        found = Range(name, 0.0, 0.0, False)
    if how not in ([], ["log"]) or not found.low < found.high or (found.by_ratio and found.low <= 0.0):
        raise argparse.ArgumentTypeError(f"expected name=low:high[:log][@start], log from above 0, got {text!r}")
    return found


def shares(policy: str, sets: Sequence[dict[str, float]], worlds: Sequence[World], seed: int, jobs: int) -> FloatArray:
    """Return the performance of sets of numbers over that of the yardstick, the mean over worlds (sets,)."""
    policies = [policy_spec(policy, parameters=numbers, label=f"set {k}") for k, numbers in enumerate(sets)]
    table = finished_runs(
        Plan.product([policy_spec(YARDSTICK, label="yardstick"), *policies], worlds, (seed,)), jobs=jobs
    )
    runs = [[table.of(one)[0] for one in table.plan.of_policy(each.label)] for each in policies]
    found = np.array([[run["performance"].sum() for run in each] for each in runs])
    return (found[1:] / np.maximum(found[:1], 1.0)).mean(axis=1)  # a yardstick may bring home nothing


def evolved(
    policy: str, ranges: Sequence[Range], before: dict[str, float], worlds: Sequence[World], words: argparse.Namespace
) -> dict[str, float]:
    """Return the numbers that the last generation is spread around."""
    import cma

    options = {"bounds": [0, 1], "popsize": words.population, "seed": words.seed + 1, "verbose": -9}
    strategy = cma.CMAEvolutionStrategy([one.share(before[one.name]) for one in ranges], WIDTH, options)
    for generation in range(words.generations):
        asked = strategy.ask()
        sets = [{one.name: one.number(x) for one, x in zip(ranges, point, strict=True)} for point in asked]
        worth = shares(policy, sets, worlds, FIRST_SEED * (1 + 2 * words.seed) + generation, words.jobs)
        strategy.tell(asked, (-worth).tolist())
        told = f"generation {generation + 1}/{words.generations}: best {worth.max():.3f}, mean {worth.mean():.3f}"
        print(told, file=sys.stderr, flush=True)
    middle = np.clip(strategy.result.xfavorite, 0.0, 1.0)
    return {one.name: float(f"{one.number(x):.3g}") for one, x in zip(ranges, middle, strict=True)}


def main() -> None:
    """Evolve, and print what was found."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("policy", help="name of the policy")
    parser.add_argument(
        "ranges", nargs="+", type=read_range, metavar="name=low:high[:log][@start]", help="what evolves"
    )
    parser.add_argument("--generations", type=int, default=20, help="default: 20")
    parser.add_argument("--population", type=int, default=8, help="sets of a generation (default: 8)")
    parser.add_argument("--seed", type=int, default=0, help="default: 0")
    parser.add_argument("--horizon", type=float, default=4000.0, help="seconds of a run (default: 4000)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    words = parser.parse_args()
    numbers: Any = getattr(load_policy(words.policy), "parameters", None)
    if len(words.ranges) < 2:
        parser.error("expected two numbers or more: CMA-ES learns how they go together")
    lacking = [one.name for one in words.ranges if not hasattr(numbers, one.name)]
    if lacking:
        parser.error(f"expected numbers of {words.policy}, got {lacking[0]!r}")
    before = {one.name: float(getattr(numbers, one.name)) if one.start is None else one.start for one in words.ranges}
    worlds = [
        replace(world, scenario=replace(world.scenario, horizon_s=words.horizon)) for world in load_protocol().training
    ]
    found = evolved(words.policy, words.ranges, before, worlds, words)
    print(f'load_policy("{words.policy}", {json.dumps(found)})')


if __name__ == "__main__":
    main()
