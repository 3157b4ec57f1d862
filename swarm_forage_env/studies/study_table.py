"""StudyTable: the table of a study's runs, as rows, and the Parquet file that holds it.

It is a `Table` like that of any plan. In addition, its conditions have addresses, and it reads records on demand.

It has one row per interval of a run, in the order of the study's conditions, seeds and intervals. A failed or missing
run has one row without an interval, so that readers notice it. The file needs no other file: its metadata hold the
study and the versions that made its runs. The same runs make the same bytes, in any order and on any number of
machines.
"""

import json
import math
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias, TypeVar

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import alone_in, parse_json, replacing
from swarm_forage_env._internal.typed import typed
from swarm_forage_env.runs.parquet import ParquetError, read_parquet, write_parquet
from swarm_forage_env.runs.plan import Condition, Curves, Plan, Table
from swarm_forage_env.runs.record import Record, RecordError
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import (
    DONE,
    FAILED,
    MISSING,
    RunFailure,
    failure_file,
    read_failure,
    record_file,
    stored_record,
)
from swarm_forage_env.runs.versions import VERSION_NAMES
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS, KEY_COLUMNS
from swarm_forage_env.studies.study import Place, StudySpec
from swarm_forage_env.studies.study_folder import PlaceState, StudyFolder, place_state

if TYPE_CHECKING:
    import polars as pl

AXIS = "axis_"
"""Prefix of the columns of axes, because axes may have the names of columns of records: throttle, handling_cost."""
LOSS_COLUMNS = ("state", "error", "traceback", "rerun")
"""Last columns: one of `study_folder.STATES`; for failed runs the exception in one line, its traceback, and the command
that makes the run again from within the folder of the study."""
TABLE_VERSION = 1
"""Version of the layout; raised whenever a column changes its name, type or meaning."""
Versions: TypeAlias = tuple[Mapping[str, str], ...]
"""Versions and commits that made the runs of a study, each once."""
_PREFIX = "swarm_forage_env.study."
_FILE_KEYS = tuple(_PREFIX + name for name in ("table_version", "study", "versions"))
_COMPRESSION = 19
"""Level of Zstandard; packing a thousand runs takes a second, and reading them is as quick."""
_NOT_KEPT = ("run_id", "controller")
"""Columns of records that the table leaves out: the study tells the first, and the column of the policy's label the
second."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyTable(Table):
    """The runs of a study."""

    spec: StudySpec
    frame: "pl.DataFrame" = field()  # pyright: ignore[reportIncompatibleVariableOverride] - here it is given
    """Columns: `study`, `condition` (index in `spec.places`), `rules`, `policy`, one `AXIS` column per axis;
    the columns of `Record`, null for runs without such a column; `LOSS_COLUMNS`."""
    versions: Versions
    wall_time_s: float | None = None
    """Sum of the times that the finished runs took, by the clock. None if unknown: files leave it out, so that the same
    runs make the same bytes."""
    damaged: tuple[str, ...] = ()
    """Why the table cannot use some files of a folder; their runs count as missing."""
    plan: Plan = field(init=False)
    records: Mapping[str, Record] = field(init=False)
    failures: Mapping[str, RunFailure] = field(init=False)

    def __post_init__(self) -> None:
        for name, value in (
            ("plan", self.spec.plan),
            ("records", _InState(self, DONE, self._record)),
            ("failures", _InState(self, FAILED, self._failure)),
        ):
            object.__setattr__(self, name, value)

    @property
    def damaged_lines(self) -> tuple[str, ...]:
        """Lines about damaged files: the first one, and how many more there are."""
        if not self.damaged:
            return ()
        first, *others = self.damaged
        more = f" {len(others)} more files are like it." if others else ""
        return (f"Counts as missing, until 'study run' makes it again: {first}{more}",)

    def rows(self, place: Place) -> "pl.DataFrame":
        """Return the rows of a condition, including failed and missing runs.

        Raises:
            KeyError: the study has no such condition.
        """
        start, stop = self._spans[place]
        return self.frame[start:stop]

    def curves(self, condition: Condition | Place, *columns: str) -> Curves:
        """Return the finished runs of a condition as arrays.

        Args:
            condition: A condition of the plan, or its place; the place of its reference is `spec.reference_of(place)`.
            columns: Columns of records; columns that its runs do not have are left out. Default all.

        Returns:
            The rising seeds of the R runs, and for each column its values in T intervals, (R, T).

        Raises:
            KeyError: the study has no such condition.
        """
        if isinstance(condition, Condition):
            return super().curves(condition, *columns)
        rows = self.rows(condition)
        rows = rows.filter(rows["state"] == DONE)
        seeds = tuple(int(seed) for seed in rows["seed"].unique(maintain_order=True))
        names = columns or INTERVAL_COLUMNS
        present = [name for name in names if name in rows.columns and rows[name].null_count() == 0]
        curves = {name: rows[name].to_numpy().astype(np.float64).reshape(len(seeds), -1) for name in present if seeds}
        return seeds, curves

    def spec_of(self, run_id: str) -> RunSpec:
        """Return the specification of a run, from which any machine can make it again.

        Raises:
            KeyError: the study has no such run.
        """
        if run_id not in self._of_run:
            raise KeyError(f"Study {self.spec.name} has no run {run_id!r}.")
        return self._spec_at(self._rows_of(run_id))

    def place_states(self) -> tuple[PlaceState, ...]:
        """Return how many runs of each condition are done, failed and missing."""
        interval = self.frame["interval"]
        states = self.frame.filter(interval.is_null() | (interval == 0))["state"].to_list()  # one row per run
        n_seeds = len(self.spec.seeds)
        return tuple(
            place_state(place, states[number * n_seeds : (number + 1) * n_seeds])
            for number, place in enumerate(self.spec.places)
        )

    def places(self) -> "pl.DataFrame":
        """Return one row per condition: address, whether it is a reference, and the number of runs in each state."""
        import polars as pl

        rows = [
            {
                **place_columns(self.spec, state.place),
                "is_reference": self.spec.reference_of(state.place) == state.place,
                "n_robots": self.spec.world(state.place).n_robots,
                **{f"n_{name}": count for name, count in state.n_runs.items()},
            }
            for state in self.place_states()
        ]
        return pl.DataFrame(rows, infer_schema_length=None)

    def write(self, path: str | Path) -> None:
        """Write the table to a Parquet file, whole or not at all.

        Raises:
            OSError: the file cannot be written.
        """
        values = (str(TABLE_VERSION), self.spec.to_json(), json.dumps(self.versions, sort_keys=True))
        with replacing(Path(path)) as draft:
            write_parquet(draft, self.frame, dict(zip(_FILE_KEYS, values, strict=True)), _COMPRESSION)

    @cached_property
    def _spans(self) -> dict[Place, tuple[int, int]]:
        """First row of each condition, and the row behind its last."""
        numbers = np.arange(len(self.spec.places) + 1)
        ends = np.searchsorted(self.frame["condition"].to_numpy(), numbers).tolist()
        return {place: (ends[number], ends[number + 1]) for number, place in enumerate(self.spec.places)}

    @cached_property
    def _of_run(self) -> dict[str, tuple[int, int]]:
        """First row and number of rows of each run; a run that several conditions share counts in the first of them."""
        lengths = self.frame.select("condition", "seed").to_struct().rle().struct.field("len").to_numpy()
        found: dict[str, tuple[int, int]] = {}
        for start, length in zip((np.cumsum(lengths) - lengths).tolist(), lengths.tolist(), strict=True):
            found.setdefault(self._spec_at(self.frame.slice(start, length)).run_id, (start, length))
        return found

    @cached_property
    def _specs(self) -> Callable[[int], Mapping[int, RunSpec]]:
        """Number of a condition -> seed -> specification."""
        return cache(lambda number: {spec.seed: spec for spec in self.spec.specs_of(self.spec.places[number])})

    def _spec_at(self, rows: "pl.DataFrame") -> RunSpec:
        """The specification of the run that rows are of."""
        return self._specs(rows["condition"][0])[rows["seed"][0]]

    def _rows_of(self, run_id: str) -> "pl.DataFrame":
        return self.frame.slice(*self._of_run[run_id])

    def _record(self, run_id: str) -> Record:
        """The record of a finished run, with the versions of all runs: a table does not say which run has which."""
        rows, spec = self._rows_of(run_id), self.spec_of(run_id)
        here = {*LOSS_COLUMNS, *KEY_COLUMNS, *_columns(self.spec)}
        kept = [name for name in rows.columns if name not in here and not rows[name].null_count()]
        names = dict.fromkeys(name for made in self.versions for name in made)
        made = {name: " or ".join(dict.fromkeys(made.get(name, "") for made in self.versions)) for name in names}
        return Record(spec=spec, columns={name: rows[name].to_numpy() for name in kept}, made_with=made)

    def _failure(self, run_id: str) -> RunFailure:
        row = self._rows_of(run_id).row(0, named=True)
        return RunFailure(spec=self.spec_of(run_id), error=row["error"], traceback=row["traceback"])


_T = TypeVar("_T")


class _InState(Mapping[str, _T]):
    """The runs of a table in one state: run_id -> what is read from the table on demand."""

    def __init__(self, table: StudyTable, state: str, read: Callable[[str], _T]) -> None:
        self._table, self._state, self._read = table, state, cache(read)

    @cached_property
    def _run_ids(self) -> dict[str, None]:
        states = self._table.frame["state"]
        return {run_id: None for run_id, (start, _) in self._table._of_run.items() if states[start] == self._state}

    def __getitem__(self, run_id: str) -> _T:
        if run_id not in self._run_ids:
            raise KeyError(run_id)
        return self._read(run_id)

    def __iter__(self) -> Iterator[str]:
        return iter(self._run_ids)

    def __len__(self) -> int:
        return len(self._run_ids)


def place_columns(spec: StudySpec, place: Place) -> dict[str, Any]:
    """Return the address of a condition by column: rules, policy, and its value on each axis; numbers are floats."""
    values = {
        AXIS + axis.name: value if isinstance(value, str | bool) else float(value)
        for axis, value in zip(spec.axes, place.values, strict=True)
    }
    return {"rules": place.rules, "policy": place.policy, **values}


def gather_study(
    folder: StudyFolder, spec: StudySpec | None = None, places: Collection[Place] | None = None
) -> StudyTable:
    """Return all runs of a study's folder as a table.

    Args:
        folder: Folder of the study.
        spec: A study to use in place of the one that the folder holds. None: the one in the folder.
        places: Conditions to read; the table has no rows for others. None: all.

    Raises:
        RecordError: the folder does not hold a study, or the file of a failure is damaged.
    """
    import polars as pl

    spec = spec or folder.study()
    versions: set[tuple[tuple[str, str], ...]] = set()
    frames: list[pl.DataFrame] = []
    damaged: list[str] = []
    wall_time_s = 0.0
    for number, place in enumerate(spec.places):
        if places is not None and place not in places:
            continue
        records: list[Record] = []
        lost: list[dict[str, Any]] = []
        for run in spec.specs_of(place):
            record = _record(folder.runs, run, damaged)
            if record is None:
                lost.append(_loss(folder.runs, run))
            else:
                records.append(record)
                wall_time_s += record.wall_time_s
                versions.add(tuple((name, record.made_with.get(name, "")) for name in VERSION_NAMES))
        first = {"study": spec.name, "condition": number, **place_columns(spec, place)}
        rows = pl.concat([_frame(records), _losses(lost)], how="diagonal").sort("seed", "interval")
        frames.append(rows.select(*(pl.lit(value).alias(name) for name, value in first.items()), pl.all()))
    frame = pl.concat(frames, how="diagonal")
    return StudyTable(
        spec=spec,
        frame=frame.select(_in_order(frame.columns, spec)),
        versions=tuple(dict(pairs) for pairs in sorted(versions)),
        wall_time_s=None if math.isnan(wall_time_s) else wall_time_s,
        damaged=tuple(damaged),
    )


def pack_study(folder: StudyFolder, chosen: Path | None = None, *, tell: Callable[[str], None] | None = None) -> Path:
    """Put all runs of a study into one file. If several calls do so at once, the file has the latest runs in the end.

    Args:
        folder: Folder of the study.
        chosen: File to write; default NAME.parquet in the folder.
        tell: Function that gets lines about damaged files.

    Returns:
        The file that was written.

    Raises:
        RecordError: see `gather_study`.
        OSError: the file cannot be written.
    """
    folder.study()  # a folder without one is refused before anything is made in it
    with alone_in(folder.runs):  # not the folder itself, which shards need in order to begin
        table = gather_study(folder)
        if tell is not None:
            for line in table.damaged_lines:
                tell(line)
        file = chosen or folder.folder / f"{table.spec.name}.parquet"
        table.write(file)
    return file


def read_study(path: str | Path) -> StudyTable:
    """Read a study's table from its packed file, or gather it from its folder.

    Raises:
        RecordError: the file is missing, is not a study, is damaged, or has another layout; the message names it.
    """
    if Path(path).is_dir():
        return gather_study(StudyFolder(path))
    name = str(path)
    try:
        return _read_file(Path(path))
    except OSError as error:
        raise RecordError(f"Cannot read {name}: {error.strerror or error}.") from error
    except (ParquetError, ConfigError) as error:
        raise RecordError(f"Cannot read {name}: {str(error).removesuffix('.')}.") from error


def _read_file(path: Path) -> StudyTable:
    """Read a packed study; errors do not name the file."""
    stamp, frame = read_parquet(path)
    if not set(_FILE_KEYS) <= stamp.keys():
        raise ParquetError("it is a Parquet file, but no study of swarm_forage_env")
    version, study, versions = (stamp[key] for key in _FILE_KEYS)
    if version != str(TABLE_VERSION):
        raise ParquetError(
            f"it has layout {version}, this version of swarm_forage_env reads {TABLE_VERSION}; "
            "read it with the version that wrote it"
        )
    spec = StudySpec.from_mapping(_parsed(study))
    lacking = [name for name in (*_columns(spec), "seed", "interval", *LOSS_COLUMNS) if name not in frame.columns]
    if lacking:
        raise ParquetError(f"it has no column {lacking[0]}")
    return StudyTable(spec=spec, frame=frame, versions=typed(Versions, _parsed(versions), "versions"))


def _parsed(told: str) -> Any:
    try:
        return parse_json(told)
    except ValueError as error:
        raise ParquetError(f"its metadata are damaged: {error}") from error


def _record(folder: Path, run: RunSpec, damaged: list[str]) -> Record | None:
    """The record of a run, with the performance that the study asks for; None if it is missing or damaged."""
    try:
        return stored_record(folder, run)
    except RecordError as error:
        damaged.append(str(error))
        return None


def _loss(folder: Path, run: RunSpec) -> dict[str, Any]:
    """The row of a run without a usable record."""
    row: dict[str, Any] = {
        "scenario": run.scenario.name,
        "n_robots": run.scenario.robots.n_robots,
        "criterion": run.world.criterion,
        "criterion_value": run.world.value,
        "seed": run.seed,
        "state": MISSING,
    }
    path = failure_file(folder, run.run_id)
    if record_file(folder, run.run_id).exists() or not path.exists():
        return row
    failure = read_failure(path)
    rerun = f"swarm-forage rerun {path.relative_to(folder.parent)}"
    return {**row, "state": FAILED, "error": failure.error, "traceback": failure.traceback, "rerun": rerun}


def _losses(rows: Sequence[Mapping[str, Any]]) -> "pl.DataFrame":
    """Rows of `_loss`; without rows, only the columns."""
    import polars as pl

    schema: dict[str, Any] = {"scenario": str, "n_robots": int, "criterion": str}
    schema |= {"criterion_value": float, "seed": int, "interval": pl.Int32, **dict.fromkeys(LOSS_COLUMNS, str)}
    return pl.DataFrame(rows, schema=schema)


def _frame(records: Sequence[Record]) -> "pl.DataFrame":
    """The rows of one condition's records, which all have the same columns."""
    import polars as pl

    if not records:
        return pl.DataFrame()
    frame = pl.concat([record.frame for record in records]).drop(_NOT_KEPT)
    return frame.with_columns(pl.lit(DONE).alias("state"))


def _columns(spec: StudySpec) -> list[str]:
    """Columns of a condition's address."""
    return ["study", "condition", "rules", "policy", *(AXIS + axis.name for axis in spec.axes)]


def _in_order(columns: Sequence[str], spec: StudySpec) -> list[str]:
    """Columns in order: address, columns of every record, contributed columns by name, and losses."""
    first = _columns(spec)
    of_records = [name for name in (*KEY_COLUMNS, *INTERVAL_COLUMNS) if name in columns]
    contributed = sorted({*columns} - {*first, *of_records, *LOSS_COLUMNS})
    return [*first, *of_records, *contributed, *LOSS_COLUMNS]
