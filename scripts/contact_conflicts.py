"""Count what happens when two robots want one object: conflicts, how many touch, how long those take.

    python scripts/contact_conflicts.py --seeds 10

A conflict is a pair of robots that go to the same remembered object and are both within its slowing radius, where
they ignore obstacles. It touches if their bodies do. It is over when one goes for something else: one has the object.
It is unresolved if the pair is still in touch when the run ends and has been for `UNRESOLVED_TICKS`.
"""

import argparse
from itertools import combinations

import numpy as np
from arguments import whole

from baselines.dpo import DPOPolicy
from baselines.robots import ACQUIRE
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.contract.codes import Counter
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.runs.run import LiveRun, build_env
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import SCENARIO_NAMES, scenario
from swarm_forage_env.world.motion import TOUCH_SLACK_M

UNRESOLVED_TICKS = 1_000


class ConflictCount:
    """Conflicts of one run: look at it after every tick.

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
            for i, j in combinations(group.tolist(), 2):
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


def conflicts_of_run(world: ScenarioConfig, seed: int) -> tuple[int, list[list[int]]]:
    """Deliveries of one run of DPO, and of each conflict its ticks, its ticks in touch, its last tick in touch."""
    policy = DPOPolicy()
    run = LiveRun(build_env(world, reads=policy.reads), policy, seed)
    env = run.forage_env
    count = ConflictCount(2 * world.robots.radius_m + TOUCH_SLACK_M)
    while not run.over:
        run.advance(to_tick=env.tick + 1)
        count.look(policy, env.swarm.position, env.tick)
    return int(env.events.counters[Counter.COLLECTED]), list(count.found.values())


def main() -> None:
    """Run the seeds and print one line each, and one for all."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--scenario", choices=SCENARIO_NAMES, default="warehouse_medium")
    parser.add_argument("--robots", type=whole(at_least=1), help="default: those of the scenario")
    parser.add_argument("--seeds", type=whole(at_least=1), default=10)
    parser.add_argument("--seconds", type=float, default=2_000.0)
    arguments = parser.parse_args()
    overrides = {} if arguments.robots is None else {"n_robots": arguments.robots}
    seconds = {"horizon_s": arguments.seconds, "interval_s": arguments.seconds}
    try:
        world = scenario(arguments.scenario, **seconds, **overrides)
    except ConfigError as error:
        parser.error(str(error))
    delivered, conflicts = 0, []
    for seed in range(arguments.seeds):
        deliveries, of_run = conflicts_of_run(world, seed)
        print(line(f"seed {seed}", deliveries, of_run, arguments.seconds))
        delivered, conflicts = delivered + deliveries, conflicts + of_run
    print(line("all", delivered, conflicts, arguments.seconds))


def line(title: str, deliveries: int, conflicts: list[list[int]], seconds: float) -> str:
    """One line of the table."""
    touching = [conflict for conflict in conflicts if conflict[1]]
    end = round(seconds / 0.2)
    unresolved = sum(last == end and ticks >= UNRESOLVED_TICKS for _, ticks, last in touching)
    median, most, longest = np.percentile([ticks for _, ticks, _ in touching] or [0], (50, 90, 100))
    per_1000 = 1_000 / max(1, deliveries)
    return (
        f"{title:>8}: {deliveries} delivered; per 1,000 of them {len(conflicts) * per_1000:.1f} conflicts, "
        f"{len(touching) * per_1000:.1f} in touch; {unresolved} unresolved; ticks in touch: median {median:.0f}, "
        f"90 % {most:.0f}, longest {longest:.0f}"
    )


if __name__ == "__main__":
    main()
