"""Studies as their files: any study from a few words, and one whose runs take a moment."""

import json

import numpy as np
import polars as pl

from swarm_forage_env.studies.ladders import CRITERIA
from swarm_forage_env.studies.results import StudyTable
from swarm_forage_env.studies.study import study_of
from swarm_forage_env.studies.study_file import Axis

RANDOM = "random"
TWIN = {"policy": "random", "label": "twin", "caches": "static"}
BROKEN = {"policy": "random", "label": "broken", "parameters": {"speed": 3}}
"""It takes no arguments, so its runs fail."""


def word(value):
    """A value as TOML has it in a line."""
    if isinstance(value, dict):
        return "{ " + ", ".join(f"{json.dumps(name)} = {word(one)}" for name, one in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(word, value)) + "]"
    return json.dumps(value) if isinstance(value, str | bool) else repr(value)


def made_up_study(*axes, reference=None, **given):
    """A study from its tables by name, `axes` as `Axis`; the budget is `small`, its keys are among the others."""
    told = {"name": "mine", "scenario": "warehouse_small", "policies": ("crw",), "rules": ("described",)} | given
    small = {name: told.pop(name) for name in ("seeds", "horizon_s", "interval_s") if name in told}
    tables = [
        {"criterion" if axis.name in (*CRITERIA, "quirk") else "field": axis.name, "values": axis.values}
        for axis in axes
    ]
    if reference is not None:
        tables[-1]["reference"] = reference
    lines = [f"{name} = {word(value)}" for name, value in (told | {"axis": tables}).items()]
    return study_of("\n".join([*lines, f"budget.small = {word(small)}"]), "small")


def tiny_study(*axes, **changes):
    """A study of two policies and two axes."""
    usual = (Axis(name="population_size", values=(2, 3)), Axis(name="noise", values=(0.0, 0.02)))
    given = {"name": "tiny", "set": {"n_objects": 20}, "policies": (RANDOM, TWIN), "seeds": (0, 1), "horizon_s": 4.0,
             "interval_s": 2.0}  # fmt: skip
    return made_up_study(*(axes or usual), **given | changes)


FOUR = ("crw", "dpo", "stochm", "stochx")
N_INTERVALS = 4
LENGTH = {"horizon_s": 10.0 * N_INTERVALS, "interval_s": 10.0}


def made_study(name="S1a", *axes, **changes):
    """A study of the four policies, which are not run; by default over three swarm sizes."""
    policies = [{"policy": "random", "label": label} for label in FOUR]
    given = {"name": name, "set": {"n_objects": 20}, "policies": policies, "seeds": tuple(range(6)), **LENGTH}
    return made_up_study(*(axes or (Axis(name="population_size", values=(1, 2, 4)),)), **given | changes)


def made_table(spec, performance, *, lost=(), adversity=lambda place: 0.0):
    """A study's table.

    Args:
        spec: The study.
        performance: Place -> level of its performance; runs differ a little from it, equally in all conditions.
        lost: (place, seed) of missing runs.
        adversity: Place -> conditions in the second half of a run.
    """
    rows = []
    for number, place in enumerate(spec.places):
        for seed in spec.seeds:
            if (place, seed) in lost:
                continue
            noise = 0.02 * np.random.default_rng(seed).normal(size=N_INTERVALS)
            rows += [
                {
                    "condition": number,
                    "rules": place.rules,
                    "policy": place.policy,
                    "seed": seed,
                    "error": None,
                    "interval": interval,
                    "t_end_s": 10.0 * (interval + 1),
                    "performance": performance(place) * (1.0 + noise[interval]),
                    "interference_fraction": 0.1,
                    "adversity": adversity(place) if 2 * interval >= N_INTERVALS else 0.1,
                    "n_active": 4.0,
                }
                for interval in range(N_INTERVALS)
            ]
    keys = {
        "condition": pl.Int64,
        "rules": pl.String,
        "policy": pl.String,
        "seed": pl.Int64,
        "error": pl.String,
        "interval": pl.Int64,
    }
    frame = pl.DataFrame(rows, schema_overrides=keys, infer_schema_length=None) if rows else pl.DataFrame(schema=keys)
    return StudyTable(spec=spec, frame=frame, versions=({"numpy": "2.0"},))
