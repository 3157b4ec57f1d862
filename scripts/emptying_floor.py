"""The floor near the nest empties: what swarms deliver at first and later, and how far free objects lie then.

python scripts/emptying_floor.py            CRW and DPO in the medium warehouse, the table of docs/controllers.md
python scripts/emptying_floor.py --seeds 2  fewer runs
"""

import argparse

import numpy as np
from arguments import whole

from metrics import aggregate
from swarm_forage_env.contract.codes import ObjectStatus
from swarm_forage_env.contract.types import FloatArray
from swarm_forage_env.policies.registry import load_policy
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.runs.run import LiveRun, build_stack
from swarm_forage_env.scenarios.config import ScenarioConfig
from swarm_forage_env.scenarios.floor import CELL_M
from swarm_forage_env.scenarios.presets import scenario

FIRST_S, LATER_S = 1000.0, 3000.0
"""End of what is called "at first", and beginning of "later"."""
POLICIES = ("crw", "dpo")


def free_objects_m(live: LiveRun) -> float:
    """Mean distance of free objects from the middle of the nest."""
    objects = live.forage_env.objects
    places = CELL_M * (objects.cell[objects.status == ObjectStatus.FREE] + 0.5)
    return float(np.hypot(*(places - live.forage_env.scenario.arena.nest_centre_m).T).mean())


def numbers_of(world: ScenarioConfig, policy: str, seed: int) -> list[float]:
    """Return deliveries per 1,000 s, share of time in interference and distance of free objects, at first and later."""
    made = load_policy(policy)
    recorder = build_stack(world, reads=getattr(made, "reads", None))
    live = LiveRun(recorder, made, seed)
    begin_m = free_objects_m(live)
    live.advance()
    columns: dict[str, FloatArray] = recorder.columns()
    later = columns["t_end_s"] > LATER_S
    found: list[float] = []
    for curve in (columns["collected"] * 1000.0 / FIRST_S, columns["interference_fraction"]):
        found += [float(curve[0]), float(curve[later].mean())]
    return [*found, begin_m, free_objects_m(live)]


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=whole(at_least=2), default=8, help="runs of each policy (default: 8)")
    parser.add_argument("--horizon", type=float, default=10_000.0, help="seconds of a run (default: 10000)")
    words = parser.parse_args()
    n_seeds = words.seeds
    world = scenario("warehouse_medium", horizon_s=words.horizon, interval_s=FIRST_S)
    rows: list[tuple[str, ...]] = []
    for policy in POLICIES:
        means = [
            aggregate(column)
            for column in zip(*(numbers_of(world, policy, seed) for seed in range(n_seeds)), strict=True)
        ]
        digits = (0, 0, 3, 3, 1, 1)
        rows.append(
            (
                policy,
                *(f"{one.mean:.{n}f} ± {one.upper - one.mean:.{n}f}" for one, n in zip(means, digits, strict=True)),
            )
        )
    header = (
        "policy",
        "delivered, first",
        "later",
        "interference, first",
        "later",
        "free objects to nest, m: begin",
        "end",
    )
    title = f"{world.name}, {world.robots.n_robots} robots: the first {FIRST_S:,.0f} s, and from {LATER_S:,.0f} s on"
    notes = [f"± 95 % interval of the mean of {n_seeds} runs; delivered per 1,000 s"]
    print(Sheet(title=title, header=header, rows=rows, notes=notes).text())


if __name__ == "__main__":
    main()
