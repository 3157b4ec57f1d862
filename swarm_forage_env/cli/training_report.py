"""What `swarm-forage train` shows: progress, evaluations as they come, a picture, and where the results are."""

import math
import shlex
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.cli import EXIT_FAILURE
from swarm_forage_env.cli.printer import drawn_or_told, note, show
from swarm_forage_env.runs.progress import progress_bar
from swarm_forage_env.training.curves import beside_baseline, counted_in, place_of, read_training
from swarm_forage_env.training.evaluation import EVALUATIONS_FILE, MODEL_FILE, PLAN_FILE, Evaluation
from swarm_forage_env.training.plan import TrainingPlan

if TYPE_CHECKING:
    from swarm_forage_env.training.sb3.training import TrainingStatus

PICTURE_FILE = "training.png"


def run_training(plan: TrainingPlan, folder: Path, *, resume: bool) -> int:
    """Train, show how it goes, and say where the results are; errors as in `training.sb3.training.train`."""
    from swarm_forage_env.training.sb3.training import train

    with progress_bar("training", plan.total_steps) as tell:
        report = _Report(plan, [plan.seed], tell)
        try:
            result = train(plan, folder, resume=resume, report=lambda news: report(plan.seed, news))
        except KeyboardInterrupt:
            _draw(folder)
            words = "Stopped before there was anything to keep; the same command starts again."
            if (folder / MODEL_FILE).exists():
                words = f"Stopped. To go on: {_go_on(folder)}"
            raise KeyboardInterrupt(words) from None
    if not result.steps:
        note(
            f"This training was finished: {result.model.num_timesteps:,} of {plan.total_steps:,} decisions. "
            "For more, give --steps beside --resume, or a plan with more."
        )
    files = {"model": folder / MODEL_FILE, "network": result.policy_file, "picture": _draw(folder)}
    note(", ".join(f"{what} {file}" for what, file in files.items() if file is not None))
    if plan.interface.actions == "discrete":
        note(f"Both files {'draw their actions by probability' if plan.samples else 'take their best action'}.")
    return 0


def _go_on(folder: Path, words: str = "") -> str:
    return f"swarm-forage --trust-models train --out {shlex.quote(str(folder))}{words} --resume"


def _draw(folder: Path) -> Path | None:
    """Draw the evaluations of a training; None without any, or where there can be no picture."""
    if not (folder / EVALUATIONS_FILE).exists():
        return None
    return drawn_or_told(beside_baseline([read_training(folder)]), folder / PICTURE_FILE)


def run_seeds(plan: TrainingPlan, seeds: Sequence[int], folder: Path, *, jobs: int | None, resume: bool) -> int:
    """Train several seeds, show how all go, draw them and print a table; arguments and errors as in `train_seeds`.

    Returns:
        1 if a training failed.
    """
    from swarm_forage_env.training.sb3.seeds import is_finished, seed_folder, train_seeds

    go_on = _go_on(folder, f" --seeds {len(seeds)}")
    with progress_bar("training", plan.total_steps * len(seeds)) as tell:
        report = _Report(plan, seeds, tell)
        try:
            found = train_seeds(plan, seeds, folder, jobs=jobs, resume=resume, report=report)
        except KeyboardInterrupt:
            words = "Interrupted before there was anything to keep; the same command starts again."
            if (folder / PLAN_FILE).exists():
                finished = sum(is_finished(seed_folder(folder, seed)) for seed in seeds)
                words = f"Interrupted: {finished} of {counted(len(seeds), 'training')} finished. To go on: {go_on}"
            raise KeyboardInterrupt(words) from None
    show(found, folder / "curves.png")
    if found.failures:
        note(f"To go on with those that failed: {go_on}")
        return EXIT_FAILURE
    return 0


class _Report:
    """Shows how trainings go: what they will do, a bar for all, each evaluation."""

    def __init__(self, plan: TrainingPlan, seeds: Sequence[int], tell: Callable[..., None]) -> None:
        self._plan, self._seeds, self._tell = plan, seeds, tell
        self._steps: dict[int, int] = {}
        self._has_begun = False

    def __call__(self, seed: int, news: "TrainingStatus | Evaluation | str") -> None:
        """Show the news of a training."""
        if isinstance(news, str):
            note(f"Seed {seed} failed: {news}")
            return
        if not self._steps:
            plan, n_seeds = self._plan, len(self._seeds)
            note(
                f"{plan.algorithm}: {f'{n_seeds} trainings of ' if n_seeds > 1 else ''}{plan.total_steps:,} decisions "
                f"in {counted(len(plan.stages), 'stage')}, evaluated every {plan.evaluation.every_steps:,} and after "
                "each stage"
            )
        self._steps[seed] = min(news.steps, self._plan.total_steps)
        text = None
        if not isinstance(news, Evaluation) and not math.isnan(news.episode_return):
            text = f"mean return {news.episode_return:.2f}"
        self._tell(sum(self._steps.values()), text=text)
        if isinstance(news, Evaluation):
            self._show(f"{seed:>6} " if len(self._seeds) > 1 else "", news)

    def _show(self, seed: str, news: Evaluation) -> None:
        what, plan = counted_in(self._plan), self._plan.evaluation
        beside = "" if plan.worlds else plan.baseline
        baseline = f"{news.worlds[0].baseline:.1f}" if beside else ""
        width = max(len(beside), 6)
        if not self._has_begun:
            note(f"Evaluated in {counted(plan.n_runs, 'run')} in {place_of(self._plan)}:")
            note(f"{'seed ' if seed else '':>{len(seed)}}{'decisions':>12}  {what}  {beside:>{width}}  interference")
        reached = f"{news.reached:>{len(what)}.2f}"
        note(f"{seed}{news.steps:>12,}  {reached}  {baseline:>{width}}  {news.interference_fraction:>12.3f}")
        if not self._has_begun and baseline == "0.0":
            note(
                f"{plan.baseline} scores 0 in such short runs. Longer ones say more (--set "
                "evaluation.horizon_s=SECONDS)."
            )
        self._has_begun = True
