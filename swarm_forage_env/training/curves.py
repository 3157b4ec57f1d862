"""How trainings went, beside other policies in the runs of their evaluations.

found = curves(["results/training/first", "results/training/second"])
print(found)                    # at their best
found.draw("curves.png")        # performance and interference over decisions
"""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env._internal.wording import counted, plain
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.runs.spec import policy_specs
from swarm_forage_env.scenarios.performance import performance_of
from swarm_forage_env.sheet import Answer, Sheet
from swarm_forage_env.training.evaluations import (
    TrainingCurve,
    chosen,
    finished_runs,
    in_all_worlds,
    judged,
    known_baselines,
    read_training,
)
from swarm_forage_env.training.plan import TrainingPlan

if TYPE_CHECKING:
    from swarm_forage_env.rendering.plots import MeanCurve


@dataclass(frozen=True, kw_only=True, eq=False)
class TrainingCurves(Answer):
    """Trainings that are judged by the same runs, and other policies in them.

    The picture shows the mean over trainings of one plan as far as all of them have come, with a band: Student's 95 %
    interval of that mean. Between evaluations, which a resumed training makes at other times, curves are straight.
    """

    trainings: tuple[TrainingCurve, ...]
    beside: Mapping[str, tuple[float, float]]
    """Policy -> what counts of it in the evaluations, and its interference; NaN where it is not known."""
    averaged: tuple[str, ...] = ()
    """Labels of trainings of one plan, whose mean is drawn; fewer than two have none."""

    @property
    def plan(self) -> TrainingPlan:
        """The plan of the first one; the others are judged alike."""
        return self.trainings[0].plan

    def sheets(self) -> tuple[Sheet, ...]:
        """Return the best evaluation of each training, and the others."""
        in_worlds = bool(self.plan.evaluation.worlds)
        digits = 2 if in_worlds else 1  # ratios are about 1
        rows = [
            (f"{label}, at its best", f"{steps:,}", f"{performance:.{digits}f}", f"{interference:.3f}")
            for label, steps, performance, interference in self._best()
        ]
        rows += [(name, "", f"{value:.{digits}f}", f"{lost:.3f}") for name, (value, lost) in self.beside.items()]
        heading = counted_in(self.plan) if in_worlds else "per 1,000 s"
        return (Sheet.of(("policy", "decisions", heading, "interference"), rows),)

    def _best(self) -> list[tuple[str, int, float, float]]:
        best = [(one.label, chosen(one.evaluations)) for one in self.trainings]
        return [(label, each.steps, each.performance, each.interference_fraction) for label, each in best]

    def to_mapping(self) -> dict[str, Any]:
        """Return all evaluations and the others as plain values."""
        return {
            "place": place_of(self.plan),
            "performance": counted_in(self.plan),
            "trainings": {one.label: [each.to_mapping() for each in one.evaluations] for one in self.trainings},
            "beside": {
                name: {"performance": value, "interference_fraction": plain(lost)}
                for name, (value, lost) in self.beside.items()
            },
        }

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw performance and interference over decisions.

        Raises:
            ImportError: matplotlib is not installed.
        """
        from swarm_forage_env.rendering.plots import draw_trainings

        plan, mean = self.plan, self._mean()
        is_one_plan = len(self.trainings) == 1 or mean is not None
        draw_trainings(
            Path(path),
            {
                one.label: (
                    [each.steps for each in one.evaluations],
                    [each.performance for each in one.evaluations],
                    [each.interference_fraction for each in one.evaluations],
                )
                for one in self.trainings
            },
            mean=mean,
            beside=dict(self.beside),
            stage_ends=self._stage_ends() if is_one_plan else (),
            title=f"{'training' if len(self.trainings) == 1 else 'trainings'} in {place_of(plan)}",
            ylabel=counted_in(plan),
            style=style,
        )

    def _stage_ends(self) -> list[int]:
        """Decisions at which stages ended, after a whole rollout and with an evaluation; as planned where none is."""
        evaluated = [each.steps for each in self.trainings[0].evaluations]
        planned = np.cumsum([stage.steps for stage in self.plan.stages]).tolist()
        return [next((steps for steps in evaluated if steps >= end), end) for end in planned]

    def _mean(self) -> "MeanCurve | None":
        """The mean of those that are averaged, as far as all of them have come; None where there is none."""
        from metrics.statistics import aggregate  # late: see training.evaluations
        from swarm_forage_env.rendering.plots import MeanCurve

        averaged = [one.evaluations for one in self.trainings if one.label in self.averaged]
        if len(averaged) < 2:
            return None
        steps = [np.array([each.steps for each in one]) for one in averaged]
        first, last = max(each[0] for each in steps), min(each[-1] for each in steps)
        common = [step for step in np.unique(np.concatenate(steps)).tolist() if first <= step <= last]
        if not common:
            return None

        def of(name: str) -> Any:
            values = [[getattr(each, name) for each in one] for one in averaged]
            found = [np.interp(common, x, y) for x, y in zip(steps, values, strict=True)]
            each_step = [aggregate(column) for column in np.transpose(found)]
            return np.array([(one.mean, one.lower, one.upper) for one in each_step]).T

        return MeanCurve(
            "mean with its\n95 % interval\n(Student's)", common, of("performance"), of("interference_fraction")
        )


def curves(
    folders: Sequence[str | Path],
    *,
    beside: Sequence[str] | None = None,
    jobs: int | None = None,
    progress: bool = True,
) -> TrainingCurves:
    """Return how trainings went, beside policies that make the runs of their evaluations.

    Args:
        folders: Folders of trainings that are judged by the same runs.
        beside: Policies, each with the caches that it is made for; default the paper's.
        jobs: Processes; default one per core.
        progress: Show progress and an estimate on stderr.

    Raises:
        ConfigError: a folder without evaluations, one that is given twice, trainings that are judged by other runs, or
            an unknown policy.
    """
    found = read_trainings(folders)
    if beside is None:
        from metrics.controllers import PAPER_POLICIES  # late: see training.evaluations

        beside = PAPER_POLICIES
    return TrainingCurves(trainings=found, beside=_levels(found[0], beside, jobs, progress=progress))


def beside_baseline(*trainings: TrainingCurve, averaged: Sequence[str] = ()) -> TrainingCurves:
    """Return how trainings that are judged by the same runs went, beside the baseline of their evaluations."""
    first = trainings[0]
    name = "baseline of each world" if first.plan.evaluation.worlds else first.plan.evaluation.baseline
    level = first.evaluations[-1].baseline, math.nan
    return TrainingCurves(trainings=trainings, beside={name: level}, averaged=tuple(averaged))


def read_trainings(folders: Sequence[str | Path]) -> tuple[TrainingCurve, ...]:
    """Read trainings that are judged by the same runs; those of folders of the same name are named by their paths.

    Raises:
        ConfigError: see `curves`.
    """
    paths = [Path(folder) for folder in folders]
    twice = [folder for folder, count in Counter(path.resolve() for path in paths).items() if count > 1]
    if twice:
        raise ConfigError(f"Expected each training once, got {twice[0]} twice.")
    found = [read_training(path) for path in paths]
    for path, one in zip(paths[1:], found[1:], strict=True):
        if _judged_by(one.plan) != _judged_by(found[0].plan):
            raise ConfigError(
                f"Expected trainings that are judged by the same runs, got {paths[0]} and {path}, whose "
                "plans differ in scenario, wrappers or evaluation; draw them one by one."
            )
    counts = Counter(one.label for one in found)
    return tuple(
        replace(one, label=str(path)) if counts[one.label] > 1 else one for path, one in zip(paths, found, strict=True)
    )


def _judged_by(plan: TrainingPlan) -> tuple[Any, ...]:
    """What decides the runs that a training is judged by."""
    worlds = plan.judging_worlds
    return plan.evaluation.chosen_by, plan.evaluation.seeds, worlds, [world.name for world in worlds]


def _levels(
    curve: TrainingCurve, names: Sequence[str], jobs: int | None, *, progress: bool
) -> dict[str, tuple[float, float]]:
    """What counts of other policies in the runs of the evaluations, and their interference."""
    if not names:
        return {}
    plan = curve.plan
    table = finished_runs(plan.judging(*policy_specs({name: name for name in names})), jobs=jobs, progress=progress)
    baselines = known_baselines(plan, curve.evaluations[-1])
    return {label: in_all_worlds(plan.evaluation, judged(table, label, baselines)) for label in dict.fromkeys(names)}


def place_of(plan: TrainingPlan) -> str:
    """Say where policies of a plan are judged."""
    if plan.evaluation.worlds:
        return counted(len(plan.evaluation.worlds), "world")
    return plan.world.name


def counted_in(plan: TrainingPlan) -> str:
    """Say what the numbers of a plan's evaluations are."""
    if plan.evaluation.worlds:
        return f"{plan.evaluation.chosen_by} ratio to the baselines"
    return f"{performance_of(plan.scenario.performance).title} per 1,000 s"
