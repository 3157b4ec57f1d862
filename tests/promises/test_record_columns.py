"""Records hold the columns that `metrics` reads by name; the two share nothing but this list of columns."""

from metrics.scoring.columns import CURVE_COLUMNS
from swarm_forage_env.runs.record import schema_table
from swarm_forage_env.scenarios.performance import PERFORMANCE_COLUMNS

NOT_RECORDED = {"deaths_per_s", "malfunctions_per_s", "births_per_s", "repairs_per_s"}
"""Rates are part of a run's specification, not measured; who scores a study adds them."""


def recorded_units() -> dict[str, str]:
    """Unit by column of a record, contributed ones included."""
    header, *rows = schema_table().splitlines()
    start, end = header.index("unit"), header.index("meaning")
    return {row.split()[0]: row[start:end].rstrip() for row in rows}


def test_every_column_that_measures_read_is_recorded():
    assert set(CURVE_COLUMNS) - recorded_units().keys() == NOT_RECORDED


def test_units_of_performances_agree():
    units = recorded_units()
    assert {name: each.unit for name, each in PERFORMANCE_COLUMNS.items()} == {
        name: units[name] for name in PERFORMANCE_COLUMNS
    }


def test_units_agree():
    units = recorded_units()
    for name, column in CURVE_COLUMNS.items():
        if name not in NOT_RECORDED:
            assert units[name] == (column.unit or "-"), name
