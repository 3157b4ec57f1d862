"""How a training goes: what is told of it, how policies do in its evaluations, and what its folder keeps.

`plan.json` holds the plan, `evaluations.csv` a row per evaluation, with several worlds a row for each of them and one
for all. They are readable without the library that trained.
"""

import csv
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass, fields, replace
from pathlib import Path
from typing import Any, TypeAlias

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.files import replacing
from swarm_forage_env.policies.network import Network
from swarm_forage_env.runs.plan import Condition, Plan, Table, run_plan
from swarm_forage_env.runs.spec import PolicySpec, policy_spec
from swarm_forage_env.training.evaluation_plan import ALL_WORLDS, BEST, CHOSEN_BY, EvaluationPlan, EvaluationWorld
from swarm_forage_env.training.plan import TrainingPlan, read_plan
from swarm_forage_env.wrappers.world import World


@dataclass(frozen=True, kw_only=True, slots=True)
class WorldEvaluation:
    """How the policy did in one of several worlds; means over runs."""

    world: str
    """Name of the world."""
    performance: float
    """What the scenario counts, per 1,000 simulated s."""
    baseline: float
    """The same of the baseline."""
    ratio: float
    """Performance over that of the baseline; see `evaluation_plan`."""
    interference_fraction: float
    """Mean fraction of active robots in interference."""
    baseline_policy: str
    """Which policy the baseline is."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Evaluation:
    """How the policy did at some point of the training, beside the baseline; means over runs.

    With several worlds, `performance` is the mean or the worst of their ratios to the baselines, and `baseline` is 1.
    """

    steps: int
    """Decisions of single robots so far."""
    wall_time_s: float
    """Time spent on the training, s; a resumed one counts on from its latest evaluation."""
    performance: float
    """What the scenario counts, per 1,000 simulated s."""
    baseline: float
    """The same of the baseline."""
    interference_fraction: float
    """Mean fraction of active robots in interference."""
    cpu_time_s: float
    """Processor time spent on the training, s, counted on like `wall_time_s`, without that of further processes."""
    worlds: tuple[WorldEvaluation, ...] = ()
    """How it did in each of several worlds; none where there is only that of the plan."""

    def to_mapping(self) -> dict[str, Any]:
        """Return the evaluation as plain values, with `worlds` only where there are several."""
        plain = asdict(self)
        if not self.worlds:
            del plain["worlds"]
        return plain


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingStatus:
    """Where a training run stands."""

    steps: int
    """Decisions of single robots so far."""
    wall_time_s: float
    """Time spent on the training, s; a resumed one counts on from its latest evaluation."""
    episode_return: float
    """Mean return of the latest episodes, nan before the first."""


Baselines: TypeAlias = Mapping[str, tuple[str, float]]
"""Name of a world -> the policy to compare with, and its performance per 1,000 s."""


def finished_runs(plan: Plan, *, jobs: int | None = 1, progress: bool = False) -> Table:
    """Make the runs of a plan, all of them; arguments as in `runs.plan.run_plan`.

    Raises:
        ConfigError: a run failed.
    """
    table = run_plan(plan, jobs=jobs, progress=progress)
    for failure in table.failures.values():
        raise ConfigError(
            f"Expected all runs of evaluations to finish, got {failure.error} in {failure.spec.describe()}."
        )
    return table


def baseline_runs(plan: TrainingPlan) -> Plan:
    """Return the runs of all policies that may be the baseline of a world.

    In the plan's scenario it has the caches of the scenario; those of other worlds have their own.
    """
    return Plan(
        conditions=tuple(condition for world in plan.judging_worlds for condition in _baselines_of(world, plan)),
        seeds=plan.evaluation.seeds,
    )


def _baselines_of(world: World, plan: TrainingPlan) -> list[Condition]:
    from metrics.controllers import (
        PAPER_POLICIES,  # late: a user's own metrics.py must not keep a training from running
    )

    if not isinstance(world, EvaluationWorld):
        return [Condition(replace(_called(plan.evaluation.baseline), caches=None), world)]
    names = PAPER_POLICIES if world.baseline == BEST else (world.baseline,)
    return [Condition(_called(name), world) for name in names]


def _called(name: str) -> PolicySpec:
    return policy_spec(name, label=name)


def best_baselines(table: Table) -> dict[str, tuple[str, float]]:
    """Return the policy that did best in each world, as `Baselines`."""
    found: dict[str, tuple[str, float]] = {}
    for condition in table.plan.conditions:
        world = condition.world.name
        performance, _ = means(table, condition)
        if world not in found or performance > found[world][1]:
            found[world] = condition.policy.label, performance
    return found


def baselines_of(plan: TrainingPlan) -> dict[str, tuple[str, float]]:
    """Run the policies that a training is compared with; returns the best in each world, as `Baselines`.

    Raises:
        ConfigError: a run failed.
    """
    return best_baselines(finished_runs(baseline_runs(plan)))


def known_baselines(plan: TrainingPlan, evaluation: Evaluation) -> dict[str, tuple[str, float]]:
    """Return the baselines of an evaluation, as `Baselines`."""
    if not evaluation.worlds:
        return {plan.judging_worlds[0].name: (plan.evaluation.baseline, evaluation.baseline)}
    return {world.world: (world.baseline_policy, world.baseline) for world in evaluation.worlds}


def means(table: Table, condition: Condition) -> tuple[float, float]:
    """Return performance per 1,000 s and interference of a policy in a world, means over its runs."""
    records = table.of(condition)
    performance = np.mean([record.per_1000_s("performance") for record in records])
    return float(performance), float(np.mean([record["interference_fraction"].mean() for record in records]))


def judged(table: Table, policy: str, baselines: Baselines) -> tuple[WorldEvaluation, ...]:
    """Return how a policy did in each world.

    Args:
        table: The runs.
        policy: Its label in them.
        baselines: What it is compared with.
    """
    found: list[WorldEvaluation] = []
    for condition in table.plan.of_policy(policy):
        performance, interference = means(table, condition)
        name, reached = baselines[condition.world.name]
        found.append(
            WorldEvaluation(
                world=condition.world.name,
                performance=performance,
                baseline=reached,
                ratio=ratio_to(reached, performance, condition.world.scenario.horizon_s * len(table.plan.seeds)),
                interference_fraction=interference,
                baseline_policy=name,
            )
        )
    return tuple(found)


def in_all_worlds(plan: EvaluationPlan, found: Sequence[WorldEvaluation]) -> tuple[float, float]:
    """Return what counts of how a policy did, and its mean interference.

    That is performance per 1,000 s; in several worlds the mean or the worst of their ratios to the baselines.
    """
    performance = CHOSEN_BY[plan.chosen_by]([world.ratio for world in found]) if plan.worlds else found[0].performance
    return float(performance), float(np.mean([world.interference_fraction for world in found]))


def lacks_evaluation(plan: TrainingPlan, evaluations: Sequence[Evaluation], steps: int) -> bool:
    """Return whether an evaluation is due after so many decisions of single robots.

    That is when `every_steps` of the plan have passed since the last one, and at the end of each stage.
    """
    last = evaluations[-1].steps if evaluations else 0
    ends = np.cumsum([stage.steps for stage in plan.stages])
    return steps - last >= plan.evaluation.every_steps or bool(np.any((ends > last) & (ends <= steps)))


def evaluated(
    plan: TrainingPlan,
    policy: PolicySpec,
    baselines: Baselines,
    *,
    steps: int,
    spent_s: Callable[[], tuple[float, float]],
) -> Evaluation:
    """Return how a policy does in the worlds of the plan's evaluation.

    Args:
        plan: Of the training.
        policy: Its policy as it is now.
        baselines: What it is compared with.
        steps: Decisions of single robots so far.
        spent_s: Tells the time of the training so far and its processor time, s; asked after the runs.

    Raises:
        ConfigError: a run failed.
    """
    worlds = judged(finished_runs(plan.judging(policy)), policy.label, baselines)
    performance, interference = in_all_worlds(plan.evaluation, worlds)
    wall_time_s, cpu_time_s = spent_s()
    return Evaluation(
        steps=steps,
        wall_time_s=round(wall_time_s, 1),
        performance=performance,
        baseline=1.0 if plan.evaluation.worlds else worlds[0].baseline,
        interference_fraction=interference,
        cpu_time_s=round(cpu_time_s, 1),
        worlds=worlds if plan.evaluation.worlds else (),
    )


def ratio_to(baseline: float, performance: float, seconds: float) -> float:
    """Return the ratio of a performance to that of the baseline, both per 1,000 s.

    A baseline that brings nothing home counts as if it had brought one object in all runs together (our choice: there
    is a ratio then, and finding what it does not find is still worth a lot).

    Args:
        baseline: Of the baseline.
        performance: Of the policy.
        seconds: Simulated seconds of all runs of one of them.
    """
    return performance / max(baseline, 1000.0 / seconds)


def as_kept(network: Network, plan: TrainingPlan) -> Network:
    """Return a network as the policy that comes of a plan: at its temperature, with the interface that it has in runs.

    Raises:
        NetworkError: the plan has a temperature, and the network does not draw discrete actions.
    """
    sharpened = network.at_temperature(plan.temperature)
    return replace(sharpened, about=replace(sharpened.about, interface=plan.run_interface))


def chosen(evaluations: Sequence[Evaluation]) -> Evaluation:
    """Return the evaluation whose network is kept: the best one, and the latest of equal ones."""
    return max(reversed(evaluations), key=lambda each: each.performance)


PLAN_FILE = "plan.json"
EVALUATIONS_FILE = "evaluations.csv"
MODEL_FILE = "model.zip"
POLICY_FILE = "policy.npz"
_TOLD_ONCE = ("steps", "wall_time_s", "cpu_time_s")
"""Columns that are the same in the rows of all worlds of an evaluation."""
_COLUMNS = tuple(item.name for item in fields(Evaluation) if item.name != "worlds")
_WORLD_COLUMNS = (*_TOLD_ONCE, *(item.name for item in fields(WorldEvaluation)))
_WORDS = ("world", "baseline_policy")
"""Columns that hold no numbers."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainingCurve:
    """How a training went."""

    label: str
    """Name of its folder."""
    plan: TrainingPlan
    evaluations: tuple[Evaluation, ...]
    """At least one, oldest first."""


def read_training(folder: Path) -> TrainingCurve:
    """Return how the training of a folder went.

    Raises:
        ConfigError: there is no training in the folder, it has not been evaluated yet, or a file is damaged.
    """
    if not (folder / PLAN_FILE).exists():
        raise ConfigError(f"Expected the folder of a training, got {folder} without {PLAN_FILE}.")
    evaluations = read_evaluations(folder / EVALUATIONS_FILE)
    below = sorted(path.parent.name for path in folder.glob(f"*/{EVALUATIONS_FILE}"))
    if not evaluations and below:
        raise ConfigError(
            f"Expected the folder of one training, got {folder} with several below it; name them: "
            f"{' '.join(str(folder / name) for name in below)}."
        )
    if not evaluations:
        raise ConfigError(f"Expected a training with evaluations, got {folder} without any in {EVALUATIONS_FILE}.")
    return TrainingCurve(
        label=folder.resolve().name, plan=read_plan(folder / PLAN_FILE), evaluations=tuple(evaluations)
    )


def check_unused(folder: Path, advice: str) -> None:
    """Refuse a folder that holds a training; `advice` says what to do about it.

    Raises:
        ConfigError: see above.
    """
    if any((folder / name).exists() for name in (MODEL_FILE, EVALUATIONS_FILE, POLICY_FILE)):
        raise ConfigError(f"Expected an unused folder, got {folder} with a training run; {advice}.")


def kept_plan(folder: Path, *, is_shared: bool = False) -> TrainingPlan:
    """Return the plan of the training that a folder holds, or that several have in common (`is_shared`).

    Raises:
        ConfigError: it does not hold a training that can be resumed, or no plan of several.
    """
    for name in (PLAN_FILE,) if is_shared else (PLAN_FILE, MODEL_FILE):
        if not (folder / name).exists():
            wanted = (
                f"trainings to resume, with {PLAN_FILE}"
                if is_shared
                else (f"a training to resume, {PLAN_FILE} and the checkpoint {MODEL_FILE}")
            )
            raise ConfigError(f"Expected {folder} to hold {wanted}, found no {name}; without resume a new one starts.")
    return read_plan(folder / PLAN_FILE)


def resumed_plan(
    folder: Path, described: TrainingPlan | None = None, steps: int | None = None, *, is_shared: bool = False
) -> TrainingPlan:
    """Return the plan of the training in a folder, to resume it; `steps` can make it longer.

    Args:
        folder: Folder of the training.
        described: Plan that must agree with it but for the number of steps; None if there is none.
        steps: Decisions in all; None = those of the plan.
        is_shared: The folder is that of several trainings; see `training.seeds`.

    Raises:
        ConfigError: no training in the folder, options that differ from its plan, or fewer steps.
    """
    kept = kept_plan(folder, is_shared=is_shared)
    plan = kept if steps is None else kept.longer(steps)
    if described is not None:
        begun, wanted = ([(stage.scenario, stage.options) for stage in each.stages] for each in (kept, described))
        # The options would divide the steps into other stages; a training keeps its own stages.
        wanted_plan = replace(described, stages=plan.stages) if begun == wanted else described
        differences = wanted_plan.differences(kept)
        if differences:
            raise ConfigError(
                f"Expected options that agree with {folder / PLAN_FILE}, got others: {'; '.join(differences)}. "
                "Without options but --out and --steps, --resume goes on by that plan."
            )
    return plan


def write_evaluations(path: Path, evaluations: Sequence[Evaluation]) -> None:
    """Write all evaluations of a training, whole or not at all.

    Where there are several worlds, an evaluation has a row for each and one for "all" of them, in which performance is
    the ratio that counts; see `evaluation_plan`.
    """
    in_worlds = any(evaluation.worlds for evaluation in evaluations)
    with replacing(path) as draft, draft.open("w", newline="", encoding="utf-8") as file:
        table = csv.DictWriter(file, _WORLD_COLUMNS if in_worlds else _COLUMNS, restval="")
        table.writeheader()
        for evaluation in evaluations:
            plain = {name: getattr(evaluation, name) for name in _COLUMNS}
            if in_worlds:
                told = {name: plain[name] for name in _TOLD_ONCE}
                table.writerows({**told, **asdict(world)} for world in evaluation.worlds)
                plain |= {"world": ALL_WORLDS, "ratio": evaluation.performance}
            table.writerow(plain)


def read_evaluations(path: Path) -> list[Evaluation]:
    """Return the evaluations of a file, none if there is no file.

    Raises:
        ConfigError: the file holds something else.
    """
    if not path.exists():
        return []
    try:
        with path.open(newline="", encoding="utf-8") as file:
            return _evaluations_of(csv.DictReader(file))
    except (ValueError, TypeError, KeyError, csv.Error) as error:
        raise ConfigError(f"Cannot read the evaluations in {path}: {error}; repair or remove the file.") from error


def _evaluations_of(rows: Iterable[dict[str, str]]) -> list[Evaluation]:
    found: list[Evaluation] = []
    worlds: list[WorldEvaluation] = []
    for row in rows:
        words = {name: row.pop(name) for name in _WORDS if name in row}
        if words.get("world", ALL_WORLDS) != ALL_WORLDS:
            told: dict[str, Any] = {name: float(text) for name, text in row.items() if name not in _TOLD_ONCE}
            worlds.append(WorldEvaluation(**{**told, **words}))
            continue
        if words:
            del row["ratio"]  # of all worlds: it is the performance
        numbers = {name: float(text) for name, text in row.items()}
        found.append(Evaluation(**{**numbers, "steps": int(numbers["steps"]), "worlds": tuple(worlds)}))  # type: ignore[arg-type] - worlds are the only tuple
        worlds = []
    return found
