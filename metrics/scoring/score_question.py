"""What `score_policy` and `compare_policies` ask: how policies do over sizes and adversity, in all measures."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.policy_spec import PolicyLike, policy_specs
from swarm_forage_env.runs.table import Table
from swarm_forage_env.scenarios.performance import Performance, performance_of
from swarm_forage_env.studies import ladders
from swarm_forage_env.studies.ladders import Budget
from swarm_forage_env.wrappers.world import World, WorldLike, world_of

from ..checks import chosen_seeds
from .columns import THROTTLE
from .forecast import forecast_population
from .measures import ScoreForms, check_measures, criteria_of
from .performance import PerformanceLike, own_performance
from .question import Question, failure_lines
from .runs import policy_curves
from .study_scores import score_study
from .table import ScoreTable


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoreQuestion(Question[tuple[ScoreTable, ...]]):
    """The runs that score some policies; the answer is one table per policy."""

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

    def answer(self, table: Table) -> tuple[ScoreTable, ...]:
        """Return one table of scores per policy."""
        return tuple(self._scores(table, policy.label) for policy in self.plan.policies)

    def _scores(self, table: Table, policy: str) -> ScoreTable:
        study = policy_curves(table, policy, self.performance)
        scores, missing = score_study(study, self.measures, self.forms)
        scenario = self.plan.conditions[0].world.scenario
        return ScoreTable(
            policy=policy,
            scenario=self.world.scenario.name,
            scores=scores,
            forecasts=forecast_population(study),
            missing=missing,
            failures=failure_lines(table, policy),
            settings={
                "budget": self.budget,
                "horizon_s": scenario.horizon_s,
                "interval_s": scenario.interval_s,
                "seeds": list(self.plan.seeds),
                "performance": self.read_as.name,
                "n_robots": self.world.n_robots,
                "out": None if table.folder is None else str(table.folder),
            },
        )


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
    """Return what `score_policy` and `compare_policies` ask; arguments and errors as there."""
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
