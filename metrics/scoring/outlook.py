"""What runs leave open, after how many runs it would be decided, and what those take.

Every line, a policy over the last axis under one of the rules, first gets the runs of the first look. Then claims are
judged. Each that stays open has a forecast of the runs that decide it. Looks and levels are those of `claims.looks`.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, NamedTuple

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.cost import MeasuredCost
from swarm_forage_env.runs.spec import RunSpec
from swarm_forage_env.runs.store import DONE

from ..claims import CLAIMS, Claim, Panel, PanelName
from ..claims.checking import Statement
from ..claims.looks import LOOKS
from ..claims.outcomes import DECIDED
from ..claims.outcomes import Answer as ClaimAnswer
from ..claims.panel import Looks
from .open_claims import OpenClaim, both_forms, open_claim, policies_of
from .run_curves import runs_looked_at
from .study_numbers import StudyPanel, experiment_of
from .study_verdict import StudyVerdict

if TYPE_CHECKING:
    from swarm_forage_env.studies.study import Place, StudySpec, Value
    from swarm_forage_env.studies.study_table import StudyTable


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
    n_decided: int = 0
    """Answers that are there: of each claim under each of the rules, as it is and relative to performance."""
    n_unscored: int = 0
    """Answers that have no scores to be decided on."""
    waiting: Mapping[tuple[str, ...], tuple[str, ...]] = field(default_factory=dict[tuple[str, ...], tuple[str, ...]])
    """Sets that are not there -> claims that wait for them."""
    cost_note: str = ""
    """Where core-hours come from, or why there are none."""

    def sheets(self) -> Sequence[Sheet]:
        """Return what has had no look yet, the claims that are open, and what each would take."""
        failed = [f"Runs of {line.describe()} failed; it gets no more." for line in self.failed]
        last = Sheet(title=self._settled(), notes=[*self._waits(), *failed])
        if not self.wanted:
            return (last,)
        sheets: list[Sheet] = []
        if first := [(one.rules, _hours(one), words_of(one.lines)) for one in self.wanted if one.open is None]:
            title = f"before claims are judged, {self.looks[0]} runs of each condition are made"
            sheets.append(Sheet(title=title, header=("rules", "core-hours", "needs runs of"), rows=first))
        if rows := [self._row(one, one.open) for one in self.wanted if one.open is not None]:
            never = f'"never": if further runs are like those there are, {self.looks[-1]} do not decide it.'
            notes = [never] if any(one.open and one.open.n_runs is None for one in self.wanted) else []
            header = ("claim", "rules", "runs", "decided after", "core-hours", "needs runs of")
            sheets.append(Sheet(title=f"not decided yet: {len(rows)}", header=header, rows=rows, notes=notes))
        return (*sheets, *([Sheet(notes=[self.cost_note])] if self.cost_note else []), last)

    def _settled(self) -> str:
        """How many answers there are, in one line."""
        n_open = sum(one.open is not None for one in self.wanted)
        if self.n_decided or self.n_unscored or n_open or not self.wanted:
            words = f"decided: {self.n_decided} of {self.n_decided + self.n_unscored + n_open} answers to claims"
            words += " about these sets alone, under each of the rules, as they are and relative to performance"
            return f"{words}; {self.n_unscored} without scores" if self.n_unscored else words
        return "No claim is judged before all of its conditions have these runs."

    def _waits(self) -> list[str]:
        """Which claims wait for which other sets, a line for each combination of these."""
        return [
            f"{counted(len(names), 'claim')} {'waits' if len(names) == 1 else 'wait'} for {', '.join(sets)}: "
            f"{', '.join(names)}"
            for sets, names in self.waiting.items()
        ]

    def _row(self, one: Wanted, claim: OpenClaim) -> tuple[str, ...]:
        n_runs = str(min(self.reached[line] for line in one.lines))
        return (one.why, one.rules, n_runs, str(claim.n_runs or "never"), _hours(one), words_of(one.lines))

    def to_mapping(self) -> dict[str, Any]:
        """Return the same as plain values."""
        return {
            "looks": list(self.looks),
            "open": [one.to_mapping() for one in self.wanted],
            "runs": {line.describe(): n_runs for line, n_runs in self.reached.items()},
            "failed": [line.describe() for line in self.failed],
            "n_decided": self.n_decided,
            "waiting": [{"for": list(sets), "claims": list(names)} for sets, names in self.waiting.items()],
        }


def _hours(one: Wanted) -> str:
    """Core-hours; empty where no run was made yet."""
    return "" if one.seconds is None else f"{one.seconds / 3600.0:.2g}"


def words_of(lines: Iterable[Line]) -> str:
    """Lines in few words: policies by experiment, under whichever rules."""
    policies: dict[str, dict[str, None]] = {}
    for line in lines:
        policies.setdefault(line.group.experiment or line.group.study, {})[line.policy] = None
    return "; ".join(f"{experiment} {', '.join(names)}" for experiment, names in policies.items())


def what_would_decide(results: StudyVerdict) -> Outlook:
    """Return what runs leave open, and what would decide it, as `run_until_decided` does without hours.

    Of packed studies it is known how long all runs took, so core-hours are in proportion to robots times ticks.

    Args:
        results: From `verdict`; studies that are not run until claims are decided are left out.
    """
    given = list(zip(results.tables, results.scored, strict=True))
    packed = [(table, scored) for table, scored in given if table.spec.looks]
    looks = max((table.spec.looks for table, _ in packed), key=len, default=LOOKS)
    standing = Standing([_Packed(table) for table, _ in packed], looks)
    standing.know(panel for _, scored in packed for panel in scored.panels if panel.variant == "corrected")
    wanted = standing.first_looks() + standing.open_claims()
    return standing.outlook(wanted)


class StudyLines:
    """The lines of a study, and which of their runs are done."""

    def __init__(self, spec: "StudySpec") -> None:
        self.spec = spec
        self.lines: dict[Line, list[Place]] = {}
        for place in self.spec.places:
            group = Group(self.spec.name, place.rules, place.values[:-1])
            self.lines.setdefault(Line(group, place.policy), []).append(place)
        self.done: dict[Place, set[int]] = {place: set() for place in self.spec.places}

    def seeds(self, n_runs: int) -> tuple[int, ...]:
        """Return the seeds of the first runs; those of a study that has not grown so far are 0, 1, 2, ..."""
        return tuple(sorted({*self.spec.seeds, *range(n_runs)}))[:n_runs]

    def reached(self, line: Line) -> int:
        """Return the last look that all conditions of a line have reached."""
        return runs_looked_at(self.spec, [self.done[place] for place in self.lines[line]])

    def learn(self, cost: MeasuredCost) -> None:
        """Find out which runs are done, and what they took."""
        raise NotImplementedError


class _Packed(StudyLines):
    """A packed study."""

    def __init__(self, table: "StudyTable") -> None:
        super().__init__(table.spec)
        self._table = table

    def learn(self, cost: MeasuredCost) -> None:
        """Find out which runs are done, and what they took."""
        done: list[RunSpec] = []
        for place in self.spec.places:
            rows = self._table.rows(place)
            self.done[place] = set(rows.filter(rows["state"] == DONE)["seed"])
            done += [run for run in self.spec.specs_of(place) if run.seed in self.done[place]]
        if done and self._table.wall_time_s is not None:
            per_robot_tick_s = self._table.wall_time_s / sum(run.robot_ticks for run in done)
            for run in done:
                cost.add(run, per_robot_tick_s * run.robot_ticks)


class Standing:
    """How far studies are, what is open, and what that takes."""

    is_measured: bool = False
    """Whether what runs take is known from a moment of each policy, not from runs."""

    def __init__(self, studies: Sequence[StudyLines], looks: Looks) -> None:
        self._looks, self._cost = looks, MeasuredCost()
        spoken_of = {name.experiment for claim in CLAIMS.values() for name in (*claim.panels, *claim.other_panels)}
        self._study_of: dict[Line, StudyLines] = {}
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
        self._forecasts: dict[tuple[str, str], tuple[list[int], OpenClaim | ClaimAnswer]] = {}

    def know(self, panels: Iterable[StudyPanel]) -> None:
        """Take the scores of all groups that have changed."""
        for panel in panels:
            if panel.experiment is not None:
                here = self._panels.setdefault(panel.rules, {})
                names = (panel.name, panel.name._replace(is_relative=True))
                here |= {name: panel.for_claims(name) for name in names if panel.scores_of(name)}
        self._changed.clear()

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

    def open_claims(self) -> list[Wanted]:
        """Return the claims that are open, those first of which a decision is foreseen, and the cheapest of them."""
        wanted: list[Wanted] = []
        for rules, panels in self._panels.items():
            for claim, is_relative in both_forms(CLAIMS.values()):
                if self._lacking(rules, claim) != ():
                    continue
                found = self._forecast(rules, claim, is_relative, panels)
                if isinstance(found, OpenClaim):
                    wanted.append(self._cheapest_way(rules, found))
        return sorted(wanted, key=lambda one: (one.open is not None and one.open.n_runs is None, one.seconds or 0.0))

    def _forecast(
        self, rules: str, claim: Claim, is_relative: bool, panels: Mapping[PanelName, Panel]
    ) -> OpenClaim | ClaimAnswer:
        """The forecast of a claim, or its answer, made again where one of its lines has more runs."""
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

    def outlook(self, wanted: Sequence[Wanted]) -> Outlook:
        """Return how far all is, and what is wanted."""
        answers = [found for _, found in self._forecasts.values() if not isinstance(found, OpenClaim)]
        n_unscored = sum(answer not in DECIDED for answer in answers)
        waiting = self._waiting()
        return Outlook(
            wanted=tuple(wanted),
            reached=self.reached,
            looks=self._looks,
            failed=tuple(self.failed),
            n_decided=len(answers) - n_unscored,
            n_unscored=n_unscored,
            waiting=waiting,
            cost_note=self._cost_note() if wanted else "",
        )

    def _lacking(self, rules: str, claim: Claim) -> tuple[str, ...] | None:
        """Sets that a claim needs and that are not there under these rules; None if it is about none that is there."""
        there = {line.group.study for line in self.reached if line.group.rules == rules}
        needed = list(dict.fromkeys(name.experiment.split()[0] for name in claim.panels))
        return tuple(name for name in needed if name not in there) if not there.isdisjoint(needed) else None

    def _waiting(self) -> dict[tuple[str, ...], tuple[str, ...]]:
        waiting: dict[tuple[str, ...], dict[str, None]] = {}
        for rules in dict.fromkeys(line.group.rules for line in self.reached):
            for name, claim in CLAIMS.items():
                if lacks := self._lacking(rules, claim):
                    waiting.setdefault(lacks, {})[name] = None
        return {sets: tuple(names) for sets, names in waiting.items()}

    def _cost_note(self) -> str:
        if self._cost.seconds(()) is None:
            return "Core-hours are not known: no run that is here says how long it took."
        if self.is_measured:
            return "Core-hours are an estimate: each policy was stepped for a moment, in its largest swarm."
        return ""

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

    def _first_of(self, study: StudyLines, place: "Place") -> RunSpec:
        key = study.spec.name, place
        if key not in self._firsts:
            self._firsts[key] = study.spec.specs_of(place)[0]
        return self._firsts[key]
