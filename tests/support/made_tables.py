"""Tables of studies whose curves are made by hand: nothing is run."""

import numpy as np
import polars as pl

from swarm_forage_env.studies.results import StudyTable
from swarm_forage_env.studies.study_file import Axis
from tests.support.tiny_study import made_up_study

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
