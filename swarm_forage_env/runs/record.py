"""RunRecord: one run as columns over recording intervals, and the Parquet file that holds it.

The fields of `RunRecord` are the schema. Units and meanings stand in `scenarios.columns`; `record_columns()` lists all
of them. A file is self-contained: its metadata hold the complete specification of the run, and the versions that made
it.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, get_type_hints

import numpy as np
from numpy.typing import NDArray

from swarm_forage_env._internal.files import parse_json, replacing
from swarm_forage_env._internal.typed import typed
from swarm_forage_env.contract.types import FloatArray, IntArray
from swarm_forage_env.runs.answer import Sheet
from swarm_forage_env.runs.parquet import ParquetError, read_parquet, write_parquet
from swarm_forage_env.runs.versions import identity
from swarm_forage_env.scenarios.columns import ALL_COLUMNS, INTERVAL_COLUMNS, KEY_COLUMNS
from swarm_forage_env.scenarios.performance import performance_curve

if TYPE_CHECKING:
    import polars as pl

SCHEMA_VERSION = 1
"""Version of the file layout; raised whenever a column changes its name, type or meaning."""

CountArray: TypeAlias = NDArray[np.int64]

_PREFIX = "swarm_forage_env."
_FILE_KEYS = tuple(_PREFIX + name for name in ("schema_version", "spec", "provenance"))


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
    """Versions, commit, time of creation, seconds of the clock and of a core."""

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
        """Return whether these `software_versions` made the run: the same packages and the same commit."""
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
            OSError: the file cannot be written.
        """
        values = (str(SCHEMA_VERSION), self.spec, json.dumps(dict(self.provenance), sort_keys=True))
        with replacing(Path(path)) as draft:
            write_parquet(draft, self.to_frame(), dict(zip(_FILE_KEYS, values, strict=True)))

    @classmethod
    def read(cls, path: str | os.PathLike[str]) -> "RunRecord":
        """Read a record back.

        Raises:
            RecordError: the file is missing, no record, damaged, or of another schema version; the message names it.
        """
        name = str(path)
        try:
            stamp, frame = read_parquet(path)
            _check_stamp(stamp)
            _, spec, provenance = (stamp[key] for key in _FILE_KEYS)
            return record_of(frame, spec, typed(Mapping[str, str], parse_json(provenance), "provenance"))
        except OSError as error:
            raise RecordError(f"Cannot read {name}: {error.strerror or error}.") from error
        except ParquetError as error:
            raise RecordError(f"Cannot read {name}: {error}.") from error
        except (LookupError, OverflowError, TypeError, ValueError) as error:
            raise RecordError(f"Cannot read {name}: its content is damaged ({error}).") from error


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


def _polars_type(dtype: type) -> Any:
    import polars as pl

    return {str: pl.String, int: pl.Int64, float: pl.Float64}[dtype]


def _check_stamp(stamp: Mapping[str, str]) -> None:
    if not set(_FILE_KEYS) <= stamp.keys():
        raise ParquetError("it is a Parquet file, but no run record of swarm_forage_env")
    version = stamp[_FILE_KEYS[0]]
    if version != str(SCHEMA_VERSION):
        raise ParquetError(
            f"it has schema version {version}, this version of swarm_forage_env reads {SCHEMA_VERSION}; read it with "
            "the version that wrote it"
        )


def record_of(frame: "pl.DataFrame", spec: str, provenance: Mapping[str, str]) -> RunRecord:
    """Build a record back from `RunRecord.to_frame`.

    Raises:
        RecordError: a column is missing, or holds what no record may.
    """
    missing = [name for name in (*_KEY_DTYPES, *COLUMN_DTYPES) if name not in frame.columns]
    if missing:
        raise RecordError(f"it has no column {missing[0]}")
    if frame.is_empty():
        raise RecordError("it has no rows")
    first = frame.row(0, named=True)
    values: dict[str, Any] = {name: dtype(first[name]) for name, dtype in _KEY_DTYPES.items()}
    values |= {name: frame[name].to_numpy() for name in COLUMN_DTYPES}
    contributed = {name: frame[name].to_numpy() for name in frame.columns if name not in values}
    return RunRecord(**values, contributed=contributed, spec=spec, provenance=provenance)
