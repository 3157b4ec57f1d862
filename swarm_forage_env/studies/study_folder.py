"""Running a study: what its folder holds, which runs are left to do, and doing them.

    <folder>/study.json     the study (`StudySpec.to_mapping`)
    <folder>/runs/          its runs and failures, see `store`
    <folder>/<name>.parquet all runs in one file, see `study_table`

A folder can be filled by several machines, each with a shard, and copied together.
"""

import errno
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from contextlib import closing, nullcontext
from dataclasses import dataclass, replace
from pathlib import Path

from swarm_forage_env._internal.fields import ConfigError, whole
from swarm_forage_env._internal.files import replacing
from swarm_forage_env._internal.parsing import parse_json
from swarm_forage_env.runs.progress import RunProgress
from swarm_forage_env.runs.record import RecordError, software_versions
from swarm_forage_env.runs.runner import processes_of, run_each, seconds_of
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import RunFailure, RunStore
from swarm_forage_env.studies.study import READING_NAMES, Cell, StudySpec

DONE, FAILED, MISSING = "done", "failed", "missing"
STATES = (DONE, FAILED, MISSING)
"""What a planned run is: recorded; tried in vain; not there, or its file is damaged."""
BATCH_ROBOT_TICKS = 20_000_000
"""How much an executor of several machines gets as one task: ten seconds or more, much longer than sending it takes."""


@dataclass(frozen=True, kw_only=True, slots=True)
class CellState:
    """How far a cell is."""

    cell: Cell
    n_runs: Mapping[str, int]
    """State -> how many runs are in it."""

    @property
    def is_complete(self) -> bool:
        """Whether every run of the cell is recorded."""
        return not (self.n_runs[FAILED] or self.n_runs[MISSING])


@dataclass(frozen=True, kw_only=True, slots=True)
class StudyState:
    """What is there of the runs of a study."""

    states: Mapping[str, str]
    """run_id -> one of `STATES`, of every planned run."""
    damaged: Mapping[str, str]
    """run_id of a run whose file cannot be used -> why; it counts as missing."""
    n_foreign: int = 0
    """Runs that another version or commit of the packages made."""

    def count(self, state: str) -> int:
        """Return how many runs are in a state."""
        return sum(1 for found in self.states.values() if found == state)


class StudyFolder:
    """The folder of a study; it is created by `take`."""

    def __init__(self, folder: str | Path) -> None:
        """Use `folder`.

        Raises:
            NotADirectoryError: there is a file of that name.
        """
        self.folder = Path(folder)
        if self.folder.exists() and not self.folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "Expected a folder for a study, got a file", str(self.folder))
        self.store = RunStore(self.folder / "runs")
        self.study_file = self.folder / "study.json"

    def study(self) -> StudySpec:
        """Return the study that the folder holds.

        Raises:
            RecordError: it holds none, or its file is damaged.
        """
        try:
            return StudySpec.from_mapping(parse_json(self.study_file.read_text(encoding="utf-8")))
        except OSError as error:
            raise RecordError(
                f"Expected the folder of a study, got {self.folder} without {self.study_file.name}."
            ) from error
        except ValueError as error:
            raise RecordError(f"Cannot use {self.study_file}: {error}") from error

    def take(self, spec: StudySpec) -> StudySpec:
        """Make it the folder of a study; a study that differs in seeds and readings alone is added to the one there.

        Returns:
            The study that the folder holds now.

        Raises:
            RecordError: the folder holds another study.
        """
        kept = spec
        if self.study_file.exists():
            there = self.study()
            kept = replace(
                spec,
                seeds=tuple(sorted({*there.seeds, *spec.seeds})),
                readings=tuple(name for name in READING_NAMES if name in {*there.readings, *spec.readings}),
            )
            mine, other = kept.to_mapping(), there.to_mapping()
            told = ("seeds", "readings", "title", "budget", "file")
            differing = [key for key in mine if key not in told and mine[key] != other[key]]
            if differing:
                raise RecordError(
                    f"Expected study {there.name} as {self.study_file} has it, got one of other {differing[0]}. Give "
                    f"another folder, or remove {self.study_file.name}: runs that both studies have are kept."
                )
        self.folder.mkdir(parents=True, exist_ok=True)
        with replacing(self.study_file) as draft:
            draft.write_text(json.dumps(kept.to_mapping(), indent=1), encoding="utf-8")
        return kept

    def state(self, planned: Iterable[str]) -> StudyState:
        """Read every file of the planned runs and say what is there.

        Args:
            planned: Their run_ids.
        """
        states: dict[str, str] = {}
        damaged: dict[str, str] = {}
        n_foreign = 0
        versions = software_versions()
        for run_id in planned:
            states[run_id] = MISSING
            if run_id in self.store:
                try:
                    n_foreign += not self.store.read(run_id).made_by(versions)
                    states[run_id] = DONE
                except RecordError as error:
                    damaged[run_id] = str(error)
            elif self.store.failure_path(run_id).exists():
                states[run_id] = FAILED
        return StudyState(states=states, damaged=damaged, n_foreign=n_foreign)

    def cell_states(self) -> tuple[CellState, ...]:
        """Return how far each cell of the study is."""
        spec = self.study()
        run_ids = {cell: [run.run_id for run in spec.specs_of(cell)] for cell in spec.cells}
        states = self.state(run_id for ids in run_ids.values() for run_id in ids).states
        return tuple(cell_state(cell, (states[run_id] for run_id in ids)) for cell, ids in run_ids.items())


def cell_state(cell: Cell, states: Iterable[str]) -> CellState:
    """Count the states of a cell's runs."""
    counted = Counter(states)
    return CellState(cell=cell, n_runs={state: counted[state] for state in STATES})


def longest_first(specs: Iterable[RunSpec]) -> tuple[RunSpec, ...]:
    """Return the runs with the most robot-ticks first, so that no long run is left alone at the end."""
    return tuple(sorted(specs, key=lambda spec: -spec.robot_ticks))


def shard(specs: Sequence[RunSpec], index: int, count: int) -> tuple[RunSpec, ...]:
    """Return a part of the runs; the parts of all indices are disjoint, complete and equally much work.

    Args:
        specs: All runs, in the same order on every machine.
        index: Which part, from 1.
        count: How many parts there are.

    Raises:
        ConfigError: no such part.
    """
    whole("the number of shards", count, at_least=1)
    whole("the shard", index, at_least=1, at_most=count)
    return tuple(longest_first(specs)[index - 1 :: count])


def run_study(
    spec: StudySpec,
    folder: StudyFolder,
    *,
    part: tuple[int, int] = (1, 1),
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool = False,
) -> StudyState:
    """Run what is missing of a study, long runs first; every finished run is stored at once.

    Runs that are there are read, and skipped if they are whole; damaged and failed ones are made again. Ctrl-C ends the
    runs under way and leaves all others stored, so that the same call does the rest.

    Args:
        spec: The study.
        folder: Where it goes.
        part: Index from 1 and number of shards; only the runs of this shard are made.
        jobs: Local processes; default one per available core, 1 = in this process.
        executor: Runs the work instead; it is not shut down.
        progress: Show progress, an estimate and damaged files on stderr.

    Returns:
        What is there of the shard's runs now.

    Raises:
        ConfigError: no such shard.
        RecordError: the folder holds another study.
        WorkerError: no worker process could be started.
    """
    planned = {run.run_id: run for run in shard(spec.expand(), *part)}
    folder.take(spec)
    before = folder.state(planned)
    states = dict(before.states)
    todo = [run for run_id, run in planned.items() if states[run_id] != DONE]
    n_done = len(planned) - len(todo)
    display = (
        RunProgress(
            total=len(planned),
            done=n_done,
            foreign=before.n_foreign,
            damaged=tuple(before.damaged.values()),
            work=sum(run.robot_ticks for run in todo),
            n_processes=None if executor is not None else processes_of(len(todo), jobs),
        )
        if progress
        else nullcontext()
    )
    outcomes = run_each(todo, store=folder.store, executor=executor, jobs=jobs, batch_robot_ticks=BATCH_ROBOT_TICKS)
    with display as shown, closing(outcomes):
        for outcome in outcomes:
            is_failure = isinstance(outcome, RunFailure)
            states[outcome.run_id] = FAILED if is_failure else DONE
            if shown is not None:
                work = planned[outcome.run_id].robot_ticks
                shown.advance(failed=is_failure, work=work, took_s=seconds_of(outcome))
    return StudyState(states=states, damaged={}, n_foreign=before.n_foreign)


def parse_shard(word: str) -> tuple[int, int]:
    """Turn "2/8" into (2, 8).

    Raises:
        ConfigError: no two whole numbers, or a shard that is not among them.
    """
    index, _, count = word.partition("/")
    try:
        part = int(index), int(count)
    except ValueError as error:
        raise ConfigError(f"Expected a shard as 2/8, the second of eight, got {word!r}.") from error
    shard((), *part)
    return part
