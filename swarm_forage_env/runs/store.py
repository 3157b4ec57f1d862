"""RunStore: a folder with one file per finished run, and one per failed run.

    <folder>/<run_id>.parquet         a RunRecord
    <folder>/failures/<run_id>.json   a RunFailure; gone once the run succeeds

Every file appears whole or not at all, so a folder can be read at any time. Several commands may write to one folder:
runs of one specification have equal results, so it does not matter whose file stays.
"""

import errno
import json
import os
from collections.abc import Iterable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import parse_json, replacing
from swarm_forage_env.runs.record import RecordError, RunRecord
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.versions import software_versions

DONE, FAILED, MISSING = "done", "failed", "missing"
STATES = (DONE, FAILED, MISSING)
"""What a planned run is: recorded; tried in vain; not there, or its file is damaged."""
FAILURES = "failures"
"""Name of the sub-folder for failed runs."""
DAMAGED = ".damaged"
"""What is added to the name of a file that cannot be used when its run is made again."""
_WAY_OUT = "Move the file away, and its run will be made again."


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


def failed_alike(failures: Iterable[RunFailure]) -> tuple[tuple[RunFailure, ...], ...]:
    """Return runs that failed, those together that a policy failed in for one reason."""
    found: dict[tuple[str, ...], list[RunFailure]] = {}
    for failure in failures:
        policy, given = failure.spec.policy, json.dumps(failure.spec.parameters, sort_keys=True)
        found.setdefault((policy, given, failure.error), []).append(failure)
    return tuple(map(tuple, found.values()))


def failure_lines(failures: Iterable[RunFailure]) -> tuple[str, ...]:
    """Return why runs failed, a line per policy and reason: one that cannot run at all fails in all runs alike."""
    return tuple(_failure_line(*alike) for alike in failed_alike(failures))


def _failure_line(first: RunFailure, *others: RunFailure) -> str:
    more = f", and {len(others):,} more of its runs" if others else ""
    return f"{first.spec.describe()}{more}: {first.error}"


@dataclass(frozen=True, kw_only=True, slots=True)
class StoredRuns:
    """What a store holds of planned runs."""

    states: Mapping[str, str] = field(default_factory=dict[str, str])
    """run_id -> one of `STATES`, of every planned run."""
    records: Mapping[str, RunRecord] = field(default_factory=dict[str, RunRecord])
    """run_id -> record, read with the performance that its specification asks for."""
    damaged: Mapping[str, str] = field(default_factory=dict[str, str])
    """run_id of a run whose file cannot be used -> why; it counts as missing."""
    n_foreign: int = 0
    """Runs that other code or other versions of the packages made."""


class RunStore:
    """Records and failures in a folder; the folder is created by the first write."""

    def __init__(self, folder: str | os.PathLike[str]) -> None:
        """Use `folder`.

        Raises:
            NotADirectoryError: there is a file of that name.
        """
        self.folder = Path(folder)
        if self.folder.exists() and not self.folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "Expected a folder for run records, got a file", str(self.folder))

    def path(self, run_id: str) -> Path:
        """Return where the record of a run is, or would be."""
        return self.folder / f"{run_id}.parquet"

    def failure_path(self, run_id: str) -> Path:
        """Return where the failure of a run is, or would be."""
        return self.folder / FAILURES / f"{run_id}.json"

    def __contains__(self, run_id: str) -> bool:
        return self.path(run_id).is_file()

    def run_ids(self) -> tuple[str, ...]:
        """Return the ids of all finished runs, sorted."""
        return tuple(sorted(file.stem for file in self.folder.glob("*.parquet") if not file.name.startswith(".")))

    def read(self, run_id: str) -> RunRecord:
        """Return a stored record.

        Raises:
            RecordError: the file is missing, damaged, no record, or holds another run than its name says.
        """
        path = self.path(run_id)
        try:
            record = RunRecord.read(path)
        except RecordError as error:
            raise RecordError(f"{error} {_WAY_OUT}" if path.exists() else str(error)) from error
        if record.run_id != run_id:
            raise RecordError(
                f"Expected {path} to hold run {run_id}, got run {record.run_id}; was the file renamed? {_WAY_OUT}"
            )
        return record

    def look_up(self, planned: Iterable[RunSpec], *, keep: bool = True) -> StoredRuns:
        """Read the files of planned runs and say what is there.

        Args:
            planned: The runs.
            keep: Return the records, too.
        """
        states: dict[str, str] = {}
        records: dict[str, RunRecord] = {}
        damaged: dict[str, str] = {}
        n_foreign = 0
        versions = software_versions()
        for spec in planned:
            run_id = spec.run_id
            states[run_id] = MISSING
            if run_id in self:
                try:
                    record = self.read(run_id)
                except RecordError as error:
                    damaged[run_id] = str(error).removesuffix(f" {_WAY_OUT}")  # whoever asks does
                    continue
                states[run_id] = DONE
                n_foreign += not record.made_by(versions)
                if keep:
                    records[run_id] = record.read_as(spec.scenario.performance)
            elif self.failure_path(run_id).exists():
                states[run_id] = FAILED
        return StoredRuns(states=states, records=records, damaged=damaged, n_foreign=n_foreign)

    def write(self, record: RunRecord) -> None:
        """Store a record; an earlier failure of the same run is removed."""
        self.folder.mkdir(parents=True, exist_ok=True)
        record.write(self.path(record.run_id))
        self.failure_path(record.run_id).unlink(missing_ok=True)

    def put_aside(self, run_id: str) -> None:
        """Rename a damaged file, so that nothing is lost by making its run again."""
        path = self.path(run_id)
        with suppress(FileNotFoundError):  # another command has done it
            path.replace(path.with_suffix(f"{path.suffix}{DAMAGED}"))

    def write_failure(self, failure: RunFailure) -> None:
        """Store why a run failed, with the command that runs it again."""
        path = self.failure_path(failure.run_id)
        path.parent.mkdir(parents=True, exist_ok=True)
        content = {
            "run": failure.spec.describe(),
            "error": failure.error,
            "rerun": f"swarm-forage rerun {path}",
            "traceback": failure.traceback.splitlines(),
            "spec": failure.spec.to_mapping(),
        }
        with replacing(path) as draft:
            draft.write_text(json.dumps(content, indent=1), encoding="utf-8")

    def records(self) -> Iterator[RunRecord]:
        """Read all records, in the order of their ids; raises as `read`."""
        return (self.read(run_id) for run_id in self.run_ids())

    def failures(self) -> tuple[RunFailure, ...]:
        """Return the runs that failed and have not succeeded since.

        Raises:
            RecordError: a file in the failures folder is no failure.
        """
        files = sorted((self.folder / FAILURES).glob("*.json"))
        return tuple(read_failure(file) for file in files if not file.name.startswith("."))


def read_failure(path: str | os.PathLike[str]) -> RunFailure:
    """Read a failure back.

    Raises:
        RecordError: the file is missing or no failure.
    """
    try:
        content = parse_json(Path(path).read_text(encoding="utf-8"))
        spec = RunSpec.from_mapping(content["spec"])
        return RunFailure(spec=spec, error=content["error"], traceback="\n".join(content["traceback"]))
    except OSError as error:
        raise RecordError(f"Cannot read {path}: {error.strerror or error}.") from error
    except (ConfigError, KeyError, TypeError, ValueError) as error:
        raise RecordError(f"Cannot read {path}: it is no failure of a run ({error}).") from error


def load(folder: str | os.PathLike[str]) -> tuple[RunRecord, ...]:
    """Return all records in a folder, in the order of their ids.

    Raises:
        RecordError: the folder holds no records, or a Parquet file in it is damaged or no record; the message names it.
    """
    store = RunStore(folder)
    records = tuple(store.records())
    if not records:
        raise RecordError(f"Expected run records (*.parquet) in {store.folder}, found none.")
    return records
