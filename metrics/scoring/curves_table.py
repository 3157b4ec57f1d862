"""Tables of runs, one row per recording interval, as arrays (runs, intervals).

The one file of this package that knows column names. Run records of `swarm_forage_env` and curves from anywhere else
arrive in the same table; which columns it may have is `CURVE_COLUMNS`. Whatever is wrong with a table raises a
`CurveError` that names the file, the row or the run, and what was expected.
"""

import difflib
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from metrics.curves import FRACTION_TOLERANCE, CurveError, FloatArray
from metrics.queues import PopulationRates

if TYPE_CHECKING:
    import polars as pl

Kind: TypeAlias = Literal["text", "whole", "number", "amount", "fraction"]
"""Of a column: text, whole numbers >= 0, numbers, numbers >= 0, numbers in [0, 1]."""

SIZE, THROTTLE, NOISE, POPULATION, UNDISTURBED = "population_size", "throttle", "noise", "population_dynamics", "none"
CRITERIA = (SIZE, THROTTLE, NOISE, POPULATION, UNDISTURBED)
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
    "performance": Column("amount", "objects", "P(N, t), larger is better", is_required=True),
    "t_end_s": Column("amount", "s", "end of the interval"),
    "interference_fraction": Column("fraction", "1", "t_lost(N, t), share of active robots avoiding others or walls"),
    "n_active": Column("amount", "robots", "mean number of robots at work"),
    "adversity": Column("number", "1", "conditions V(t), mean over the interval; those of the reference run are I_ec"),
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

_RATES = {
    "lambda_d": "deaths_per_s",
    "lambda_bd": "malfunctions_per_s",
    "mu_b": "births_per_s",
    "mu_bd": "repairs_per_s",
}
_CURVES = tuple(
    name
    for name, column in CURVE_COLUMNS.items()
    if column.kind in ("amount", "fraction", "number") and name != "criterion_value" and name not in _RATES.values()
)
"""Columns with one value per interval."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RunCurves:
    """The runs of one experiment: one criterion at one value with one swarm size."""

    criterion: str
    """One of `CRITERIA`."""
    value: float
    n_robots: int
    seeds: tuple[int, ...]
    """Number of each run, rising, (R,)."""
    curves: dict[str, FloatArray]
    """Column -> values, (R, T); columns that the table does not have are not in it."""
    rates: PopulationRates | None = None
    """Rates of change of the population, per second."""
    n_planned: int | None = None
    """How many runs there should be; None = those there are."""

    @property
    def performance(self) -> FloatArray:
        """P(N, t), (R, T)."""
        return self.curves["performance"]

    @property
    def interference(self) -> FloatArray:
        """t_lost(N, t), (R, T)."""
        return self.curves["interference_fraction"]

    @property
    def n_lost(self) -> int:
        """Runs that were planned and are not there."""
        return 0 if self.n_planned is None else self.n_planned - len(self.seeds)

    def describe(self) -> str:
        """Return the experiment in a few words."""
        size = f"N = {self.n_robots}"
        return size if self.criterion == SIZE else f"{self.criterion} {self.value:g}, {size}"

    def averaged(self, performance: FloatArray) -> "RunCurves":
        """Return the experiment with another performance, (..., T), and the mean over runs of all other curves."""
        means: dict[str, FloatArray] = {name: curve.mean(axis=0) for name, curve in self.curves.items()}
        return replace(self, curves=means | {"performance": performance})

    def at_seeds(self, seeds: Sequence[int]) -> "RunCurves":
        """Return the same experiment with some of its runs only."""
        rows = [self.seeds.index(seed) for seed in seeds]
        return replace(self, seeds=tuple(seeds), curves={name: curve[rows] for name, curve in self.curves.items()})


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyCurves:
    """All experiments of one policy, on one clock."""

    controller: str
    experiments: tuple[RunCurves, ...]
    t_end_s: FloatArray | None
    """Ends of the intervals, (T,); None where the table does not tell."""
    where: str = "the table"
    """Name of the table in error messages."""

    @property
    def horizon_s(self) -> float | None:
        """Length of a run in seconds, where known."""
        return None if self.t_end_s is None else float(self.t_end_s[-1])

    def sizes(self) -> tuple[RunCurves, ...]:
        """Return the experiments that vary the swarm size, smallest first."""
        return tuple(sorted((e for e in self.experiments if e.criterion == SIZE), key=lambda e: e.n_robots))

    def levels(self, criterion: str) -> tuple[tuple[RunCurves, RunCurves], ...]:
        """Return (reference, disturbed) for each level of a criterion, by swarm size and value.

        Raises:
            CurveError: levels without a reference run of the same swarm size.
        """
        mine = [e for e in self.experiments if e.criterion == criterion and e.value != 0.0]
        return tuple(
            (self._reference(level), level) for level in sorted(mine, key=lambda level: (level.n_robots, level.value))
        )

    def _reference(self, level: RunCurves) -> RunCurves:
        same_size = [e for e in self.experiments if e.n_robots == level.n_robots]
        own = [e for e in same_size if e.criterion == level.criterion and e.value == 0.0]
        shared = [e for e in same_size if e.criterion == UNDISTURBED]
        for reference in (*own, *shared):
            return reference
        raise CurveError(
            f"Expected a reference run for {level.describe()} of {self.controller} in {self.where}: the same swarm "
            f"size with criterion {level.criterion} and value 0, or with criterion {UNDISTURBED}; got neither."
        )


def common_runs(*experiments: RunCurves) -> tuple[RunCurves, ...]:
    """Return the experiments with only those runs whose number all of them have, paired by it."""
    shared = _shared_seeds(experiments)
    return tuple(experiment.at_seeds(shared) for experiment in experiments)


def _shared_seeds(experiments: Sequence[RunCurves]) -> list[int]:
    first, *others = (experiment.seeds for experiment in experiments)
    return [seed for seed in first if all(seed in seeds for seeds in others)]


def read_curves(path: str | Path) -> tuple[StudyCurves, ...]:
    """Read curves from a CSV or Parquet file with the columns of `CURVE_COLUMNS`; one study per policy in it.

    Raises:
        CurveError: whatever is wrong with the file, in one line: as `study_curves`, a file that cannot be read, no
            reference run for what is varied, no runs that can be paired.
    """
    file = Path(path)
    studies = study_curves(_read_frame(file), where=str(file), controller=file.stem)
    for study in studies:
        _check_comparable(study)
    return studies


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


def _check_comparable(study: StudyCurves) -> None:
    """Check that there is a reference for everything that is varied, and that runs can be paired."""
    for criterion in (THROTTLE, NOISE, POPULATION):
        study.levels(criterion)
    if not _shared_seeds(study.experiments):
        raise CurveError(
            f"Expected runs with numbers in common over all experiments of {study.controller} in {study.where}, "
            "got none; number the runs of each experiment alike (column seed)."
        )


def _read_frame(file: Path) -> "pl.DataFrame":
    import polars as pl

    readers = {".csv": pl.read_csv, ".parquet": pl.read_parquet}
    reader = readers.get(file.suffix.lower())
    if reader is None:
        raise CurveError(f"Expected curves as a .csv or .parquet file, got {file}.")
    try:
        content = file.read_bytes()
    except OSError as error:
        raise CurveError(f"Cannot read {file}: {error.strerror or error}.") from error
    if not content.strip():
        raise CurveError(f"Expected curves in {file}, but the file is empty.")
    try:
        return reader(content)
    except (pl.exceptions.PolarsError, pl.exceptions.PanicException, UnicodeDecodeError) as error:
        reason = str(error).splitlines()[0]
        raise CurveError(f"Cannot read {file} as {file.suffix.lower()[1:].upper()}: {reason}.") from error


def _checked_frame(frame: "pl.DataFrame", where: str, controller: str) -> "pl.DataFrame":
    """Return the known columns, of the right types, with the optional keys filled in."""
    import polars as pl

    missing = [name for name, column in CURVE_COLUMNS.items() if column.is_required and name not in frame.columns]
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
    if column.kind == "text":
        values = given.cast(pl.String)
        _refuse(values, values.is_null(), name, where, "a text")
        return values
    values = given.cast(pl.Float64, strict=False)
    unread = values.is_null() & (pl.repeat(True, len(given), eager=True) if column.is_required else given.is_not_null())
    _refuse(given, unread | values.is_nan().fill_null(False), name, where, "a number")
    _refuse(given, values.is_infinite().fill_null(False), name, where, "a finite number")
    if column.kind == "whole":
        _refuse(given, (values != values.floor()) | (values < 0), name, where, "a whole number >= 0")
        return values.cast(pl.Int64)
    if column.kind in ("amount", "fraction"):
        _refuse(given, (values < 0).fill_null(False), name, where, "no negative number")
    if column.kind == "fraction":
        _refuse(given, (values > 1 + FRACTION_TOLERANCE).fill_null(False), name, where, "a fraction in [0, 1]")
    return values


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
    return StudyCurves(controller=controller, experiments=experiments, t_end_s=_clock(experiments, whose), where=where)


def _runs(frame: "pl.DataFrame", whose: str) -> RunCurves:
    """Return the runs of one experiment as arrays."""
    frame = frame.sort("seed", "interval")
    first = frame.row(0, named=True)
    criterion, value, n_robots = first["criterion"], float(first["criterion_value"]), int(first["n_robots"])
    if n_robots < 1:
        raise CurveError(f"Expected n_robots >= 1 in {whose}, got {n_robots}.")
    if criterion == SIZE and value not in (0.0, float(n_robots)):
        raise CurveError(
            f"Expected criterion_value = n_robots for criterion {SIZE} of {whose}, got {value:g} and {n_robots}."
        )
    bare = RunCurves(criterion=criterion, value=value, n_robots=n_robots, seeds=(), curves={})
    seeds, counts = np.unique(frame["seed"].to_numpy(), return_counts=True)
    _check_intervals(frame["interval"].to_numpy(), seeds.tolist(), counts.tolist(), f"{bare.describe()} of {whose}")
    shape = (len(seeds), int(counts[0]))
    curves: dict[str, FloatArray] = {}
    for name in _present(frame, _CURVES, f"{bare.describe()} of {whose}"):
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
    for rate, name in _RATES.items():
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
