"""Tables of studies whose curves are made by hand: nothing is run."""

import numpy as np
import polars as pl

from swarm_forage_env.runs.policy_spec import PolicySpec
from swarm_forage_env.studies.study import Axis, StudySpec
from swarm_forage_env.studies.study_table import LOSS_COLUMNS, StudyTable, place_columns

FOUR = ("crw", "dpo", "stochm", "stochx")
N_INTERVALS = 4


def four_policies():
    """The policies of the paper by label; whatever stands behind them, it is not run."""
    return tuple(PolicySpec(label=label, policy="random") for label in FOUR)


def made_study(name="S1a", *axes, **changes):
    """A study of the four policies; by default over three swarm sizes."""
    given = {
        "name": name,
        "scenario": "warehouse_small",
        "settings": {"n_objects": 20},
        "policies": four_policies(),
        "axes": axes or (Axis(name="population_size", values=(1, 2, 4)),),
        "reference": None,
        "rules": ("described",),
        "seeds": tuple(range(6)),
        "horizon_s": 10.0 * N_INTERVALS,
        "interval_s": 10.0,
    }
    return StudySpec(**given | changes)


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
            where = {"condition": number, **place_columns(spec, place), "seed": seed, **dict.fromkeys(LOSS_COLUMNS)}
            if (place, seed) in lost:
                rows.append({**where, "state": "missing"})
                continue
            noise = 0.02 * np.random.default_rng(seed).normal(size=N_INTERVALS)
            rows += [
                {
                    **where,
                    "state": "done",
                    "interval": interval,
                    "t_end_s": spec.interval_s * (interval + 1),
                    "performance": performance(place) * (1.0 + noise[interval]),
                    "interference_fraction": 0.1,
                    "adversity": adversity(place) if 2 * interval >= N_INTERVALS else 0.1,
                    "n_active": 4.0,
                }
                for interval in range(N_INTERVALS)
            ]
    return StudyTable(spec=spec, frame=pl.DataFrame(rows, infer_schema_length=None), versions=({"numpy": "2.0"},))
