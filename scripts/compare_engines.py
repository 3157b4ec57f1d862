"""Run both engines of physics and print the measures that differ, as a Markdown table.

    python scripts/compare_engines.py --scenario warehouse_small,warehouse_medium --policy crw,dpo --robots 16,64
    python scripts/compare_engines.py --check

Every case is run in Chipmunk and in the compiled engine, with the same seeds. Two runs stay together until rounding or
a heap of several robots parts them; from then on they are two samples of one distribution if the engines are
equivalent. A difference is compiled minus Chipmunk, the mean over seeds with a 95 % t interval.

With --check the cases are fixed, among them a crowded floor, all rows are printed, and the command fails (exit code 1)
if more than one run in eight of a case has other numbers. Engines that are alike pass it: all runs of these cases are
the same. With friction or driving speed in contact changed by a tenth in one of them, half of the runs or more are
others, long before an interval leaves out zero.
"""

import argparse
import itertools
import sys
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from scipy.spatial import KDTree

from baselines.dpo import DPOPolicy
from baselines.robots import ACQUIRE
from metrics.statistics import aggregate
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.scenarios.config import PHYSICS_ENGINES, ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.world.motion import TOUCH_SLACK_M

MEASURES = {
    "deliveries": 1,
    "first pick-ups": 1,
    "interference, %": 2,
    "contacts per robot and 1,000 s": 2,
    "ticks of a contact, median": 1,
    "ticks of a contact, 90 %": 1,
    "deepest overlap, % of a diameter": 2,
}
"""What is measured, and with how many decimals it is written."""
CONFLICTS = {
    "conflicts over one object": 1,
    "of these in touch": 1,
    "ticks of a conflict in touch, median": 0,
    "ticks of a conflict in touch, 90 %": 0,
    "ticks of a conflict in touch, longest": 0,
    "conflicts unresolved at the end": 1,
}
"""The same for DPO alone."""
CROWDED = "crowded"
"""In the place of a scenario: sixty robots on 6 x 6 m, a fifth of the time in each other's way."""
CHECKED = [("warehouse_small", "crw", 64), ("warehouse_small", "dpo", 64), (CROWDED, "crw", 60), (CROWDED, "dpo", 60)]
"""Scenario, policy and robots of each case of --check."""
CHECKED_SEEDS, CHECKED_S = 8, 200.0
"""Runs of a case, and their length."""
MOST_PARTED = 1 / 8
"""Share of the runs of a case that may part by rounding (our choice: none of those checked does)."""
UNRESOLVED_TICKS = 1_000
"""A conflict that has been in touch so long when the run ends will not be resolved."""


class ContactCount:
    """Contacts of one run: how long each pair touches without a break, and how deep bodies overlap."""

    def __init__(self, radius_m: float) -> None:
        self._diameter_m = 2 * radius_m
        self._since: dict[tuple[int, int], int] = {}
        self.durations: list[int] = []
        self.deepest = 0.0

    def look(self, at: FloatArray, tick: int) -> None:
        """Note who touches; `at` (N, 2) is where robots are, in m."""
        pairs = KDTree(at).query_pairs(self._diameter_m + TOUCH_SLACK_M, output_type="ndarray")
        if len(pairs):
            apart = np.linalg.norm(at[pairs[:, 0]] - at[pairs[:, 1]], axis=1).min()
            self.deepest = max(self.deepest, 1.0 - float(apart) / self._diameter_m)
        touching = {(i, j) for i, j in pairs.tolist()}
        for pair in self._since.keys() - touching:
            self.durations.append(tick - self._since.pop(pair))
        for pair in touching - self._since.keys():
            self._since[pair] = tick


class ConflictCount:
    """Conflicts of one run over objects: look at it after every tick.

    A conflict is a pair of robots that go to the same remembered object and are both within its slowing radius, where
    they ignore obstacles. It is over when one goes for something else: one has the object.

    Attributes:
        found: Of each conflict, by (robot, robot, target, first tick): its ticks, its ticks in touch, its last tick in
            touch.
    """

    def __init__(self, touch_m: float) -> None:
        self.found: dict[tuple[int, int, int, int], list[int]] = {}
        self._touch_m = touch_m
        self._open_since: dict[tuple[int, int, int], tuple[int, int]] = {}

    def look(self, policy: DPOPolicy, at: FloatArray, tick: int) -> None:
        """Note who is in conflict; `at` (N, 2) is where robots are, in m."""
        robots = policy._robots
        goal = np.column_stack((robots["goal_x_m"], robots["goal_y_m"]))
        there = np.hypot(*(goal - at).T) <= policy.parameters.slowing_radius_m
        rows = np.flatnonzero(there & (robots["activity"] == ACQUIRE) & (robots["target"] >= 0))
        rows = rows[np.argsort(robots["target"][rows], kind="stable")]
        by_target = np.split(rows, np.flatnonzero(np.diff(robots["target"][rows])) + 1)
        for group in by_target:
            for i, j in itertools.combinations(group.tolist(), 2):
                pair = (i, j, int(robots["target"][i]))
                begun, last = self._open_since.get(pair, (tick, tick))
                if tick - last > 1:
                    begun = tick
                self._open_since[pair] = begun, tick
                conflict = self.found.setdefault((*pair, begun), [0, 0, 0])
                conflict[0] += 1
                if np.hypot(*(at[i] - at[j])) <= self._touch_m:
                    conflict[1] += 1
                    conflict[2] = tick


def measured(world: ScenarioConfig, policy_name: str, seed: int) -> dict[str, float]:
    """The measures of one run, by name."""
    policy = load_policy(policy_name)
    run = LiveRun(build_env(world, reads=getattr(policy, "reads", None)), policy, seed)
    env = run.forage_env
    contacts = ContactCount(world.robots.radius_m)
    conflicts = ConflictCount(2 * world.robots.radius_m + TOUCH_SLACK_M)
    while not run.over:
        run.advance(to_tick=env.tick + 1)
        contacts.look(env.swarm.position, env.tick)
        if isinstance(policy, DPOPolicy):
            conflicts.look(policy, env.swarm.position, env.tick)
    counters = env.events.counters
    durations = contacts.durations or [0]
    values: list[float] = [
        counters[Counter.COLLECTED],
        counters[Counter.FIRST_PICKED],
        100 * counters[Counter.INTERFERING] / max(1, counters[Counter.ACTIVE]),
        1_000 * len(contacts.durations) / (world.robots.n_robots * world.horizon_s),
        *np.percentile(durations, (50, 90)),
        100 * contacts.deepest,
    ]
    told = dict(zip(MEASURES, map(float, values), strict=True))
    return told | (of_conflicts(conflicts, env.tick) if isinstance(policy, DPOPolicy) else {})


def of_conflicts(conflicts: ConflictCount, end: int) -> dict[str, float]:
    """The measures of conflicts, by name."""
    touching = [(in_touch, last) for _, in_touch, last in conflicts.found.values() if in_touch]
    values = [
        len(conflicts.found),
        len(touching),
        *np.percentile([in_touch for in_touch, _ in touching] or [0], (50, 90, 100)),
        sum(last == end and in_touch >= UNRESOLVED_TICKS for in_touch, last in touching),
    ]
    return dict(zip(CONFLICTS, map(float, values), strict=True))


def case(name: str, policy: str, n_robots: int, horizon_s: float) -> list[RunSpec]:
    """Plan a run in each engine, in the order of `PHYSICS_ENGINES`."""
    if name == CROWDED:
        floor = {"width_m": 6.0, "height_m": 6.0, "nest_centre_m": (1.2, 3.0), "nest_size_m": (1.2, 4.8)}
        fields: dict[str, Any] = {"n_objects": 12, "start_margin_m": 0.6, **floor}
        world = scenario("warehouse_small", n_robots=n_robots, horizon_s=horizon_s, interval_s=horizon_s, **fields)
        world = replace(world, name=CROWDED)
    else:
        world = scenario(name, n_robots=n_robots, horizon_s=horizon_s, interval_s=horizon_s)
    return [plan_run(replace(world, physics=physics), policy) for physics in PHYSICS_ENGINES]


@dataclass(frozen=True)
class Row:
    """One measure of one case in both engines."""

    text: str
    n_parted: int
    """Runs that had another number in the other engine, as far as it is printed."""
    apart: bool
    """Whether the interval of the difference leaves out zero."""


def rows_of_case(specs: Sequence[RunSpec], seeds: int) -> Iterator[Row]:
    """Run one case in both engines; one line of the table per measure."""
    name, policy, n_robots = specs[0].scenario.name, specs[0].policy, specs[0].scenario.robots.n_robots
    runs = [[measured(spec.scenario, policy, seed) for seed in range(seeds)] for spec in specs]
    for measure, decimals in {**MEASURES, **CONFLICTS}.items():
        if measure not in runs[0][0]:
            continue
        compiled, chipmunk = (np.array([run[measure] for run in of_engine]) for of_engine in runs)
        difference = aggregate(compiled - chipmunk)
        cells = (chipmunk.mean(), compiled.mean(), difference.mean, difference.lower, difference.upper)
        n_parted = int(np.count_nonzero(np.abs(compiled - chipmunk) >= 0.5 * 10.0**-decimals))
        before, after, mean, low, high = (written(value, decimals) for value in cells)
        yield Row(
            text=f"| {name} | {policy} | {n_robots} | {measure} | {before} | {after} | {mean} ({low} to {high}) "
            f"| {seeds - n_parted} of {seeds} |",
            n_parted=n_parted,
            apart=difference.lower > 0.0 or difference.upper < 0.0,
        )


def written(value: float, decimals: int) -> str:
    """A number with so many decimals, and zero without a sign."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def listed(text: str) -> list[str]:
    """Names separated by commas."""
    return text.split(",")


def numbers(text: str) -> list[int]:
    """Whole numbers separated by commas."""
    return [int(word) for word in listed(text)]


def main(words: Sequence[str] | None = None) -> int:
    """Print the table, case by case; returns the exit code."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", type=listed, default=["warehouse_small"], help="presets, separated by commas")
    parser.add_argument("--policy", type=listed, default=["crw", "dpo"], help="policies, separated by commas")
    parser.add_argument("--robots", type=numbers, default=[16, 64], help="numbers of robots, separated by commas")
    parser.add_argument("--seeds", type=int, default=4, help="runs of a case, for an interval two or more")
    parser.add_argument("--all", action="store_true", help="print rows with the same numbers in both engines, too")
    parser.add_argument("--horizon", type=float, default=2_000.0, help="length of a run in s")
    parser.add_argument("--check", action="store_true", help="the fixed cases; fail if runs part")
    chosen = parser.parse_args(words)
    try:
        if chosen.check:
            cases, seeds = [case(*of, CHECKED_S) for of in CHECKED], CHECKED_SEEDS
        else:
            asked = itertools.product(chosen.scenario, chosen.policy, chosen.robots)
            cases, seeds = [case(*of, chosen.horizon) for of in asked], chosen.seeds
    except ValueError as error:  # a scenario, a policy or a number that there is not
        parser.error(str(error))
    print("| scenario | policy | robots | measure | Chipmunk | compiled | difference | same runs |")
    print("|---|---|--:|---|--:|--:|--:|--:|")
    n_alike, n_rows, n_apart, n_parted = 0, 0, 0, 0
    for specs in cases:
        rows = list(rows_of_case(specs, seeds))
        most = max(row.n_parted for row in rows)
        n_parted += most > MOST_PARTED * seeds
        n_alike += not most
        n_rows += sum(row.n_parted > 0 for row in rows)
        n_apart += sum(row.apart for row in rows if row.n_parted)
        for row in rows:
            if chosen.all or chosen.check or row.n_parted:
                print(row.text, flush=True)
    print(f"{n_alike} of {len(cases)} cases have the same numbers in both engines.")
    print(f"In {n_apart} of the {n_rows} rows that differ, the interval of the difference leaves out zero.")
    if chosen.check and n_parted:
        print(f"The engines differ: in {n_parted} cases more than {MOST_PARTED:.0%} of the runs have other numbers.")
    return int(chosen.check and n_parted > 0)


if __name__ == "__main__":
    sys.exit(main())
