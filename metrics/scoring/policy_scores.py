"""Scores of policies: what `score_policy` and `compare_policies` ask, and the scores of curves from a file."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.policy_spec import PolicyLike, policy_specs
from swarm_forage_env.runs.table import Table
from swarm_forage_env.scenarios.performance import Performance, performance_of
from swarm_forage_env.studies import ladders
from swarm_forage_env.studies.ladders import Budget
from swarm_forage_env.wrappers.world import SIZE, World, WorldLike, world_of

from ..checks import CurveError, chosen_seeds
from .curves_file import read_curves
from .limits import share_of_limit
from .measures import score_study
from .question import Question, ask
from .run_curves import THROTTLE, PerformanceLike, own_performance, policy_curves
from .score_tables import Comparison, ScoreTable, side_by_side
from .scores import Score, ScoreForms, check_measures, criteria_of

if TYPE_CHECKING:
    from concurrent.futures import Executor


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoreQuestion(Question[Comparison]):
    """The runs that score policies, and that compare them if there are several."""

    world: World
    """What the worlds of the plan are variants of."""
    measures: tuple[str, ...]
    budget: str
    """Name of the budget, "custom" for one of the user's own."""
    performance: Performance | None = None
    """A function of records that is the performance; None = what the scenario names."""
    forms: ScoreForms = field(default_factory=ScoreForms)

    @property
    def read_as(self) -> Performance:
        """What the performance is: its name and unit, and whether it is a total and adds up over robots."""
        return self.performance or performance_of(self.world.scenario.performance)

    def answer(self, table: Table) -> Comparison:
        """Return one table of scores per policy, and their differences."""
        return side_by_side([self._scores(table, policy.label) for policy in self.plan.policies])

    def _scores(self, table: Table, policy: str) -> ScoreTable:
        study = policy_curves(table, policy, self.performance)
        scores, missing = score_study(study, self.measures, self.forms)
        scores = tuple(self._beside_limit(score, policy) for score in scores)
        scenario = self.plan.conditions[0].world.scenario
        return ScoreTable(
            policy=policy,
            scenario=self.world.title(),
            scores=scores,
            missing=missing,
            failures=table.failure_lines(policy),
            settings={
                "budget": self.budget,
                "horizon_s": scenario.horizon_s,
                "interval_s": scenario.interval_s,
                "seeds": list(self.plan.seeds),
                "performance": self.read_as.name,
                "n_robots": self.world.n_robots,
                "out": None if table.folder is None else str(table.folder),
            },
            band=self.forms.band,
        )

    def _beside_limit(self, score: Score, policy: str) -> Score:
        """Return the performance of a swarm size with its share of the limit; other scores as they are."""
        if score.measure != "raw_performance" or self.performance is not None:
            return score
        sizes = [self.plan.specs_of(one)[0].world for one in self.plan.of_policy(policy) if one.world.criterion == SIZE]
        world = next(each for each in sizes if each.n_robots == score.x)
        share = share_of_limit(world, score.summary.mean)
        return score if share is None else replace(score, beside={"of_limit": share})


def score_policy(
    policy: PolicyLike,
    world: WorldLike = "warehouse_small",
    *,
    measures: Sequence[str] | None = None,
    budget: str | Budget = "standard",
    seeds: int | Sequence[int] | None = None,
    horizon_s: float | None = None,
    performance: PerformanceLike | None = None,
    name: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
    density: float | None = None,
    disturbance: str = THROTTLE,
    forms: ScoreForms | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> ScoreTable:
    """Run a policy in all experiments that the measures need, and score it.

    Args:
        policy: See `PolicyLike`. Objects, classes and functions run in this process, one run at a time; each run gets
            its own copy of an object.
        world: Name of a preset, a complete configuration, or a world with wrappers, which then act in all runs. The
            budget sets horizon and interval.
        measures: Names out of `MEASURE_CRITERIA`; default all.
        budget: "quick", "standard", "paper" (`swarm_forage_env.studies.ladders.BUDGETS`), or one of your own.
        seeds: Their number, or a list; default those of the budget. All experiments use the same seeds, so runs are
            paired.
        horizon_s: Length of a run in seconds, whole intervals; default that of the budget.
        performance: What P(N, t) is: a recorded column ("n_carrying"), "1/" and a column in which less is better
            ("1/interference_fraction"), "task_balance", "cache_load", or a function of a record (`Performance`).
            Default: the performance of the scenario. It only changes how runs are read, so runs in `out` are not
            repeated.
        name: Name in tables and stored runs. A policy that is an object or a function needs a name for `out`. Give
            another name when its code has changed.
        parameters: Keyword arguments of a registered policy or a class.
        caches: "none", "static", "dynamic"; default see `swarm_forage_env.runs.spec.chosen_caches`.
        density: Robots per m^2 at all swarm sizes: the arena grows with the swarm, and one robot is in the smallest
            arena. Default: all sizes are in the scenario's arena (in search and rescue: at its density).
        disturbance: Disturbance for reactivity and adaptability: "throttle" (robots lose speed) or "handling_cost"
            (picking up and dropping take longer).
        forms: Variants and forms of the measures; default the corrected marginal one.
        out: Folder for run records. Runs that it already holds are not made again, so you can repeat an interrupted
            call.
        jobs: Processes; default one per core.
        executor: Makes the runs in place of the processes, for example Dask's `client.get_executor()`.
        progress: Show progress and an estimate on stderr.

    Returns:
        The table. The note of a score says if runs are missing, and `failures` says why runs failed.

    Raises:
        CurveError: unknown measures, or a performance that is negative or not a number.
        ValueError: an unknown policy, performance, scenario, budget, or values that describe no run.
        ImportError: the policy is a model, and stable-baselines3 is not installed.
        swarm_forage_env.runs.runner.RunsInterrupted: Ctrl-C; finished runs are in `out`.
    """
    question = score_question(
        {name: policy} if name else [policy],
        world,
        measures=measures,
        budget=budget,
        seeds=seeds,
        horizon_s=horizon_s,
        performance=performance,
        parameters=parameters,
        caches=caches,
        density=density,
        disturbance=disturbance,
        forms=forms,
    )
    return ask(question, out=out, jobs=jobs, executor=executor, progress=progress).tables[0]


def compare_policies(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    world: WorldLike = "warehouse_small",
    *,
    measures: Sequence[str] | None = None,
    budget: str | Budget = "standard",
    seeds: int | Sequence[int] | None = None,
    horizon_s: float | None = None,
    performance: PerformanceLike | None = None,
    caches: str | None = None,
    density: float | None = None,
    disturbance: str = THROTTLE,
    forms: ScoreForms | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> Comparison:
    """Score policies in the same experiments and compare them seed by seed.

    Args and errors as in `score_policy`; `policies` are two or more, or a mapping from names to policies.
    """
    question = score_question(
        policies,
        world,
        measures=measures,
        budget=budget,
        seeds=seeds,
        horizon_s=horizon_s,
        performance=performance,
        caches=caches,
        density=density,
        disturbance=disturbance,
        forms=forms,
    )
    names = [policy.label for policy in question.plan.policies]
    if len(names) < 2:
        raise CurveError(f"Expected two or more policies to compare, got {', '.join(names)}.")
    return ask(question, out=out, jobs=jobs, executor=executor, progress=progress)


def score_question(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    world: WorldLike = "warehouse_small",
    *,
    measures: Sequence[str] | None = None,
    budget: str | Budget = "standard",
    seeds: int | Sequence[int] | None = None,
    horizon_s: float | None = None,
    performance: PerformanceLike | None = None,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
    density: float | None = None,
    disturbance: str = THROTTLE,
    forms: ScoreForms | None = None,
) -> ScoreQuestion:
    """Return the question of `score_policy` and `compare_policies`; arguments and errors as there."""
    wanted = check_measures(measures)
    allowed = ladders.budget(budget) if isinstance(budget, str) else budget
    if horizon_s is not None:
        allowed = replace(allowed, horizon_s=horizon_s)
    chosen = world_of(world)
    if isinstance(performance, str):
        chosen = replace(chosen, scenario=replace(chosen.scenario, performance=performance))
    worlds = ladders.plan_worlds(chosen, criteria_of(wanted, disturbance), allowed, density=density)
    return ScoreQuestion(
        plan=Plan.product(
            policy_specs(policies, parameters=parameters, caches=caches), worlds, chosen_seeds(seeds, allowed.n_seeds)
        ),
        world=chosen,
        measures=wanted,
        budget=budget if isinstance(budget, str) else "custom",
        performance=own_performance(performance),
        forms=forms or ScoreForms(),
    )


def score_curves(
    path: str | Path,
    *,
    measures: Sequence[str] | None = None,
    performance: PerformanceLike | None = None,
    forms: ScoreForms | None = None,
) -> tuple[ScoreTable, ...]:
    """Score curves from any simulator, one table per policy in the file.

    Args:
        path: CSV or Parquet file with the columns of `CURVE_COLUMNS`.
        measures: Names of measures; default all that the columns allow. The table says which others are missing, and
            why.
        performance: A column of the file in place of `performance`, "1/" and a column, or a function of the rows of a
            run (`Performance`).
        forms: As in `score_policy`.

    Raises:
        CurveError: a file with an error, or a measure that you name and that cannot be computed.
    """
    wanted = check_measures(measures)
    own = own_performance(performance)
    told = {} if performance is None else {"performance": performance if own is None else own.name}
    tables: list[ScoreTable] = []
    for study in read_curves(path, performance):
        scores, missing = score_study(study, wanted, forms)
        if missing and (measures is not None or not scores):
            measure, reason = next(iter(missing.items()))
            raise CurveError(f"Cannot compute {measure} for {study.controller} from {path}: {reason}.")
        tables.append(
            ScoreTable(
                policy=study.controller,
                scenario="",
                scores=scores,
                missing=missing,
                settings={"curves": str(path), "horizon_s": study.horizon_s, **told},
                band=forms is not None and forms.band,
            )
        )
    return tuple(tables)
