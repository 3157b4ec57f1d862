"""Run a plan, and turn the records of its runs into one table of scores per policy."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from metrics.queues import PopulationRates

from .contestants import Contestant
from .curves_table import study_curves
from .forecast import forecast_population
from .performance import checked_performance
from .plan import ScoringPlan
from .studies import RunCurves, StudyCurves
from .study_scores import score_study
from .table import ScoreTable

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import polars as pl

    from swarm_forage_env.runs.record import RunRecord
    from swarm_forage_env.runs.runner import StudyResult
    from swarm_forage_env.studies.ladders import Experiment


def run_scores(
    plan: ScoringPlan,
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> tuple[ScoreTable, ...]:
    """Run a plan and return one table per policy; arguments and errors as in `score_policy`."""
    results = run_plan(plan, out=out, jobs=jobs, executor=executor, progress=progress)
    return tuple(_table(plan, contestant, results, out) for contestant in plan.contestants)


def run_plan(
    plan: ScoringPlan,
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: "Executor | None" = None,
    progress: bool = True,
) -> "list[StudyResult]":
    """Run a plan and return the outcomes of its runs; arguments and errors as in `score_policy`."""
    from swarm_forage_env.policies.registry import local_policy
    from swarm_forage_env.runs.runner import run_all
    from swarm_forage_env.runs.store import RunStore

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
    return results


def _table(
    plan: ScoringPlan, contestant: Contestant, results: "Sequence[StudyResult]", out: str | Path | None
) -> ScoreTable:
    planned = {spec.run_id for spec in plan.specs_of(contestant)}
    records = [record for result in results for record in result.records if record.run_id in planned]
    failures = [failure for result in results for failure in result.failures if failure.run_id in planned]
    study = _study(plan, contestant, records)
    scores, missing = score_study(study, plan.measures, plan.forms)
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
            "performance": plan.read_as.name,
            "n_robots": plan.scenario.robots.n_robots,
            "out": None if out is None else str(out),
        },
    )


def _study(plan: ScoringPlan, contestant: Contestant, records: "Sequence[RunRecord]") -> StudyCurves:
    """All planned experiments, those without a finished run included."""
    found: dict[tuple[str, float, int], RunCurves] = {}
    if records:
        (study,) = study_curves(_frame(plan, records), where="the run records")
        found = {(e.criterion, e.value, e.n_robots): e for e in study.experiments}
    experiments: list[RunCurves] = []
    for experiment in plan.experiments:
        key = (experiment.criterion, experiment.value, experiment.scenario.robots.n_robots)
        nothing = RunCurves(criterion=key[0], value=key[1], n_robots=key[2], seeds=(), curves={})
        experiments.append(replace(found.get(key, nothing), rates=rates_of(experiment), n_planned=len(plan.seeds)))
    n_intervals = round(plan.budget.horizon_s / plan.budget.interval_s)
    return StudyCurves(
        controller=contestant.label,
        experiments=tuple(experiments),
        t_end_s=plan.budget.interval_s * np.arange(1.0, n_intervals + 1.0),
        amount=plan.read_as.amount,
        is_total=plan.read_as.is_total,
        adds_up=plan.read_as.adds_up,
    )


def _frame(plan: ScoringPlan, records: "Sequence[RunRecord]") -> "pl.DataFrame":
    """All records in one table, with the performance that the plan asks for."""
    import polars as pl

    frames: list[pl.DataFrame] = []
    for record in records:
        frame, where = record.to_frame(), f"run {record.run_id}"
        if plan.performance is None:
            curve = checked_performance(record.performance, plan.read_as.name, len(frame), where)
        else:
            curve = plan.performance.curve(frame, where)
        frames.append(frame.with_columns(pl.Series("performance", curve)))
    return pl.concat(frames, how="diagonal").sort("criterion", "criterion_value", "n_robots", maintain_order=True)


def rates_of(experiment: "Experiment") -> PopulationRates | None:
    """Return the rates of an experiment, per second; None where the population stays as it is."""
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
