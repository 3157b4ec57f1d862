"""Checks of the rows in a packed study, which may come from a stranger: their types, and whether they fit the study."""

from functools import cache
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.fields import check_file_name
from swarm_forage_env.runs.parquet import ParquetError, check_columns, check_texts
from swarm_forage_env.runs.record import COLUMN_DTYPES, RunRecord
from swarm_forage_env.runs.store import DONE, STATES

if TYPE_CHECKING:
    import polars as pl

    from swarm_forage_env.studies.study import StudySpec

AXIS = "axis_"
"""Prefix of the columns of axes, because axes may have the names of columns of records: throttle, handling_cost."""
LOSS_COLUMNS = ("state", "error", "traceback", "rerun")
"""Last columns: one of `study_folder.STATES`; for failed runs the exception in one line, its traceback, and the command
that makes the run again from within the folder of the study."""
MOST_BYTES = 2**31
"""Largest packed study, in the file, unpacked and in memory; our choice: fifty times our largest one."""
_NEEDED = ("cell", "run_id", "seed", "interval", "state")
_TEXTS = ("study", "reading", "policy", "run_id", "scenario", "criterion", *LOSS_COLUMNS)


def check_types(frame: "pl.DataFrame") -> None:
    """Refuse a table that lacks columns of a packed study, or has them with other types; see `check_columns`.

    Raises:
        ParquetError: a column is missing or has another type.
    """
    axes = {name: (*_types()["text"], *_types()["number"], *_types()["truth"])
            for name in frame.columns if name.startswith(AXIS)}  # fmt: skip
    check_columns(frame, _kinds() | axes, _types()["number"], needed=_NEEDED)
    check_texts(frame, MOST_BYTES)


def check_rows(frame: "pl.DataFrame", spec: "StudySpec") -> None:
    """Refuse rows that do not fit a study: each run of each condition once, in order, whole or lost.

    Raises:
        ParquetError: rows are missing, repeated or in another order.
        ConfigError: a run has a name that cannot be the name of a file.
    """
    import polars as pl

    for name in ("cell", "run_id", "seed", "state"):
        if frame[name].null_count():
            raise ParquetError(f"its column {name} has empty places")
    cells, is_done = frame["cell"], frame["state"] == DONE
    if not cells.is_sorted() or len(frame) == 0 or cells[0] != 0 or cells[-1] != len(spec.places) - 1:
        raise ParquetError(f"expected its rows in the order of the {len(spec.places)} conditions of its study")
    unknown = set(frame["state"].unique()) - set(STATES)
    if unknown:
        raise ParquetError(f"expected runs that are {', '.join(STATES)}, got {min(unknown)!r}")
    if frame["interval"].is_null().to_list() != (~is_done).to_list():
        raise ParquetError("expected intervals of finished runs alone")
    firsts = frame.filter(frame["interval"].fill_null(0) == 0)
    seeds = firsts.group_by("cell", maintain_order=True).agg(pl.col("seed").sort())["seed"]
    wanted = sorted(spec.seeds)
    if len(seeds) != len(spec.places) or any(found.to_list() != wanted for found in seeds):
        raise ParquetError(f"expected the {len(wanted)} seeds of its study once in each condition")
    _check_intervals(frame.filter(is_done), len(firsts.filter(firsts["state"] == DONE)))
    for run_id in frame["run_id"].unique():
        check_file_name("a run_id", run_id)


def _check_intervals(done: "pl.DataFrame", n_runs: int) -> None:
    """Refuse runs whose rows do not lie together, runs of several lengths in a condition, and times of 0 or less."""
    import polars as pl

    runs = done.group_by("cell", "seed", maintain_order=True).agg(
        pl.len().alias("length"), pl.col("run_id").n_unique(), pl.col("interval") == pl.int_range(pl.len())
    )
    is_whole = len(runs) == n_runs == done.select("cell", "seed", "run_id").to_struct("run").rle_id().n_unique()
    if not is_whole or not (runs["run_id"] == 1).all() or not runs["interval"].list.all().all():
        raise ParquetError("expected the intervals 0, 1, 2, ... of each run one after the other")
    if not runs.group_by("cell").agg(pl.col("length").n_unique() == 1)["length"].all():
        raise ParquetError("expected runs of one length in each condition")
    if "t_end_s" in done.columns and not (done["t_end_s"] > 0.0).all():
        raise ParquetError("expected a t_end_s above 0 in finished runs")


@cache
def _types() -> dict[str, tuple[Any, ...]]:
    """The types of polars by what they hold; `Null` for columns without values."""
    import polars as pl

    whole = (pl.Int64, pl.Int32, pl.UInt32)
    return {
        "text": (pl.String, pl.Null),
        "whole": whole,
        "number": (pl.Float64, *whole, pl.Null),
        "truth": (pl.Boolean,),
    }


@cache
def _kinds() -> dict[str, tuple[Any, ...]]:
    """Column -> the types that it may have."""
    of = _types()
    whole = {name: of["whole"] for name in (*RunRecord.column_names(), "cell") if name not in _TEXTS}
    numbers = {name: of["number"] for name in (*COLUMN_DTYPES, "criterion_value") if name != "interval"}
    return whole | numbers | {"interval": (*of["whole"], *of["text"][1:])} | dict.fromkeys(_TEXTS, of["text"])
