"""Tables of plans whose runs are made by hand: nothing is run."""

import numpy as np

from swarm_forage_env.runs.record import COLUMN_DTYPES, RunRecord
from swarm_forage_env.runs.store import RunFailure
from swarm_forage_env.runs.table import Table


def made_record(spec, total):
    """A record of a run whose performance, summed over its intervals, is `total`; all other columns are 0."""
    scenario = spec.scenario
    n_intervals = round(scenario.horizon_s / scenario.interval_s)
    columns = {name: np.zeros(n_intervals, dtype) for name, dtype in COLUMN_DTYPES.items()}
    columns["interval"] = np.arange(n_intervals)
    columns["t_end_s"] = scenario.interval_s * np.arange(1.0, n_intervals + 1.0)
    columns["performance"] = np.full(n_intervals, total / n_intervals)
    return RunRecord(
        run_id=spec.run_id,
        scenario=scenario.name,
        controller=spec.policy,
        n_robots=spec.world.n_robots,
        criterion=spec.world.criterion,
        criterion_value=spec.world.value,
        seed=spec.seed,
        **columns,
        contributed={},
        spec=spec.to_json(),
        provenance={},
    )


def table_of_totals(plan, totals):
    """The table of a plan.

    Args:
        plan: The plan.
        totals: Label of a policy -> for each of its conditions the totals of its runs, seed by seed; where there are
            fewer than seeds, the others failed.
    """
    records, failures = {}, {}
    for label, of_policy in totals.items():
        for condition, of_seeds in zip(plan.of_policy(label), of_policy, strict=True):
            specs = plan.specs_of(condition)
            for spec, total in zip(specs, of_seeds, strict=False):
                records[spec.run_id] = made_record(spec, total)
            for spec in specs[len(of_seeds) :]:
                failures[spec.run_id] = RunFailure(spec=spec, error="it broke", traceback="")
    return Table(plan=plan, records=records, failures=failures)
