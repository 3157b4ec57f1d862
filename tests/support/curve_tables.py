"""Tables of curves made by hand, for the tests of scoring."""

from collections.abc import Mapping, Sequence
from typing import Any

import polars as pl


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
