"""The columns of a table of curves, which has one row per recording interval.

Run records of `swarm_forage_env` and curves from other sources use the same table with these names.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias

Kind: TypeAlias = Literal["text", "whole", "number", "amount", "fraction"]
"""Kind of a column: text, whole numbers >= 0, numbers, numbers >= 0, numbers in [0, 1]."""

SIZE, THROTTLE, NOISE, POPULATION, UNDISTURBED = "population_size", "throttle", "noise", "population_dynamics", "none"
HANDLING = "handling_cost"
CRITERIA = (SIZE, THROTTLE, HANDLING, NOISE, POPULATION, UNDISTURBED)
"""What a study varies, in column `criterion`."""


@dataclass(frozen=True, slots=True)
class Column:
    """A column of a table of curves."""

    kind: Kind
    unit: str
    meaning: str
    is_required: bool = False


CURVE_COLUMNS: dict[str, Column] = {
    "controller": Column("text", "", "name of the policy; default: one policy, named after the file"),
    "criterion": Column("text", "", f"what is varied: {', '.join(CRITERIA)}; default {SIZE}"),
    "criterion_value": Column("number", "", "its value, 0 for the reference run; not needed for swarm sizes"),
    "n_robots": Column("whole", "robots", "swarm size N", is_required=True),
    "seed": Column("whole", "", "number of the run; runs of equal number are paired", is_required=True),
    "interval": Column("whole", "", "index of the interval, 0, 1, 2, ...", is_required=True),
    "performance": Column("amount", "", "P(N, t), larger is better", is_required=True),
    "t_end_s": Column("amount", "s", "end of the interval"),
    "interference_fraction": Column("fraction", "1", "t_lost(N, t), share of active robots avoiding others or walls"),
    "n_active": Column("amount", "robots", "mean number of robots at work"),
    "adversity": Column(
        "number",
        "1 or ticks",
        "conditions V(t), mean over the interval: of a throttle, or under a handling cost the ticks that handling "
        "takes; those of the reference run are I_ec",
    ),
    "throttle": Column("number", "1", "conditions V(t) at the end of the interval, as the paper samples them"),
    "handling_cost": Column("number", "ticks", "likewise, under a handling cost"),
    "deaths_per_s": Column("amount", "1/s", "rate of the whole swarm, the same in each row of a run"),
    "malfunctions_per_s": Column("amount", "1/s", "likewise"),
    "births_per_s": Column("amount", "1/s", "likewise"),
    "repairs_per_s": Column("amount", "1/s", "likewise"),
    "deaths": Column("amount", "robots", "that died in the interval"),
    "malfunctions": Column("amount", "robots", "that left the swarm for repair"),
    "repairs": Column("amount", "robots", "that came back"),
    "time_in_repair_s": Column("amount", "s", "mean length of the absences that ended in the interval"),
}
"""Column -> what it holds. Further columns are ignored."""

RATE_COLUMNS = {
    "lambda_d": "deaths_per_s",
    "lambda_bd": "malfunctions_per_s",
    "mu_b": "births_per_s",
    "mu_bd": "repairs_per_s",
}
"""Field of `PopulationRates` -> column; one value per run."""
INTERVAL_COLUMNS = tuple(
    name
    for name, column in CURVE_COLUMNS.items()
    if column.kind in ("amount", "fraction", "number") and name not in ("criterion_value", *RATE_COLUMNS.values())
)
"""Columns with one value per interval."""
