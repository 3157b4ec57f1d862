"""The plan of a scoring: which policies, which experiments, which seeds."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from metrics.checks import chosen_seeds

from .columns import THROTTLE
from .contestants import Contestant, PolicyLike, contestants_of
from .measures import ScoreForms, check_measures, criteria_of
from .performance import Performance, PerformanceLike, own_performance

if TYPE_CHECKING:
    from swarm_forage_env.runs.spec import RunSpec
    from swarm_forage_env.scenarios.config import ScenarioConfig
    from swarm_forage_env.scenarios.performance import Quantity
    from swarm_forage_env.studies.ladders import Budget, Experiment


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoringPlan:
    """The runs that score some policies."""

    contestants: tuple[Contestant, ...]
    experiments: "tuple[Experiment, ...]"
    seeds: tuple[int, ...]
    performance: Performance | None = None
    """A function of records that is the performance; None = what the scenario names."""
    measures: tuple[str, ...]
    scenario: "ScenarioConfig"
    budget: "Budget"
    budget_name: str
    """Empty for runs that follow no budget."""
    forms: ScoreForms = field(default_factory=ScoreForms)

    def specs_of(self, contestant: Contestant) -> "tuple[RunSpec, ...]":
        """Return the runs of one policy, seed by seed."""
        from swarm_forage_env.studies.ladders import plan_specs

        return plan_specs(
            self.experiments,
            contestant.policy,
            seeds=self.seeds,
            parameters=contestant.parameters,
            caches=contestant.caches,
        )

    @property
    def specs(self) -> "tuple[RunSpec, ...]":
        """All runs, those of the first policy first."""
        return tuple(spec for contestant in self.contestants for spec in self.specs_of(contestant))

    @property
    def read_as(self) -> "Quantity | Performance":
        """What the performance is: its name and unit, and whether it is a total and adds up over robots."""
        from swarm_forage_env.scenarios.performance import quantity

        return self.performance or quantity(self.scenario.performance)


def plan_scores(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    scenario: "str | ScenarioConfig" = "warehouse_small",
    *,
    measures: Sequence[str] | None = None,
    budget: "str | Budget" = "standard",
    seeds: int | Sequence[int] | None = None,
    horizon_s: float | None = None,
    performance: PerformanceLike | None = None,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
    density: float | None = None,
    disturbance: str = THROTTLE,
) -> ScoringPlan:
    """Return the runs that `score_policy` and `compare_policies` make; arguments and errors as there."""
    from swarm_forage_env.scenarios.presets import scenario as preset
    from swarm_forage_env.studies import ladders as experiments

    wanted = check_measures(measures)
    budget_name = budget if isinstance(budget, str) else "custom"
    allowed = experiments.budget(budget) if isinstance(budget, str) else budget
    if horizon_s is not None:
        allowed = replace(allowed, horizon_s=horizon_s)
    chosen = preset(scenario) if isinstance(scenario, str) else scenario
    if isinstance(performance, str):
        chosen = replace(chosen, performance=performance)
    return ScoringPlan(
        contestants=contestants_of(policies, parameters or {}, chosen, caches),
        experiments=experiments.plan_experiments(chosen, criteria_of(wanted, disturbance), allowed, density=density),
        seeds=chosen_seeds(seeds, allowed.n_seeds),
        measures=wanted,
        scenario=chosen,
        budget=allowed,
        budget_name=budget_name,
        performance=own_performance(performance),
    )
