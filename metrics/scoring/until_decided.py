"""Studies that run until the claims of the paper are decided: the next runs go where an open claim needs fewest.

Every line, a policy over the last axis under one of the rules, first gets the runs of the first look. Then claims are
judged. Each that stays open has a forecast of the runs that decide it, and the cheapest get the runs of the next look.
Looks and levels are those of `claims.looks`. All is in the folders: after Ctrl-C, and when the time is over, the same
call goes on.
"""

import math
import time
from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any, NamedTuple

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.cost import MeasuredCost, duration
from swarm_forage_env.runs.record import RunRecord
from swarm_forage_env.runs.runner import run_specs
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE
from swarm_forage_env.runs.workers import processes_of
from swarm_forage_env.studies.study_folder import StudyFolder
from swarm_forage_env.studies.study_table import gather_study

from ..checks import CurveError
from ..claims import CLAIMS, Claim, Panel, PanelName
from ..claims.checking import Statement
from ..claims.looks import LOOKS
from ..claims.panel import Looks
from .open_claims import OpenClaim, both_forms, open_claim, policies_of
from .run_curves import runs_looked_at
from .study_numbers import experiment_of, study_panels
from .study_verdict import why_no_claims

if TYPE_CHECKING:
    from swarm_forage_env.studies.study import Place, StudySpec, Value

ROUND_S = 300.0
"""Least time that runs are made before claims are judged again, if there is so much to run (our choice)."""
MOST_NAMED = 6
"""Claims that are named when runs for them begin."""


class Group(NamedTuple):
    """What a panel shows: a study under one of the rules, at one value of each axis but the last."""

    study: str
    rules: str
    others: "tuple[Value, ...]"

    @property
    def experiment(self) -> str | None:
        """Name in `metrics.claims.EXPERIMENTS`; None if claims are not about it."""
        return experiment_of(self.study, self.others)


class Line(NamedTuple):
    """What gets runs: a policy in a group, at all values of the last axis."""

    group: Group
    policy: str

    def describe(self) -> str:
        """Return it in a few words."""
        return f"{self.group.experiment or self.group.study} {self.group.rules} {self.policy}"


@dataclass(frozen=True, kw_only=True)
class Wanted:
    """Lines that need runs, and why."""

    lines: tuple[Line, ...]
    why: str
    rules: str
    open: OpenClaim | None
    """None for the first look at lines."""
    seconds: float | None
    """Of processors, for all that is needed; None before any run was made."""

    def to_mapping(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {
            "claim": self.why,
            "rules": self.rules,
            "n_runs": None if self.open is None else self.open.n_runs,
            "core_hours": None if self.seconds is None else self.seconds / 3600.0,
            "lines": [line.describe() for line in self.lines],
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Outlook(Answer):
    """What studies have not decided, and what that would take."""

    wanted: tuple[Wanted, ...]
    """The cheapest first."""
    reached: Mapping[Line, int]
    looks: Looks
    failed: tuple[Line, ...] = ()
    """Lines with runs that failed; they get no more."""

    def sheets(self) -> Sequence[Sheet]:
        """Return what has had no look yet, the claims that are open, and what each would take."""
        failed = [f"Runs of {line.describe()} failed; it gets no more." for line in self.failed]
        if not self.wanted:
            return (Sheet(title="Every claim that these studies are about is decided.", notes=failed),)
        sheets: list[Sheet] = []
        if first := [(one.rules, _hours(one), _words(one.lines)) for one in self.wanted if one.open is None]:
            title = f"before claims are judged, {self.looks[0]} runs of each condition are made"
            sheets.append(Sheet(title=title, header=("rules", "core-hours", "needs runs of"), rows=first))
        if rows := [self._row(one, one.open) for one in self.wanted if one.open is not None]:
            never = f'"never": if further runs are like those there are, {self.looks[-1]} do not decide it.'
            notes = [never] if any(one.open and one.open.n_runs is None for one in self.wanted) else []
            header = ("claim", "rules", "runs", "decided after", "core-hours", "needs runs of")
            sheets.append(Sheet(title=f"not decided yet: {len(rows)}", header=header, rows=rows, notes=notes))
        return (*sheets, *([Sheet(notes=failed)] if failed else []))

    def _row(self, one: Wanted, claim: OpenClaim) -> tuple[str, ...]:
        n_runs = str(min(self.reached[line] for line in one.lines))
        return (one.why, one.rules, n_runs, str(claim.n_runs or "never"), _hours(one), _words(one.lines))

    def to_mapping(self) -> dict[str, Any]:
        """Return the same as plain values."""
        return {
            "looks": list(self.looks),
            "open": [one.to_mapping() for one in self.wanted],
            "runs": {line.describe(): n_runs for line, n_runs in self.reached.items()},
            "failed": [line.describe() for line in self.failed],
        }


def _hours(one: Wanted) -> str:
    """Core-hours; empty where no run was made yet."""
    return "" if one.seconds is None else f"{one.seconds / 3600.0:.2g}"


def _words(lines: Iterable[Line]) -> str:
    """Lines in few words: policies by experiment, under whichever rules."""
    policies: dict[str, dict[str, None]] = {}
    for line in lines:
        policies.setdefault(line.group.experiment or line.group.study, {})[line.policy] = None
    return "; ".join(f"{experiment} {', '.join(names)}" for experiment, names in policies.items())


def run_until_decided(
    studies: "Sequence[tuple[StudySpec, StudyFolder]]",
    *,
    hours: float,
    looks: Looks = LOOKS,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool = False,
    tell: Callable[[str], None] | None = None,
) -> Outlook:
    """Run studies until the claims about them are decided, the time is over, or the last look has come.

    Args:
        studies: Sets of the paper, each with its folder. Seeds follow from the looks, and runs in the folders count.
        hours: By the clock. Runs that would take longer than what is left are not begun; 0 runs nothing.
        looks: Numbers of runs of a condition after which claims are judged.
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
    course = _Course([_Study(spec, folder, looks, is_dry=hours <= 0.0) for spec, folder in studies], looks)
    course.executor, course.jobs, course.progress = executor, jobs, progress
    while True:
        left_s = until - time.monotonic()
        wanted = course.first_looks()
        if not (chosen := course.affordable(wanted, left_s)):
            wanted += course.open_claims(tell)
            chosen = course.affordable(wanted, left_s)
        if not chosen:
            return Outlook(wanted=tuple(wanted), reached=course.reached, looks=looks, failed=tuple(course.failed))
        if tell is not None:
            tell(f"{duration(left_s)} left; {course.describe(wanted, chosen)}")
        course.run(chosen)


class _Study:
    """A study, its folder, and which of its runs are done."""

    def __init__(self, spec: "StudySpec", folder: StudyFolder, looks: Looks, *, is_dry: bool) -> None:
        self.folder = folder
        self.spec = replace(spec, looks=looks, seeds=tuple(range(looks[0])))
        if not is_dry:
            self.grow(looks[0])
        elif folder.study_file.exists():
            self.spec = replace(self.spec, seeds=tuple(sorted({*self.spec.seeds, *folder.study().seeds})))
        self.lines: dict[Line, list[Place]] = {}
        for place in self.spec.places:
            group = Group(self.spec.name, place.rules, place.values[:-1])
            self.lines.setdefault(Line(group, place.policy), []).append(place)
        self.done: dict[Place, set[int]] = {place: set() for place in self.spec.places}

    def grow(self, n_runs: int) -> None:
        """Let the study in the folder have so many runs of each condition, or more."""
        rules = self.spec.rules
        self.spec = replace(self.folder.take(replace(self.spec, seeds=tuple(range(n_runs)))), rules=rules)

    def learn(self, cost: MeasuredCost) -> None:
        """Find out which runs are done, and what they took."""
        runs = {place: self.spec.specs_of(place) for place in self.spec.places}
        stored = self.folder.store.look_up(run for of in runs.values() for run in of)
        for place, of in runs.items():
            self.done[place] = {run.seed for run in of if stored.states[run.run_id] == DONE}
        for run in (run for of in runs.values() for run in of):
            if run.run_id in stored.records:
                _add_cost(cost, run, stored.records[run.run_id])

    def seeds(self, n_runs: int) -> tuple[int, ...]:
        """Return the seeds of the first runs; those of a study that has not grown so far are 0, 1, 2, ..."""
        return tuple(sorted({*self.spec.seeds, *range(n_runs)}))[:n_runs]

    def reached(self, line: Line) -> int:
        """Return the last look that all conditions of a line have reached."""
        return runs_looked_at(self.spec, [self.done[place] for place in self.lines[line]])


def _add_cost(cost: MeasuredCost, run: RunSpec, record: RunRecord) -> None:
    if not math.isnan(record.wall_time_s):
        cost.add(run, record.wall_time_s)


class _Course:
    """How far studies are, what is open, and what that takes."""

    executor: Executor | None = None
    jobs: int | None = None
    progress: bool = False

    def __init__(self, studies: Sequence[_Study], looks: Looks) -> None:
        self._looks, self._cost = looks, MeasuredCost()
        spoken_of = {name.experiment for claim in CLAIMS.values() for name in (*claim.panels, *claim.other_panels)}
        self._study_of: dict[Line, _Study] = {}
        self._firsts: dict[tuple[str, Place], RunSpec] = {}
        self.reached: dict[Line, int] = {}
        self.failed: dict[Line, None] = {}
        for study in studies:
            study.learn(self._cost)
            for line in study.lines:
                if line.group.experiment in spoken_of:
                    self._study_of[line] = study
                    self.reached[line] = study.reached(line)
        self._groups = {(line.group.rules, line.group.experiment): line.group for line in self.reached}
        self._changed: set[Group] = set(self._groups.values())
        self._panels: dict[str, dict[PanelName, Panel]] = {}
        self._forecasts: dict[tuple[str, str], tuple[list[int], OpenClaim | None]] = {}
        self._bought_s = self._took_s = 0.0

    def first_looks(self) -> list[Wanted]:
        """Return the groups without the runs of the first look, the least work first."""
        groups: dict[Group, list[Line]] = {}
        for line, n_runs in self.reached.items():
            if n_runs == 0 and line not in self.failed:
                groups.setdefault(line.group, []).append(line)
        wanted = [
            Wanted(lines=tuple(lines), why="", rules=group.rules, open=None, seconds=self._seconds(self._step(lines)))
            for group, lines in groups.items()
        ]
        return sorted(wanted, key=lambda one: sum(self._robot_ticks(line) for line in one.lines))

    def open_claims(self, tell: Callable[[str], None] | None) -> list[Wanted]:
        """Return the claims that are open, those first of which a decision is foreseen, and the cheapest of them."""
        self._score(tell)
        wanted: list[Wanted] = []
        for rules, panels in self._panels.items():
            for claim, is_relative in both_forms(CLAIMS.values()):
                found = self._forecast(rules, claim, is_relative, panels)
                if found is not None:
                    wanted.append(self._cheapest_way(rules, found))
        return sorted(wanted, key=lambda one: (one.open is not None and one.open.n_runs is None, one.seconds or 0.0))

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
        return f"{words}{more}: {_words(chosen)} to {looks} runs{about}"

    def run(self, chosen: Mapping[Line, int]) -> None:
        """Make the runs that lines lack up to a look."""
        by_study: dict[int, list[Line]] = {}
        studies = {id(study): study for study in self._study_of.values()}
        for line in chosen:
            by_study.setdefault(id(self._study_of[line]), []).append(line)
        for key, lines in by_study.items():
            study = studies[key]
            study.grow(max(chosen[line] for line in lines))
            self._run(study, {line: chosen[line] for line in lines})

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

    def _score(self, tell: Callable[[str], None] | None) -> None:
        """Score what has changed."""
        changed = {line.group for line, n_runs in self.reached.items() if n_runs and line.group in self._changed}
        for study in {id(study): study for study in self._study_of.values()}.values():
            groups = {line.group for line in study.lines} & changed
            if not groups:
                continue
            if tell is not None:
                tell(f"scoring {', '.join(sorted({f'{group.experiment} {group.rules}' for group in groups}))}")
            places = {place for line, places in study.lines.items() if line.group in groups for place in places}
            for panel in study_panels(gather_study(study.folder, study.spec, places)).panels:
                if panel.experiment is not None:
                    here = self._panels.setdefault(panel.rules, {})
                    names = (panel.name, panel.name._replace(is_relative=True))
                    here |= {name: panel.for_claims(name) for name in names if panel.scores_of(name)}
        self._changed.clear()

    def _forecast(
        self, rules: str, claim: Claim, is_relative: bool, panels: Mapping[PanelName, Panel]
    ) -> OpenClaim | None:
        """The forecast of a claim, made again where one of its lines has more runs."""
        experiments = {name.experiment for name in claim.panels}
        state = [
            n_runs
            for line, n_runs in self.reached.items()
            if line.group.rules == rules and line.group.experiment in experiments
        ]
        key = (rules, f"{claim.name} {is_relative}")
        if key not in self._forecasts or self._forecasts[key][0] != state:
            self._forecasts[key] = state, open_claim(claim, is_relative, panels)
        return self._forecasts[key][1]

    def _cheapest_way(self, rules: str, found: OpenClaim) -> Wanted:
        ways = [
            tuple(dict.fromkeys(line for statement in way for line in self._lines_of(rules, statement)))
            for way in found.ways
        ]
        look = found.n_runs or self._looks[-1]
        costs = {lines: self._seconds({line: look for line in lines if self.reached[line] < look}) for lines in ways}
        lines = min(costs, key=lambda lines: costs[lines] or 0.0)
        return Wanted(lines=lines, why=found.words, rules=rules, open=found, seconds=costs[lines])

    def _lines_of(self, rules: str, statement: Statement) -> list[Line]:
        groups = {self._groups[rules, name.experiment] for name in statement.panels}
        policies = policies_of(statement, self._panels[rules])
        return [line for line in self.reached if line.group in groups and line.policy in policies]

    def _step(self, lines: Collection[Line]) -> dict[Line, int]:
        """The next look of those lines that have had fewest."""
        least = min(self.reached[line] for line in lines)
        look = next((look for look in self._looks if look > least), least)
        return {line: look for line in lines if self.reached[line] < look}

    def _seconds(self, wanted: Mapping[Line, int]) -> float | None:
        """Return the processor time of the runs that lines lack up to a look; None before any run was made."""
        total_s = 0.0
        for line, look in wanted.items():
            study = self._study_of[line]
            for place in study.lines[line]:
                run_s = self._cost.seconds([self._first_of(study, place)])
                if run_s is None:
                    return None
                total_s += run_s * len({*study.seeds(look)} - study.done[place])
        return total_s

    def _robot_ticks(self, line: Line) -> int:
        study = self._study_of[line]
        return sum(self._first_of(study, place).robot_ticks for place in study.lines[line])

    def _first_of(self, study: _Study, place: "Place") -> RunSpec:
        key = study.spec.name, place
        if key not in self._firsts:
            self._firsts[key] = study.spec.specs_of(place)[0]
        return self._firsts[key]

    @property
    def _speed(self) -> float:
        """Runs at a time: processes, or on a cluster what was measured."""
        if self.executor is None:
            return float(processes_of(len(self.reached) * self._looks[0], self.jobs))
        return self._bought_s / self._took_s if self._bought_s else 1.0
