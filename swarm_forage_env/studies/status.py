"""How far a study is, what came of its runs, and what is left of it."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.cost import calibrate, kind_of
from swarm_forage_env.runs.progress import duration
from swarm_forage_env.runs.runner import Outcomes
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE, FAILED, MISSING, STATES
from swarm_forage_env.studies.study import StudySpec
from swarm_forage_env.studies.study_folder import StudyFolder, shard
from swarm_forage_env.studies.study_table import LOSS_COLUMNS, StudyTable

FAILURES_SHOWN = 10
"""Failed runs that are named; the packed file and `to_mapping` have all."""


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyStatus(Answer):
    """Which runs of a study are done, failed and missing."""

    table: StudyTable

    @property
    def is_complete(self) -> bool:
        """Whether every run is done."""
        return all(state.is_complete for state in self.table.place_states())

    @property
    def headline(self) -> str:
        """The study, and how many runs are in which state."""
        spec = self.table.spec
        totals = [sum(state.n_runs[name] for state in self.table.place_states()) for name in STATES]
        return f"{spec.name}, budget {spec.budget}: {_counts(totals)}"

    def sheets(self) -> Sequence[Sheet]:
        """Return how far it is, the conditions that are not complete, and failed runs."""
        spec, versions, states = self.table.spec, self.table.versions, self.table.place_states()
        left = [state for state in states if not state.is_complete]
        lines = [f"{len(states) - len(left):,} of {counted(len(states), 'condition')} complete"]
        if len(versions) > 1:
            lines.append(f"The runs were made by {len(versions)} versions or commits of the packages.")
        sheets = [Sheet(title=self.headline, notes=lines)]
        if left:
            shown = spec.place_words()
            rows = [(*shown[state.place], *(str(state.n_runs[name]) for name in STATES)) for state in left]
            sheets.append(Sheet(header=("rules", "policy", *(axis.name for axis in spec.axes), *STATES), rows=rows))
        failures = self._failures()
        for row in failures[:FAILURES_SHOWN]:
            title = f"failed: {row['policy']}, seed {row['seed']}: {row['error']}"
            sheets.append(Sheet(title=title, notes=[f"  again: {row['rerun']}"]))
        if more := _more(len(failures)):
            sheets[-1] = Sheet(title=sheets[-1].title, notes=[*sheets[-1].notes, *more])
        return sheets

    def to_mapping(self) -> dict[str, Any]:
        """Return the states of all conditions, and all failed runs."""
        return {
            "study": self.table.spec.to_mapping(),
            "versions": list(self.table.versions),
            "conditions": self.table.places().to_dicts(),
            "failures": self._failures(),
        }

    def _failures(self) -> list[dict[str, Any]]:
        lost = self.table.frame.filter(self.table.frame["state"] == FAILED)
        keys = {"run_id": "run_id", "rules": "reading"} | {name: name for name in ("policy", "seed", *LOSS_COLUMNS[1:])}
        return [{key: row[name] for key, name in keys.items()} for row in lost.iter_rows(named=True)]


def status(table: StudyTable) -> StudyStatus:
    """Say how far a study is, from `read_study`."""
    return StudyStatus(table=table)


@dataclass(frozen=True, kw_only=True, eq=False)
class StudyOutcome(Answer):
    """What came of the runs that one call made."""

    outcomes: Outcomes
    folder: StudyFolder

    def sheets(self) -> Sequence[Sheet]:
        """Return how many are done, and how to make each failed one again."""
        files = [str(file) for file in self._failed()]
        lines = [f"  again, alone: swarm-forage rerun {file}" for file in files[:FAILURES_SHOWN]]
        counts = _counts([self.outcomes.count(name) for name in STATES])
        return (Sheet(title=f"{counts}, in {self.folder.folder}", notes=[*lines, *_more(len(files))]),)

    def to_mapping(self) -> dict[str, Any]:
        """Return how many runs are in which state, and the files of the failed ones."""
        counts = {name: self.outcomes.count(name) for name in STATES}
        return {"folder": str(self.folder.folder), "n_runs": counts, "failed": [str(file) for file in self._failed()]}

    def _failed(self) -> list[Any]:
        failed = [run_id for run_id, state in self.outcomes.states.items() if state == FAILED]
        return [self.folder.store.failure_path(run_id) for run_id in failed]


@dataclass(frozen=True, kw_only=True, eq=False)
class WorkLeft(Answer):
    """What is left to run of a study, and how long it takes."""

    spec: StudySpec
    part: tuple[int, int]
    n_planned: int
    workers: int
    runs: Mapping[str, Sequence[RunSpec]]
    """Label of a policy -> its runs."""
    seconds: Mapping[str, float]
    """run_id -> how long it takes one core."""

    @property
    def wall_s(self) -> float:
        """How long all of it takes."""
        return max(sum(self.seconds.values()) / self._busy, *self.seconds.values(), 0.0)

    def sheets(self) -> Sequence[Sheet]:
        """Return one row per policy, and how long it takes."""
        spec, (index, count) = self.spec, self.part
        shares = f", shard {index} of {count}" if count > 1 else ""
        cores = counted(self._busy, "core")
        title = f"{spec.name}, budget {spec.budget}{shares}: {len(self.seconds):,} of {self.n_planned:,} runs to do"
        note = f"about {duration(self.wall_s)} on {cores} as fast as this one is now, and some seconds to start"
        rows = [
            (label, f"{n_runs:,}", f"{ticks:.3g}", _hours(seconds)) for label, n_runs, ticks, seconds in self._rows()
        ]
        header = ("policy", "runs", "robot-ticks", "core-hours")
        return (Sheet(title=title, header=header, rows=rows, notes=(note,)),)

    def to_mapping(self) -> dict[str, Any]:
        """Return the rows, all runs together last."""
        keys = ("policy", "n_runs", "robot_ticks", "core_s")
        return {
            "study": self.spec.to_mapping(),
            "shard": list(self.part),
            "n_planned": self.n_planned,
            "wall_s": self.wall_s,
            "rows": [dict(zip(keys, row, strict=True)) for row in self._rows()],
        }

    @property
    def _busy(self) -> int:
        return min(self.workers, max(1, len(self.seconds)))

    def _rows(self) -> list[tuple[str, int, float, float]]:
        every = [run for runs in self.runs.values() for run in runs]
        return [
            (label, len(runs), sum(run.robot_ticks for run in runs), sum(self.seconds[run.run_id] for run in runs))
            for label, runs in (*self.runs.items(), ("all", every))
        ]


def work_left(
    spec: StudySpec,
    folder: StudyFolder,
    *,
    part: tuple[int, int] = (1, 1),
    workers: int = 1,
    tell: Callable[[str], None] | None = None,
) -> WorkLeft:
    """Say what is left to run of a study, and how long it takes, measured here for a moment.

    Args:
        spec: The study.
        folder: Where its runs are.
        part: As in `run_study`.
        workers: How many runs are made at once.
        tell: Called with words about what is measured.
    """
    planned = {run.run_id: run for run in shard(spec.plan.specs, *part)}
    states = folder.store.look_up(planned.values(), keep=False).states
    todo = {run_id: run for run_id, run in planned.items() if states[run_id] != DONE}
    costs = calibrate(todo.values(), tell=tell or _silent)
    labels = {run.run_id: place.policy for place in spec.places for run in spec.specs_of(place)}
    by_policy: dict[str, list[RunSpec]] = {}
    for run_id, run in todo.items():
        by_policy.setdefault(labels[run_id], []).append(run)
    return WorkLeft(
        spec=spec,
        part=part,
        n_planned=len(planned),
        workers=workers,
        runs=by_policy,
        seconds={run_id: costs[kind_of(run)].seconds(run) for run_id, run in todo.items()},
    )


def _silent(words: str) -> None:
    """Say nothing."""


def _hours(seconds: float) -> str:
    """Hours with two digits behind the point; nobody plans with fewer than 36 s."""
    hours = seconds / 3600.0
    return f"{hours:,.2f}" if hours >= 0.01 or seconds == 0.0 else "<0.01"


def _more(n_failed: int) -> list[str]:
    return [f"  and {n_failed - FAILURES_SHOWN} more"] if n_failed > FAILURES_SHOWN else []


def _counts(numbers: Sequence[int]) -> str:
    done, failed, missing = numbers
    words = [f"{done:,} of {counted(sum(numbers), 'run')} {DONE}"]
    words += [f"{number:,} {state}" for state, number in ((FAILED, failed), (MISSING, missing)) if number]
    return ", ".join(words)
