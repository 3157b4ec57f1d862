"""Score policies, or curves of other simulators and of real robots: which runs their measures need, and their answer.

score(["crw", "dpo"], "warehouse_small", budget="quick", out="results/small")
score(["crw"], curves=read_curves("theirs.csv"))
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import replace
from pathlib import Path
from typing import Any, NamedTuple, cast

import numpy as np
import polars as pl

from swarm_forage_env.runs.plan import Plan, Table, run_plan
from swarm_forage_env.runs.spec import PolicyLike, PolicySpec, policy_specs
from swarm_forage_env.scenarios.performance import performance_of
from swarm_forage_env.studies import ladders
from swarm_forage_env.studies.ladders import Budget
from swarm_forage_env.wrappers.world import SIZE, World, WorldLike, world_of

from ..checks import CurveError, chosen_seeds
from ..curves import Form, Variant
from .answer import Scores
from .frame import scores
from .measures import DISTURBANCES, MEASURES, check_words, checked_request
from .run_curves import THROTTLE, StudyCurves, policy_curves


class Question(NamedTuple):
    """Which runs a score needs, before any is made, and how their table answers it."""

    plan: Plan
    answer: Callable[[Table], Scores]
    """From the table of the runs to the answer, which says which runs failed."""


def score(
    policies: PolicyLike | Sequence[PolicyLike] | Mapping[str, PolicyLike] = (),
    world: WorldLike = "warehouse_small",
    *,
    out: str | Path | None = None,
    jobs: int | None = None,
    executor: Executor | None = None,
    progress: bool = True,
    **asked: Any,
) -> Scores:
    """Run policies in all experiments that the measures need, score them, and compare them seed by seed.

    Args:
        policies: As in `score_question`. With `out` objects, classes and functions need a name.
        world: As in `score_question`.
        out: Folder for run records. Runs that it already holds are not made again, so a call can be repeated.
        jobs: Processes; default one per core.
        executor: Makes the runs in place of the processes, for example Dask's `client.get_executor()`.
        progress: Show progress and an estimate on stderr.
        asked: All further arguments of `score_question`: measures, budget, seeds, curves, against and others.

    Raises:
        CurveError: unknown measures, or a performance that is negative or not a number; of curves a measure that you
            name and that cannot be computed, or a clock or swarm sizes that no policy can be run with.
        ValueError: an unknown policy, performance, scenario, budget, or values that describe no run.
        ImportError: the policy is a model, and stable-baselines3 is not installed.
        KeyboardInterrupt: Ctrl-C; finished runs are in `out`.
    """
    question = score_question(policies, world, **asked)
    return question.answer(run_plan(question.plan, out=out, jobs=jobs, executor=executor, progress=progress))


def score_question(
    policies: PolicyLike | Sequence[PolicyLike] | Mapping[str, PolicyLike] = (),
    world: WorldLike = "warehouse_small",
    *,
    curves: Sequence[StudyCurves] = (),
    measures: Sequence[str] | None = None,
    budget: str | Budget = "standard",
    seeds: int | Sequence[int] | None = None,
    horizon_s: float | None = None,
    density: float | None = None,
    disturbance: str = THROTTLE,
    variants: Sequence[Variant] = ("corrected",),
    forms: Sequence[Form] = ("marginal",),
    against: str | None = None,
    is_full: bool = False,
) -> Question:
    """Return the question of `score`, which has its runs before any is made; errors as there.

    Args:
        policies: One (see `PolicyLike`), several, or a mapping from names to policies. Objects, classes and functions
            run in this process, one run at a time, each with its own copy of an object. `policy_specs` gives policies
            parameters or caches of their own.
        world: Name of a preset, a complete configuration, or a world with wrappers, which then act in all runs. The
            budget sets horizon and interval.
        curves: Runs of other simulators or of real robots, from `read_curves`. Policies then run with swarm sizes,
            numbers of runs and clock of these; without policies the plan has no runs.
        measures: Names in `MEASURES`; default all.
        budget: "quick", "standard", "paper" (`swarm_forage_env.studies.ladders.BUDGETS`), or one of your own. It and
            all until `disturbance` need policies without curves.
        seeds: Their number, or a list; default those of the budget. All experiments use them, so runs are paired.
        horizon_s: Length of a run in seconds, whole intervals; default that of the budget.
        density: Robots per m^2 at all swarm sizes: the arena grows with the swarm, and one robot is in the smallest
            arena. Default: all sizes are in the scenario's arena (in search and rescue: at its density).
        disturbance: Disturbance for reactivity and adaptability: "throttle" (robots lose speed) or "handling_cost"
            (picking up and dropping take longer).
        variants: Of the measures, "corrected" or "paper"; a measure without these is scored in the corrected one.
        forms: "marginal" compares a swarm size with the next smaller one, "interactive" with as many lone robots.
        against: Label of a policy that all others are compared with; default all pairs are compared.
        is_full: Whether the text has all levels, numbers and differences.
    """
    wanted = checked_request(measures, variants, forms)
    chosen = world_of(world)
    specs = policy_specs(cast("Any", policies if isinstance(policies, Mapping | list | tuple) else [policies]))
    labels = [*(spec.label for spec in specs), *(study.controller for study in curves)]
    if against is not None:
        check_words("policy to compare against", [against], labels)
    if curves:
        if (budget, seeds, horizon_s, density, disturbance) != ("standard", None, None, None, THROTTLE):
            raise CurveError(
                "Expected no budget, seeds, length of runs, density or disturbance beside curves, whose runs are as "
                "their file says."
            )
        plan, settings, notes = _asked_beside(curves, specs, chosen)
    else:
        allowed = ladders.budget(budget) if isinstance(budget, str) else budget
        allowed = allowed if horizon_s is None else replace(allowed, horizon_s=horizon_s)
        check_words("disturbance", [disturbance], DISTURBANCES)
        varied = {MEASURES[name].varies for name in wanted}
        criteria = {disturbance if criterion == THROTTLE else criterion for criterion in varied}
        worlds = ladders.plan_worlds(chosen, criteria, allowed, density=density)
        plan = Plan.product(specs, worlds, chosen_seeds(seeds, allowed.n_seeds))
        settings = {"budget": budget if isinstance(budget, str) else "custom", **_settings_of(plan, chosen, allowed)}
        notes = [*_other_objects(chosen, worlds)]

    def answer(table: Table) -> Scores:
        studies = [*(policy_curves(table, spec.label) for spec in specs), *curves]
        frame, missing = scores(studies, wanted, variants=variants, forms=forms)
        for study in curves:
            _refuse_missing(study, frame, missing, is_asked=measures is not None)
        return Scores(
            frame=frame,
            policies=tuple(labels),
            world=chosen.title() if specs else "",
            missing=missing,
            failures={spec.label: lines for spec in specs if (lines := table.failure_lines(spec.label))},
            settings={**settings, "out": None if table.folder is None else str(table.folder)},
            notes=tuple(notes),
            against=against,
            is_full=is_full,
        )

    return Question(plan=plan, answer=answer)


def _asked_beside(
    curves: Sequence[StudyCurves], specs: Sequence[PolicySpec], chosen: World
) -> tuple[Plan, dict[str, Any], list[str]]:
    """Return which runs policies need beside curves, the settings of the answer, and notes on the file."""
    first = curves[0]
    plan = _plan_beside(curves, specs, chosen) if specs else Plan(conditions=(), seeds=(0,))
    counted = sorted({seed for study in curves for runs in study.experiments for seed in runs.seeds})
    settings: dict[str, Any] = {"curves": first.where, "seeds": counted, "horizon_s": first.horizon_s}
    settings |= {"performance": first.read_as.name}
    return plan, settings, [f"{first.where}: {first.note}"] if first.note else []


def _settings_of(plan: Plan, chosen: World, allowed: Budget) -> dict[str, Any]:
    """Return what the answer says of the runs that a budget asks for."""
    return {
        "horizon_s": allowed.horizon_s,
        "interval_s": allowed.interval_s,
        "seeds": list(plan.seeds),
        "performance": performance_of(chosen.scenario.performance).name,
        "n_robots": chosen.n_robots,
    }


def _refuse_missing(
    study: StudyCurves, frame: pl.DataFrame, missing: Mapping[tuple[str, str], str], *, is_asked: bool
) -> None:
    """Refuse curves that lack a measure that was asked for, or all of them."""
    reasons = {label: why for (policy, label), why in missing.items() if policy == study.controller}
    if reasons and (is_asked or frame.filter(policy=study.controller).is_empty()):
        label, reason = next(iter(reasons.items()))
        raise CurveError(f"Cannot compute {label} for {study.controller} from {study.where}: {reason}.")


def _other_objects(world: World, worlds: Sequence[World]) -> Iterator[str]:
    """Yield how worlds over swarm sizes differ from the world that was named, where they do."""
    there = {each.scenario.objects.n_objects for each in worlds if each.criterion == SIZE}
    here = world.scenario.objects.n_objects
    if there - {here}:
        objects = " or ".join(f"{n:,}" for n in sorted(there))
        yield f"rows over N have {objects} objects, enough for large swarms; 'run' has the {here:,} of the scenario"


def _plan_beside(given: Sequence[StudyCurves], policies: Sequence[PolicySpec], world: World) -> Plan:
    """Return the runs of policies in a world with the swarm sizes, numbers of runs and clock of curves."""
    clock, where = given[0].t_end_s, given[0].where
    sizes = {size.n_robots: size.seeds for study in given for size in study.sizes()}
    if clock is None or not np.allclose(np.diff(clock, prepend=0.0), clock[0]):
        raise CurveError(
            f"Expected equal intervals of known length in {where} to run policies alike; tell their length in s."
        )
    if not sizes:
        raise CurveError(f"Expected curves of several swarm sizes in {where} to run policies alike, got none.")
    scenario = replace(world.scenario, horizon_s=float(clock[-1]), interval_s=float(clock[0]))
    worlds = [
        World(replace(scenario, robots=replace(scenario.robots, n_robots=n)), world.wrappers, criterion=SIZE, value=n)
        for n in sorted(sizes)
    ]
    twice = {policy.label for policy in policies} & {study.controller for study in given}
    if twice:
        raise CurveError(
            f"Expected other names in {where} than those of the policies beside it, got {min(twice)} in both."
        )
    return Plan.product(policies, worlds, sorted({seed for seeds in sizes.values() for seed in seeds}))
