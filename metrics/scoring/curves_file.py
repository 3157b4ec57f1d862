"""Curves from a CSV or Parquet file as arrays, with every check that a table of curves needs.

Whatever is wrong with a table raises a `CurveError` that names the file, the row or the run, and what was expected.
"""

import difflib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from swarm_forage_env.runs.parquet import ParquetError, read_parquet
from swarm_forage_env.scenarios.performance import INVERTED, Performance
from swarm_forage_env.wrappers.world import SIZE

from ..checks import CurveError
from ..curves import FRACTION_TOLERANCE, FloatArray
from ..queues import PopulationRates
from .run_curves import (
    CRITERIA,
    CURVE_COLUMNS,
    DELIVERIES,
    HANDLING,
    INTERVAL_COLUMNS,
    NOISE,
    POPULATION,
    RATE_COLUMNS,
    REQUIRED_COLUMNS,
    THROTTLE,
    PerformanceLike,
    RunCurves,
    StudyCurves,
    checked_performance,
    own_curve,
    own_performance,
    shared_seeds,
)

if TYPE_CHECKING:
    import polars as pl


RUN_KEYS = ("controller", "criterion", "criterion_value", "n_robots", "seed")
"""Columns that tell the runs of a table apart, where it has them."""
_ROW = "row of the table"
"""Column for the order of rows; no table of curves has one of this name."""
MOST = 1e15
"""Largest number in a table; our choice: sums of squares of such numbers are finite, and whole ones are exact."""
MOST_ROBOTS = 10_000_000
"""Largest swarm in a table; our choice: some measures need an array of this length."""
_STEERING = "[\\p{Cc}\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069]"
"""Characters that steer a terminal or the direction of writing, which a name must not."""


def read_curves(path: str | Path, performance: PerformanceLike | None = None) -> tuple[StudyCurves, ...]:
    """Read curves from a CSV or Parquet file with the columns of `CURVE_COLUMNS`; one study per policy in it.

    Args:
        path: The file.
        performance: What is read as performance; default the column of that name. See `with_performance`.

    Raises:
        CurveError: whatever is wrong with the file, in one line: as `study_curves`, a file that cannot be read, no
            reference run for what is varied, no runs that can be paired.
    """
    file = Path(path)
    frame = _read_frame(file)
    read_as = DELIVERIES
    if performance is not None:
        frame, read_as = with_performance(frame, performance, str(file))
    studies = study_curves(frame, where=str(file), controller=file.stem)
    for study in studies:
        _check_comparable(study)
    return tuple(replace(study, read_as=read_as) for study in studies)


def _check_comparable(study: StudyCurves) -> None:
    """Check that there is a reference for everything that is varied, and that runs can be paired."""
    for criterion in (THROTTLE, HANDLING, NOISE, POPULATION):
        study.levels(criterion)
    if not shared_seeds(study.experiments):
        raise CurveError(
            f"Expected runs with numbers in common over all experiments of {study.controller} in {study.where}, "
            "got none; number the runs of each experiment alike (column seed)."
        )


def _read_frame(file: Path) -> "pl.DataFrame":
    import polars as pl

    reader = {".csv": pl.read_csv, ".parquet": _read_parquet}.get(file.suffix.lower())
    if reader is None:
        raise CurveError(f"Expected curves as a .csv or .parquet file, got {file}.")
    try:
        if not file.read_bytes().strip():
            raise CurveError(f"Expected curves in {file}, but the file is empty.")
        return reader(file)
    except OSError as error:
        raise CurveError(f"Cannot read {file}: {error.strerror or error}.") from error
    except (ParquetError, pl.exceptions.PolarsError, pl.exceptions.PanicException, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0]
        raise CurveError(f"Cannot read {file} as {file.suffix.lower()[1:].upper()}: {reason}.") from error


def _read_parquet(file: Path) -> "pl.DataFrame":
    return read_parquet(file)[1]


def with_performance(frame: "pl.DataFrame", given: PerformanceLike, where: str) -> tuple["pl.DataFrame", Performance]:
    """Replace the column `performance` of a table of curves.

    Args:
        frame: One row per interval and run.
        given: A column of the table, "1/" and a column, or a function of the rows of one run in the order of intervals.
        where: Name of the table in error messages.

    Returns:
        The table with its rows in the same order, and what its performance is now.

    Raises:
        CurveError: there is no such column, or no such numbers.
    """
    import polars as pl

    own = own_performance(given)
    if own is None:
        assert isinstance(given, str), "own_performance returns None for names only"
        curve, read_as = _column(frame, given, where)
        return frame.with_columns(pl.Series("performance", curve)), read_as
    keys = [name for name in RUN_KEYS if name in frame.columns]
    ordered = frame.with_row_index(_ROW).sort("interval") if "interval" in frame.columns else frame.with_row_index(_ROW)
    parts = ordered.partition_by(keys, maintain_order=True) if keys else [ordered]
    runs = [
        part.with_columns(pl.Series("performance", own_curve(own, part.drop(_ROW), _run(part, keys, where))))
        for part in parts
    ]
    return pl.concat(runs).sort(_ROW).drop(_ROW), own


def _run(part: "pl.DataFrame", keys: list[str], where: str) -> str:
    """Return the name of a run for error messages."""
    first = part.row(0, named=True)
    return f"{', '.join(f'{key} {first[key]}' for key in keys)} in {where}"


def _column(frame: "pl.DataFrame", name: str, where: str) -> tuple[FloatArray, Performance]:
    import polars as pl

    own = name.removeprefix(INVERTED)
    if own not in frame.columns:
        close = difflib.get_close_matches(own, frame.columns, n=1)
        hint = f" Did you mean {close[0]!r}?" if close else ""
        raise CurveError(f"Expected a column {own} for performance in {where}, got {', '.join(frame.columns)}.{hint}")
    given = frame[own].cast(pl.Float64, strict=False)
    curve = given.fill_null(np.nan).to_numpy()
    if own != name:
        curve = np.divide(1.0, curve, out=np.zeros_like(curve), where=curve != 0.0)
    curve = checked_performance(curve, name, len(frame), where)
    known = CURVE_COLUMNS.get(name)
    # Of a column of one's own nobody knows whether it is a total, or adds up; a share and an inverse do not.
    adds_up = own == name and (known is None or known.kind == "amount")
    return curve, Performance(name, (known and known.unit) or "1", is_total=False, adds_up=adds_up)


def study_curves(frame: "pl.DataFrame", *, where: str = "the table", controller: str = "") -> tuple[StudyCurves, ...]:
    """Turn a table of curves into arrays, one study per policy in it.

    Args:
        frame: Columns as in `CURVE_COLUMNS`, rows in any order within a run.
        where: Name of the table in error messages.
        controller: Name of the policy where the table has no such column.

    Raises:
        CurveError: columns are missing or hold what they may not, runs are incomplete or of unequal length, or sizes
            are in the wrong order.
    """
    frame = _checked_frame(frame, where, controller)
    return tuple(
        _study(part, where, str(key[0]))
        for key, part in frame.partition_by("controller", as_dict=True, maintain_order=True).items()
    )


def _checked_frame(frame: "pl.DataFrame", where: str, controller: str) -> "pl.DataFrame":
    """Return the known columns, of the right types, with the optional keys filled in."""
    import polars as pl

    missing = [name for name in REQUIRED_COLUMNS if name not in frame.columns]
    if missing:
        close = difflib.get_close_matches(missing[0], frame.columns, n=1)
        hint = f" Is {close[0]!r} meant to be {missing[0]!r}?" if close else ""
        raise CurveError(
            f"Expected the column{'s' if len(missing) > 1 else ''} {', '.join(missing)} in {where}, got "
            f"{', '.join(frame.columns)}.{hint}"
        )
    if frame.is_empty():
        raise CurveError(f"Expected curves in {where}, got column names without a row.")
    frame = frame.select(_checked_column(frame, name, where) for name in CURVE_COLUMNS if name in frame.columns)
    has_values = "criterion_value" in frame.columns
    defaults = {"controller": controller, "criterion": SIZE, "criterion_value": 0.0}
    frame = frame.with_columns(
        pl.lit(value).alias(name) for name, value in defaults.items() if name not in frame.columns
    )
    for name in frame["criterion"].unique().sort().to_list():
        if name not in CRITERIA:
            raise CurveError(f"Expected criterion in {where} to be one of {', '.join(CRITERIA)}, got {name!r}.")
    is_level = frame["criterion"] != SIZE
    if is_level.any() and not has_values:
        raise CurveError(f"Expected the column criterion_value beside criterion in {where}.")
    values = frame["criterion_value"]
    _refuse(values, values.is_null() & is_level, "criterion_value", where, "a number")
    return frame.with_columns(values.fill_null(0.0))


def _checked_column(frame: "pl.DataFrame", name: str, where: str) -> "pl.Series":
    import polars as pl

    column, given = CURVE_COLUMNS[name], frame[name]
    if not _is_plain(given.dtype):
        wanted = "texts" if column.kind == "text" else "numbers"
        raise CurveError(f"Expected {wanted} in column {name} of {where}, got values of type {given.dtype}.")
    if isinstance(given.dtype, pl.Categorical | pl.Enum):
        given = given.cast(pl.String)
    if column.kind == "text":
        values = given.cast(pl.String)
        _refuse(values, values.is_null(), name, where, "a text")
        _refuse(values, values.str.contains(_STEERING), name, where, "a text without control characters")
        return values
    values = given.cast(pl.Float64, strict=False)
    is_required = name in REQUIRED_COLUMNS
    unread = values.is_null() & (pl.repeat(True, len(given), eager=True) if is_required else given.is_not_null())
    _refuse(given, unread | values.is_nan().fill_null(False), name, where, "a number")
    _refuse(given, values.is_infinite().fill_null(False), name, where, "a finite number")
    _refuse(given, (values.abs() > MOST).fill_null(False), name, where, f"a number of at most {MOST:g} in size")
    if column.kind == "whole":
        _refuse(given, (values != values.floor()) | (values < 0), name, where, "a whole number >= 0")
        return values.cast(pl.Int64)
    if column.kind in ("amount", "fraction"):
        _refuse(given, (values < 0).fill_null(False), name, where, "no negative number")
    if column.kind == "fraction":
        _refuse(given, (values > 1 + FRACTION_TOLERANCE).fill_null(False), name, where, "a fraction in [0, 1]")
    return values


def _is_plain(kind: "pl.DataType") -> bool:
    """Whether a column holds one text or number per row, and no bytes, dates, lists or tables."""
    import polars as pl

    return kind.is_numeric() or isinstance(kind, pl.String | pl.Categorical | pl.Enum | pl.Boolean | pl.Null)


def _refuse(given: "pl.Series", is_bad: "pl.Series", name: str, where: str, wanted: str) -> None:
    rows = is_bad.arg_true()
    if len(rows):
        value = given[int(rows[0])]
        shown = "nothing" if value is None else repr(value)
        raise CurveError(
            f"Expected {wanted} in column {name} of {where}, got {shown} in row {int(rows[0]) + 1}"
            + (f" and {len(rows) - 1} more rows." if len(rows) > 1 else ".")
        )


def _study(frame: "pl.DataFrame", where: str, controller: str) -> StudyCurves:
    keys = ("criterion", "criterion_value", "n_robots")
    whose = f"{controller} in {where}"
    experiments = tuple(_runs(part, whose) for part in frame.partition_by(keys, maintain_order=True))
    lengths = {experiment.performance.shape[1]: experiment for experiment in experiments}
    if len(lengths) > 1:
        told = ", ".join(f"{length} at {experiment.describe()}" for length, experiment in lengths.items())
        raise CurveError(f"Expected runs of equally many intervals of {whose}, got {told}.")
    sizes = [experiment.n_robots for experiment in experiments if experiment.criterion == SIZE]
    if sizes != sorted(sizes):
        raise CurveError(
            f"Expected the swarm sizes of {whose} in rising order, got {', '.join(map(str, sizes))}; sort the table by "
            "n_robots, and look whether each size stands beside its own curve."
        )
    clock = _clock(experiments, whose)
    if clock is not None:
        experiments = tuple(replace(experiment, horizon_s=float(clock[-1])) for experiment in experiments)
    return StudyCurves(controller=controller, experiments=experiments, t_end_s=clock, where=where)


def _runs(frame: "pl.DataFrame", whose: str) -> RunCurves:
    """Return the runs of one experiment as arrays."""
    frame = frame.sort("seed", "interval")
    first = frame.row(0, named=True)
    criterion, value, n_robots = first["criterion"], float(first["criterion_value"]), int(first["n_robots"])
    if not 1 <= n_robots <= MOST_ROBOTS:
        raise CurveError(f"Expected n_robots from 1 to {MOST_ROBOTS:,} in {whose}, got {n_robots}.")
    if criterion == SIZE and value not in (0.0, float(n_robots)):
        raise CurveError(
            f"Expected criterion_value = n_robots for criterion {SIZE} of {whose}, got {value:g} and {n_robots}."
        )
    bare = RunCurves(criterion=criterion, value=value, n_robots=n_robots, seeds=(), curves={})
    seeds, counts = np.unique(frame["seed"].to_numpy(), return_counts=True)
    _check_intervals(frame["interval"].to_numpy(), seeds.tolist(), counts.tolist(), f"{bare.describe()} of {whose}")
    shape = (len(seeds), int(counts[0]))
    curves: dict[str, FloatArray] = {}
    for name in _present(frame, INTERVAL_COLUMNS, f"{bare.describe()} of {whose}"):
        curves[name] = frame[name].to_numpy().astype(np.float64).reshape(shape)
    return replace(
        bare, seeds=tuple(int(seed) for seed in seeds), curves=curves, rates=_rates(frame, bare.describe(), whose)
    )


def _check_intervals(interval: np.ndarray, seeds: list[int], counts: list[int], whose: str) -> None:
    """Check that each run has the intervals 0, 1, ..., T - 1, each once, with one T for all."""
    start = 0
    for seed, count in zip(seeds, counts, strict=True):
        own = interval[start : start + count]
        if not np.array_equal(own, np.arange(count)):
            raise CurveError(
                f"Expected the intervals 0, 1, 2, ... once each for seed {seed}, {whose}, got "
                f"{', '.join(map(str, own[:12]))}{', ...' if count > 12 else ''}."
            )
        start += count
    if len(set(counts)) > 1:
        told = ", ".join(f"{count} for seed {seed}" for seed, count in zip(seeds, counts, strict=True))
        raise CurveError(f"Expected curves of equal length, {whose}, got {told}.")


def _present(frame: "pl.DataFrame", names: Iterable[str], whose: str) -> Iterator[str]:
    """Names of the columns that hold values here; a column with some values only is refused."""
    for name in names:
        if name not in frame.columns or frame[name].null_count() == len(frame):
            continue
        if frame[name].null_count():
            raise CurveError(f"Expected column {name} in every interval or in none, {whose}, got gaps.")
        yield name


def _rates(frame: "pl.DataFrame", experiment: str, whose: str) -> PopulationRates | None:
    rates: dict[str, float] = {}
    for rate, name in RATE_COLUMNS.items():
        for present in _present(frame, (name,), f"{experiment} of {whose}"):
            values = frame[present].unique().to_list()
            if len(values) > 1:
                raise CurveError(f"Expected one {name} for {experiment} of {whose}, got {sorted(values)}.")
            rates[rate] = float(values[0])
    return PopulationRates(**rates) if rates else None


def _clock(experiments: Sequence[RunCurves], whose: str) -> FloatArray | None:
    clocks = [experiment.curves["t_end_s"] for experiment in experiments if "t_end_s" in experiment.curves]
    if not clocks:
        return None
    clock = clocks[0][0]
    if any((times != clock).any() for times in clocks) or (np.diff(clock, prepend=0.0) <= 0.0).any():
        raise CurveError(f"Expected the same rising t_end_s in all runs of {whose}.")
    return clock
