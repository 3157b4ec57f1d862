"""What must not move: values of a score, answers of a verdict, and a training.

`python -m tests.support.frozen` writes `tests/promises/frozen/*.json` anew. Do that only for a change that is meant to
change results. All that these values take from the package is asked for here.
"""

import json
import re
import tempfile
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import polars as pl

from metrics import score, verdict
from metrics.claims import CLAIMS
from swarm_forage_env import scenario
from swarm_forage_env.studies.ladders import Budget
from swarm_forage_env.studies.results import read_study, run_study
from swarm_forage_env.studies.study import load_study, study_of

FOLDER = Path(__file__).parent.parent / "promises" / "frozen"
MINUTE = Path(__file__).parent.parent.parent / "docs" / "benchmark" / "plans" / "minute.toml"
FOUR = ("crw", "dpo", "stochm", "stochx")
CROWDED = {
    "n_robots": 12,
    "n_objects": 120,
    "width_m": 12.0,
    "height_m": 8.0,
    "nest_centre_m": (1.6, 4.0),
    "nest_size_m": (1.6, 6.4),
}
"""A small and full warehouse, in which robots meet often and deliver within minutes."""


def score_values() -> dict[str, dict[str, list[float]]]:
    """Return policy -> measure, variant, level and form -> value of each seed; of all measures."""
    budget = Budget(horizon_s=600.0, interval_s=60.0, n_seeds=2, n_sizes=3, n_levels=2)
    world = scenario("warehouse_small", **CROWDED)
    values: dict[str, dict[str, list[float]]] = {policy: {} for policy in FOUR}
    for variant in ("corrected", "paper"):
        found = score(list(FOUR), world, budget=budget, variants=[variant], jobs=1, progress=False).frame
        for (policy, *key), rows in found.group_by(
            "policy", "measure", "variant", "form", "criterion", "x", maintain_order=True
        ):
            name = "{} {} {} {} {:g}".format(*key)
            given = rows.filter(pl.col("seed").is_not_null())
            values[policy][name] = given["value"].to_list()
            values[policy][f"{name} relative"] = given["relative"].drop_nulls().to_list()
    return values


def verdict_answers() -> dict[str, str]:
    """Return claim, rules and reading -> the answer and why, of tiny runs over swarm sizes."""
    small = "seeds = 4\nhorizon_s = 400.0\ninterval_s = 40.0\nvalues = { population_size = [1, 2, 4, 8, 16, 32] }\n"
    study = study_of(f"{load_study('S1a').text}\n[budget.small]\n{small}", "small")
    with tempfile.TemporaryDirectory() as folder:
        run_study(study, folder, jobs=1)
        found = verdict(read_study(folder))
    return {
        "{claim} {rules} {reading}".format(**row): "{answer}: {why}".format(**row)
        for row in found.frame.filter(pl.col("answer") != "no runs").iter_rows(named=True)
        if row["claim"] in CLAIMS
    }


def training_weights() -> dict[str, float]:
    """Return the norm of each layer after the first 20,000 decisions of the minute's plan; needs torch."""
    from swarm_forage_env.policies.network import Network
    from swarm_forage_env.training.plan import Stage, read_plan
    from swarm_forage_env.training.sb3.training import train

    plan = read_plan(MINUTE)
    short = replace(
        plan,
        starts=1,
        stages=(Stage(steps=20_000),),
        options={**plan.options, "n_steps": 16},
        evaluation=replace(plan.evaluation, horizon_s=200.0),
    )
    with tempfile.TemporaryDirectory() as folder:
        train(short, Path(folder))
        network = Network.load(Path(folder) / "policy.npz")
    layers = zip(network.weights, network.biases, strict=True)
    return {
        f"layer {n}": float(np.linalg.norm(weight) + np.linalg.norm(bias)) for n, (weight, bias) in enumerate(layers)
    }


FROZEN = {"score": score_values, "verdict": verdict_answers, "training": training_weights}
"""Name of a file -> what makes its values."""


def stored(name: str) -> Any:
    """Return the values of a file."""
    return json.loads((FOLDER / f"{name}.json").read_text(encoding="utf-8"))


if __name__ == "__main__":
    for name, values in FROZEN.items():
        text = re.sub(r"\n {3,}|\n  (?=\])", " ", json.dumps(values(), indent=1))
        (FOLDER / f"{name}.json").write_text(f"{text}\n", encoding="utf-8")
