"""RunRecord: one run as columns over recording intervals, and the Parquet file that holds it.

The fields of `RunRecord` are the schema. Units and meanings stand in `scenarios.columns`; `record_columns()` lists all
of them. A file is self-contained: its metadata hold the complete specification of the run, the versions that made it,
and a digest by which a damaged file is noticed.
"""

import hashlib
import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, get_type_hints

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.fields import number, table, text, whole
from swarm_forage_env._internal.files import parse_json, replacing
from swarm_forage_env.contract.types import FloatArray, IntArray
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.runs.parquet import (
    ParquetError,
    check_columns,
    check_size,
    check_texts,
    open_parquet,
    parse_parquet,
)
from swarm_forage_env.runs.versions import identity
from swarm_forage_env.scenarios.columns import ALL_COLUMNS, INTERVAL_COLUMNS, KEY_COLUMNS
from swarm_forage_env.scenarios.performance import performance_curve

if TYPE_CHECKING:
    import polars as pl

SCHEMA_VERSION = 2
"""Version of the file layout; raised whenever a column changes its name, type or meaning."""

CountArray: TypeAlias = NDArray[np.int64]

MOST_BYTES = 2**28
"""What a record may have, in the file, unpacked and in memory: 600,000 intervals; our choice."""
_PREFIX = "swarm_forage_env."
_FILE_KEYS = tuple(_PREFIX + name for name in ("schema_version", "spec", "provenance", "digest"))


class RecordError(ValueError):
    """A record that cannot be built, or a file that holds no undamaged record; the message names the file."""


@dataclass(frozen=True, kw_only=True, eq=False)
class RunRecord:
    """One run: its keys and arrays over T intervals, all of length T and read-only.

    After an early end (every robot dead) the remaining intervals are zeros.
    """

    run_id: str
    scenario: str
    controller: str
    n_robots: int
    criterion: str
    criterion_value: float
    seed: int

    interval: IntArray
    t_end_s: FloatArray
    performance: FloatArray
    collected: CountArray
    first_picked: CountArray
    free_pickups: CountArray
    cache_pickups: CountArray
    cache_drops: CountArray
    floor_drops: CountArray
    displaced_drops: CountArray
    objects_moved: CountArray
    caches_created: CountArray
    caches_depleted: CountArray
    interference_ticks: CountArray
    interference_fraction: FloatArray
    n_active: FloatArray
    n_present: FloatArray
    n_carrying: FloatArray
    n_caches: FloatArray
    n_objects_cached: FloatArray
    adversity: FloatArray

    contributed: Mapping[str, FloatArray]
    """Further columns, (T,) float64 each, from wrappers and policies; see `CONTRIBUTED_COLUMNS`."""
    spec: str
    """The run's complete specification as JSON (`runs.spec.RunSpec.from_json`)."""
    provenance: Mapping[str, str]
    """Versions, code, commit, time of creation, seconds of the clock and of a core."""

    def __post_init__(self) -> None:
        n_intervals = len(self.interval)
        for name, dtype in COLUMN_DTYPES.items():
            object.__setattr__(self, name, _checked(name, getattr(self, name), dtype, n_intervals))
        taken = sorted(set(self.contributed) & (set(COLUMN_DTYPES) | set(_KEY_DTYPES)))
        if taken:
            raise RecordError(f"Expected contributed columns with names of their own, got {', '.join(taken)}.")
        contributed = {
            name: _checked(name, values, np.float64, n_intervals) for name, values in sorted(self.contributed.items())
        }
        object.__setattr__(self, "contributed", contributed)
        object.__setattr__(self, "provenance", dict(self.provenance))

    @property
    def n_intervals(self) -> int:
        """Number of intervals T."""
        return len(self.interval)

    @property
    def horizon_s(self) -> float:
        """Length of the run in simulated seconds."""
        return float(self.t_end_s[-1])

    @property
    def wall_time_s(self) -> float:
        """Wall-clock seconds that the run took, policy and recording included; NaN where unknown."""
        return float(self.provenance.get("wall_time_s", "nan"))

    @property
    def cpu_time_s(self) -> float:
        """Seconds of a core that the run took, other work of the machine left out; NaN where unknown."""
        return float(self.provenance.get("cpu_time_s", "nan"))

    def keys(self) -> dict[str, str | int | float]:
        """Return the identifying fields by name."""
        return {name: getattr(self, name) for name in _KEY_DTYPES}

    def columns(self) -> dict[str, np.ndarray]:
        """Return all (T,) columns by name, contributed ones last."""
        return {name: getattr(self, name) for name in COLUMN_DTYPES} | dict(self.contributed)

    @classmethod
    def column_names(cls) -> tuple[str, ...]:
        """Return the names of the columns that every record has, keys first, in their order."""
        return (*_KEY_DTYPES, *COLUMN_DTYPES)

    def rate_per_1000_s(self, column: str) -> float:
        """Return the sum of a column over the run, per 1,000 simulated seconds."""
        return float(self.columns()[column].sum()) * 1000.0 / self.horizon_s

    def read_as(self, performance: str) -> "RunRecord":
        """Return the same run with another performance; column and specification say so, the identity stays.

        Args:
            performance: As in `swarm_forage_env.scenarios.performance.performance_of`.

        Raises:
            ConfigError: there is no such performance.
        """
        spec = json.loads(self.spec)
        if spec["scenario"]["performance"] == performance:
            return self
        spec["scenario"]["performance"] = performance
        curve = performance_curve(performance, self.columns())
        return replace(self, performance=curve, spec=json.dumps(spec, sort_keys=True))

    def made_by(self, versions: Mapping[str, str]) -> bool:
        """Return whether these `software_versions` made the run: the same packages and the same code."""
        return identity(self.provenance) == identity(versions)

    def same_results(self, other: "RunRecord") -> bool:
        """Return whether both records hold the same keys and bit-equal columns; provenance may differ."""
        return self.keys() == other.keys() and self.same_columns(other)

    def same_columns(self, other: "RunRecord") -> bool:
        """Return whether both records hold the same columns, bit for bit, whatever run they are of."""
        mine, theirs = self.columns(), other.columns()
        return mine.keys() == theirs.keys() and all(np.array_equal(mine[name], theirs[name]) for name in mine)

    def describe(self) -> str:
        """Return a few lines about the run for people."""
        seconds = self.horizon_s
        lines = [
            f"run {self.run_id}: {self.controller} in {self.scenario}, {self.n_robots} robots, seed {self.seed}",
            f"  criterion      {self.criterion} = {self.criterion_value:g}",
            f"  length         {seconds:g} s in {self.n_intervals} intervals of {seconds / self.n_intervals:g} s",
            f"  delivered      {self.collected.sum()} ({self.rate_per_1000_s('collected'):.1f} per 1,000 s)",
            f"  first pick-ups {self.first_picked.sum()} ({self.rate_per_1000_s('first_picked'):.1f} per 1,000 s)",
            f"  interference   {self.interference_fraction.mean():.3f} of active robot time",
            f"  active robots  {self.n_active.mean():.1f} on average",
        ]
        origin = [f"{name} {value}" for name, value in sorted(self.provenance.items()) if value]
        return "\n".join([*lines, "  made with      " + ", ".join(origin)])

    def to_frame(self) -> "pl.DataFrame":
        """Return the record as a table of T rows; keys are repeated on each row."""
        import polars as pl

        keys = [
            pl.lit(getattr(self, name), dtype=_polars_type(dtype)).alias(name) for name, dtype in _KEY_DTYPES.items()
        ]
        return pl.DataFrame(self.columns()).select(*keys, pl.all())

    def write(self, path: str | os.PathLike[str]) -> None:
        """Write the record to a Parquet file, whole or not at all.

        Args:
            path: File to create or replace; its folder must exist.

        Raises:
            RecordError: it is larger than what `read` reads.
            OSError: the file cannot be written.
        """
        provenance = json.dumps(dict(self.provenance), sort_keys=True)
        values = (str(SCHEMA_VERSION), self.spec, provenance, _digest(self, provenance))
        frame = self.to_frame()
        with replacing(Path(path)) as draft:
            # By way of memory: polars tells a full disk as an error of its own, among many others.
            buffer = BytesIO()
            frame.write_parquet(buffer, metadata=dict(zip(_FILE_KEYS, values, strict=True)))
            content = buffer.getvalue()
            try:
                check_texts(frame, MOST_BYTES)
                parse_parquet(content, MOST_BYTES)
            except ParquetError as error:
                raise _too_large(self.run_id, error) from error
            draft.write_bytes(content)

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> "RunRecord":
        """Read a record back.

        Raises:
            RecordError: the file is missing, no record, damaged, or of another schema version; the message names it.
        """
        import polars as pl

        name = str(path)
        try:
            opened = open_parquet(Path(path), MOST_BYTES)
            _check_stamp(name, opened.stamp)
            frame = opened.frame()
        except OSError as error:
            raise RecordError(f"Cannot read {name}: {error.strerror or error}.") from error
        except ParquetError as error:
            raise RecordError(f"Cannot read {name}: {error}.") from error
        version, spec, provenance, digest = (opened.stamp[key] for key in _FILE_KEYS)
        try:
            check_columns(frame, _column_types(), (pl.Float64,), needed=cls.column_names())
            check_texts(frame, MOST_BYTES)
            if sum(frame.null_count().row(0)):
                raise RecordError("it has empty places")
            record = record_of(frame, spec, _checked_provenance(provenance))
            _check_content(record)
        except (pl.exceptions.PolarsError, LookupError, OverflowError, RecursionError, TypeError, ValueError) as error:
            raise RecordError(f"Cannot read {name}: its content does not match schema {version} ({error}).") from error
        if _digest(record, provenance) != digest:
            raise RecordError(f"Cannot read {name}: its content does not match its digest, so the file is damaged.")
        return record


def check_intervals(run_id: str, n_intervals: int) -> None:
    """Refuse a run of more intervals than any record has, before it is made.

    Raises:
        RecordError: its record would be larger than what `RunRecord.read` reads.
    """
    try:
        check_size(n_intervals, len(RunRecord.column_names()), MOST_BYTES)
    except ParquetError as error:
        raise _too_large(run_id, error) from error


def _too_large(run_id: str, why: ParquetError) -> RecordError:
    return RecordError(f"Cannot store run {run_id}: {why}; choose longer intervals (interval_s).")


_DTYPES: dict[Any, type] = {
    str: str,
    int: int,
    float: float,
    IntArray: np.int32,
    CountArray: np.int64,
    FloatArray: np.float64,
}
_HINTS = get_type_hints(RunRecord)
_KEY_DTYPES = {name: _DTYPES[_HINTS[name]] for name in KEY_COLUMNS}
COLUMN_DTYPES = {name: _DTYPES[_HINTS[name]] for name in INTERVAL_COLUMNS}
"""Column of an interval -> type of its numbers."""


def record_columns() -> Sheet:
    """Return the schema as a table: name, type, unit, meaning; contributed columns last."""
    dtypes = _KEY_DTYPES | COLUMN_DTYPES
    rows = [
        (name, dtypes[name].__name__, column.unit or "-", column.meaning)
        if name in dtypes
        else (name, "float64", column.unit, column.meaning + " (optional)")
        for name, column in ALL_COLUMNS.items()
    ]
    return Sheet(title="columns", header=("column", "type", "unit", "meaning"), rows=rows)


def _checked(name: str, values: Any, dtype: type, n_intervals: int) -> np.ndarray:
    given = np.asarray(values)
    if given.shape != (n_intervals,):
        raise RecordError(f"Expected column {name} with shape (intervals,) = ({n_intervals},), got {given.shape}.")
    with np.errstate(invalid="ignore"):  # what no whole number can be is refused below, in words
        column = np.array(given, dtype=dtype)
    if not (np.isfinite(column).all() and np.array_equal(column, given)):
        raise RecordError(f"Expected column {name} to hold finite {np.dtype(dtype).name} values, got {given.tolist()}.")
    column.flags.writeable = False
    return column


def _digest(record: RunRecord, provenance: str) -> str:
    state = hashlib.blake2b(digest_size=16)
    state.update(json.dumps([record.keys(), record.spec, provenance], sort_keys=True).encode())
    for name, values in record.columns().items():
        state.update(name.encode())
        state.update(values.tobytes())
    return state.hexdigest()


def _polars_type(dtype: type) -> Any:
    import polars as pl

    return {str: pl.String, int: pl.Int64, float: pl.Float64}[dtype]


def _column_types() -> dict[str, tuple[Any, ...]]:
    """Column of a record -> types that it may have in a file."""
    import polars as pl

    whole = (pl.Int64, pl.Int32)
    types = {str: (pl.String,), int: whole, float: (pl.Float64,), np.int32: whole, np.int64: whole}
    types[np.float64] = types[float]
    return {name: types[dtype] for name, dtype in (_KEY_DTYPES | COLUMN_DTYPES).items()}


def _checked_provenance(told: str) -> Mapping[str, str]:
    """Return versions and times as a file has them, if they are texts by name, and times numbers."""
    found = table("provenance", parse_json(told))
    for name, value in found.items():
        if not isinstance(value, str):
            raise RecordError(f"expected provenance.{name} to be a text")
        if name in ("wall_time_s", "cpu_time_s") and value:
            number(name, float(value), at_least=0.0)
    return found


def _check_content(record: RunRecord) -> None:
    """Refuse what no run has: a clock that stands, no robots, a specification without what it is read by."""
    for name in ("run_id", "scenario", "controller", "criterion"):
        text(name, getattr(record, name))
    number("criterion_value", record.criterion_value)
    whole("n_robots", record.n_robots, at_least=1)
    whole("seed", record.seed, at_least=0)
    if not np.array_equal(record.interval, np.arange(record.n_intervals)):
        raise RecordError("expected the intervals 0, 1, 2, ... once each")
    if not (np.diff(record.t_end_s, prepend=0.0) > 0.0).all():
        raise RecordError("expected a rising t_end_s")
    scenario = table("scenario", table("the specification", parse_json(record.spec)).get("scenario"))
    text("performance", scenario.get("performance"))


def _check_stamp(name: str, stamp: Mapping[str, str]) -> None:
    if not set(_FILE_KEYS) <= stamp.keys():
        raise RecordError(f"Cannot read {name}: it is a Parquet file, but no run record of swarm_forage_env.")
    version = stamp[_FILE_KEYS[0]]
    if version != str(SCHEMA_VERSION):
        raise RecordError(
            f"Cannot read {name}: it has schema version {version}, this version of swarm_forage_env reads "
            f"{SCHEMA_VERSION}; read it with the version that wrote it."
        )


def record_of(frame: "pl.DataFrame", spec: str, provenance: Mapping[str, str]) -> RunRecord:
    """Build a record back from `RunRecord.to_frame`.

    Raises:
        RecordError: a column is missing, or holds what no record may.
    """
    missing = [name for name in (*_KEY_DTYPES, *COLUMN_DTYPES) if name not in frame.columns]
    if missing:
        raise RecordError(f"it has no column {missing[0]}")
    first = frame.row(0, named=True)
    values: dict[str, Any] = {name: dtype(first[name]) for name, dtype in _KEY_DTYPES.items()}
    values |= {name: frame[name].to_numpy() for name in COLUMN_DTYPES}
    contributed = {name: frame[name].to_numpy() for name in frame.columns if name not in values}
    return RunRecord(**values, contributed=contributed, spec=spec, provenance=provenance)
