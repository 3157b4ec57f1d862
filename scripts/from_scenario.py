"""Swarms predicted from the scenario alone, beside runs, over swarm sizes and densities: the table of docs/laws.md.

    python scripts/from_scenario.py               some minutes
    python scripts/from_scenario.py --seeds 2     a first look
    python scripts/from_scenario.py --out FOLDER  keep the runs, and do not repeat those that are there

`scripts/update_docs --remake from_scenario` writes it into the page.
"""

import argparse
from collections.abc import Iterator, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from metrics.scoring import ask, scenario_question
from swarm_forage_env._internal.wording import number, percent
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.scenarios.presets import scenario

SMALL, MEDIUM = (1, 8, 32, 128), (1, 8, 64, 256)
WORLDS = (
    ("crw", "warehouse_small", 64, SMALL),
    ("crw", "warehouse_small", 192, SMALL),
    ("crw", "warehouse_small", 512, SMALL),
    ("crw", "warehouse_medium", 192, MEDIUM),
    ("crw", "warehouse_medium", 768, MEDIUM),
    ("crw", "warehouse_medium", 2048, MEDIUM),
    ("crw", "search_and_rescue", None, (12, 51, 115)),
    ("dpo", "warehouse_small", 512, SMALL),
    ("dpo", "warehouse_medium", 768, MEDIUM),
)
"""Policy, scenario, objects where they are not those of the scenario, swarm sizes."""
HEADER = (
    "policy", "scenario", "objects", "robots", "per 100 m2", "model", "runs", "error", "time lost", "runs",
    "search", "runs", "home", "runs",
)  # fmt: skip
FEWEST = 8
"""Smaller swarms deliver so little that runs say little of them."""


class Beside(NamedTuple):
    """One swarm size."""

    cells: tuple[str, ...]
    policy: str
    scenario: str
    n_robots: int
    errors: tuple[float, float, float]
    """By what shares the model is above the runs: deliveries, time lost, time of a search."""


def beside(
    policy: str, name: str, n_objects: int | None, sizes: Sequence[int], n_seeds: int, out: str | None
) -> Iterator[Beside]:
    """Return what runs of 4,000 s show of each swarm size, beside the model."""
    world = scenario(name, horizon_s=4000.0, interval_s=400.0)
    if n_objects is not None:
        world = replace(world, objects=replace(world.objects, n_objects=n_objects))
    question = scenario_question([policy], world, [], hold=sizes, seeds=n_seeds)
    (table,) = ask(question, out=out).tables
    for condition in question.plan.conditions:
        made, n = condition.world.scenario, condition.world.n_robots
        model, runs = table.predicted[n], table.runs[n]
        lost = float(model.interference.mean()), float(runs.interference.mean())
        search_s = float(model.search_s.mean()), runs.search_s
        cells = (
            *(policy, name, str(made.objects.n_objects), str(n)),
            f"{100.0 * n / (made.arena.width_m * made.arena.height_m):.2g}",
            *(number(float(curves.performance.sum(axis=-1).mean())) for curves in (model, runs)),
            f"{100.0 * table.error(n):+.0f} %",
            *map(percent, lost),
            *(f"{seconds:.0f} s" for seconds in (*search_s, model.home_s.mean(), runs.home_s)),
        )
        errors = table.error(n), lost[0] / lost[1] - 1.0, search_s[0] / search_s[1] - 1.0
        yield Beside(cells, policy, name, n, errors)


def summary(found: Sequence[Beside]) -> Iterator[str]:
    """Return how far the model is off, for each policy and scenario."""
    for policy, name in dict.fromkeys((one.policy, one.scenario) for one in found):
        errors = np.array(
            [one.errors for one in found if (one.policy, one.scenario) == (policy, name) and one.n_robots >= FEWEST]
        )
        told = (
            f"{what} {100.0 * np.median(column):+.0f} % ({100.0 * column.min():+.0f} to {100.0 * column.max():+.0f})"
            for what, column in zip(("deliveries", "time lost", "searches"), errors.T, strict=True)
        )
        yield f"{policy} in {name}: {', '.join(told)}"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--seeds", type=int, default=8, help="runs per size")
    parser.add_argument("--out", help="folder that keeps the runs")
    words = parser.parse_args()
    found = [one for world in WORLDS for one in beside(*world, words.seeds, words.out)]
    title = f"objects in 4,000 s from the scenario alone, beside {words.seeds} runs each"
    notes = (f"Errors of the model for {FEWEST} robots or more, median (least to largest):", *summary(found))
    print(Sheet(title=title, header=HEADER, rows=[one.cells for one in found], notes=notes).text())


if __name__ == "__main__":
    main()
