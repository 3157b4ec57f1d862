"""Studies that run until the claims of the paper are decided: the next runs go where an open claim needs fewest.

Every line, a policy over the last axis under one of the rules, first gets the runs of the first look. Then claims are
judged. Each that stays open has a forecast of the runs that decide it, and the cheapest get the runs of the next look.
Looks and levels are those of `claims.looks`. All is in the folders: after Ctrl-C, and when the time is over, the same
call goes on.
"""

import math
import time
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from typing import TYPE_CHECKING

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.runs.cost import MeasuredCost, duration, kind_of
from swarm_forage_env.runs.plan_summary import measured_costs
from swarm_forage_env.runs.record import RecordError, RunRecord
from swarm_forage_env.runs.runner import run_specs
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE
from swarm_forage_env.runs.workers import processes_of
from swarm_forage_env.studies.study_folder import StudyFolder
from swarm_forage_env.studies.study_table import gather_study

from ..checks import CurveError
from ..claims.looks import LOOKS
from ..claims.panel import Looks
from .outlook import Line, Outlook, Standing, StudyLines, Wanted, words_of
from .study_numbers import StudyPanel, study_panels
from .study_verdict import why_no_claims

if TYPE_CHECKING:
    from swarm_forage_env.studies.study import Place, StudySpec

ROUND_S = 300.0
"""Least time that runs are made before claims are judged again, if there is so much to run (our choice)."""
MOST_NAMED = 6
"""Claims that are named when runs for them begin."""


def run_until_decided(
    studies: "Sequence[tuple[StudySpec, StudyFolder]]",
    *,
    hours: float,
    looks: Looks | None = None,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool = False,
    tell: Callable[[str], None] | None = None,
) -> Outlook:
    """Run studies until the claims about them are decided, the time is over, or the last look has come.

    Args:
        studies: Sets of the paper, each with its folder. Seeds follow from the looks, and runs in the folders count.
        hours: By the clock. Runs that would take longer than what is left are not begun; 0 runs nothing.
        looks: Numbers of runs of a condition after which claims are judged. None: those of the folders, or `LOOKS`.
        jobs: As in `run_specs`, and so are all further arguments.
        executor: Runs the work instead of local processes.
        progress: Show progress and an estimate on stderr.
        tell: Called with words about what is under way.

    Returns:
        What is not decided, and what that would take.

    Raises:
        CurveError: a study that no claim of the paper is about, or one twice.
        RecordError: a folder holds another study, or one with other looks.
        RunsInterrupted: Ctrl-C; finished runs are kept.
    """
    under = [f"{spec.name} ({rules})" for spec, _ in studies for rules in spec.rules]
    if len(set(under)) < len(under):
        raise CurveError(f"Expected each study once under the same rules, got {', '.join(under)}.")
    for spec, _ in studies:
        if why := why_no_claims(spec):
            raise CurveError(f"{why} Others have no claims that runs could decide.")
    until = time.monotonic() + 3600.0 * hours
    looks = _looks_of(studies, looks)
    course = _Course([_Study(spec, folder, looks, is_dry=hours <= 0.0) for spec, folder in studies], looks)
    course.executor, course.jobs, course.progress = executor, jobs, progress
    for why in (why for study in course.studies for why in study.damaged):
        if tell is not None:
            tell(f"Counts as missing: {why}")
    if executor is None:  # how fast the workers of others are is not known before they have made a run
        course.measure(tell)
    while True:
        wanted = course.first_looks()
        if not (chosen := course.affordable(wanted, until - time.monotonic())):
            course.score(tell)
            wanted += course.open_claims()
            chosen = course.affordable(wanted, until - time.monotonic())
        if not chosen:
            if tell is not None and hours > 0.0:
                tell(course.ended(wanted, until - time.monotonic()))
            return course.outlook(wanted)
        if tell is not None:
            tell(f"{duration(until - time.monotonic())} left; {course.describe(wanted, chosen)}")
        course.run(chosen)


def _looks_of(studies: "Sequence[tuple[StudySpec, StudyFolder]]", asked: Looks | None) -> Looks:
    """Return the looks that are asked for, or else those of the folders that have some."""
    stored = {folder.study_file: folder.study().looks for _, folder in studies if folder.study_file.exists()}
    wanted = asked or next(filter(None, stored.values()), LOOKS)
    for file, looks in stored.items():
        if looks and looks != wanted:
            raise RecordError(
                f"Expected looks after {_told(looks)} runs, as {file} has them, got {_told(wanted)}. Looks cannot be "
                f"changed later: give --seeds {looks[-1]} or none for this study, or another folder."
            )
    return wanted


def _told(looks: Looks) -> str:
    return ", ".join(map(str, looks))


class _Study(StudyLines):
    """A study in its folder, which grows."""

    damaged: tuple[str, ...] = ()
    """Why files of runs cannot be used."""

    def __init__(self, spec: "StudySpec", folder: StudyFolder, looks: Looks, *, is_dry: bool) -> None:
        self.folder = folder
        self.spec = replace(spec, looks=looks, seeds=tuple(range(looks[0])))
        if not is_dry:
            self.grow(looks[0])
        elif folder.study_file.exists():
            self.spec = replace(folder.joined(self.spec), rules=spec.rules)
        super().__init__(self.spec)

    def grow(self, n_runs: int) -> None:
        """Let the study in the folder have so many runs of each condition, or more."""
        rules = self.spec.rules
        self.spec = replace(self.folder.take(replace(self.spec, seeds=tuple(range(n_runs)))), rules=rules)

    def learn(self, cost: MeasuredCost) -> None:
        """Find out which runs are done, and what they took."""
        runs = {place: self.spec.specs_of(place) for place in self.spec.places}
        stored = self.folder.store.look_up(run for of in runs.values() for run in of)
        self.damaged = tuple(stored.damaged.values())
        for place, of in runs.items():
            self.done[place] = {run.seed for run in of if stored.states[run.run_id] == DONE}
        for run in (run for of in runs.values() for run in of):
            if run.run_id in stored.records:
                _add_cost(cost, run, stored.records[run.run_id])


def _add_cost(cost: MeasuredCost, run: RunSpec, record: RunRecord) -> None:
    if not math.isnan(record.wall_time_s):
        cost.add(run, record.wall_time_s)


class _Course(Standing):
    """How far studies are that make runs."""

    executor: Executor | None = None
    jobs: int | None = None
    progress: bool = False

    def __init__(self, studies: Sequence[_Study], looks: Looks) -> None:
        super().__init__(studies, looks)
        self.studies = studies
        self._bought_s = self._took_s = 0.0
        self._n_made = 0

    def measure(self, tell: Callable[[str], None] | None) -> None:
        """Where no run says what runs take, step each policy in each world for a moment, in its largest swarm."""
        if self._cost.seconds(()) is not None:
            return
        largest: dict[tuple[str, str], RunSpec] = {}
        for line, study in self._study_of.items():
            for run in (self._first_of(study, place) for place in study.lines[line]):
                key = run.scenario.name, run.policy
                if key not in largest or run.robot_ticks > largest[key].robot_ticks:
                    largest[key] = run
        costs = measured_costs(largest.values(), tell)
        for run in largest.values():
            if kind_of(run) in costs:
                self._cost.add(run, costs[kind_of(run)].seconds(run))
        self.is_measured = bool(costs)

    def affordable(self, wanted: Sequence[Wanted], left_s: float) -> dict[Line, int]:
        """Return which lines get runs up to which look next: as much as a round takes, and as fits into the time."""
        chosen: dict[Line, int] = {}
        total_s = 0.0
        for one in wanted:
            step = {line: look for line, look in self._step(one.lines).items() if look > chosen.get(line, 0)}
            seconds = self._seconds(step)
            if left_s <= 0.0 or not step or not self.failed.keys().isdisjoint(one.lines):
                continue
            if seconds is not None and (total_s + seconds) / self._speed > left_s:
                continue
            chosen |= step
            total_s += seconds or 0.0
            if seconds is None or total_s / self._speed >= ROUND_S:  # what is not known is tried alone
                break
        return chosen

    def describe(self, wanted: Sequence[Wanted], chosen: Mapping[Line, int]) -> str:
        """Return what comes next and why, in one line."""
        n_open = sum(one.open is not None for one in wanted)
        why = [f"{one.why} {one.rules}" for one in wanted if one.open and not chosen.keys().isdisjoint(one.lines)]
        seconds = self._seconds(chosen)
        words = f"{counted(n_open, 'claim')} open, now for {', '.join(why[:MOST_NAMED])}" if why else "first look"
        more = f" and {len(why) - MOST_NAMED} more" if len(why) > MOST_NAMED else ""
        about = "" if seconds is None else f", about {duration(seconds / self._speed)}"
        looks = ", ".join(map(str, sorted(set(chosen.values()))))
        return f"{words}{more}: {words_of(chosen)} to {looks} runs{about}"

    def ended(self, wanted: Sequence[Wanted], left_s: float) -> str:
        """Return what was done, and why it ends here, in one line."""
        made = f"{counted(self._n_made, 'run')} made"
        steps = [seconds for one in wanted if (seconds := self._seconds(self._step(one.lines)))]
        if not steps:
            return f"{made}; no further run is of use"
        least = f"the least that is of use takes about {duration(min(steps) / self._speed)}"
        return f"{made}; nothing more is begun: {duration(max(0.0, left_s))} left, and {least}"

    def run(self, chosen: Mapping[Line, int]) -> None:
        """Make the runs that lines lack up to a look."""
        for study in self.studies:
            if mine := {line: chosen[line] for line in study.lines if line in chosen}:
                study.grow(max(mine.values()))
                self._run(study, mine)

    def _run(self, study: _Study, chosen: Mapping[Line, int]) -> None:
        places: dict[str, list[Place]] = {}
        todo: dict[str, RunSpec] = {}
        for line, look in chosen.items():
            for place in study.lines[line]:
                lacking = {*study.seeds(look)} - study.done[place]
                for run in study.spec.specs_of(place):
                    if run.seed in lacking:
                        todo[run.run_id] = run
                        places.setdefault(run.run_id, []).append(place)
        started = time.monotonic()
        found = run_specs(
            todo.values(), store=study.folder.store, executor=self.executor, jobs=self.jobs, progress=self.progress
        )
        self._n_made += len(found.records) - found.n_stored
        for run_id, record in found.records.items():
            _add_cost(self._cost, todo[run_id], record)
            self._bought_s += 0.0 if math.isnan(record.wall_time_s) else record.wall_time_s
            for place in places[run_id]:
                study.done[place].add(todo[run_id].seed)
        self._took_s += time.monotonic() - started
        for line, look in chosen.items():
            self.reached[line] = study.reached(line)
            self._changed.add(line.group)
            if self.reached[line] < look:
                self.failed[line] = None

    def score(self, tell: Callable[[str], None] | None) -> None:
        """Score what has changed."""
        changed = {line.group for line, n_runs in self.reached.items() if n_runs and line.group in self._changed}
        panels: list[StudyPanel] = []
        for study in self.studies:
            groups = {line.group for line in study.lines} & changed
            if not groups:
                continue
            if tell is not None:
                tell(f"scoring {', '.join(sorted({f'{group.experiment} {group.rules}' for group in groups}))}")
            places = {place for line, places in study.lines.items() if line.group in groups for place in places}
            panels += study_panels(gather_study(study.folder, study.spec, places)).panels
        self.know(panels)

    @property
    def _speed(self) -> float:
        """Runs at a time: processes, or on a cluster what was measured."""
        if self.executor is None:
            return float(processes_of(len(self.reached) * self._looks[0], self.jobs))
        return self._bought_s / self._took_s if self._bought_s else 1.0
