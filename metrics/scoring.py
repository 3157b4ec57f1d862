"""The front door: score any policy in any scenario, or curves from anywhere else.

The one file of this package that knows runs. It imports `swarm_forage_env` when something is run, not before.
"""

import copy
import inspect
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from .comparison import Comparison, compare_tables
from .curves import CurveError
from .forecast import forecast_population
from .queues import PopulationRates
from .score_rows import MEASURE_CRITERIA, check_measures, score_study
from .score_table import ScoreTable
from .study_table import RunCurves, StudyCurves, read_curves, study_curves

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import polars as pl

    from swarm_forage_env.scenarios.config import ScenarioConfig
    from swarm_forage_env.study.experiments import Budget, Experiment
    from swarm_forage_env.study.record import RunRecord
    from swarm_forage_env.study.runner import StudyResult
    from swarm_forage_env.study.spec import RunSpec

PolicyLike: TypeAlias = Any
"""A registered name; the path of a trained policy (*.zip of stable-baselines3, *.npz); a policy object or class; a
function without arguments that returns a policy; a function of observations (N, D) that returns actions (N, 3)."""


@dataclass(frozen=True, kw_only=True, eq=False)
class Contestant:
    """A policy as it is run."""

    label: str
    """Name in tables."""
    policy: str
    """Name in run specifications."""
    parameters: Mapping[str, Any]
    caches: str
    """Which caches its runs have."""
    factory: Callable[..., Any] | None = None
    """Builds the policy in this process, for those that no worker could find by name."""
    is_named: bool = True
    """Whether its runs may be stored: a name tells which policy a stored run belongs to."""


@dataclass(frozen=True, kw_only=True, eq=False)
class ScoringPlan:
    """What would be run to score some policies."""

    contestants: tuple[Contestant, ...]
    experiments: "tuple[Experiment, ...]"
    seeds: tuple[int, ...]
    measures: tuple[str, ...]
    scenario: "ScenarioConfig"
    budget: "Budget"
    budget_name: str

    def specs_of(self, contestant: Contestant) -> "tuple[RunSpec, ...]":
        """Return the runs of one policy, seed by seed."""
        from swarm_forage_env.study.experiments import plan_specs

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


def score_policy(
    policy: PolicyLike,
    scenario: "str | ScenarioConfig" = "warehouse_small",
    *,
    measures: Sequence[str] | None = None,
    budget: "str | Budget" = "standard",
    seeds: int | Sequence[int] | None = None,
    horizon_s: float | None = None,
    name: str | None = None,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> ScoreTable:
    """Run a policy in all experiments that the measures need, and score it.

    Args:
        policy: See `PolicyLike`. What is neither a name nor a path is run in this process, one run at a time; objects
            are copied for each run.
        scenario: Name of a preset, or a complete configuration; its horizon and interval are those of the budget.
        measures: Names out of `MEASURE_CRITERIA`; default all.
        budget: "quick", "standard", "paper" (`swarm_forage_env.study.experiments.BUDGETS`), or one of your own.
        seeds: How many, or which; default those of the budget. Experiments share them, so runs are paired.
        horizon_s: Length of a run in seconds, whole intervals; default that of the budget.
        name: Name in tables and stored runs. A policy given as object or function needs one for `out`; it then stands
            for the code: give another name when the code has changed.
        parameters: Keyword arguments of a registered policy or a class.
        caches: "none", "static", "dynamic"; default the world that the policy is made for.
        out: Folder for run records. Runs it already holds are not repeated, so an interrupted call is just repeated.
        jobs: Processes; default one per core.
        executor: Runs the work instead, for example Dask's `client.get_executor()`.
        progress: Show progress and an estimate on stderr.

    Returns:
        The table. Rows whose runs failed say so, and `failures` says why.

    Raises:
        CurveError: unknown measures.
        ValueError: an unknown policy, scenario, budget, or values that describe no run.
        ImportError: a model, and stable-baselines3 is not installed.
        swarm_forage_env.study.runner.StudyInterrupted: Ctrl-C; finished runs are in `out`.
    """
    plan = plan_scores(
        {name: policy} if name else [policy],
        scenario,
        measures=measures,
        budget=budget,
        seeds=seeds,
        horizon_s=horizon_s,
        parameters=parameters,
        caches=caches,
    )
    return run_scores(plan, out=out, jobs=jobs, executor=executor, progress=progress)[0]


def compare_policies(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    scenario: "str | ScenarioConfig" = "warehouse_small",
    *,
    measures: Sequence[str] | None = None,
    budget: "str | Budget" = "standard",
    seeds: int | Sequence[int] | None = None,
    horizon_s: float | None = None,
    caches: str | None = None,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> Comparison:
    """Score policies in the same worlds and compare them seed by seed.

    Args and errors as in `score_policy`; `policies` are two or more, or a mapping from names to policies.
    """
    plan = plan_scores(
        policies, scenario, measures=measures, budget=budget, seeds=seeds, horizon_s=horizon_s, caches=caches
    )
    return compare_tables(run_scores(plan, out=out, jobs=jobs, executor=executor, progress=progress))


def score_curves(path: str | Path, *, measures: Sequence[str] | None = None) -> tuple[ScoreTable, ...]:
    """Score curves from any simulator, one table per policy in the file.

    Args:
        path: CSV or Parquet file with the columns of `study_table.CURVE_COLUMNS`.
        measures: Default all that the columns allow; the table says which others are missing, and why.

    Raises:
        CurveError: whatever is wrong with the file, or a measure that was asked for and cannot be computed.
    """
    wanted = check_measures(measures)
    tables: list[ScoreTable] = []
    for study in read_curves(path):
        scores, missing = score_study(study, wanted)
        if missing and (measures is not None or not scores):
            measure, reason = next(iter(missing.items()))
            raise CurveError(f"Cannot compute {measure} for {study.controller} from {path}: {reason}.")
        tables.append(
            ScoreTable(
                policy=study.controller,
                scenario="",
                scores=scores,
                forecasts=forecast_population(study),
                missing=missing,
                settings={"curves": str(path), "horizon_s": study.horizon_s},
            )
        )
    return tuple(tables)


def plan_scores(
    policies: Sequence[PolicyLike] | Mapping[str, PolicyLike],
    scenario: "str | ScenarioConfig" = "warehouse_small",
    *,
    measures: Sequence[str] | None = None,
    budget: "str | Budget" = "standard",
    seeds: int | Sequence[int] | None = None,
    horizon_s: float | None = None,
    parameters: Mapping[str, Any] | None = None,
    caches: str | None = None,
) -> ScoringPlan:
    """Return what `score_policy` and `compare_policies` would run; arguments and errors as there."""
    from swarm_forage_env.scenarios.presets import scenario as preset
    from swarm_forage_env.study import experiments

    wanted = check_measures(measures)
    budget_name = budget if isinstance(budget, str) else "custom"
    allowed = experiments.budget(budget) if isinstance(budget, str) else budget
    if horizon_s is not None:
        allowed = replace(allowed, horizon_s=horizon_s)
    world = preset(scenario) if isinstance(scenario, str) else scenario
    named = policies.items() if isinstance(policies, Mapping) else [(None, policy) for policy in policies]
    contestants = tuple(_contestant(policy, name, parameters or {}, world, caches) for name, policy in named)
    contestants = _told_apart(contestants)
    return ScoringPlan(
        contestants=contestants,
        experiments=experiments.plan_experiments(world, {MEASURE_CRITERIA[name] for name in wanted}, allowed),
        seeds=_seeds(seeds, allowed.n_seeds),
        measures=wanted,
        scenario=world,
        budget=allowed,
        budget_name=budget_name,
    )


def run_scores(
    plan: ScoringPlan,
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> tuple[ScoreTable, ...]:
    """Run a plan and return one table per policy; arguments and errors as in `score_policy`."""
    from swarm_forage_env.policies.registry import local_policy
    from swarm_forage_env.study.runner import run_all
    from swarm_forage_env.study.store import RunStore

    store = None if out is None else RunStore(out)
    unnamed = [contestant.label for contestant in plan.contestants if not contestant.is_named]
    if store is not None and unnamed:
        raise ValueError(f"Expected name= for the policy {unnamed[0]}, by which its runs in {out} are found again.")
    found_by_name = [contestant for contestant in plan.contestants if contestant.factory is None]
    specs = tuple(spec for contestant in found_by_name for spec in plan.specs_of(contestant))
    results = [run_all(specs, store=store, jobs=jobs, executor=executor, progress=progress)] if specs else []
    for contestant in plan.contestants:
        if contestant.factory is not None:
            with local_policy(contestant.policy, contestant.factory):
                results.append(run_all(plan.specs_of(contestant), store=store, jobs=1, progress=progress))
    return tuple(_table(plan, contestant, results, out) for contestant in plan.contestants)


def _told_apart(contestants: tuple[Contestant, ...]) -> tuple[Contestant, ...]:
    """Name files of equal names by their folders, too, or by whole paths.

    Raises:
        CurveError: policies still have equal names.
    """
    for n_parts in (2, 0):  # folder and file, all
        counts = Counter(contestant.label for contestant in contestants)
        contestants = tuple(
            replace(contestant, label=str(Path(*Path(contestant.policy).parts[-n_parts:])))
            if counts[contestant.label] > 1
            else contestant
            for contestant in contestants
        )
    labels = [contestant.label for contestant in contestants]
    if len(set(labels)) < len(labels):
        raise CurveError(f"Expected policies of different names, got {', '.join(labels)}; give a mapping from names.")
    return contestants


def _seeds(seeds: int | Sequence[int] | None, default: int) -> tuple[int, ...]:
    if seeds is None or isinstance(seeds, int):
        count = default if seeds is None else seeds
        if count < 1:
            raise ValueError(f"Expected one or more seeds, got {count}.")
        return tuple(range(count))
    if not seeds or len(set(seeds)) < len(seeds):
        raise ValueError(f"Expected different seeds, at least one, got {list(seeds)}.")
    return tuple(seeds)


def _contestant(
    policy: PolicyLike, name: str | None, parameters: Mapping[str, Any], world: "ScenarioConfig", caches: str | None
) -> Contestant:
    """Find out what was given as a policy."""
    from swarm_forage_env.policies.registry import from_callable, is_policy_file
    from swarm_forage_env.study.spec import chosen_caches, pin_policy

    if isinstance(policy, (str, Path)):
        found, pinned, stating = pin_policy(policy, parameters)
        label = name or (Path(policy).stem if is_policy_file(found) else found)
        return Contestant(label=label, policy=found, parameters=pinned, caches=chosen_caches(caches, stating, world))
    if not callable(policy) and not _is_policy(policy):
        raise TypeError(
            "Expected a policy as a registered name, the path of a trained one, an object or class with reset and act, "
            f"or a function of observations, got {policy!r}."
        )
    label = name or getattr(policy, "__name__", type(policy).__name__)
    given: Any = policy
    if inspect.isclass(given) or (not _is_policy(given) and _takes_nothing(given)):
        factory = given
    elif parameters:
        raise ValueError(f"Expected parameters with a name, a file or a class only, got them with {given!r}.")
    else:
        factory = partial(copy.deepcopy, given) if _is_policy(given) else partial(from_callable, given, name=label)
    return Contestant(
        label=label,
        policy=label,
        parameters=parameters,
        caches=chosen_caches(caches, given, world),
        factory=factory,
        is_named=name is not None,
    )


def _is_policy(policy: Any) -> bool:
    return callable(getattr(policy, "act", None)) and callable(getattr(policy, "reset", None))


def _takes_nothing(function: Any) -> bool:
    """Whether a function can only be a factory: it could not take observations."""
    try:
        parameters = inspect.signature(function).parameters.values()
    except ValueError:  # some compiled functions do not tell; they are taken for policies
        return False
    return not any(p.kind in (p.POSITIONAL_ONLY, p.POSITIONAL_OR_KEYWORD, p.VAR_POSITIONAL) for p in parameters)


# --------------------------------------------------------------------------------------------- from runs to a table


def _table(
    plan: ScoringPlan, contestant: Contestant, results: "Sequence[StudyResult]", out: str | Path | None
) -> ScoreTable:
    planned = {spec.run_id for spec in plan.specs_of(contestant)}
    records = [record for result in results for record in result.records if record.run_id in planned]
    failures = [failure for result in results for failure in result.failures if failure.run_id in planned]
    study = _study(plan, contestant, records)
    scores, missing = score_study(study, plan.measures)
    return ScoreTable(
        policy=contestant.label,
        scenario=plan.scenario.name,
        scores=scores,
        forecasts=forecast_population(study),
        missing=missing,
        failures=tuple(f"{failure.spec.describe()}: {failure.error}" for failure in failures),
        settings={
            "budget": plan.budget_name,
            "horizon_s": plan.budget.horizon_s,
            "interval_s": plan.budget.interval_s,
            "seeds": list(plan.seeds),
            "n_robots": plan.scenario.robots.n_robots,
            "out": None if out is None else str(out),
        },
    )


def _study(plan: ScoringPlan, contestant: Contestant, records: "Sequence[RunRecord]") -> StudyCurves:
    """All planned experiments, those without a finished run included."""
    found: dict[tuple[str, float, int], RunCurves] = {}
    if records:
        (study,) = study_curves(_frame(records), where="the run records")
        found = {(e.criterion, e.value, e.n_robots): e for e in study.experiments}
    experiments: list[RunCurves] = []
    for experiment in plan.experiments:
        key = (experiment.criterion, experiment.value, experiment.scenario.robots.n_robots)
        nothing = RunCurves(criterion=key[0], value=key[1], n_robots=key[2], seeds=(), curves={})
        experiments.append(replace(found.get(key, nothing), rates=_rates(experiment), n_planned=len(plan.seeds)))
    n_intervals = round(plan.budget.horizon_s / plan.budget.interval_s)
    return StudyCurves(
        controller=contestant.label,
        experiments=tuple(experiments),
        t_end_s=plan.budget.interval_s * np.arange(1.0, n_intervals + 1.0),
    )


def _frame(records: "Sequence[RunRecord]") -> "pl.DataFrame":
    import polars as pl

    frames = [record.to_frame() for record in records]
    return pl.concat(frames, how="diagonal").sort("criterion", "criterion_value", "n_robots", maintain_order=True)


def _rates(experiment: "Experiment") -> PopulationRates | None:
    """Rates of an experiment, per second."""
    config = experiment.population
    if config is None:
        return None
    dt_s = experiment.scenario.dt_s
    return PopulationRates(
        lambda_d=config.death_per_tick / dt_s,
        lambda_bd=config.malfunction_per_tick / dt_s,
        mu_b=config.birth_per_tick / dt_s,
        mu_bd=config.repair_per_tick / dt_s,
    )
