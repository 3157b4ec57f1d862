"""Evolve numbers of a policy in the training worlds of the benchmark, by CMA-ES or NSGA-II (pip install ".[evolve]").

    python scripts/evolve_controller.py cpfa search_per_tick=0.001:0.5:log uninformed_turn_rad=0:2
    python scripts/evolve_controller.py dpo wander_speed_mps=0.02:0.1 wander_max_change_deg=1:20:log@5
    python scripts/evolve_controller.py dpo wander_speed_mps=0.02:0.1 recovery_s=0:10 --front front.png

A number is named with the range in which it is looked for; "log" looks in equal ratios. The search begins at the number
behind "@", else at that of the policy. A set of numbers is worth its
performance as a share of DPO's, averaged over the worlds. All sets of a generation run with the same seed, which the
next generation changes, so nothing is fitted to one seed. The table compares what was found with the numbers of before,
with seeds that no generation had.

With --front, Optuna's NSGA-II looks for numbers that trade performance against interference: the Pareto front, whose
sets no other set beats in both. Both are shares of DPO's. The table has the sets in the order of their performance, and
says which of them are on the front by the new seeds, too.
"""

import argparse
import json
import math
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from metrics import aggregate
from metrics.benchmark import load_protocol
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.rendering.figures import COLOURS, check_picture, saved_figure
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.spec import PolicySpec, policy_spec
from swarm_forage_env.sheet import Sheet
from swarm_forage_env.training.evaluations import finished_runs
from swarm_forage_env.wrappers.world import World

YARDSTICK = "dpo"
"""The best of the paper's controllers in these worlds."""
FIRST_SEED, JUDGING_SEED = 100_000, 200_000
"""Seeds of the generations and of the table; far from those of the benchmark."""
WIDTH = 0.25
"""Standard deviation of the first generation, as a share of each range; pycma advises about that much."""
LEAST = np.array([1.0, 1e-6])[:, None, None, None]
"""Of what shares are taken: a yardstick that brings home nothing, or that nothing disturbs, counts as this much."""
JUDGED = 8
"""Sets of a front that are run with new seeds, evenly along it."""


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


def seed_of(generation: int, seed: int) -> int:
    """Return the seed of the runs of a generation; none is one of the table's, which begin at `JUDGING_SEED`."""
    return FIRST_SEED * (1 + 2 * seed) + generation


def measured(policies: Sequence[PolicySpec], worlds: Sequence[World], seeds: Sequence[int], jobs: int) -> FloatArray:
    """Return performance (objects of a run) and interference (share of robot time), (2, policies, worlds, seeds)."""
    table = finished_runs(Plan.product(policies, worlds, seeds), jobs=jobs)
    runs = [[table.of(one) for one in table.plan.of_policy(policy.label)] for policy in policies]
    performance = [[[run["performance"].sum() for run in each] for each in rows] for rows in runs]
    interference = [[[run["interference_fraction"].mean() for run in each] for each in rows] for rows in runs]
    return np.array([performance, interference])


def shares(
    policy: str, sets: Sequence[dict[str, float]], worlds: Sequence[World], seeds: Sequence[int], jobs: int
) -> FloatArray:
    """Return performance and interference of sets of numbers over those of the yardstick, (2, sets, worlds, seeds)."""
    policies = [policy_spec(policy, parameters=numbers, label=f"set {k}") for k, numbers in enumerate(sets)]
    found = measured([policy_spec(YARDSTICK, label="yardstick"), *policies], worlds, seeds, jobs)
    return found[:, 1:] / np.maximum(found[:, :1], LEAST)


def tell(generation: int, worth: FloatArray, words: argparse.Namespace) -> None:
    """Say on stderr how a generation did."""
    told = f"generation {generation + 1}/{words.generations}: best {worth.max():.3f}, mean {worth.mean():.3f}"
    print(told, file=sys.stderr, flush=True)


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
        worth = shares(policy, sets, worlds, (seed_of(generation, words.seed),), words.jobs)[0].mean(axis=(1, 2))
        strategy.tell(asked, (-worth).tolist())
        tell(generation, worth, words)
    middle = np.clip(strategy.result.xfavorite, 0.0, 1.0)
    return {one.name: float(f"{one.number(x):.3g}") for one, x in zip(ranges, middle, strict=True)}


@dataclass(frozen=True)
class Search:
    """What the search for a front saw, and its front by new seeds."""

    seen: FloatArray
    """(2, all sets) shares of performance and interference, by the seeds of the search."""
    sets: list[dict[str, float]]
    """Before, and then the sets of the front that are judged, the least performance first."""
    judged: FloatArray
    """(2, sets, seeds) means over worlds, by new seeds."""

    @property
    def stays(self) -> list[bool]:
        """Whether no other set is better in both, by new seeds."""
        return on_front(self.judged.mean(axis=2))


def on_front(points: FloatArray) -> list[bool]:
    """Return of points (2, n) which are on the Pareto front: no other is as good in both, and better in one.

    Much of the first is good, and little of the second.
    """
    more, less = points
    as_good = (more >= more[:, None]) & (less <= less[:, None])
    better = (more > more[:, None]) | (less < less[:, None])
    return (~(as_good & better).any(axis=1)).tolist()


def searched(
    policy: str, ranges: Sequence[Range], before: dict[str, float], worlds: Sequence[World], words: argparse.Namespace
) -> Search:
    """Return the front of performance and interference that NSGA-II finds; the numbers of before are its first set."""
    import optuna

    optuna.logging.set_verbosity(optuna.logging.WARNING)
    sampler = optuna.samplers.NSGAIISampler(population_size=words.population, seed=words.seed)
    study = optuna.create_study(directions=["maximize", "minimize"], sampler=sampler)
    space: dict[str, Any] = {
        one.name: optuna.distributions.FloatDistribution(one.low, one.high, log=one.by_ratio) for one in ranges
    }
    study.enqueue_trial({one.name: one.number(one.share(before[one.name])) for one in ranges})
    for generation in range(words.generations):
        trials = [study.ask(space) for _ in range(words.population)]
        sets = [trial.params for trial in trials]
        found = shares(policy, sets, worlds, (seed_of(generation, words.seed),), words.jobs).mean(axis=(2, 3))
        for trial, values in zip(trials, found.T.tolist(), strict=True):
            study.tell(trial, values)
        tell(generation, found[0], words)
    front = sorted(study.best_trials, key=lambda trial: trial.values[0])
    places = np.unique(np.linspace(0, len(front) - 1, JUDGED).round().astype(int))
    rounded = [{name: float(f"{x:.3g}") for name, x in front[place].params.items()} for place in places]
    seeds = range(JUDGING_SEED, JUDGING_SEED + words.judging)
    judged = shares(policy, [before, *rounded], worlds, seeds, words.jobs).mean(axis=2)
    return Search(np.array([trial.values for trial in study.trials]).T, [before, *rounded], judged)


def front_sheet(policy: str, search: Search, words: argparse.Namespace) -> Sheet:
    """Return the sets of a front beside the numbers of before."""
    rows = []
    for k, numbers in enumerate(search.sets):
        both = [aggregate(search.judged[measure, k]) for measure in (0, 1)]
        told = [f"{one.mean:.2f} ± {one.upper - one.mean:.2f}" for one in both]
        told.append("yes" if search.stays[k] else "no")
        rows.append((f"{k or 'before'}", *told, *(f"{x:g}" for x in numbers.values())))
    return Sheet.of(
        ("set", "performance", "interference", "on the front", *search.sets[0]),
        rows,
        title=f"Performance and interference of {policy} in {words.horizon:,.0f} s, as shares of {YARDSTICK}'s",
        notes=[f"± 95 % interval of the mean over {words.judging} seeds that the search did not have"],
    )


def draw_front(path: Path, policy: str, search: Search) -> None:
    """Draw what the search saw, and the front by new seeds."""
    with saved_figure(path, (6.5, 4.5), title=f"{policy}: performance against interference") as figure:
        panel = figure.subplots()
        panel.plot(*search.seen, ".", color="0.7", label="tried, one seed each")
        for k, judged in enumerate(search.judged.transpose(1, 0, 2)):
            both = [aggregate(one) for one in judged]
            x, y = (one.mean for one in both)
            bars = {f"{axis}err": one.upper - one.mean for axis, one in zip("xy", both, strict=True)}
            stays = search.stays[k]
            label = "before" if k == 0 else "of the front, new seeds" if k == 1 else None
            look = {"color": COLOURS[0 if k else 1], "marker": "o" if k else "s", "label": label}
            panel.errorbar(x, y, **bars, **look, markerfacecolor=None if stays else "white")
            panel.annotate(f"{k}" if k else "", (x, y), (4, 4), textcoords="offset points")
        panel.set(xlabel=f"performance, share of {YARDSTICK}'s", ylabel=f"interference, share of {YARDSTICK}'s")
        panel.legend()


def comparison(
    policy: str,
    before: dict[str, float],
    found: dict[str, float],
    worlds: Sequence[World],
    words: argparse.Namespace,
) -> Sheet:
    """Return performance before and after, beside that of the yardstick."""
    seeds = range(JUDGING_SEED, JUDGING_SEED + words.judging)
    policies = [
        policy_spec(YARDSTICK, label=f"{YARDSTICK}, unchanged"),
        policy_spec(policy, parameters=before, label="before"),
        policy_spec(policy, parameters=found, label="evolved"),
    ]
    means = [[aggregate(one) for one in each] for each in measured(policies, worlds, seeds, words.jobs)[0]]
    return Sheet.of(
        ("numbers", *(world.scenario.name for world in worlds)),
        [
            (spec.label, *(f"{one.mean:.1f} ± {one.upper - one.mean:.1f}" for one in each))
            for spec, each in zip(policies, means, strict=True)
        ],
        title=f"Performance of {policy} in {words.horizon:,.0f} s",
        notes=[f"± 95 % interval of the mean of {words.judging} runs"],
    )


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
    parser.add_argument("--judging", type=int, default=4, help="runs behind the table (default: 4)")
    parser.add_argument("--jobs", type=int, default=1, help="processes (default: 1)")
    parser.add_argument("--front", type=Path, metavar="PICTURE", help="trade performance against interference")
    words = parser.parse_args()
    numbers: Any = getattr(load_policy(words.policy), "parameters", None)
    if len(words.ranges) < 2:
        parser.error("expected two numbers or more: CMA-ES learns how they go together")
    lacking = [one.name for one in words.ranges if not hasattr(numbers, one.name)]
    if lacking:
        parser.error(f"expected numbers of {words.policy}, got {lacking[0]!r}")
    before = {one.name: float(getattr(numbers, one.name)) if one.start is None else one.start for one in words.ranges}
    worlds = [
        replace(one.world, scenario=replace(one.world.scenario, horizon_s=words.horizon))
        for one in load_protocol().worlds
        if not one.is_held_out
    ]
    if words.front:
        check_picture(words.front)
        search = searched(words.policy, words.ranges, before, worlds, words)
        draw_front(words.front, words.policy, search)
        print(front_sheet(words.policy, search, words).text())
        return
    found = evolved(words.policy, words.ranges, before, worlds, words)
    print(comparison(words.policy, before, found, worlds, words).text())
    print(f'load_policy("{words.policy}", {json.dumps(found)})')


if __name__ == "__main__":
    main()
