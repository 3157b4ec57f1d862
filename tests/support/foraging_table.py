"""The table of a study whose runs do what the mean-field model says; nothing is run."""

import polars as pl
from metrics.foraging_model import ForagingRates, mean_field

from swarm_forage_env.runs.policy_spec import PolicySpec
from swarm_forage_env.studies.study import Axis
from swarm_forage_env.studies.study_table import StudyTable
from tests.support.made_tables import made_study

SIZES = (1, 2, 4, 8)
ONE = (PolicySpec(label="crw", policy="random"),)
RATES = ForagingRates(finding=1e-4, homing_s=100.0, encounters=2e-4, walls=0.01, avoidance_s=1.0, n_objects=512.0)
HORIZON_S, N_INTERVALS = 4000.0, 8


def foraging_table(**settings):
    """A study over sizes whose runs do what the mean field says."""
    spec = made_study(
        "mine",
        Axis(name="population_size", values=SIZES),
        policies=ONE,
        settings=settings,
        seeds=(0, 1),
        horizon_s=HORIZON_S,
        interval_s=HORIZON_S / N_INTERVALS,
    )
    rows = []
    for number, place in enumerate(spec.places):
        model = mean_field(RATES, place.values[-1], HORIZON_S, n_points=80 * N_INTERVALS + 1)
        carrying = model.carrying + model.avoiding_carrying
        for seed in spec.seeds:
            for interval in range(N_INTERVALS):
                span = slice(80 * interval, 80 * (interval + 1) + 1)
                delivered = model.delivered[span][-1] - model.delivered[span][0]
                picked = delivered + carrying[span][-1] - carrying[span][0]
                rows.append(
                    {"cell": number, "seed": seed, "run_id": f"{number}_{seed}", "state": "done", "interval": interval}
                    | {"performance": delivered, "collected": delivered, "free_pickups": picked}
                    | {"n_carrying": carrying[span].mean(), "interference_fraction": model.interference[span].mean()}
                    | {"n_active": float(place.values[-1])}
                )
    return StudyTable(spec=spec, frame=pl.DataFrame(rows, infer_schema_length=None), versions=())
