"""What talking is worth: four whole runs of each of ten trained swarms, as docs/benchmark/talk.csv has them."""

import csv
import sys
from pathlib import Path

from swarm_forage_env import World, scenario
from swarm_forage_env.runs.plan import Condition, Plan, run_plan
from swarm_forage_env.runs.spec import policy_specs

PLACE = {"width_m": 32.0, "height_m": 32.0, "nest_centre_m": (16.0, 16.0), "nest_size_m": (4.0, 4.0)}
HEAP = World(scenario("warehouse_small", n_robots=24, n_objects=64, placement="heap", **PLACE))

if __name__ == "__main__":
    out = csv.writer(sys.stdout, lineterminator="\n")
    out.writerow(["swarm", "training", "seed", "per_1000_s"])
    for swarm in ("talk", "silent"):
        for file in sorted(Path("results", swarm).glob("seed_*/policy.npz")):
            plan = Plan(conditions=(Condition(*policy_specs([str(file)]), HEAP),), seeds=(9101, 9102, 9103, 9104))
            for record in run_plan(plan).of(plan.conditions[0]):
                rate = record.per_1000_s("performance")
                out.writerow([swarm, file.parent.name.removeprefix("seed_"), record.spec.seed, f"{rate:g}"])
