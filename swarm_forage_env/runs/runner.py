"""Many runs, or a stored one again. Records are stored as runs finish, so what was interrupted can be started again.

found = run_all(specs, out="results/small")                                    # one process per core
found = run_all(specs, out="results/small", executor=client.get_executor())    # on many machines, by Dask
"""

from collections.abc import Callable, Collection, Iterable, Iterator, Mapping
from concurrent.futures import Executor
from contextlib import ExitStack, closing
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import Any, NamedTuple

from rich.console import Console

from swarm_forage_env._internal.fields import checked, instance
from swarm_forage_env._internal.files import check_folder
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.policies.registry import load_policy, local_policy
from swarm_forage_env.runs.progress import progress_bar
from swarm_forage_env.runs.record import Record, RecordError
from swarm_forage_env.runs.run import run_one, run_policy
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import RunFailure, read_failure, store, stored_record
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.runs.workers import each_run, prepare


@dataclass(frozen=True, kw_only=True, slots=True)
class Outcomes:
    """What became of planned runs."""

    records: Mapping[str, Record]
    """run_id -> record of the runs that finished, in their order; empty where they are kept in a folder alone."""
    failures: Mapping[str, RunFailure]
    """run_id -> why a run failed."""
    n_done: int
    """How many runs finished, now or before."""
    n_stored: int
    """How many of them had been stored before and were not run again."""


def run_all(
    specs: Iterable[RunSpec],
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool = True,
    keep: bool = True,
    made_here: Mapping[str, Callable[..., Any]] | None = None,
) -> Outcomes:
    """Make every run once, the longest first, and return what became of them.

    Args:
        specs: What to run; equal ones count once. So do those that differ in performance alone, read as the last asks.
        out: Folder for records and failures. Runs that it holds are read, not repeated; failed ones are tried again,
            and so are those whose file is damaged. Default: nothing is stored.
        jobs: Processes, default one per available core; 1 = in this process.
        executor: Makes the runs instead, for example Dask's `client.get_executor()`. It is not shut down.
        progress: Show progress, an estimate and damaged files on stderr.
        keep: Return the records; without it they are in `out` alone, for studies larger than memory.
        made_here: Policy of specifications -> what builds it, where only this process can; they run here, at last.

    Raises:
        ConfigError: `jobs` is no number of processes.
        OSError: `out` cannot be written to; then nothing has been run, or what was stored before is kept.
        KeyboardInterrupt: Ctrl-C; it says how many runs are kept.
        WorkerError: see there; what had finished is kept.
    """
    instance("specs", specs, Iterable, hint="; plan_run makes one of them, Plan.product(...).specs are many")
    if executor is not None:
        instance("executor", executor, Executor, hint="; jobs= sets the number of processes")
    wanted = {checked("a run", spec, RunSpec).run_id: spec for spec in specs}
    folder, here = None if out is None else Path(out), made_here or {}
    records, failures, done = dict[str, Record](), dict[str, RunFailure](), set[str]()

    def finished(record: Record) -> None:
        done.add(record.run_id)
        if keep:
            records[record.run_id] = record

    try:
        for record in _stored(wanted.values(), folder, tell=progress) if folder is not None else ():
            finished(record)
        n_stored = len(done)
        todo = longest_first(spec for run_id, spec in wanted.items() if run_id not in done)
        if folder is not None and todo:
            check_folder(folder)
        apart = [spec for spec in todo if spec.policy not in here]
        robot_ticks = 0
        with (
            ExitStack() as names,
            progress_bar("runs", sum(spec.robot_ticks for spec in todo), shown=progress and bool(todo)) as tell,
            closing(each_run(_tried, apart, jobs=jobs, executor=executor)) as made,
        ):
            for name, factory in here.items():
                names.enter_context(local_policy(name, factory))
            made_last = each_run(_tried_here, [spec for spec in todo if spec.policy in here], jobs=1)
            for spec, result in chain(made, made_last):
                if folder is not None:
                    store(folder, result)
                if isinstance(result, RunFailure):
                    failures[spec.run_id] = result
                else:
                    finished(result)
                robot_ticks += spec.robot_ticks
                failed = f", {len(failures)} failed" if failures else ""
                tell(robot_ticks, text=f"{len(done) + len(failures)}/{len(wanted)} runs{failed}")
    except KeyboardInterrupt as interrupt:
        kept = "" if folder is None else f" They are in {folder}; the same command does the rest."
        told = f"Interrupted: {len(done)} of {counted(len(wanted), 'run')} are finished.{kept}"
        raise type(interrupt)(told) from None
    in_order = {run_id: records[run_id] for run_id in wanted if run_id in records}
    return Outcomes(records=in_order, failures=failures, n_done=len(done), n_stored=n_stored)


def longest_first(specs: Iterable[RunSpec]) -> tuple[RunSpec, ...]:
    """Return the runs with the most robot-ticks first, so that no long run is left alone at the end.

    Of equal ones those with the least seed come first, so that a run of each policy soon says how long they take.
    """
    return tuple(sorted(specs, key=lambda spec: (-spec.robot_ticks, spec.seed)))


def _tried_here(spec: RunSpec) -> Record | RunFailure:
    """Make a run of a policy that only this process has, which acts in its runs and nowhere else."""
    return _tried(spec, replace(spec, policy="random", parameters={}))


def _tried(spec: RunSpec, like: RunSpec | None = None) -> Record | RunFailure:
    """Make a run; one that fails does not end the others."""
    prepare(like or spec)
    try:
        return run_one(spec)
    except Exception as error:  # noqa: BLE001 - whatever a run raises is its failure
        return RunFailure.of(spec, error)


def _stored(specs: Collection[RunSpec], folder: Path, *, tell: bool) -> Iterator[Record]:
    """Yield the records that a folder holds, and say at last what is odd about them."""
    n_found, n_foreign, damaged = 0, 0, list[str]()
    for spec in specs:
        try:
            record = stored_record(folder, spec)
        except RecordError as error:
            damaged.append(str(error))
            continue
        if record is not None:
            n_found += 1
            n_foreign += not record.made_by(software_versions())
            yield record
    console = Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True, quiet=not tell)
    if n_found:
        other = f", {n_foreign:,} by other code or versions (give another folder to run them afresh)" * bool(n_foreign)
        console.print(f"{n_found:,} of {counted(len(specs), 'run')} stored already{other}.")
    if damaged:
        more = f" So are those of {len(damaged) - 1} more files." if len(damaged) > 1 else ""
        console.print(f"{damaged[0]} Its run is made again.{more}")


class Rerun(NamedTuple):
    """What came out when a stored run was made again."""

    record: Record
    is_same: bool | None
    """Whether the results are those in the file, bit for bit; None where the run had failed."""


def rerun(file: str | Path) -> Rerun:
    """Make a stored run again, in this process.

    Args:
        file: A record (.parquet) or a failure (.json).

    Raises:
        RecordError: no such file, another content, or a policy that is not here, has changed or is not trusted.
        Exception: whatever a run that had failed raises again.
    """
    path = Path(checked("file", file, str | Path))
    stored = read_failure(path) if path.suffix == ".json" else Record.read(path)
    try:
        policy = load_policy(stored.spec.policy, stored.spec.parameters)
    except ValueError as error:
        raise RecordError(f"Cannot run {path} again: {error}") from error
    again = run_policy(policy, stored.spec)
    return Rerun(again, again.equals(stored) if isinstance(stored, Record) else None)
