"""Tables of curves made by hand, for the tests of scoring."""

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl

from metrics.scoring.curves_file import study_curves
from metrics.scoring.frame import scores


def rows(
    n_robots: int, runs: Sequence[Sequence[float]], *, first_seed: int = 0, **columns: Any
) -> list[dict[str, Any]]:
    """One row per interval of runs with these performances; other columns are constant or given per interval."""
    return [
        {
            "n_robots": n_robots,
            "seed": seed,
            "interval": interval,
            "performance": value,
            **{name: given[interval] if isinstance(given, list) else given for name, given in columns.items()},
        }
        for seed, run in enumerate(runs, first_seed)
        for interval, value in enumerate(run)
    ]


def table(*parts: Sequence[Mapping[str, Any]]) -> pl.DataFrame:
    """All rows of all parts."""
    return pl.DataFrame([row for part in parts for row in part], infer_schema_length=None)


CROWDING = table(
    rows(1, [[1.0]], interference_fraction=0.1),
    rows(2, [[1.8]], interference_fraction=0.2),
    rows(4, [[3.2]], interference_fraction=0.3),
)
"""A swarm whose robots get in each other's way, one interval; its scores are computed by hand in the tests."""

IDEAL = [[4.0, 6.0, 5.0, 6.0], [5.0, 5.0, 7.0, 4.0], [6.0, 4.0, 5.0, 5.0]]
SLOWED = [[4.0, 5.0, 2.0, 3.0], [5.0, 5.0, 3.0, 2.0], [5.0, 4.0, 2.0, 3.0]]
CLOCK = [100.0, 200.0, 300.0, 400.0]
SIGNAL = [0.1, 0.1, 0.6, 0.6]


def scored(*parts: Sequence[Mapping[str, Any]], measures: Sequence[str] | None = None, **how: Any) -> pl.DataFrame:
    """Scores of the studies in these rows."""
    return scores(study_curves(table(*parts)), measures, **how)[0]


def missing(*parts: Sequence[Mapping[str, Any]], measures: Sequence[str], **how: Any) -> str:
    """Why the one measure of the one study in these rows is not computed."""
    ((_, reason),) = scores(study_curves(table(*parts)), measures, **how)[1].items()
    return reason


def throttled(ideal=IDEAL, slowed=SLOWED):
    """Rows of a reference run and of one throttled level."""
    common = {"criterion": "throttle", "t_end_s": CLOCK}
    return (
        rows(9, ideal, criterion_value=0.0, adversity=0.1, **common),
        rows(9, slowed, criterion_value=0.3, adversity=SIGNAL, **common),
    )
