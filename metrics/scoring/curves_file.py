"""Curves of other simulators and of real robots: a table of theirs as the arrays that measures take.

    read_curves("theirs.csv", columns={"n_robots": "swarm", "performance": "items"})
    read_curves("log.csv", events=True, interval_s=100.0)          # a row per delivery, with its time

Whatever is wrong with a table is one line: its place in the file, what was expected, and what is there.
"""

import csv
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, cast

import numpy as np
import polars as pl

from swarm_forage_env._internal.fields import checked
from swarm_forage_env._internal.wording import counted, shown, suggestion
from swarm_forage_env.scenarios.columns import Column
from swarm_forage_env.scenarios.performance import INVERTED, PERFORMANCE_COLUMNS, Performance
from swarm_forage_env.wrappers.world import SIZE, UNDISTURBED

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
    THROTTLE,
    RunCurves,
    StudyCurves,
    shared_seeds,
)

TIME, END = "time_s", "t_end_s"
"""Columns: when a delivery was, and where an interval ends."""
EVENT_COLUMNS: Mapping[str, Column] = {
    **{name: column for name, column in CURVE_COLUMNS.items() if name not in (*INTERVAL_COLUMNS, "interval")},
    TIME: Column("amount", "s", "when the delivery was, from the start of the run"),
    "performance": Column("amount", "", "how much was delivered; default 1"),
}
"""Columns of event logs -> what they hold. Further columns are ignored."""
MOST = 1e15
"""Largest number in a table; our choice: sums of squares of such numbers are finite, and whole ones are exact."""
MOST_ROBOTS = 10_000_000
"""Largest swarm in a table; our choice: some measures need an array of this length."""
_KINDS: Mapping[str, tuple[str, Callable[[pl.Series], pl.Series]]] = {
    "whole": ("a whole number >= 0", lambda values: (values >= 0) & (values == values.floor())),
    "amount": ("a number >= 0", lambda values: values >= 0),
    "fraction": ("a fraction in [0, 1]", lambda values: (values >= 0) & (values <= 1 + FRACTION_TOLERANCE)),
    "number": ("a number", lambda values: values.is_finite()),
}
"""Kind of a column -> what its values are, and which are that."""
_IN_EACH_ROW = ("n_robots", "seed", "interval", "t_end_s", "performance", TIME)
_EXPERIMENT = ("controller", "criterion", "criterion_value", "n_robots")
_RUN = (*_EXPERIMENT, "seed")
MOST_INTERVALS = 1_000_000
"""Most intervals of a run of deliveries; our choice: some measures need a table of so many by so many."""
_NEAR = 1e-9
"""Relative difference of times that are the same."""
_LINE = "line of the file"
"""Column for places in messages; no table of curves has one of this name."""


def read_curves(source: str | Path | pl.DataFrame, **how: Any) -> tuple[StudyCurves, ...]:
    """Read curves; one study per policy in them.

    Args:
        source: A Parquet file; or a text with a line of column names, and with commas, semicolons or tabs between
            values. Beside semicolons and tabs, commas in numbers are decimal. Or a table of such columns, such as
            `Record.frame`.
        how: Further arguments of `study_curves`.

    Raises:
        CurveError: as `study_curves`; or the file cannot be read, there is no reference run for what is varied, or no
            runs can be paired.
    """
    if isinstance(source, pl.DataFrame):
        frame, about = source, {"where": "the table", "controller": "curves"}
    else:
        file = Path(checked("path", source, str | Path))
        about = {"where": str(file), "controller": file.stem}
        try:
            frame = pl.read_parquet(file) if file.suffix.lower() == ".parquet" else _read_text(file)
        except OSError as error:
            raise CurveError(f"Cannot read {file}: {error.strerror or error}.") from error
        except (pl.exceptions.PolarsError, pl.exceptions.PanicException) as error:
            raise CurveError(f"Cannot read {file} as Parquet: {str(error).splitlines()[0]}.") from error
    studies = study_curves(frame, **about, **how)
    for study in studies:
        for criterion in (THROTTLE, HANDLING, NOISE, POPULATION):
            study.levels(criterion)  # each has a reference
        if not shared_seeds(study.experiments):
            raise CurveError(
                f"Expected runs with numbers in common over all experiments of {study.controller} in {study.where}, "
                "got none; number the runs of each experiment alike (column seed)."
            )
    return studies


def _read_text(file: Path) -> pl.DataFrame:
    """Return the values of a text as texts, with decimal points, and the line of each row."""
    try:
        text = file.read_bytes().decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise CurveError(f"Expected {file} to be text in UTF-8, got other bytes from byte {error.start} on.") from error
    lines = text.splitlines(keepends=True)
    separator = max(",;\t", key=next(filter(str.strip, lines), "").count)
    reader = csv.reader(lines, delimiter=separator)
    rows: list[list[str]] = []
    try:
        rows = [[str(reader.line_num), *map(str.strip, cells)] for cells in reader if any(map(str.strip, cells))]
    except csv.Error as error:
        raise CurveError(f"Cannot read line {reader.line_num} of {file}: {error}.") from error
    if not rows:
        raise CurveError(f"Expected curves in {file}, but the file is empty.")
    (first, *names), *values = rows
    for name in names:
        if names.count(name) > 1:
            raise CurveError(f"Expected a name per column in line {first} of {file}, got {name!r} more than once.")
    for line, *cells in values:
        if len(cells) != len(names):
            between = {",": "commas", ";": "semicolons", "\t": "tabs"}[separator]
            raise CurveError(f"Expected {len(names)} values with {between} in line {line} of {file}, got {len(cells)}.")
    frame = pl.DataFrame(values, schema=dict.fromkeys([_LINE, *names], pl.String), orient="row")
    if separator == ",":
        return frame
    return frame.with_columns(pl.all().str.replace(r"^([+-]?\d*),(\d+(?:[eE][+-]?\d+)?)$", "$1.$2"))


def study_curves(
    frame: pl.DataFrame,
    *,
    columns: Mapping[str, str] | None = None,
    events: bool = False,
    interval_s: float | None = None,
    where: str = "the table",
    controller: str = "curves",
) -> tuple[StudyCurves, ...]:
    """Turn a table of curves into arrays on one clock, one study per policy in it.

    Args:
        frame: Rows in any order, one per interval of a run with columns as in `CURVE_COLUMNS`, or one per delivery with
            those of `EVENT_COLUMNS`. Runs are cut to the shortest; `StudyCurves.note` says so.
        columns: Our name of a column -> its name in the table, or a number, which then stands in each row. That of
            performance may be "1/" and a column in which less is better.
        events: Whether a row is a delivery.
        interval_s: Length of an interval, s. Needed for events; of curves without `END`, where it is known.
        where: Name of the table in messages.
        controller: Name of the policy where the table has no such column.

    Raises:
        CurveError: columns are missing or hold what they may not, runs are incomplete, or intervals differ.
    """
    if interval_s is None and events:
        raise CurveError(f"Expected the length of an interval for the deliveries in {where}, got none (--interval S).")
    if interval_s is not None and not 0.0 < interval_s <= MOST:
        raise CurveError(f"Expected an interval of more than 0 s, got {interval_s:g} s.")
    names = dict(columns or {})
    performance = names.get("performance", "performance")
    names |= {"performance": performance.removeprefix(INVERTED)} if "performance" in names else {}
    known = EVENT_COLUMNS if events else CURVE_COLUMNS
    given = _Given.named(frame, names, known, where)
    clock = TIME if events else END if END in given.frame.columns else "interval"
    given.require("n_robots", "seed", clock, *([] if events else ["performance"]))
    table, note = _with_experiments(given.typed(known), given, controller), ""
    if performance.startswith(INVERTED):  # 1/0 is 0: distances need finite curves
        inverse = pl.when(pl.col("performance") != 0.0).then(1.0 / pl.col("performance")).otherwise(0.0)
        table = table.with_columns(performance=inverse)
    if events:
        table, note = _counted(table, interval_s or MOST, where)
    runs = table.sort(END if events else clock).partition_by(*_RUN, as_dict=True, maintain_order=True)
    lengths = [len(run) for run in runs.values()]
    least, most = min(lengths), max(lengths)
    if least < most:
        note = f"runs have from {least} to {most} intervals and are cut to the first {least}"
    steps = [] if interval_s is None else [interval_s * np.arange(1.0, least + 1.0)]
    told = [run[END].to_numpy()[:least] for run in runs.values()] if END in table.columns else []
    ends = _same([*told, *steps], where)
    of_policy: dict[Any, list[RunCurves]] = {}
    for key, part in table.partition_by(*_EXPERIMENT, as_dict=True, maintain_order=True).items():
        mine = {run_key[-1]: run for run_key, run in runs.items() if run_key[:-1] == key}
        of_policy.setdefault(key[0], []).append(_experiment(key, part, mine, ends, least, given))
    about: dict[str, Any] = {"t_end_s": ends, "read_as": _performance(performance), "where": where, "note": note}
    return tuple(StudyCurves(controller=name, experiments=tuple(of), **about) for name, of in of_policy.items())


def _counted(table: pl.DataFrame, interval_s: float, where: str) -> tuple[pl.DataFrame, str]:
    """Add up the deliveries in each interval of each run; returns a row for each, and what was done.

    All runs last as long as the latest delivery tells.
    """
    latest = cast("float", table[TIME].max())
    n_intervals = max(1, math.ceil(latest / interval_s * (1.0 - _NEAR)))
    if n_intervals > MOST_INTERVALS:
        raise CurveError(
            f"Expected times from the start of each run in {where}, got {latest:g} s, which would be {n_intervals:,} "
            f"intervals of {interval_s:g} s."
        )
    place = (pl.col(TIME) / interval_s).floor().clip(upper_bound=n_intervals - 1).cast(pl.Int64)
    amount = pl.col("performance").sum() if "performance" in table.columns else pl.len().cast(pl.Float64)
    delivered = table.group_by(*_RUN, interval=place).agg(performance=amount)
    every = table.unique(_RUN, keep="first", maintain_order=True).drop(TIME, "performance", strict=False)
    every = every.join(pl.DataFrame({"interval": range(n_intervals)}), how="cross")
    counts = every.join(delivered, on=[*_RUN, "interval"], how="left", maintain_order="left").with_columns(
        pl.col("performance").fill_null(0.0), (interval_s * (pl.col("interval") + 1)).alias(END)
    )
    note = (
        f"deliveries are counted in {counted(n_intervals, 'interval')} of {interval_s:g} s; all runs are taken to last "
        f"{n_intervals * interval_s:g} s, as the latest delivery tells"
    )
    return counts, note


def _same(ends_s: Sequence[FloatArray], where: str) -> FloatArray | None:
    """Return the ends of the intervals, which all runs share; None where they are not known."""
    for each in ends_s:
        for place in np.flatnonzero(~np.isclose(each, ends_s[0], rtol=_NEAR, atol=0.0)):
            raise CurveError(
                f"Expected intervals with the same ends in all runs of {where}, got one that ends at "
                f"{ends_s[0][place]:g} s and one at {each[place]:g} s; bring the runs to one clock."
            )
    return ends_s[0] if ends_s else None


def _performance(name: str) -> Performance:
    """Return what a column is as performance."""
    if name == "performance" or _is_number(name):
        return DELIVERIES
    # Nobody knows what a column of one's own is; it is taken for a total. An inverse is none, and does not add up.
    known = PERFORMANCE_COLUMNS.get(name, Performance(name, is_total=True, adds_up=True))
    return Performance(name, known.unit, adds_up=known.adds_up and not name.startswith(INVERTED))


@dataclass(frozen=True, kw_only=True)
class _Given:
    """A table with our names of columns, and what messages tell of a place in it."""

    frame: pl.DataFrame
    theirs: Mapping[str, str]
    """Our name of a column -> theirs, where it is another."""
    where: str

    @classmethod
    def named(cls, frame: pl.DataFrame, names: Mapping[str, str], known: Mapping[str, Column], where: str) -> "_Given":
        """Give columns our names; arguments and errors as in `study_curves`."""
        there = [name for name in frame.columns if name != _LINE]
        if _LINE not in frame.columns:
            frame = frame.with_row_index(_LINE, offset=1)
        for ours, theirs in names.items():
            if ours not in known:
                raise CurveError(
                    f"Expected one of {', '.join(known)} before '=', got {ours!r}.{suggestion(ours, known)}"
                )
            if theirs not in there and not _is_number(theirs):
                hint = suggestion(theirs, there)
                raise CurveError(f"Expected a column {theirs} for {ours} in {where}, got {', '.join(there)}.{hint}")
        chosen = [(pl.col(theirs) if theirs in there else pl.lit(theirs)).alias(ours) for ours, theirs in names.items()]
        return cls(frame=frame.with_columns(chosen), theirs=names, where=where)

    def require(self, *names: str) -> None:
        """Check that there are columns, and rows in them."""
        there = [name for name in self.frame.columns if name != _LINE]
        missing = [name for name in names if name not in there]
        if missing:
            raise CurveError(
                f"Expected the column{'s' if len(missing) > 1 else ''} {', '.join(missing)} in {self.where}, got "
                f"{', '.join(there)}; --columns {missing[0]}=NAME names another one.{suggestion(missing[0], there)}"
            )
        if self.frame.is_empty():
            raise CurveError(f"Expected curves in {self.where}, got column names without a row.")

    def typed(self, known: Mapping[str, Column]) -> pl.DataFrame:
        """Return the known columns with values of their kinds, beside the row of each."""
        names = [name for name in known if name in self.frame.columns]
        return pl.DataFrame([self._typed(name, known[name].kind) for name in names]).with_row_index("row")

    def _typed(self, name: str, kind: str) -> pl.Series:
        given = self.frame[name]
        if given.dtype.is_nested() or isinstance(given.dtype, pl.Binary | pl.Object | pl.Date | pl.Duration):
            raise CurveError(f"Expected texts or numbers in column {name} of {self.where}, got {given.dtype}.")
        texts = given.cast(pl.String).replace("", None)
        if kind == "text":
            self.refuse(texts.is_null().arg_true(), name, "a text")
            return texts
        values = texts.cast(pl.Float64, strict=False)
        wanted, is_right = _KINDS[kind]
        is_known = (values.is_finite() & (values.abs() <= MOST) & is_right(values)).fill_null(False)
        is_bad = ~is_known & (texts.is_not_null() | (name in _IN_EACH_ROW))
        self.refuse(is_bad.arg_true(), name, wanted)
        return values.cast(pl.Int64) if kind == "whole" else values

    def refuse(self, wrong: pl.DataFrame | pl.Series, name: str, wanted: str) -> None:
        """Raise an error about the first of some rows, if there is one: those of a table, or by their numbers."""
        for row in wrong if isinstance(wrong, pl.Series) else wrong["row"]:
            theirs, got = self.theirs.get(name, name), self.frame[name][row]
            raise CurveError(
                f"Expected {wanted} in line {self.frame[_LINE][row]} of {self.where}, column {theirs}"
                f"{'' if theirs == name else f' ({name})'}, got {'nothing' if got in (None, '') else shown(got)}."
            )


def _is_number(text: str) -> bool:
    try:
        return bool(np.isfinite(float(text)))
    except ValueError:
        return False


def _with_experiments(table: pl.DataFrame, given: _Given, controller: str) -> pl.DataFrame:
    """Return the table with all columns that tell experiments apart; values of a criterion that has none are alike."""
    if "criterion" not in table.columns:
        table = table.with_columns(criterion=pl.lit(SIZE))
    if "controller" not in table.columns:
        table = table.with_columns(controller=pl.lit(controller))
    given.refuse((~table["criterion"].is_in(CRITERIA)).arg_true(), "criterion", f"one of {', '.join(CRITERIA)}")
    is_swarm = table["n_robots"].is_between(1, MOST_ROBOTS)
    given.refuse((~is_swarm).arg_true(), "n_robots", f"1 to {MOST_ROBOTS:,} robots")
    value = pl.when(criterion=SIZE).then(pl.col("n_robots").cast(pl.Float64)).when(criterion=UNDISTURBED).then(0.0)
    if not table["criterion"].is_in((SIZE, UNDISTURBED)).all():
        given.require("criterion_value")
        value = value.otherwise("criterion_value")
    table = table.with_columns(value.alias("criterion_value"))
    given.refuse(table["criterion_value"].is_null().arg_true(), "criterion_value", "a number")
    return table


def _experiment(
    key: tuple[Any, ...],
    part: pl.DataFrame,
    runs: Mapping[int, pl.DataFrame],
    ends_s: FloatArray | None,
    n_intervals: int,
    given: _Given,
) -> RunCurves:
    """Return the runs of one experiment, in the order of their numbers; their intervals follow each other."""
    _, criterion, value, n_robots = key
    names = [name for name in INTERVAL_COLUMNS if name in part.columns and part[name].count()]
    for name in names:
        wanted = f"a value, as in other intervals with N = {n_robots}"
        given.refuse(part.filter(pl.col(name).is_null()), name, wanted)
    for seed, run in runs.items():
        if END in names:
            wrong = pl.col(END).diff().fill_null(pl.col(END).first()) <= 0.0
            given.refuse(run.filter(wrong), END, f"a later end of an interval of run {seed}")
        elif "interval" in run.columns:
            wrong = pl.col("interval") != pl.int_range(pl.len()) + min(run["interval"][0], 1)
            given.refuse(run.filter(wrong), "interval", f"the next interval of run {seed}, each once")
    seeds = sorted(runs)
    return RunCurves(
        criterion=criterion,
        value=value,
        n_robots=n_robots,
        seeds=tuple(seeds),
        curves={name: np.stack([runs[seed][name].to_numpy()[:n_intervals] for seed in seeds]) for name in names},
        rates=_rates(part, given),
        horizon_s=None if ends_s is None else float(ends_s[-1]),
    )


def _rates(part: pl.DataFrame, given: _Given) -> PopulationRates | None:
    rates: dict[str, float] = {}
    for rate, name in RATE_COLUMNS.items():
        if name in part.columns and part[name].count():
            first = part[name][0]
            wanted = f"the same rate in each row of {part['criterion'][0]} {part['criterion_value'][0]:g}"
            given.refuse(part.filter(pl.col(name).ne_missing(first)), name, wanted)
            rates[rate] = first
    return PopulationRates(**rates) if rates else None
