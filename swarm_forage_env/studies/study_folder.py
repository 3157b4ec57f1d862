"""Running a study: what its folder holds, which runs are missing, and how to make them.

    <folder>/study.json     the study (`StudySpec.to_mapping`)
    <folder>/runs/          its runs and failures, see `store`
    <folder>/<name>.parquet all runs in one file, see `study_table`

Several machines can fill a folder, each with a shard. Folders of shards can also be copied into one.
"""

import errno
import json
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from pathlib import Path

from swarm_forage_env._internal.fields import ConfigError, whole
from swarm_forage_env._internal.files import alone_in, parse_json, replacing
from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.runs.runner import Outcomes, longest_first, run_all
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import FAILED, MISSING, STATES, state_of
from swarm_forage_env.studies.study import RULES_NAMES, Place, StudySpec


@dataclass(frozen=True, kw_only=True, slots=True)
class PlaceState:
    """How many runs of a condition are in which state."""

    place: Place
    n_runs: Mapping[str, int]
    """State -> number of runs in it."""

    @property
    def is_complete(self) -> bool:
        """Whether every run of the condition is recorded."""
        return not (self.n_runs[FAILED] or self.n_runs[MISSING])


class StudyFolder:
    """The folder of a study; it is created by `take`."""

    def __init__(self, folder: str | Path) -> None:
        """Use `folder`.

        Raises:
            NotADirectoryError: a file has this name.
        """
        self.folder = Path(folder)
        if self.folder.exists() and not self.folder.is_dir():
            raise NotADirectoryError(errno.ENOTDIR, "Expected a folder for a study, got a file", str(self.folder))
        self.runs = self.folder / "runs"
        self.study_file = self.folder / "study.json"

    def study(self) -> StudySpec:
        """Return the study that the folder holds.

        Raises:
            RecordError: the folder does not hold a study, or the file of the study is damaged.
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
        """Make it the folder of a study. If it holds a study that differs in seeds and rules alone, the two are joined.

        Returns:
            The study that the folder holds now.

        Raises:
            RecordError: the folder holds another study.
        """
        with alone_in(self.folder):  # shards on several machines add their seeds, one after the other
            kept = self.joined(spec) if self.study_file.exists() else spec
            with replacing(self.study_file) as draft:
                draft.write_text(json.dumps(kept.to_mapping(), indent=1), encoding="utf-8")
        return kept

    def joined(self, spec: StudySpec) -> StudySpec:
        """Return the study that the folder would hold, if `take` added one; writes nothing.

        Raises:
            RecordError: the folder holds another study, or none.
        """
        there = self.study()
        kept = replace(
            spec,
            seeds=tuple(sorted({*there.seeds, *spec.seeds})),
            rules=tuple(name for name in RULES_NAMES if name in {*there.rules, *spec.rules}),
            looks=spec.looks or there.looks,
        )
        mine, other = kept.to_mapping(), there.to_mapping()
        told = ("seeds", "rules", "title", "budget", "file", *(() if there.looks else ("looks",)))
        differing = [key for key in mine if key not in told and mine[key] != other[key]]
        if differing:
            raise RecordError(
                f"Expected study {there.name} as {self.study_file} has it, got one of other {differing[0]}. Give "
                f"another folder, or remove {self.study_file.name}: runs that both studies have are kept."
            )
        return kept

    def place_states(self) -> tuple[PlaceState, ...]:
        """Return how many runs of each condition are in which state."""
        spec = self.study()
        return tuple(
            place_state(place, (state_of(self.runs, run) for run in spec.specs_of(place))) for place in spec.places
        )


def place_state(place: Place, states: Iterable[str]) -> PlaceState:
    """Count the states of a condition's runs."""
    counted = Counter(states)
    return PlaceState(place=place, n_runs={state: counted[state] for state in STATES})


def shard(specs: Sequence[RunSpec], index: int, count: int) -> tuple[RunSpec, ...]:
    """Return a part of the runs; the parts are disjoint, together have all runs, and take about equally long.

    Args:
        specs: All runs, in the same order on every machine.
        index: Number of the part, from 1.
        count: Number of parts.

    Raises:
        ConfigError: there is no such part.
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
) -> Outcomes:
    """Make the missing runs of a study; the function stores their records in the folder and does not return them.

    It reads the runs that the folder holds, and makes damaged and failed ones again. Ctrl-C stops the current runs and
    keeps the finished ones, so the same call then does the rest.

    Args:
        spec: The study.
        folder: Folder of the study.
        part: Index from 1 and number of shards; the call makes the runs of this shard only.
        jobs: As in `runs.runner.run_all`, like all further arguments.
        executor: Runs the work instead; the call does not shut it down.
        progress: Show progress, an estimate and damaged files on stderr.

    Returns:
        How the runs of the shard ended.

    Raises:
        ConfigError: there is no such shard.
        RecordError: the folder holds another study.
        KeyboardInterrupt: Ctrl-C.
        WorkerError: no worker process could be started.
    """
    planned = shard(spec.plan.specs, *part)
    folder.take(spec)
    return run_all(planned, out=folder.runs, jobs=jobs, executor=executor, progress=progress, keep=False)


def parse_shard(word: str) -> tuple[int, int]:
    """Turn "2/8" into (2, 8).

    Raises:
        ConfigError: not two whole numbers, or a shard that does not exist.
    """
    index, _, count = word.partition("/")
    try:
        part = int(index), int(count)
    except ValueError as error:
        raise ConfigError(f"Expected a shard as 2/8, the second of eight, got {word!r}.") from error
    shard((), *part)
    return part
