"""The columns of a table of curves, which has one row per recording interval.

Run records of `swarm_forage_env` and curves from other sources use the same table with these names.
"""

from collections.abc import Mapping

from swarm_forage_env.scenarios.columns import ALL_COLUMNS, Column
from swarm_forage_env.wrappers.world import SIZE, UNDISTURBED

THROTTLE, NOISE, POPULATION, HANDLING = "throttle", "noise", "population_dynamics", "handling_cost"
CRITERIA = (SIZE, THROTTLE, HANDLING, NOISE, POPULATION, UNDISTURBED)
"""What a study varies, in column `criterion`."""

RATE_COLUMNS = {
    "lambda_d": "deaths_per_s",
    "lambda_bd": "malfunctions_per_s",
    "mu_b": "births_per_s",
    "mu_bd": "repairs_per_s",
}
"""Field of `PopulationRates` -> column; one value per run. They are no part of records: specifications tell them."""
REQUIRED_COLUMNS = ("n_robots", "seed", "interval", "performance")
CURVE_COLUMNS: Mapping[str, Column] = {
    **{
        name: ALL_COLUMNS[name]
        for name in (
            "controller",
            "criterion",
            "criterion_value",
            *REQUIRED_COLUMNS,
            "t_end_s",
            "interference_fraction",
            "n_active",
            "adversity",
            "throttle",
            "handling_cost",
        )
    },
    **{
        name: Column("amount", "1/s", "rate of the whole swarm, the same in each row") for name in RATE_COLUMNS.values()
    },
    **{name: ALL_COLUMNS[name] for name in ("deaths", "malfunctions", "repairs", "time_in_repair_s")},
}
"""Columns that measures read -> what they hold. Further columns are ignored."""
INTERVAL_COLUMNS = tuple(
    name
    for name, column in CURVE_COLUMNS.items()
    if column.kind in ("amount", "fraction", "number") and name not in ("criterion_value", *RATE_COLUMNS.values())
)
"""Columns with one value per interval."""
