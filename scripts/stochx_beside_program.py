"""STOCHX under the rules `AUTHORS_PROGRAM` beside runs of the authors' program itself: tables of docs/controllers.md.

    python scripts/stochx_beside_program.py                 runs of 10,000 s, some minutes
    python scripts/stochx_beside_program.py --seeds 4       fewer of them

Runs have compiled bodies. The figures of the program are means of two runs of 10,000 s each.
"""

import argparse
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from arguments import whole

from metrics import aggregate
from swarm_forage_env.contract.codes import Task
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.run import run_one
from swarm_forage_env.runs.spec import plan_run
from swarm_forage_env.scenarios.presets import scenario

INTERVAL_S = 200.0
TASKS = tuple(task for task in Task if task is not Task.NONE)


class Place(NamedTuple):
    """A world, and what the authors' program did there."""

    name: str
    n_robots: int
    n_objects: int
    program: float | None
    """Deliveries per 1,000 s; None: not known."""


PLACES = (
    Place("warehouse_small", 16, 230, None),
    Place("warehouse_small", 32, 230, 11.7),
    Place("warehouse_small", 50, 177, 20.2),
    Place("warehouse_small", 64, 230, 24.8),
    Place("warehouse_medium", 200, 800, 69.5),
)
WITH_TASKS = PLACES[2]
TASKS_OF_PROGRAM = (8.7, 2.2, 7.7, 6.6, 9.2, 13.2, 2.6)
"""Mean robots per task there in the second half of a run, in the order of `TASKS`."""


@dataclass(frozen=True, kw_only=True)
class Found:
    """The runs of a place."""

    place: Place
    records: Sequence[RunRecord]

    def robots_per_task(self) -> list[float]:
        """Mean number of robots in each of `TASKS` in the second half."""
        shares = [
            [np.array_split(record.columns()[f"task_share_{task.name.lower()}"], 2)[1].mean() for task in TASKS]
            for record in self.records
        ]
        return (self.place.n_robots * np.mean(shares, axis=0)).tolist()

    def first_cache_s(self) -> list[float]:
        """End of the interval in which each run got its first cache, infinite where it got none; sorted."""
        created = (np.flatnonzero(record.columns()["caches_created"]) for record in self.records)
        return sorted((at[0] + 1) * INTERVAL_S if len(at) else np.inf for at in created)


def runs_of(place: Place, n_seeds: int, horizon_s: float) -> Found:
    """Run STOCHX in a place."""
    world = scenario(
        place.name,
        n_robots=place.n_robots,
        n_objects=place.n_objects,
        quirks="AUTHORS_PROGRAM",
        physics="compiled",
        horizon_s=horizon_s,
        interval_s=INTERVAL_S,
    )
    return Found(place=place, records=[run_one(plan_run(world, "stochx", seed=seed)) for seed in range(n_seeds)])


def deliveries(found: Sequence[Found]) -> Sheet:
    """One row per place."""
    rows = []
    for place, records in ((one.place, one.records) for one in found):
        rates = [record.rate_per_1000_s("performance") for record in records]
        mean = aggregate(rates)
        ratio = "-" if place.program is None else f"{mean.mean / place.program:.2f}"
        rows.append(
            (
                place.name,
                str(place.n_robots),
                str(place.n_objects),
                "-" if place.program is None else f"{place.program:.1f}",
                f"{mean.mean:.1f}",
                f"{mean.lower:.1f} to {mean.upper:.1f}",
                ratio,
                f"{np.std(rates, ddof=1):.1f}",
            )
        )
    header = ("world", "robots", "objects", "program", "AUTHORS_PROGRAM", "95 %", "ratio", "sd of one run")
    note = f"95 %: Student's interval of the mean of {len(found[0].records)} runs"
    return Sheet(title="deliveries per 1,000 s", header=header, rows=rows, notes=[note])


def tasks(found: Found) -> Sheet:
    """The place whose tasks are known of the program."""
    words = [task.name.lower().replace("_", " ") for task in TASKS]
    rows = [
        ("program", *(f"{robots:.1f}" for robots in TASKS_OF_PROGRAM)),
        ("AUTHORS_PROGRAM", *(f"{robots:.1f}" for robots in found.robots_per_task())),
    ]
    place = found.place
    title = f"mean robots per task, second half: {place.name}, {place.n_robots} robots, {place.n_objects} objects"
    return Sheet(title=title, header=("", *words), rows=rows)


def first_caches(found: Sequence[Found]) -> Sheet:
    """When caches begin."""
    rows = []
    for one in found:
        at = one.first_cache_s()
        quartiles = (f"{at[place]:,.0f}" for place in (len(at) // 4, len(at) // 2, 3 * len(at) // 4))
        late = ("later" if number == "inf" else number for number in quartiles)
        rows.append((one.place.name, str(one.place.n_robots), *late, str(at.count(np.inf))))
    header = ("world", "robots", "a quarter", "half", "three quarters", "runs without")
    return Sheet(title="time in s by which a share of the runs had its first cache", header=header, rows=rows)


def main() -> None:
    """Do what the command line says."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=whole(at_least=2), default=16, help="runs of each world (default: 16)")
    parser.add_argument("--horizon", type=float, default=10_000.0, help="seconds of a run (default: 10000)")
    words = parser.parse_args()
    found = [runs_of(place, words.seeds, words.horizon) for place in PLACES]
    by_place = {one.place: one for one in found}
    sheets = (deliveries(found), tasks(by_place[WITH_TASKS]), first_caches(found))
    print("\n\n".join(sheet.text() for sheet in sheets))


if __name__ == "__main__":
    main()
