"""A folder of runs: one file per finished run, and one per failed run.

    <folder>/<run_id>.parquet         a Record
    <folder>/failures/<run_id>.json   a RunFailure; gone once the run succeeds

Every file appears whole or not at all, so a folder can be read at any time. Several commands may write to one folder:
runs of one specification have equal results, so it does not matter whose file stays.
"""

import json
import os
import traceback
from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

from swarm_forage_env._internal.files import read_json, replacing
from swarm_forage_env.runs.record import Record, RecordError
from swarm_forage_env.runs.spec import RunSpec


@dataclass(frozen=True, kw_only=True, slots=True)
class RunFailure:
    """A run that did not finish, and why."""

    spec: RunSpec
    error: str
    """The exception in one line."""
    traceback: str

    @property
    def run_id(self) -> str:
        """Identity of the run that failed."""
        return self.spec.run_id

    @classmethod
    def of(cls, spec: RunSpec, error: BaseException) -> "RunFailure":
        """Return the failure of a run that raised an error."""
        reason = str(error).splitlines()
        kind = MemoryError if isinstance(error, MemoryError) else type(error)  # numpy has a kind of its own
        return cls(
            spec=spec,
            error=f"{kind.__name__}: {reason[0] if reason else 'no message'}",
            traceback="".join(traceback.format_exception(error)).rstrip(),
        )


def record_file(folder: Path, run_id: str) -> Path:
    """Return where the record of a run is."""
    return folder / f"{run_id}.parquet"


def failure_file(folder: Path, run_id: str) -> Path:
    """Return where the failure of a run is, if it failed."""
    return folder / "failures" / f"{run_id}.json"


def store(folder: Path, result: Record | RunFailure) -> None:
    """Write what became of a run. A record ends the failure of an earlier try."""
    failure = failure_file(folder, result.run_id)
    if isinstance(result, Record):
        result.write(record_file(folder, result.run_id))
        failure.unlink(missing_ok=True)
        return
    content = {
        "run": result.spec.describe(),
        "error": result.error,
        "rerun": f"swarm-forage rerun {failure}",
        "traceback": result.traceback.splitlines(),
        "spec": result.spec.to_mapping(),
    }
    with replacing(failure) as draft:
        draft.write_text(json.dumps(content, indent=1), encoding="utf-8")


def stored_record(folder: Path, spec: RunSpec) -> Record | None:
    """Return the record of a run with the performance that its specification asks for; None if there is none.

    Raises:
        RecordError: the file is damaged, or holds another run than its name says.
    """
    file = record_file(folder, spec.run_id)
    if not file.exists():
        return None
    record = Record.read(file)
    if record.run_id != spec.run_id:
        raise RecordError(f"Expected {file} to hold run {spec.run_id}, got run {record.run_id}; was it renamed?")
    return record.read_as(spec.scenario.performance)


def is_stored(folder: Path, spec: RunSpec) -> bool:
    """Return whether a folder holds the record of a run, undamaged."""
    try:
        return stored_record(folder, spec) is not None
    except RecordError:
        return False


def read_failure(path: str | os.PathLike[str]) -> RunFailure:
    """Read a failure back.

    Raises:
        RecordError: the file is missing or no failure.
    """
    content = read_json(Path(path), RecordError)
    try:
        spec = RunSpec.from_mapping(content["spec"])
        return RunFailure(spec=spec, error=content["error"], traceback="\n".join(content["traceback"]))
    except (KeyError, TypeError, ValueError) as error:
        raise RecordError(f"Cannot read {path}: it is no failure of a run ({error}).") from error


def load(folder: str | os.PathLike[str]) -> tuple[Record, ...]:
    """Return all records in a folder, in the order of their ids.

    Raises:
        RecordError: the folder holds no records, or a Parquet file in it is damaged or no record; the message names it.
    """
    files = sorted(file for file in Path(folder).glob("*.parquet") if not file.name.startswith("."))
    if not files:
        raise RecordError(f"Expected run records (*.parquet) in {folder}, found none.")
    return tuple(map(Record.read, files))


def failure_lines(failures: Iterable[RunFailure]) -> tuple[str, ...]:
    """Return why runs failed, a line per policy and reason: one that cannot run at all fails in all runs alike."""
    alike: dict[tuple[str, ...], list[RunFailure]] = {}
    for failure in failures:
        given = json.dumps(failure.spec.parameters, sort_keys=True)
        alike.setdefault((failure.spec.policy, given, failure.error), []).append(failure)
    return tuple(
        f"{first.spec.describe()}{f', and {len(others):,} more of its runs' if others else ''}: {first.error}"
        for first, *others in alike.values()
    )
