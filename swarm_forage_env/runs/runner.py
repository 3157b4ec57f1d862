"""Many runs, or a stored one again. Records are stored as runs finish, so what was interrupted can be started again.

The default is a pool of local processes. For several machines, pass another executor, for example Dask's
`Client.get_executor()`; the code is the same.
"""

from collections.abc import Iterable, Mapping
from concurrent.futures import (
    Executor,
)
from contextlib import closing, nullcontext
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.policies.registry import load_policy, local_policy, policy_class
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.progress import RunProgress
from swarm_forage_env.runs.record import RecordError, RunRecord
from swarm_forage_env.runs.run import run_one, run_policy
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE, FAILED, MISSING, RunFailure, RunStore, StoredRuns, read_failure
from swarm_forage_env.runs.table import Table
from swarm_forage_env.runs.workers import processes_of, run_each


class RunsInterrupted(KeyboardInterrupt):
    """Ctrl-C during `run_specs` or `run_plan`; `result` holds what had finished by then."""

    def __init__(self, result: "Outcomes", n_planned: int) -> None:
        """Remember what was kept of `n_planned` runs."""
        super().__init__(f"Interrupted: {result.count(DONE)} of {n_planned} runs are finished and kept.")
        self.result = result


@dataclass(frozen=True, slots=True)
class Outcomes:
    """What became of planned runs, in their order."""

    states: Mapping[str, str]
    """run_id -> one of `store.STATES`, of every planned run."""
    records: Mapping[str, RunRecord]
    """run_id -> record of the runs that finished; empty where they are kept in a store alone."""
    failures: Mapping[str, RunFailure]
    """run_id -> why a run failed just now."""
    n_stored: int = 0
    """How many finished runs had been stored before and were not run again."""

    def count(self, state: str) -> int:
        """Return how many runs are in a state."""
        return sum(found == state for found in self.states.values())


def run_plan(
    plan: Plan,
    *,
    store: RunStore | None = None,
    executor: Executor | None = None,
    jobs: int | None = None,
    progress: bool = False,
) -> Table:
    """Make the runs of a plan and return them as a table.

    Args:
        plan: What to run. Policies that only this process can build run here, after all others.
        store: As in `run_specs`, and so are all further arguments.
        executor: Runs the work; default a pool of local processes.
        jobs: Processes of the default pool.
        progress: Show progress and an estimate on stderr.

    Raises:
        ValueError: a store, and a policy without a name by which its runs are found again.
        RunsInterrupted: Ctrl-C; finished runs are kept, the others cancelled.
        OSError: see `run_specs`, and so for WorkerError.
    """
    unnamed = [policy.label for policy in plan.policies if not policy.is_named]
    if store is not None and unnamed:
        raise ValueError(
            f"Expected name= for the policy {unnamed[0]}, by which its runs in {store.folder} are found again."
        )
    by_policy: dict[str, list[RunSpec]] = {}
    for condition in plan.conditions:
        made_here = condition.policy.label if condition.policy.factory is not None else ""
        by_policy.setdefault(made_here, []).extend(plan.specs_of(condition))
    factories = {policy.label: policy for policy in plan.policies}
    found: list[Outcomes] = []
    for label in sorted(by_policy, key=bool):  # those that are found by name first
        policy = factories.get(label)
        here = nullcontext() if policy is None or policy.factory is None else local_policy(label, policy.factory)
        with here:
            elsewhere, processes = (None, 1) if label else (executor, jobs)
            specs = by_policy[label]
            found.append(run_specs(specs, store=store, executor=elsewhere, jobs=processes, progress=progress))
    return Table(
        plan=plan,
        records={run_id: record for one in found for run_id, record in one.records.items()},
        failures={run_id: failure for one in found for run_id, failure in one.failures.items()},
        n_stored=sum(one.n_stored for one in found),
        folder=None if store is None else store.folder,
    )


def run_specs(
    specs: Iterable[RunSpec],
    *,
    store: RunStore | None = None,
    executor: Executor | None = None,
    jobs: int | None = None,
    progress: bool = False,
    keep: bool = True,
) -> Outcomes:
    """Run every specification once, the longest first, and return what became of them.

    Args:
        specs: What to run; equal ones count once. So do those that differ in performance alone, read as the last asks.
        store: Where records and failures go as they happen. Runs it already holds are read, not repeated, and have
            the performance that their specification asks for; failed ones are tried again, and so are those whose file
            is damaged, which is put aside.
        executor: Runs the work; default a pool of local processes. It is not shut down.
        jobs: Processes of the default pool, default one per available core; 1 = in this process.
        progress: Show progress, an estimate and damaged files on stderr.
        keep: Return the records, too; without it they are in the store alone, for studies larger than memory.

    Raises:
        OSError: the store cannot be written to; then nothing has been run, or what was stored before is kept.
        RunsInterrupted: Ctrl-C; finished runs are kept, the others cancelled.
        WorkerError: no worker process could be started.
    """
    planned = {spec.run_id: spec for spec in specs}
    stored = StoredRuns() if store is None else store.look_up(planned.values(), keep=keep)
    states = {run_id: stored.states.get(run_id, MISSING) for run_id in planned}
    records, failures = dict(stored.records), dict[str, RunFailure]()
    todo = longest_first(spec for run_id, spec in planned.items() if states[run_id] != DONE)
    n_stored = len(planned) - len(todo)

    def result() -> Outcomes:
        in_order = {run_id: records[run_id] for run_id in planned if run_id in records}
        return Outcomes(states=states, records=in_order, failures=failures, n_stored=n_stored)

    for run_id in stored.damaged:
        assert store is not None, "only a store has files"
        store.put_aside(run_id)
    shown = RunProgress(
        todo,
        n_stored=n_stored,
        n_foreign=stored.n_foreign,
        damaged=tuple(stored.damaged.values()),
        n_processes=None if executor is not None else processes_of(len(todo), jobs),
    )
    try:
        # Closing ends the workers at once, wherever the interrupt came.
        fresh = run_each(todo, store=store, executor=executor, jobs=jobs)
        with shown if progress else nullcontext(), closing(fresh):
            for outcome in fresh:
                states[outcome.run_id] = FAILED if isinstance(outcome, RunFailure) else DONE
                if isinstance(outcome, RunFailure):
                    failures[outcome.run_id] = outcome
                elif keep:
                    records[outcome.run_id] = outcome
                if progress:
                    shown.advance(planned[outcome.run_id], None if isinstance(outcome, RunFailure) else outcome)
    except KeyboardInterrupt:
        raise RunsInterrupted(result(), len(planned)) from None
    return result()


def longest_first(specs: Iterable[RunSpec]) -> tuple[RunSpec, ...]:
    """Return the runs with the most robot-ticks first, so that no long run is left alone at the end."""
    return tuple(sorted(specs, key=lambda spec: -spec.robot_ticks))


@dataclass(frozen=True, kw_only=True, eq=False)
class Rerun(Answer):
    """What came out when a stored run was made again."""

    record: RunRecord
    file: Path
    """Of the record, or the failure."""
    is_same: bool | None
    """Whether the results are those in the file, bit for bit; None where the run had failed."""

    def sheets(self) -> tuple[Sheet, ...]:
        """Return a text: the run, and whether it is the same."""
        same = {True: f"bit for bit the same as {self.file}", False: f"the results differ from those in {self.file}"}
        return (Sheet(notes=[self.record.describe(), *([] if self.is_same is None else [same[self.is_same]])]),)

    def to_mapping(self) -> dict[str, Any]:
        """Return what the run is, and whether it is the same."""
        return {**self.record.keys(), "file": str(self.file), "is_same": self.is_same}


def rerun(file: str | Path) -> Rerun:
    """Make a stored run again, in this process.

    Args:
        file: A record (.parquet) or a failure (.json).

    Raises:
        RecordError: no such file, another content, or a failure of a policy that is not installed here.
        ConfigError: the policy of a record is not installed here, or its file has gone or changed.
        Exception: whatever a run that had failed raises again.
    """
    path = Path(file)
    if path.suffix == ".json":
        failed = read_failure(path).spec
        try:
            policy_class(failed.policy)
        except ConfigError:  # a file that is not trusted
            raise
        except ValueError as error:
            raise RecordError(f"Cannot run {path} again: {error}") from error
        return Rerun(record=run_one(failed), file=path, is_same=None)
    stored = RunRecord.read(path)
    spec = RunSpec.from_json(stored.spec)
    try:
        policy = load_policy(spec.policy, spec.parameters)
    except ValueError as error:
        raise ConfigError(f"Cannot run {path} again: {error}") from error
    again = run_policy(policy, spec)
    return Rerun(record=again, file=path, is_same=again.same_results(stored))
