"""The runs of a study: made in a folder, packed into one file, read as one frame.

    <folder>/study.toml     the study file, with what was chosen of it
    <folder>/runs/          its runs and failures, see `runs.store`
    <folder>/<name>.parquet all runs in one file: rows, with `study.toml` and versions in its metadata

Several machines can fill a folder, each with a shard. Folders of shards can also be copied into one. The same runs make
the same packed bytes, in any order and on any number of machines.
"""

import json
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, checked, instance, whole
from swarm_forage_env._internal.files import alone_in, parse_json, replacing
from swarm_forage_env.runs.plan import Curves
from swarm_forage_env.runs.record import RecordError, read_parquet, write_parquet
from swarm_forage_env.runs.runner import Outcomes, longest_first, run_all
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import failure_file, read_failure, stored_record
from swarm_forage_env.runs.versions import VERSION_NAMES
from swarm_forage_env.scenarios.columns import INTERVAL_COLUMNS
from swarm_forage_env.studies.study import Place, StudySpec, study_of
from swarm_forage_env.studies.study_file import Value, word_of

if TYPE_CHECKING:
    import polars as pl

AXIS = "axis_"
"""Prefix of the columns of axes, because axes may have the names of columns of records: throttle, handling_cost."""
Versions: TypeAlias = tuple[Mapping[str, str], ...]
"""Versions and commits that made the runs of a study, each once."""
_STUDY, _VERSIONS = "swarm_forage_env.study", "swarm_forage_env.versions"
_COMPRESSION = 19
"""Level of Zstandard; packing a thousand runs takes a second, and reading them is as quick."""


def study_file(folder: str | Path) -> Path:
    """Return where the folder of a study keeps it."""
    return Path(folder, "study.toml")


def study_in(folder: str | Path) -> StudySpec:
    """Return the study that a folder holds.

    Raises:
        RecordError: the folder does not hold a study, or the file of the study is damaged.
    """
    file = study_file(folder)
    try:
        return study_of(file.read_text(encoding="utf-8"))
    except OSError as error:
        raise RecordError(f"Expected the folder of a study, got {folder} without {file.name}.") from error
    except ValueError as error:
        raise RecordError(f"Cannot use {file}: {error}") from error


def take(spec: StudySpec, folder: str | Path) -> StudySpec:
    """Make it the folder of a study. If it holds a study that differs in seeds and rules alone, the two are joined.

    Returns:
        The study that the folder holds now.

    Raises:
        NotADirectoryError: a file has this name.
        RecordError: the folder holds another study.
    """
    file = study_file(folder)
    with alone_in(Path(folder)):  # shards on several machines add their seeds, one after the other
        kept = _joined(spec, study_in(folder), file) if file.exists() else spec
        with replacing(file) as draft:
            draft.write_text(kept.to_toml(), encoding="utf-8")
    return kept


def _joined(spec: StudySpec, there: StudySpec, file: Path) -> StudySpec:
    seeds = tuple(sorted({*there.seeds, *spec.seeds}))
    rules = tuple(name for name in spec.file.rules if name in {*there.rules, *spec.rules})
    kept, before = (one.with_run(seeds=seeds, rules=rules) for one in (spec, there))
    differs = [
        what for what in ("name", "policies", "axes", "reference") if getattr(kept, what) != getattr(before, what)
    ]
    if not differs and kept.plan.conditions != before.plan.conditions:
        differs = ["worlds"]
    if differs:
        raise RecordError(
            f"Expected study {there.name} as {file} has it, got one of other {differs[0]}. Give another folder, or "
            f"remove {file.name}: runs that both studies have are kept."
        )
    return kept


def shard(specs: Sequence[RunSpec], part: str) -> tuple[RunSpec, ...]:
    """Return a part of the runs; the parts are disjoint, together have all runs, and take about equally long.

    Args:
        specs: All runs, in the same order on every machine.
        part: "2/8" is the second of eight.

    Raises:
        ConfigError: not two whole numbers, or a part that does not exist.
    """
    index, _, count = checked("shard", part, str).partition("/")
    try:
        number, parts = int(index), int(count)
    except ValueError as error:
        raise ConfigError(f"Expected a shard as 2/8, the second of eight, got {part!r}.") from error
    whole("the number of shards", parts, at_least=1)
    whole("the shard", number, at_least=1, at_most=parts)
    return tuple(longest_first(specs)[number - 1 :: parts])


def run_study(
    spec: StudySpec,
    folder: str | Path,
    *,
    part: str = "1/1",
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool = False,
) -> Outcomes:
    """Make the missing runs of a study; the function stores their records in the folder and does not return them.

    It reads the runs that the folder holds, and makes damaged and failed ones again. Ctrl-C stops the current runs and
    keeps the finished ones, so the same call then does the rest.

    Args:
        spec: The study.
        folder: Folder of the study.
        part: Which `shard` of the runs to make.
        jobs: As in `runs.runner.run_all`, like all further arguments.
        executor: Runs the work instead; the call does not shut it down.
        progress: Show progress, an estimate and damaged files on stderr.

    Raises:
        ConfigError: there is no such shard.
        RecordError: the folder holds another study.
        KeyboardInterrupt: Ctrl-C.
        WorkerError: no worker process could be started.
    """
    instance("spec", spec, StudySpec, hint="; load_study(file) reads one")
    planned = shard(spec.plan.specs, part)
    take(spec, folder)
    runs = Path(folder, "runs")
    return run_all(planned, out=runs, jobs=jobs, executor=executor, progress=progress, keep=False)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyTable:
    """The runs of a study."""

    spec: StudySpec
    frame: "pl.DataFrame"
    """One row per interval of a run, in the order of conditions, seeds and intervals, and one row without an interval
    per failed run; missing runs have none. Columns: `study`, `condition` (index in `spec.places`), `rules`, `policy`,
    one `AXIS` column per axis; those of records, null for runs without such a column; `error` of failed runs."""
    versions: Versions
    damaged: tuple[str, ...] = ()
    """Why the table cannot use some files of a folder; their runs count as missing."""

    @property
    def damaged_lines(self) -> tuple[str, ...]:
        """Lines about damaged files: the first one, and how many more there are."""
        if not self.damaged:
            return ()
        first, *others = self.damaged
        more = f" {len(others)} more files are like it." if others else ""
        return (f"Counts as missing, until 'study run' makes it again: {first}{more}",)

    def rows(self, place: Place) -> "pl.DataFrame":
        """Return the rows of a condition; KeyError if the study does not have it."""
        start, stop = self._spans[place]
        return self.frame[start:stop]

    def curves(self, place: Place, *columns: str) -> Curves:
        """Return the finished runs of a condition as arrays.

        Args:
            place: A condition; that of its reference is `spec.reference_of(place)`.
            columns: Columns of records; those that its runs do not have are left out. Default all of every record.

        Returns:
            The rising seeds of the R runs, and for each column its values in T intervals, (R, T).

        Raises:
            KeyError: the study has no such condition.
        """
        rows = self.rows(place)
        rows = rows.filter(rows["interval"].is_not_null())
        seeds = tuple(int(seed) for seed in rows["seed"].unique(maintain_order=True))
        present = [
            name for name in columns or INTERVAL_COLUMNS if name in rows.columns and rows[name].null_count() == 0
        ]
        curves = {name: rows[name].to_numpy().astype(np.float64).reshape(len(seeds), -1) for name in present if seeds}
        return seeds, curves

    @cached_property
    def _spans(self) -> dict[Place, tuple[int, int]]:
        """First row of each condition, and the row behind its last."""
        numbers = np.arange(len(self.spec.places) + 1)
        ends = np.searchsorted(self.frame["condition"].to_numpy(), numbers).tolist()
        return {place: (ends[number], ends[number + 1]) for number, place in enumerate(self.spec.places)}

    def places(self) -> "pl.DataFrame":
        """Return one row per condition: address, whether it is a reference, runs that are done, failed and missing."""
        import polars as pl

        is_done = pl.col("interval").is_not_null()
        counts = self.frame.group_by("condition").agg(
            pl.col("seed").filter(is_done).n_unique().alias("done"), is_done.not_().sum().alias("failed")
        )
        rows = [
            {
                "condition": number,
                **_address(self.spec, place),
                "is_reference": self.spec.reference_of(place) == place,
                "n_robots": self.spec.world(place).n_robots,
            }
            for number, place in enumerate(self.spec.places)
        ]
        known = pl.DataFrame(rows, infer_schema_length=None).with_columns(pl.col("condition").cast(pl.Int32))
        left = pl.lit(len(self.spec.seeds)) - pl.col("done") - pl.col("failed")
        return (
            known.join(counts, on="condition", how="left", maintain_order="left")
            .with_columns(pl.col("done", "failed").fill_null(0).cast(pl.Int64))
            .with_columns(left.cast(pl.Int64).alias("missing"))
        )

    def write(self, path: str | Path) -> None:
        """Write the table to a Parquet file, whole or not at all; raises OSError where that cannot be."""
        texts = {_STUDY: self.spec.to_toml(), _VERSIONS: json.dumps(self.versions, sort_keys=True)}
        write_parquet(Path(path), self.frame, texts, _COMPRESSION)


def _address(spec: StudySpec, place: Place) -> dict[str, Any]:
    """The address of a condition by column: rules, policy, and its value on each axis; whole numbers are floats."""
    values = {AXIS + axis.name: _cell(value) for axis, value in zip(spec.axes, place.values, strict=True)}
    return {"rules": place.rules, "policy": place.policy, **values}


def _cell(value: Value) -> float | str | bool:
    if isinstance(value, str | bool):
        return value
    return word_of(value) if isinstance(value, tuple) else float(value)


def read_study(path: str | Path) -> StudyTable:
    """Read the runs of a study from its packed file, or gather them from its folder.

    Raises:
        RecordError: the file is missing, is not a study, or is damaged; the message names it.
    """
    if Path(checked("path", path, str | Path)).is_dir():
        return _gathered(Path(path))
    texts, frame = read_parquet(path)
    if not {_STUDY, _VERSIONS} <= texts.keys():
        raise RecordError(f"Cannot read {path}: it is a Parquet file, but no study of swarm_forage_env.")
    lacking = {"condition", "seed", "interval", "error"} - {*frame.columns}
    if lacking:
        raise RecordError(f"Cannot read {path}: it has no column {min(lacking)}.")
    try:
        return StudyTable(spec=study_of(texts[_STUDY]), frame=frame, versions=tuple(parse_json(texts[_VERSIONS])))
    except ValueError as error:
        raise RecordError(f"Cannot read {path}: {str(error).removesuffix('.')}.") from error


def _gathered(folder: Path) -> StudyTable:
    import polars as pl

    spec, runs = study_in(folder), folder / "runs"
    versions: set[tuple[tuple[str, str], ...]] = set()
    damaged: list[str] = []
    frames: list[pl.DataFrame] = []
    for number, place in enumerate(spec.places):
        address = {"study": spec.name, "condition": number, **_address(spec, place)}
        columns = [pl.lit(value).alias(name) for name, value in address.items()]
        if not frames:  # the columns of a study without any run
            none = pl.DataFrame(schema={"seed": pl.Int64, "interval": pl.Int32, "error": pl.String})
            frames.append(none.select(*columns, pl.all()).clear())
        for run in spec.specs_of(place):
            try:
                record = stored_record(runs, run)
            except RecordError as error:
                damaged.append(str(error))
                continue
            if record is not None:
                versions.add(tuple((name, record.made_with.get(name, "")) for name in VERSION_NAMES))
                frames.append(record.frame.drop("run_id", "controller").select(*columns, pl.all()))
            elif failure_file(runs, run.run_id).exists():
                told = read_failure(failure_file(runs, run.run_id)).error
                frames.append(pl.DataFrame({"seed": [run.seed], "error": [told]}).select(*columns, pl.all()))
    frame = pl.concat(frames, how="diagonal")
    first = ["study", "condition", *_address(spec, spec.places[0])]
    in_order = [name for name in (*first, "scenario", "n_robots", "criterion", "criterion_value", "seed",
                                  *INTERVAL_COLUMNS) if name in frame.columns]  # fmt: skip
    contributed = sorted({*frame.columns} - {*in_order, "error"})
    return StudyTable(
        spec=spec,
        frame=frame.select(*in_order, *contributed, "error"),
        versions=tuple(dict(pairs) for pairs in sorted(versions)),
        damaged=tuple(damaged),
    )


def pack_study(folder: str | Path, file: Path | None = None) -> tuple[Path, StudyTable]:
    """Put all runs of a study into one file. If several calls do so at once, the file has the latest runs in the end.

    Args:
        folder: Folder of the study.
        file: File to write; default NAME.parquet in the folder.

    Returns:
        The file that was written, and what it holds.

    Raises:
        RecordError: as in `read_study`.
        OSError: the file cannot be written.
    """
    study_in(folder)  # a folder without one is refused before anything is made in it
    with alone_in(Path(folder, "runs")):  # not the folder itself, which shards need in order to begin
        table = read_study(folder)
        file = file or Path(folder, f"{table.spec.name}.parquet")
        table.write(file)
    return file, table
