"""How trainings went, beside other policies in the runs of their evaluations.

found = curves(["results/training/first", "results/training/second"])
print(found)                    # at their best
found.draw("curves.png")        # performance and interference over decisions
"""

import math
import os
import shlex
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import counted
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.runs.plan import Plan, finished_runs
from swarm_forage_env.runs.progress import duration
from swarm_forage_env.runs.spec import policy_specs
from swarm_forage_env.scenarios.performance import performance_of
from swarm_forage_env.sheet import Answer, Sheet
from swarm_forage_env.training.evaluation import (
    EVALUATIONS_FILE,
    EXPORTABLE,
    MODEL_FILE,
    PLAN_FILE,
    POLICY_FILE,
    Evaluation,
    best_of,
    judged,
    reached_in,
    read_evaluations,
)
from swarm_forage_env.training.plan import TrainingPlan, read_plan


@dataclass(frozen=True, kw_only=True)
class Training:
    """What the folder of a training holds."""

    label: str
    folder: Path
    plan: TrainingPlan
    evaluations: tuple[Evaluation, ...]
    """At least one, oldest first."""

    @property
    def kept(self) -> Evaluation:
        """The evaluation of what it leaves to be used: the best network, or the last model where a file holds none."""
        return best_of(self.evaluations) if self.plan.algorithm in EXPORTABLE else self.evaluations[-1]

    @property
    def policy(self) -> str:
        """File of that network or model."""
        path = self.folder / (POLICY_FILE if self.plan.algorithm in EXPORTABLE else MODEL_FILE)
        model = path.with_suffix(".zip")  # of a learner that is not ours
        return (model if model.exists() else path).as_posix()

    @property
    def is_finished(self) -> bool:
        """Whether it was carried out to its end, the last evaluation included."""
        _, end = self.plan.parts(self.evaluations)[-1]
        return self.evaluations[-1].steps >= end and (self.folder / MODEL_FILE).exists()


def read_training(folder: Path) -> Training:
    """Return how the training of a folder went.

    Raises:
        ConfigError: there is no training in the folder, it has not been evaluated yet, or a file is damaged.
    """
    if not (folder / PLAN_FILE).exists():
        raise ConfigError(f"Expected the folder of a training, got {folder} without {PLAN_FILE}.")
    evaluations = read_evaluations(folder / EVALUATIONS_FILE)
    if not evaluations:
        below = " ".join(str(path.parent) for path in sorted(folder.glob(f"*/{EVALUATIONS_FILE}")))
        hint = f"; name those below it: {below}" if below else ""
        raise ConfigError(f"Expected a training with evaluations, got {folder} without any{hint}.")
    plan = read_plan(folder / PLAN_FILE)
    return Training(label=folder.resolve().name, folder=folder, plan=plan, evaluations=tuple(evaluations))


@dataclass(frozen=True, kw_only=True, eq=False)
class Trainings(Answer):
    """Trainings that are judged by the same runs, and other policies in them.

    Those of one plan that differ in their seeds have a mean, with Student's 95 % interval of the mean over trainings.
    """

    trainings: tuple[Training, ...]
    beside: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    """Policy -> what counts of it in the evaluations, and its interference; NaN where it is not known."""
    failures: Mapping[str, str] = field(default_factory=dict)
    """Label of a training that failed -> why; it is in no mean."""

    @property
    def plan(self) -> TrainingPlan:
        """The plan of the first one; the others are judged alike."""
        return self.trainings[0].plan

    def sheets(self) -> tuple[Sheet, ...]:
        """Return a row per training as it is kept, mean and interval, the others, and how to score what is kept."""
        notes = [f"{label} failed and is in no mean: {reason}" for label, reason in self.failures.items()]
        if not self.trainings:
            return (Sheet(title="no training was evaluated", notes=notes),)
        digits = 2 if self.plan.evaluation.worlds else 1  # ratios are about 1

        def row(label: str, reached: float, interference: float, steps: str = "", time: str = "") -> tuple[str, ...]:
            busy = "" if math.isnan(interference) else f"{interference:.3f}"
            return label, steps, f"{reached:.{digits}f}", busy, time

        rows = [
            row(one.label, *one.kept.levels, f"{one.kept.steps:,}", duration(one.evaluations[-1].cpu_time_s))
            for one in self.trainings
        ]
        sound = [one for one in self.trainings if one.label not in self.failures]
        of, seeds = _methods(sound), {one.plan.seed for one in sound}
        is_averaged = len(sound) > 1 and len(seeds) == len(sound) and of.count(of[0]) == len(of)
        if is_averaged:
            from metrics.statistics import aggregate  # late: see evaluation.baseline_runs

            reached, busy = map(aggregate, zip(*(one.kept.levels for one in sound), strict=True))
            ends = f"{reached.lower:.{digits}f} to {reached.upper:.{digits}f}", f"{busy.lower:.3f} to {busy.upper:.3f}"
            rows += [row("mean", reached.mean, busy.mean), ("95 %", "", *ends, "")]
            notes.insert(0, "95 %: Student's interval of the mean over trainings.")
            notes.append("These evaluations chose the networks and flatter them. To score all in runs of their own:")
            files = [Path(os.path.relpath(one.policy)).as_posix() for one in sound]
            notes.append(
                shlex.join(["swarm-forage", "benchmark", *files, "--name", sound[0].folder.resolve().parent.name])
            )
        rows += [row(name, *levels) for name, levels in self.beside.items()]
        header = ("policy", "decisions", counted_in(self.plan), "interference", "processor time")
        return (Sheet.of(header, rows, title=f"at their best in {place_of(self.plan)}", notes=notes),)

    @property
    def methods(self) -> list[str]:
        """What each training is drawn as: its label, or the folder above it where others are seeds of the same method.

        Seeds of one method lie in one folder, and their plans differ in nothing else. Those of a single method have
        their labels.
        """
        of = _methods(self.trainings)
        if of.count(of[0]) == len(of):
            return [one.label for one in self.trainings]
        return [
            one.folder.parent.as_posix() if of.count(method) > 1 else one.label
            for method, one in zip(of, self.trainings, strict=True)
        ]

    @property
    def has_picture(self) -> bool:
        """Whether there is an evaluation to draw."""
        return bool(self.trainings)

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw performance and interference over decisions; raises ImportError without matplotlib.

        Seeds of one method look alike where there are several methods.
        """
        from swarm_forage_env.rendering.plots import draw_trainings

        is_one = len(self.trainings) == 1
        draw_trainings(
            Path(path),
            {one.label: [(each.steps, *each.levels) for each in one.evaluations] for one in self.trainings},
            methods=self.methods,
            beside=self.beside,
            stage_ends=[end for _, end in self.plan.parts(self.trainings[0].evaluations)] if is_one else (),
            title=f"{'training' if is_one else 'trainings'} in {place_of(self.plan)}",
            ylabel=counted_in(self.plan),
            style=style,
        )


def _methods(trainings: Sequence[Training]) -> list[tuple[Path, TrainingPlan]]:
    """Return what trainings of one method have in common."""
    return [(one.folder.resolve().parent, replace(one.plan, seed=0)) for one in trainings]


def beside_baseline(trainings: Sequence[Training], failures: Mapping[str, str] | None = None) -> Trainings:
    """Return how trainings that are judged by the same runs went, beside the baseline of their evaluations."""
    if not trainings:
        return Trainings(trainings=(), failures=failures or {})
    world, *others = trainings[0].evaluations[-1].worlds
    name = "baseline of each world" if others else world.baseline_policy
    level = (1.0 if trainings[0].plan.evaluation.worlds else world.baseline), math.nan
    return Trainings(trainings=tuple(trainings), beside={name: level}, failures=failures or {})


def curves(
    folders: Sequence[str | Path],
    *,
    beside: Sequence[str] | None = None,
) -> Trainings:
    """Return how trainings went, beside policies that make the runs of their evaluations.

    Args:
        folders: Folders of trainings that are judged by the same runs.
        beside: Policies, each with the caches that it is made for; default the paper's.

    Raises:
        ConfigError: a folder without evaluations, one that is given twice, trainings that are judged by other runs, or
            an unknown policy.
    """
    found = read_trainings(folders)
    if beside is None:
        from metrics.controllers import PAPER_POLICIES  # late: see evaluation.baseline_runs

        beside = PAPER_POLICIES
    levels: dict[str, tuple[float, float]] = {}
    plan, last = found[0].plan, found[0].evaluations[-1]
    baselines = {world.world: (world.baseline_policy, world.baseline) for world in last.worlds}
    if beside:
        specs = policy_specs({name: name for name in beside})
        table = finished_runs(Plan.product(specs, plan.judging_worlds, plan.evaluation.seeds), jobs=None, progress=True)
        for name in beside:
            worlds = judged(plan.evaluation, table, name, baselines)
            interference = float(np.mean([world.interference_fraction for world in worlds]))
            levels[name] = reached_in(plan.evaluation, worlds), interference
    return Trainings(trainings=found, beside=levels)


def read_trainings(folders: Sequence[str | Path]) -> tuple[Training, ...]:
    """Read trainings that are judged by the same runs; those of folders of the same name are named by their paths.

    Raises:
        ConfigError: see `curves`.
    """
    paths = [Path(folder) for folder in folders]
    twice = [folder for folder, count in Counter(path.resolve() for path in paths).items() if count > 1]
    if twice:
        raise ConfigError(f"Expected each training once, got {twice[0]} twice.")
    found = [read_training(path) for path in paths]
    for one in found[1:]:
        if _judged_by(one.plan) != _judged_by(found[0].plan):
            raise ConfigError(
                f"Expected trainings that are judged by the same runs, got {found[0].folder} and {one.folder}, whose "
                "plans differ in scenario, wrappers or evaluation; draw them one by one."
            )
    counts = Counter(one.label for one in found)
    return tuple(replace(one, label=str(one.folder)) if counts[one.label] > 1 else one for one in found)


def _judged_by(plan: TrainingPlan) -> tuple[Any, ...]:
    """What decides the runs that a training is judged by."""
    worlds = plan.judging_worlds
    return plan.evaluation.chosen_by, plan.evaluation.seeds, worlds, [world.name for world in worlds]


def place_of(plan: TrainingPlan) -> str:
    """Say where policies of a plan are judged."""
    n_worlds = len(plan.evaluation.worlds)
    return counted(n_worlds, "world") if n_worlds else plan.world.name


def counted_in(plan: TrainingPlan) -> str:
    """Say what counts in a plan's evaluations."""
    if plan.evaluation.worlds:
        return f"{plan.evaluation.chosen_by} ratio to the baselines"
    return f"{performance_of(plan.scenario.performance).title} per 1,000 s"
