"""Which policy meets given constraints: runs under each constraint, verdicts with confidence, and a ranking."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from scipy.special import stdtr  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from swarm_forage_env._internal.wording import counted, number, percent, plain
from swarm_forage_env.runs.answer import Answer, Sheet
from swarm_forage_env.runs.policy_spec import PolicyLike
from swarm_forage_env.runs.table import Table
from swarm_forage_env.scenarios.performance import performance_of
from swarm_forage_env.studies.ladders import joined_wrappers, repairs_per_tick
from swarm_forage_env.wrappers.base import WrapperConfig
from swarm_forage_env.wrappers.noise import noise_levels
from swarm_forage_env.wrappers.population import PopulationConfig
from swarm_forage_env.wrappers.world import World, WorldLike, world_of

from ..checks import CurveError
from ..significance import SIGNIFICANT, paired_p
from ..statistics import Summary, aggregate
from .question import Question, ask, plan_totals, run_totals, unit_text
from .run_curves import NOISE, POPULATION
from .scores import bounds, interval

if TYPE_CHECKING:
    from concurrent.futures import Executor

MET, NOT_MET, UNDECIDED = "met", "not met", "undecided"
"""Verdicts: the whole 95 % interval of mean performance reaches the demand, stays below it, or contains it."""
RULE = (
    "met: the whole 95 % interval (Student's, over seeds) reaches the demand; not met: it stays below; undecided: the "
    "demand lies inside. Confidence: probability that mean performance reaches the demand, from the same distribution. "
    "Ranked by constraints met, then by fewest not met, then by undisturbed performance."
)
_NEARLY = 0.001
"""Probabilities closer than this to 0 or 1 are shown as below or above it."""
_HEADER = ("rank", "policy", "constraint", "demand", "measured", "95 % interval", "margin", "confidence", "runs", "")


@dataclass(frozen=True, kw_only=True)
class Constraint:
    """A demand on performance under one condition."""

    condition: str
    """In words: "undisturbed", "failures 0.001", "deaths 10", "noise 0.01"."""
    demand: float
    """Performance that a run must reach, summed over time."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Evidence:
    """What the runs of a policy say about a constraint."""

    constraint: Constraint
    per_seed: Mapping[int, float]
    """Seed -> performance summed over the run."""

    @property
    def summary(self) -> Summary | None:
        """Mean performance with Student's interval; None if no run finished."""
        return aggregate(list(self.per_seed.values())) if self.per_seed else None

    @property
    def margin(self) -> float:
        """Mean performance minus the demand; NaN without runs."""
        return math.nan if self.summary is None else self.summary.mean - self.constraint.demand

    @property
    def confidence(self) -> float:
        """Probability that mean performance reaches the demand, by Student's distribution; NaN for fewer than two runs.

        Runs that are all alike leave no doubt: 1 or 0.
        """
        summary = self.summary
        if summary is None or summary.n_used < 2:
            return math.nan
        error = summary.std / math.sqrt(summary.n_used)
        if error == 0.0:
            return 1.0 if self.margin >= 0.0 else 0.0
        return float(stdtr(summary.n_used - 1, self.margin / error))

    @property
    def n_reaching(self) -> int:
        """Runs that reach the demand, each for itself."""
        return sum(value >= self.constraint.demand for value in self.per_seed.values())

    @property
    def verdict(self) -> str:
        """`MET`, `NOT_MET` or `UNDECIDED`."""
        summary = self.summary
        if summary is None or math.isnan(summary.lower):
            return UNDECIDED
        if summary.lower >= self.constraint.demand:
            return MET
        return NOT_MET if summary.upper < self.constraint.demand else UNDECIDED

    def cells(self) -> tuple[str, ...]:
        """Return the evidence as texts for the table."""
        summary = self.summary
        sign = "+" if self.margin > 0.0 else ""
        return (
            self.constraint.condition,
            number(self.constraint.demand),
            "-" if summary is None else number(summary.mean),
            "-" if summary is None else interval(summary),
            sign + number(self.margin),
            _probability(self.confidence),
            f"{self.n_reaching} of {len(self.per_seed)}",
            self.verdict,
        )

    def to_mapping(self) -> dict[str, Any]:
        """Return the evidence as plain values; numbers that do not exist are None."""
        return {
            "constraint": self.constraint.condition,
            "demand": self.constraint.demand,
            "measured": bounds(self.summary),
            "margin": plain(self.margin),
            "confidence": plain(self.confidence),
            "runs_reaching": self.n_reaching,
            "per_seed": {str(seed): value for seed, value in self.per_seed.items()},
            "verdict": self.verdict,
        }


@dataclass(frozen=True, kw_only=True, eq=False)
class Candidate:
    """A policy with its evidence, constraint by constraint, the undisturbed one first."""

    policy: str
    evidence: tuple[Evidence, ...]
    failures: tuple[str, ...] = ()
    """Why runs failed, a line per reason."""

    @property
    def performance(self) -> float:
        """Mean undisturbed performance; minus infinity without runs."""
        summary = self.evidence[0].summary
        return -math.inf if summary is None else summary.mean

    def conditions(self, verdict: str) -> tuple[str, ...]:
        """Return the conditions of all constraints with a verdict."""
        return tuple(e.constraint.condition for e in self.evidence if e.verdict == verdict)

    @property
    def lacks_runs(self) -> bool:
        """Whether a condition has no finished run."""
        return any(evidence.summary is None for evidence in self.evidence)

    @property
    def order(self) -> tuple[bool, int, int, float]:
        """What candidates are sorted by, the best lowest; one that lacks runs comes last."""
        return self.lacks_runs, -len(self.conditions(MET)), len(self.conditions(NOT_MET)), -self.performance


@dataclass(frozen=True, kw_only=True, eq=False)
class Choice(Answer):
    """Policies in order, the best first, with the evidence."""

    candidates: tuple[Candidate, ...]
    scenario: str
    n_robots: int
    horizon_s: float
    unit: str
    """Of demands and performance: "objects", "robots summed over intervals"."""

    @property
    def reason(self) -> str:
        """One sentence: why the first is first, and what that does not say."""
        first, *others = self.candidates
        n_all, n_met = len(first.evidence), len(first.conditions(MET))
        meets = f"meets {n_met} of {counted(n_all, 'constraint')} with confidence"
        if not others:
            return f"{first.policy} {meets}{_missing(first)}."
        second = others[0]
        opening = f"{first.policy} comes first: it {meets}"
        if first.lacks_runs != second.lacks_runs:
            return f"{opening}{_missing(first)}; runs of {second.policy} failed."
        if first.order[1] != second.order[1]:
            return f"{opening}{_missing(first)}, {second.policy} {len(second.conditions(MET))}{_missing(second)}."
        if first.order[2] != second.order[2]:
            failed, others = (len(candidate.conditions(NOT_MET)) for candidate in (first, second))
            return f"{opening}, as {second.policy} does, and fails {failed} where {second.policy} fails {others}."
        words = f"{opening}, as {second.policy} does, and achieves {number(first.performance)} undisturbed against "
        return f"{words}{number(second.performance)}; {self._significance(first, second)}."

    def _significance(self, first: Candidate, second: Candidate) -> str:
        mine, theirs = first.evidence[0].per_seed, second.evidence[0].per_seed
        p = paired_p(np.array([mine[seed] - theirs[seed] for seed in mine if seed in theirs]))
        if math.isnan(p):
            return "there are too few runs to test the difference"
        told = f"the difference is {'' if p <= SIGNIFICANT else 'not '}significant (paired t test, p = {p:.2g})"
        return told if p <= SIGNIFICANT else f"{told}, so the runs do not tell them apart"

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values, ready for JSON."""
        return {
            "scenario": self.scenario,
            "n_robots": self.n_robots,
            "horizon_s": self.horizon_s,
            "unit": self.unit,
            "rule": RULE,
            "reason": self.reason,
            "ranking": [
                {
                    "rank": rank,
                    "policy": candidate.policy,
                    "performance": plain(candidate.performance),
                    "met": list(candidate.conditions(MET)),
                    "not_met": list(candidate.conditions(NOT_MET)),
                    "undecided": list(candidate.conditions(UNDECIDED)),
                    "evidence": [evidence.to_mapping() for evidence in candidate.evidence],
                    "failures": list(candidate.failures),
                }
                for rank, candidate in enumerate(self.candidates, 1)
            ],
        }

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the ranking, and runs that failed."""
        rows: list[Sequence[str]] = []
        for rank, candidate in enumerate(self.candidates, 1):
            names = [(str(rank), candidate.policy), *[("", "")] * (len(candidate.evidence) - 1)]
            rows += [(*name, *evidence.cells()) for name, evidence in zip(names, candidate.evidence, strict=True)]
        failures = [f"failed: {failure}" for candidate in self.candidates for failure in candidate.failures]
        title = f"{self.scenario}, {counted(self.n_robots, 'robot')}, runs of {self.horizon_s:,g} s: {self.unit}"
        return Sheet(title=title, header=_HEADER, rows=rows, notes=(self.reason, RULE)), Sheet(notes=failures)


@dataclass(frozen=True, kw_only=True, eq=False)
class ChoiceQuestion(Question[Choice]):
    """The runs of a choice, and what is demanded in each world."""

    constraints: tuple[Constraint, ...]
    """One per world of the plan, in its order, the undisturbed one first."""

    def answer(self, table: Table) -> Choice:
        """Return the policies, those first that meet most constraints, then miss fewest, then do best undisturbed."""
        candidates = [self._candidate(table, policy.label) for policy in self.plan.policies]
        world = self.plan.conditions[0].world
        scenario = world.scenario
        return Choice(
            candidates=tuple(sorted(candidates, key=lambda candidate: candidate.order)),
            scenario=world.title(),
            n_robots=scenario.robots.n_robots,
            horizon_s=scenario.horizon_s,
            unit=unit_text(performance_of(scenario.performance)),
        )

    def _candidate(self, table: Table, policy: str) -> Candidate:
        return Candidate(
            policy=policy,
            evidence=tuple(
                Evidence(constraint=constraint, per_seed=run_totals(table, condition))
                for constraint, condition in zip(self.constraints, self.plan.of_policy(policy), strict=True)
            ),
            failures=table.failure_lines(policy),
        )


def choose_policy(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    world: WorldLike = "warehouse_small",
    *,
    deliver: float,
    keep: float = 1.0,
    failures: float | None = None,
    deaths: float | None = None,
    noise: float | None = None,
    seeds: int | Sequence[int] = 4,
    caches: str | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> Choice:
    """Rank policies by the constraints that they meet.

        choose_policy(["crw", "dpo"], scenario("warehouse_small", n_robots=50), deliver=200, noise=0.01, keep=0.5)

    asks for 200 objects from 50 undisturbed robots, and for 100 objects from 50 robots with noise of 0.01.

    Args:
        policies: As in `compare_policies`, one or more.
        world: Name of a preset, a complete configuration, or a world with wrappers, which then act in all runs. The
            world sets the number of robots and the length of a run, and defines performance.
        deliver: Performance that an undisturbed run must reach, summed over its intervals; above 0.
        keep: Share of `deliver` that a run must reach under each disturbance.
        failures: Malfunctions per tick of the whole swarm. Robots stop where they are and are repaired one after the
            other, a little faster than they fail, see `swarm_forage_env.studies.ladders.repairs_per_tick`.
        deaths: Expected number of robots that die during a run, one by one at random times; they do not come back.
        noise: Standard deviation of the noise of all sensors and wheels, see `SensorNoise` and `ActuatorNoise`.
        seeds: Their number, at least two, or a list. All policies and conditions use the same seeds.
        caches: As in `score_policy`, and so are all further arguments.
        out: Folder for run records; runs that it already holds are not made again.
        jobs: Processes; default one per core.
        executor: Makes the runs in place of the processes.
        progress: Show progress and an estimate on stderr.

    Raises:
        CurveError: a demand or a disturbance that is not a number above 0, more deaths than robots, or fewer than two
            seeds.
        ValueError: an unknown policy or scenario.
        swarm_forage_env.runs.runner.RunsInterrupted: Ctrl-C; finished runs are in `out`.
    """
    question = choice_question(
        policies,
        world,
        deliver=deliver,
        keep=keep,
        failures=failures,
        deaths=deaths,
        noise=noise,
        seeds=seeds,
        caches=caches,
    )
    return ask(question, out=out, jobs=jobs, executor=executor, progress=progress)


def choice_question(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    world: WorldLike = "warehouse_small",
    *,
    deliver: float,
    keep: float = 1.0,
    failures: float | None = None,
    deaths: float | None = None,
    noise: float | None = None,
    seeds: int | Sequence[int] = 4,
    caches: str | None = None,
) -> ChoiceQuestion:
    """Return the question of `choose_policy`; arguments and errors as there."""
    chosen = world_of(world)
    given = {"deliver": deliver, "keep": keep, "failures": failures, "deaths": deaths, "noise": noise}
    for name, value in given.items():
        if value is not None and not (math.isfinite(value) and value > 0.0):
            raise CurveError(f"Expected {name} as a number above 0, got {value:g}.")
    if deaths is not None and deaths > chosen.n_robots:
        raise CurveError(
            f"Expected at most {chosen.n_robots} deaths, one for each robot, got {deaths:g}; "
            "ask for fewer deaths or more robots."
        )
    worlds = [chosen]
    constraints = [Constraint(condition="undisturbed", demand=deliver)]
    disturbances = {"failures": (failures, _failing), "deaths": (deaths, _dying), "noise": (noise, _noisy)}
    for name, (strength, disturbed) in disturbances.items():
        if strength is not None:
            worlds.append(disturbed(chosen, float(strength)))
            constraints.append(Constraint(condition=f"{name} {strength:g}", demand=keep * deliver))
    plan = plan_totals(policies, worlds, seeds=seeds, caches=caches)
    return ChoiceQuestion(plan=plan, constraints=tuple(constraints))


def _probability(value: float) -> str:
    """Return a probability in percent; one that is nearly 0 or 1 is not called certain."""
    if 0.0 < value < _NEARLY or 1.0 - _NEARLY < value < 1.0:
        return f"< {percent(_NEARLY)}" if value < 0.5 else f"> {percent(1.0 - _NEARLY)}"
    return percent(value)


def _missing(candidate: Candidate) -> str:
    """Return the constraints that are not met, in brackets; empty if all are."""
    told = [
        f"{verdict}: {', '.join(candidate.conditions(verdict))}"
        for verdict in (NOT_MET, UNDECIDED)
        if candidate.conditions(verdict)
    ]
    return f" ({'; '.join(told)})" if told else ""


def _failing(world: World, rate: float) -> World:
    """Malfunctions per tick, and repairs as in the study."""
    repair = repairs_per_tick(rate, world.n_robots)
    return _with(world, POPULATION, rate, PopulationConfig(malfunction_per_tick=rate, repair_per_tick=repair))


def _dying(world: World, count: float) -> World:
    """Deaths per tick, so many that `count` are expected in a run."""
    rate = count / world.scenario.horizon_ticks
    return _with(world, POPULATION, rate, PopulationConfig(death_per_tick=rate))


def _noisy(world: World, sigma: float) -> World:
    """Noise of all sensors and wheels, as in scores."""
    _, noisy = noise_levels(sigma, n_levels=2)
    return _with(world, NOISE, sigma, *noisy)


def _with(world: World, criterion: str, value: float, *wrappers: WrapperConfig) -> World:
    return World(world.scenario, joined_wrappers(world.wrappers, wrappers, criterion), criterion=criterion, value=value)
