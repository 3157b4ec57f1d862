"""How does a policy do in every preset, from small swarms to large ones, beside the best of the paper's controllers?

    python scripts/every_size.py                           generalist; more than half an hour
    python scripts/every_size.py --policy a.npz --seeds 1  a first look at another policy

Each warehouse has the same hall in all sizes, so large swarms are crowded; that of search and rescue grows with them.
"of the limit" is the share that the policy reaches of what `metrics.limit_of` estimates for the world.
"""

import argparse
from collections.abc import Sequence

import numpy as np
from arguments import whole

from metrics.controllers import PAPER_POLICIES
from metrics.scoring.world_limits import share_of_limit, share_text
from metrics.statistics import aggregate
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.policy_spec import PolicySpec, policy_specs
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.evaluations import finished_runs
from swarm_forage_env.wrappers.world import World

PRESETS = ("warehouse_small", "warehouse_medium", "warehouse_dual", "warehouse_quad", "search_and_rescue")
SIZES = (8, 32, 128, 512)
FIRST_SEED = 70_000


def rows_of(policy: PolicySpec, worlds: Sequence[World], seeds: Sequence[int], jobs: int) -> list[tuple[str, ...]]:
    """Return the row of each world; numbers are performance per 1,000 s."""
    names = (policy.label, *PAPER_POLICIES)
    if policy.label in PAPER_POLICIES:
        raise ConfigError(f"Expected another policy than {', '.join(PAPER_POLICIES)}, which are the yardstick.")
    every = (policy, *policy_specs(list(PAPER_POLICIES)))
    table = finished_runs(Plan.product(every, worlds, seeds), jobs=jobs, progress=True)  # all, for one estimate
    made = {name: [table.of(one) for one in table.plan.of_policy(name)] for name in names}
    return [
        _row(world, {name: np.array([run.performance.sum() for run in made[name][k]]) for name in names}, policy.label)
        for k, world in enumerate(worlds)
    ]


def _row(world: World, totals: dict[str, FloatArray], ours: str) -> tuple[str, ...]:
    """Return the row of a world from the performance of whole runs, (runs,) for each policy."""
    per_1000_s = {name: aggregate(1000.0 * of_runs / world.scenario.horizon_s) for name, of_runs in totals.items()}
    best = max(PAPER_POLICIES, key=lambda name: per_1000_s[name].mean)
    told = [
        f"{one.mean:.1f}" + (f" ± {one.upper - one.mean:.1f}" if one.n_used > 1 else "")
        for one in (per_1000_s[best], per_1000_s[ours])
    ]
    ratio = per_1000_s[ours].mean / per_1000_s[best].mean
    share = share_text(share_of_limit(world, totals[ours].mean()))
    return (world.scenario.name, str(world.scenario.robots.n_robots), best, *told, f"{ratio:.2f}", share)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--policy", default="generalist", help="a name or a file")
    parser.add_argument("--seeds", type=whole(at_least=1), default=5, help="runs of each (default: 5)")
    parser.add_argument("--horizon", type=float, default=10_000.0, help="seconds of a run (default: 10,000)")
    parser.add_argument("--jobs", type=whole(at_least=1), default=1, help="processes (default: 1)")
    words = parser.parse_args()
    try:
        (policy,) = policy_specs([words.policy])
        worlds = [World(scenario(name, n_robots=size, horizon_s=words.horizon)) for name in PRESETS for size in SIZES]
        rows = rows_of(policy, worlds, range(FIRST_SEED, FIRST_SEED + words.seeds), words.jobs)
    except ConfigError as error:
        raise SystemExit(str(error)) from error
    header = ("scenario", "robots", "best of the four", "performance", policy.label, "ratio", "of the limit")
    title = f"Performance per 1,000 s, means of {counted(words.seeds, 'run')} of {words.horizon:,.0f} s"
    print(Sheet(title=title, header=header, rows=rows, notes=["± 95 % interval of the mean"]).text())


if __name__ == "__main__":
    main()
