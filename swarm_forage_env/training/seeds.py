"""Trainings of one plan that differ in their seeds alone: what their folders hold, together.

A folder has the plan, and for each seed the folder of a training, `seed_0` and so on.
"""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple

from swarm_forage_env._internal.wording import counted, plain
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle
from swarm_forage_env.runs.progress import duration
from swarm_forage_env.sheet import Answer, Sheet
from swarm_forage_env.training.curves import TrainingCurves, beside_baseline, counted_in, place_of
from swarm_forage_env.training.evaluations import (
    EVALUATIONS_FILE,
    MODEL_FILE,
    POLICY_FILE,
    TrainingCurve,
    chosen,
    ratio_to,
    read_evaluations,
    read_training,
)
from swarm_forage_env.training.plan import EXPORTABLE, TrainingPlan

if TYPE_CHECKING:
    from metrics.statistics import Summary


@dataclass(frozen=True, slots=True)
class TrainingFailure:
    """A training failed; the others go on."""

    reason: str


def seed_folder(folder: Path, seed: int) -> Path:
    """Return the folder of the training with a seed."""
    return folder / f"seed_{seed}"


def is_finished(plan: TrainingPlan, folder: Path) -> bool:
    """Return whether a folder holds the whole training of a plan, its last evaluation included.

    Raises:
        ConfigError: a damaged file.
    """
    evaluations = read_evaluations(folder / EVALUATIONS_FILE)
    return bool(evaluations) and evaluations[-1].steps >= plan.total_steps and (folder / MODEL_FILE).exists()


@dataclass(frozen=True, kw_only=True, slots=True)
class KeptNetwork:
    """What a training leaves to be used, and its evaluation."""

    seed: int
    policy: str
    """File of the network of the best evaluation; of an algorithm whose network a file cannot hold, the last model."""
    steps: int
    """Decisions of single robots before the evaluation."""
    performance: float
    """What the scenario counts, per 1,000 simulated s; in several worlds the same as `ratio`."""
    ratio: float
    """Performance over that of the baseline; in several worlds the mean or the worst of their ratios."""
    interference_fraction: float
    """Mean fraction of active robots in interference."""
    cpu_time_s: float
    """Processor time of the whole training, s."""


def kept_network(training: TrainingCurve, folder: Path) -> KeptNetwork:
    """Return what is kept of a training in a folder."""
    plan, evaluations = training.plan, training.evaluations
    has_network = plan.algorithm in EXPORTABLE
    kept = chosen(evaluations) if has_network else evaluations[-1]
    simulated_s = plan.judging_worlds[0].scenario.horizon_s * plan.evaluation.n_runs
    return KeptNetwork(
        seed=plan.seed,
        policy=(folder / (POLICY_FILE if has_network else MODEL_FILE)).as_posix(),
        steps=kept.steps,
        performance=kept.performance,
        ratio=kept.performance if kept.worlds else ratio_to(kept.baseline, kept.performance, simulated_s),
        interference_fraction=kept.interference_fraction,
        cpu_time_s=evaluations[-1].cpu_time_s,
    )


class _Column(NamedTuple):
    """A number of each network that has a mean."""

    name: str
    """Of a field of `KeptNetwork`."""
    heading: str
    digits: int

    def text(self, value: float) -> str:
        return f"{value:.{self.digits}f}"


@dataclass(frozen=True, kw_only=True, eq=False)
class SeedTrainings(Answer):
    """How trainings of one plan with several seeds went. Means and intervals are over those that did not fail."""

    plan: TrainingPlan
    folder: Path
    trainings: Mapping[int, TrainingCurve]
    """Seed -> how the training went, of those that have been evaluated."""
    failures: Mapping[int, str]
    """Seed -> why the training failed."""

    def kept(self) -> tuple[KeptNetwork, ...]:
        """Return what is kept of the trainings."""
        return tuple(kept_network(one, seed_folder(self.folder, seed)) for seed, one in self.trainings.items())

    def means(self) -> "dict[str, Summary]":
        """Return means over trainings with Student's 95 % interval, by fields of `KeptNetwork`; none where all failed.

        Bounds are NaN for one training; those of a share end at 0 and 1.
        """
        from metrics.statistics import aggregate  # late: see training.evaluations

        kept = self._finished()
        found = {name: aggregate([getattr(one, name) for one in kept]) for name, *_ in self._columns if kept}
        share = found.get("interference_fraction")
        if share is not None:  # Student's interval knows no bounds
            found["interference_fraction"] = replace(
                share,
                lower=max(share.lower, 0.0),  # NaN comes first, so that it is kept
                upper=min(share.upper, 1.0),
            )
        return found

    def _finished(self) -> list[KeptNetwork]:
        """What is kept of trainings that did not fail."""
        return [one for one in self.kept() if one.seed not in self.failures]

    def command(self) -> str | None:
        """Return the command that scores these networks as one entry of the benchmark.

        None where all failed.
        """
        from metrics.benchmark.entry import entry_command  # late: see training.evaluations

        policies = [one.policy for one in self._finished()]
        return entry_command(policies, self.folder.resolve().name) if policies else None

    @property
    def _columns(self) -> tuple[_Column, ...]:
        evaluation = self.plan.evaluation
        lost = _Column("interference_fraction", "interference", 3)
        if evaluation.worlds:
            return _Column("ratio", counted_in(self.plan), 2), lost
        reached = _Column("performance", counted_in(self.plan), 1)
        return reached, _Column("ratio", f"ratio to {evaluation.baseline}", 2), lost

    def sheets(self) -> tuple[Sheet, ...]:
        """Return a row per seed, mean and interval, what failed, and the command that scores all of them."""
        columns, means = self._columns, self.means()
        rows = [
            (
                str(one.seed),
                f"{one.steps:,}",
                *(column.text(getattr(one, column.name)) for column in columns),
                duration(one.cpu_time_s),
            )
            for one in self.kept()
        ]
        notes: list[str] = []
        if means:
            rows.append(("mean", "", *(column.text(means[column.name].mean) for column in columns), ""))
        if means and plain(means["ratio"].lower) is not None:
            bounds = [(column, means[column.name]) for column in columns]
            rows.append(("95 %", "", *(f"{one.text(of.lower)} to {one.text(of.upper)}" for one, of in bounds), ""))
            notes.append("95 %: Student's interval of the mean over trainings.")
        notes += [f"Seed {seed} failed and is not in the mean: {reason}" for seed, reason in self.failures.items()]
        command = self.command()
        if command is not None:
            notes.append("These evaluations chose the networks and flatter them. To score all in runs of their own:")
            notes.append(command)
        return (
            Sheet.of(
                ("seed", "decisions", *(column.heading for column in columns), "processor time"),
                rows,
                title=f"{counted(len(self.trainings), 'training')} by {self.plan.algorithm} in {place_of(self.plan)}",
                notes=notes,
            ),
        )

    def to_mapping(self) -> dict[str, Any]:
        """Return everything as plain values."""
        return {
            "algorithm": self.plan.algorithm,
            "place": place_of(self.plan),
            "performance": counted_in(self.plan),
            "trainings": [asdict(one) for one in self.kept()],
            "means": {
                name: {"mean": of.mean, "lower": plain(of.lower), "upper": plain(of.upper), "n": of.n_used}
                for name, of in self.means().items()
            },
            "failures": {str(seed): reason for seed, reason in self.failures.items()},
            "benchmark": self.command(),
        }

    @property
    def has_picture(self) -> bool:
        """Whether there is an evaluation to draw."""
        return bool(self.trainings)

    def curves(self) -> TrainingCurves:
        """Return the curves, with their mean; raises IndexError without an evaluation."""
        averaged = [one.label for seed, one in self.trainings.items() if seed not in self.failures]
        return beside_baseline(*self.trainings.values(), averaged=averaged)

    def draw(self, path: str | Path, *, style: FigureStyle = SCREEN) -> None:
        """Draw the evaluations of all trainings, their mean with its 95 % interval, and the baseline.

        Raises:
            ImportError: matplotlib is not installed.
        """
        self.curves().draw(path, style=style)


def read_seeds(
    plan: TrainingPlan, folder: Path, seeds: Iterable[int], failures: Mapping[int, str] | None = None
) -> SeedTrainings:
    """Return how trainings of a plan with several seeds went so far.

    Args:
        plan: What they have in common.
        folder: Folder of all.
        seeds: Their seeds.
        failures: Seed -> why the training failed.

    Raises:
        ConfigError: a damaged file.
    """
    places = {seed: seed_folder(folder, seed) for seed in seeds}
    begun = {seed: place for seed, place in places.items() if read_evaluations(place / EVALUATIONS_FILE)}
    return SeedTrainings(
        plan=plan,
        folder=folder,
        trainings={seed: read_training(place) for seed, place in begun.items()},
        failures=dict(failures or {}),
    )
