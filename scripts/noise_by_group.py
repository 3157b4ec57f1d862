"""What noise on one group of sensors, or on the wheels, leaves of the performance: a table per world and reading.

    python scripts/noise_by_group.py            all worlds, groups and readings; shows how much time is left
    python scripts/noise_by_group.py --scenario warehouse_small --sigmas 0.03 --seeds 4

Numbers are performance in percent of the same policy's without noise; runs are paired by seed and kept in --out.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from arguments import whole

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.runs.record import RecordError, RunRecord
from swarm_forage_env.runs.runner import run_all
from swarm_forage_env.runs.spec import RunSpec, plan_run
from swarm_forage_env.runs.store import RunStore
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.scenarios.quirks import READINGS
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.noise import NOISE_GROUPS, ActuatorNoiseConfig, SensorNoiseConfig

POLICIES = ("crw", "dpo", "stochm", "stochx")
SOURCES = (*NOISE_GROUPS, "wheels", "all")


def disturbances(source: str, sigma: float) -> tuple[WrapperConfig, ...]:
    """Return noise on one group of sensors, on the wheels, or on everything."""
    sensors = (
        SensorNoiseConfig(sigma=sigma, groups=NOISE_GROUPS if source == "all" else (source,))
        if source != "wheels"
        else None
    )
    wheels = ActuatorNoiseConfig(sigma=sigma) if source in ("wheels", "all") else None
    return tuple(config for config in (sensors, wheels) if config is not None)


@dataclass(frozen=True)
class TablePlan:
    """The runs of one table."""

    world: ScenarioConfig
    reading: str
    sigmas: Sequence[float]
    calm: dict[str, list[RunSpec]]
    """Runs without noise, by policy."""
    noisy: dict[tuple[str, float], dict[str, list[RunSpec]]]
    """Those with it, by source and sigma, and then by policy."""


def with_noise(calm: dict[str, list[RunSpec]], source: str, sigma: float) -> dict[str, list[RunSpec]]:
    """Return the same runs of each policy with noise."""
    wrappers = disturbances(source, sigma) if sigma else ()
    return {policy: [replace(spec, wrappers=wrappers) for spec in specs] for policy, specs in calm.items()}


def share(records: dict[str, RunRecord], calm: Sequence[RunSpec], noisy: Sequence[RunSpec]) -> str:
    """Return what is left of the performance, in percent."""
    before, after = (sum(float(records[spec.run_id].performance.sum()) for spec in specs) for specs in (calm, noisy))
    return f"{100 * after / before:.0f}" if before else "-"


def false_obstacles(records: dict[str, RunRecord], specs: Sequence[RunSpec]) -> str:
    """Return the share of robot time in which a false obstacle is seen: believed less true interference."""
    own = [records[spec.run_id] for spec in specs]
    mean = np.mean([(r.contributed["believed_interference_fraction"] - r.interference_fraction).mean() for r in own])
    return f"{round(float(mean), 2) + 0.0:.2f}"  # zero without a sign


def tables(chosen: argparse.Namespace) -> Iterator[TablePlan]:
    """Plan all tables."""
    for name in chosen.scenario:
        for reading, quirks in READINGS.items():
            world = scenario(name, n_robots=chosen.robots, horizon_s=chosen.horizon, quirks=quirks)
            calm = {p: [plan_run(world, p, seed=seed) for seed in range(chosen.seeds)] for p in POLICIES}
            noisy = {(s, sigma): with_noise(calm, s, sigma) for s in SOURCES for sigma in chosen.sigmas}
            yield TablePlan(world, reading, chosen.sigmas, calm, noisy)


def lines(plan: TablePlan, store: RunStore, jobs: int | None) -> Iterator[str]:
    """Run what a table needs and yield its lines."""
    specs = [spec for runs in (plan.calm, *plan.noisy.values()) for own in runs.values() for spec in own]
    found = run_all(specs, store=store, jobs=jobs, progress=True)
    records = {record.run_id: record for record in found.records}
    world, sigmas = plan.world, plan.sigmas
    yield f"**{world.name}, {world.robots.n_robots} robots, {plan.reading}: performance in % of that without noise**"
    yield ""
    yield "| noise on | " + " | ".join(f"{p} {sigma:g}" for sigma in sigmas for p in POLICIES) + " |"
    yield "|---|" + "--:|" * (len(sigmas) * len(POLICIES))
    for source in SOURCES:
        shares = [share(records, plan.calm[p], plan.noisy[source, sigma][p]) for sigma in sigmas for p in POLICIES]
        yield f"| {source.replace('_', ' ')} | " + " | ".join(shares) + " |"
    false = [f"{sigma:g}: {false_obstacles(records, plan.noisy['proximity', sigma]['crw'])}" for sigma in sigmas]
    yield ""
    yield f"Share of robot time in which CRW sees a false obstacle, by sigma on proximity: {', '.join(false)}."


def main() -> None:
    """Print the tables of all worlds and readings."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    worlds = ("warehouse_small", "warehouse_medium", "search_and_rescue")
    parser.add_argument("--scenario", nargs="+", default=worlds, choices=worlds)
    parser.add_argument("--sigmas", nargs="+", type=float, default=[0.004, 0.017, 0.03, 0.1])
    parser.add_argument("--robots", type=whole(at_least=1), default=50)
    parser.add_argument("--seeds", type=whole(at_least=1), default=2)
    parser.add_argument("--horizon", type=float, default=2000.0, help="simulated seconds per run")
    parser.add_argument("--jobs", type=whole(at_least=1), help="processes; default one per core")
    parser.add_argument("--out", type=Path, default=Path("results/noise"), help="folder for records")
    chosen = parser.parse_args()
    try:
        store, plans = RunStore(chosen.out), list(tables(chosen))
        chosen.out.mkdir(parents=True, exist_ok=True)
    except (ConfigError, RecordError, OSError) as error:
        parser.error(str(error))
    for plan in plans:
        print("\n".join(lines(plan, store, chosen.jobs)), end="\n\n", flush=True)


if __name__ == "__main__":
    main()
