"""How policies are judged while they learn: by runs in fixed worlds, beside a controller. The best one is kept.

    evaluator = Evaluator(plan, "results/mine/seed_0", {"by": "my_learner.py"})
    ...                                              # learn for some decisions
    if evaluator.is_due(decisions):
        print(evaluator.evaluate(network, decisions))

The folder becomes that of a training: `swarm-forage train curves` draws it. Deliveries of eight robots and of five
hundred cannot be added up. So in several worlds the policy is compared with the baseline of each: what counts is the
mean of the ratios, or the worst of them.
"""

import dataclasses
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from functools import cached_property, partial
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import polars as pl

from swarm_forage_env._internal.fields import (
    MOST_SEEDS,
    Checked,
    ConfigError,
    Count,
    FileName,
    Name,
    Positive,
    Whole,
    checked,
    whole,
)
from swarm_forage_env._internal.files import check_folder, replacing
from swarm_forage_env.contract.policy import Policy
from swarm_forage_env.policies.network import Network, NetworkPolicy
from swarm_forage_env.runs.plan import Condition, Plan, Table, finished_runs
from swarm_forage_env.runs.run import clocks_s
from swarm_forage_env.runs.spec import PolicySpec, policy_spec
from swarm_forage_env.runs.versions import software_versions
from swarm_forage_env.scenarios.overrides import with_overrides
from swarm_forage_env.wrappers.world import World

BEST = "best"
"""As a baseline: the best of the paper's controllers in that world, each with the caches that it is made for."""
EVALUATE_EVERY = 1_000_000
"""Decisions of single robots between two evaluations, at least; our choice."""
PLAN_FILE = "plan.json"
EVALUATIONS_FILE = "evaluations.csv"
MODEL_FILE = "model.zip"
POLICY_FILE = "policy.npz"
LEARNING = PolicySpec(label="policy", policy="policy")
"""The policy that is trained, in its evaluations."""
EXPORTABLE = ("ppo", "a2c", "dqn")
"""Algorithms whose networks a file can hold."""

Baselines: TypeAlias = Mapping[str, tuple[str, float]]
"""Name of a world -> the policy to compare with, and its performance per 1,000 s."""


@dataclass(frozen=True, slots=True)
class EvaluationWorld(World):
    """A fixed world to judge a policy in; its name is by default the scenario's with the number of robots."""

    baseline: str = field(default=BEST, kw_only=True)
    """Policy to compare with, or "best"."""

    def __post_init__(self) -> None:
        World.__post_init__(self)
        checked("the name of a world", self.name, FileName)
        checked("baseline", self.baseline, Name)

    def _default_name(self) -> str:
        return f"{self.scenario.name}_{self.n_robots}"


@dataclass(frozen=True, kw_only=True, slots=True)
class EvaluationPlan(Checked):
    """How a policy is judged meanwhile: whole runs of the plan's world, or of others, beside a controller.

    Raises:
        ConfigError: a value that cannot be, or worlds of equal names.
    """

    called = "evaluation"
    every_steps: Whole = EVALUATE_EVERY
    """Decisions between two evaluations; there is one more at the end of each stage."""
    horizon_s: Positive | None = None
    """Length of a run, s; None = that of the world. Jams build up, so that short runs promise too much."""
    n_runs: Whole = 1
    first_seed: Count = 1_000_000
    """Seeds are counted up from here, away from those of training."""
    baseline: Name = "crw"
    """Controller to compare with in the world of the plan, run once under the same seeds; worlds have their own."""
    worlds: tuple[EvaluationWorld, ...] = ()
    """Worlds to judge the policy in; none = that of the plan."""
    chosen_by: Literal["mean", "worst"] = "mean"
    """By which ratio to the baselines of all worlds the network is chosen."""

    def check(self) -> None:
        """Refuse worlds of equal names, and more runs than anybody waits for."""
        whole("evaluation.n_runs", self.n_runs, at_least=1, at_most=MOST_SEEDS)
        names = [world.name for world in self.worlds]
        if len(set(names)) < len(names):
            raise ConfigError(f"Expected evaluation.worlds with different names, got {', '.join(names)}; give names.")

    @property
    def seeds(self) -> tuple[int, ...]:
        """Seeds of the runs in each world."""
        return tuple(range(self.first_seed, self.first_seed + self.n_runs))

    def worlds_of(self, world: World) -> tuple[EvaluationWorld, ...]:
        """Return the worlds that a policy is judged in, with runs as long as the plan says.

        Args:
            world: That of the training; judged in where the plan has no others.
        """
        own = EvaluationWorld(world.scenario, world.wrappers, name=world.name, baseline=self.baseline)
        worlds = self.worlds or (own,)
        if self.horizon_s is None:
            return worlds
        return tuple(replace(one, scenario=with_overrides(one.scenario, horizon_s=self.horizon_s)) for one in worlds)


@dataclass(frozen=True, kw_only=True, slots=True)
class WorldEvaluation:
    """How a policy did in one world; means over runs."""

    world: str
    baseline_policy: str
    performance: float
    """What the scenario counts, per 1,000 simulated s."""
    baseline: float
    """The same of the baseline."""
    ratio: float
    """Performance over that of the baseline."""
    interference_fraction: float
    """Mean fraction of active robots in interference."""


@dataclass(frozen=True, kw_only=True, slots=True)
class Evaluation:
    """How a policy did at some point of its training."""

    steps: int
    """Decisions of single robots so far."""
    wall_time_s: float
    """Time spent on the training, s; a resumed one counts on from its latest evaluation."""
    cpu_time_s: float
    """Processor time of the training, s, counted on likewise, without that of further processes."""
    reached: float
    """What counts: performance per 1,000 s in the world of the plan, or the mean or worst ratio in several worlds."""
    worlds: tuple[WorldEvaluation, ...]
    """How it did in each world, one or more."""

    @property
    def interference_fraction(self) -> float:
        """Mean fraction of active robots in interference, over all worlds."""
        return float(np.mean([world.interference_fraction for world in self.worlds]))

    @property
    def levels(self) -> tuple[float, float]:
        """What counts, and interference."""
        return self.reached, self.interference_fraction


def _means(table: Table, condition: Condition) -> tuple[float, float]:
    """Return performance per 1,000 s and interference, means over the runs of a condition."""
    records = table.of(condition)
    performance = np.mean([record.per_1000_s("performance") for record in records])
    return float(performance), float(np.mean([record["interference_fraction"].mean() for record in records]))


def baseline_runs(plan: EvaluationPlan, world: World) -> Plan:
    """Return the runs of all policies that may be a baseline; raises ConfigError where there is no such policy."""
    from metrics.controllers import (
        PAPER_POLICIES,  # late: a user's own metrics.py must not keep a training from running
    )

    conditions = tuple(
        Condition(policy_spec(name, label=name), place)
        for place in plan.worlds_of(world)
        for name in (PAPER_POLICIES if place.baseline == BEST else (place.baseline,))
    )
    return Plan(conditions=conditions, seeds=plan.seeds)


def baselines_of(plan: EvaluationPlan, world: World) -> dict[str, tuple[str, float]]:
    """Run the policies that a training is compared with; returns the best in each world, as `Baselines`."""
    table = finished_runs(baseline_runs(plan, world))
    found: dict[str, tuple[str, float]] = {}
    for condition in table.plan.conditions:
        name, (performance, _) = condition.world.name, _means(table, condition)
        if name not in found or performance > found[name][1]:
            found[name] = condition.policy.label, performance
    return found


def judged(plan: EvaluationPlan, table: Table, policy: str, baselines: Baselines) -> tuple[WorldEvaluation, ...]:
    """Return how a policy, by its label in the runs, did in each world beside its baseline."""
    found: list[WorldEvaluation] = []
    for condition in table.plan.of_policy(policy):
        (performance, interference), place = _means(table, condition), condition.world
        name, reached = baselines[place.name]
        found.append(
            WorldEvaluation(
                world=place.name,
                baseline_policy=name,
                performance=performance,
                baseline=reached,
                ratio=performance / max(reached, 1000.0 / (place.scenario.horizon_s * plan.n_runs)),
                interference_fraction=interference,
            )
        )
    return tuple(found)


def reached_in(plan: EvaluationPlan, worlds: Sequence[WorldEvaluation]) -> float:
    """Return what counts of how a policy did; see `Evaluation.reached`.

    A baseline that brings nothing home counts as if it had brought one object in all runs together (our choice: there
    is a ratio then, and finding what it does not find is still worth a lot).
    """
    if not plan.worlds:
        return worlds[0].performance
    ratios = [world.ratio for world in worlds]
    return float(np.mean(ratios) if plan.chosen_by == "mean" else np.min(ratios))


def reached_by(evaluations: Sequence[Evaluation], steps: int) -> float:
    """Return what counts of the first evaluation after so many decisions, nan before there is one."""
    return next((each.reached for each in evaluations if each.steps >= steps), math.nan)


def best_of(evaluations: Sequence[Evaluation]) -> Evaluation:
    """Return the evaluation whose network is kept: the best one, and the latest of equal ones."""
    return max(reversed(evaluations), key=lambda each: each.reached)


_TIMES = {"steps": pl.Int64, "wall_time_s": pl.Float64, "cpu_time_s": pl.Float64, "reached": pl.Float64}
_COLUMNS = pl.Schema(
    {
        **_TIMES,
        **{
            item.name: pl.String if item.name in ("world", "baseline_policy") else pl.Float64
            for item in dataclasses.fields(WorldEvaluation)
        },
    }
)


def write_evaluations(path: Path, evaluations: Sequence[Evaluation]) -> None:
    """Write a row for each evaluation and world, whole or not at all."""
    rows = [
        {**{name: getattr(each, name) for name in _TIMES}, **asdict(world)}
        for each in evaluations
        for world in each.worlds
    ]
    with replacing(path) as draft:
        pl.DataFrame(rows, schema=_COLUMNS).write_csv(draft)


def read_evaluations(path: Path) -> list[Evaluation]:
    """Return the evaluations of a file, none if there is no file; raises ConfigError if it holds something else."""
    if not path.exists():
        return []
    try:
        frame = pl.read_csv(path, schema_overrides=_COLUMNS)
        if frame.schema != _COLUMNS or frame.null_count().sum_horizontal().item():
            raise ValueError(f"Expected the columns {', '.join(_COLUMNS)}, each with a value in every row.")
    except (pl.exceptions.PolarsError, ValueError) as error:
        reason = " ".join(str(error).split())[:200]
        raise ConfigError(f"Cannot read the evaluations in {path}: {reason}; repair or remove the file.") from error
    found: list[Evaluation] = []
    for _, rows in frame.group_by("steps", maintain_order=True):
        worlds = tuple(WorldEvaluation(**row) for row in rows.drop(*_TIMES).iter_rows(named=True))
        found.append(Evaluation(**rows.select(*_TIMES).row(0, named=True), worlds=worlds))
    return found


def check_unused(folder: Path, advice: str) -> None:
    """Refuse a folder that holds a training with a ConfigError; `advice` says what to do about it."""
    if any((folder / name).exists() for name in (MODEL_FILE, EVALUATIONS_FILE, POLICY_FILE)):
        raise ConfigError(f"Expected an unused folder, got {folder} with a training run; {advice}.")


class Evaluator:
    """Runs networks in the worlds of a plan's evaluation, beside its baselines, and keeps the best one.

    Attributes:
        plan: Of the training.
        evaluations: All of them, oldest first.
        baselines: What networks are compared with in each world; run when they are asked for.
    """

    def __init__(
        self,
        plan: Any,
        folder: str | Path,
        made_by: Mapping[str, Any],
        *,
        resume: bool = False,
    ) -> None:
        """Begin a training, or go on with one.

        Args:
            plan: A `TrainingPlan`: says the worlds, when they are run, and which network counts as best.
            folder: Gets `plan.json`, `evaluations.csv` and `policy.npz`. It is made if it is not there.
            made_by: What the card of the network says besides plan, evaluation and versions, as plain values. Its
                `versions`, if any, are added to ours.
            resume: Go on after the evaluations in the folder.

        Raises:
            ConfigError: the folder holds a training and `resume` is False, or a baseline is no policy.
            OSError: the folder cannot be made or written to.
        """
        self.plan, self._folder, self._started_s = plan, Path(folder), clocks_s()
        self._made_by = {**made_by, "versions": {**software_versions(), **made_by.get("versions", {})}}
        if not resume:
            check_unused(self._folder, "choose another folder, or remove it")
        check_folder(self._folder)
        baseline_runs(plan.evaluation, plan.world)
        self.evaluations = read_evaluations(self._folder / EVALUATIONS_FILE)
        last = self.evaluations[-1] if self.evaluations else None
        self._before_s = (0.0, 0.0) if last is None else (last.wall_time_s, last.cpu_time_s)

    @cached_property
    def baselines(self) -> Baselines:
        """Name of a world -> the policy to compare with, and its performance per 1,000 s."""
        if not self.evaluations:
            return baselines_of(self.plan.evaluation, self.plan.world)
        return {world.world: (world.baseline_policy, world.baseline) for world in self.evaluations[-1].worlds}

    def spent_s(self) -> tuple[float, float]:
        """Return time and processor time of the training so far, s."""
        wall_s, cpu_s = (clocks_s() - self._started_s).tolist()
        return self._before_s[0] + wall_s, self._before_s[1] + cpu_s

    def is_due(self, steps: int) -> bool:
        """Return whether an evaluation is due after so many decisions of single robots.

        That is when `every_steps` of the plan have passed since the last one, and at the end of each stage and start.
        """
        last = self.evaluations[-1].steps if self.evaluations else 0
        parts = self.plan.parts(self.evaluations)
        return steps - last >= self.plan.evaluation.every_steps or any(last < end <= steps for _, end in parts)

    def evaluate(
        self, network: Network | None, steps: int, *, policy: Callable[[], Policy] | None = None
    ) -> Evaluation:
        """Run a network as the policy that comes of the plan, and write its file if none did better.

        Args:
            network: It sees and acts as the plan's interface says, by which it learns. None: nothing is written of it.
            steps: Decisions of single robots so far, more than at the last evaluation. They need not be due.
            policy: Makes what is run in place of the network.

        Raises:
            ConfigError: the network sees or acts in another way, there are no more decisions than at the last
                evaluation, or a run failed.
        """
        plan, folder = self.plan, self._folder
        last = self.evaluations[-1].steps if self.evaluations else -1
        if steps <= last:
            raise ConfigError(f"Expected more decisions than at the last evaluation, {last}, got {steps}.")
        kept = None if network is None else plan.as_kept(network)
        if kept is not None and policy is None:
            policy = partial(NetworkPolicy, kept)
        places = plan.evaluation.worlds_of(plan.world)
        table = finished_runs(Plan.product([replace(LEARNING, factory=policy)], places, plan.evaluation.seeds))
        worlds = judged(plan.evaluation, table, LEARNING.label, self.baselines)
        wall_s, cpu_s = self.spent_s()
        evaluation = Evaluation(
            steps=steps,
            wall_time_s=round(wall_s, 1),
            cpu_time_s=round(cpu_s, 1),
            reached=reached_in(plan.evaluation, worlds),
            worlds=worlds,
        )
        self.evaluations.append(evaluation)
        plan.write(folder / PLAN_FILE)
        if kept is not None and best_of(self.evaluations) is evaluation:  # the network first: no table without it
            card = {**self._made_by, "plan": plan.to_mapping(), "evaluation": asdict(evaluation)}
            replace(kept, about=replace(kept.about, card=card)).save(folder / POLICY_FILE)
        write_evaluations(folder / EVALUATIONS_FILE, self.evaluations)
        return evaluation
