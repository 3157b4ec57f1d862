"""What `swarm-forage train` shows: progress, evaluations as they come, a picture, and where the results are."""

import math
import shlex
import time
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from rich.progress import Progress

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.cli import EXIT_FAILURE
from swarm_forage_env.cli.printer import bar, drawn_or_told, note, show
from swarm_forage_env.runs.progress import duration
from swarm_forage_env.training.curves import beside_baseline, counted_in, place_of, read_training
from swarm_forage_env.training.evaluation import EVALUATIONS_FILE, MODEL_FILE, PLAN_FILE, Evaluation
from swarm_forage_env.training.plan import TrainingPlan

if TYPE_CHECKING:
    from swarm_forage_env.training.sb3.training import TrainingStatus

PICTURE_FILE = "training.png"
TIMED_S = 5.0
"""Of a training, before it is said how long the rest takes; our choice."""


def run_training(plan: TrainingPlan, folder: Path, *, resume: bool) -> int:
    """Train, show how it goes, and say where the results are; errors as in `training.sb3.training.train`."""
    from swarm_forage_env.training.sb3.training import train

    with bar() as shown:
        report = _Report(plan, [plan.seed], shown)
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
    with bar() as shown:
        report = _Report(plan, seeds, shown)
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
    """Shows how trainings go: what they will do, a bar for all or how long they take, each evaluation."""

    def __init__(self, plan: TrainingPlan, seeds: Sequence[int], shown: Progress) -> None:
        self._plan, self._seeds, self._shown = plan, seeds, shown
        self._steps: dict[int, int] = {}
        self._total = plan.total_steps * len(seeds)
        self._task = shown.add_task("training", total=self._total)
        self._first: tuple[float, int] | None = None
        self._has_begun = self._is_timed = False

    def __call__(self, seed: int, news: "TrainingStatus | Evaluation | str") -> None:
        """Show the news of a training."""
        if isinstance(news, str):
            self._shown.console.out(f"Seed {seed} failed: {news}")
            return
        self._steps[seed] = min(news.steps, self._plan.total_steps)
        done = sum(self._steps.values())
        self._shown.update(self._task, completed=done)
        self._tell_time(done)
        if isinstance(news, Evaluation):
            self._show(f"{seed:>6} " if len(self._seeds) > 1 else "", news)
        elif not math.isnan(news.episode_return):
            self._shown.update(self._task, description=f"mean return {news.episode_return:.2f}")

    def _tell_time(self, done: int) -> None:
        """Say at once what will happen, and after some seconds, where no bar shows it, how long the rest takes."""
        now, say = time.monotonic(), self._shown.console.out
        if self._first is None:
            self._first = now, done
            trainings = f"{len(self._seeds)} trainings of " if len(self._seeds) > 1 else ""
            plan = self._plan
            say(
                f"{plan.algorithm}: {trainings}{plan.total_steps:,} decisions in {counted(len(plan.stages), 'stage')}, "
                f"evaluated every {plan.evaluation.every_steps:,} and after each stage"
            )
            return
        began, before = self._first
        if self._shown.disable and not self._is_timed and now - began >= TIMED_S and done > before:
            self._is_timed = True
            say(f"About {duration((self._total - done) * (now - began) / (done - before))} to go, and the evaluations")

    def _show(self, seed: str, news: Evaluation) -> None:
        what, plan, say = counted_in(self._plan), self._plan.evaluation, self._shown.console.out
        beside = "" if plan.worlds else plan.baseline
        baseline = f"{news.worlds[0].baseline:.1f}" if beside else ""
        width = max(len(beside), 6)
        if not self._has_begun:
            say(f"Evaluated in {counted(plan.n_runs, 'run')} in {place_of(self._plan)}:")
            say(f"{'seed ' if seed else '':>{len(seed)}}{'decisions':>12}  {what}  {beside:>{width}}  interference")
        reached = f"{news.reached:>{len(what)}.2f}"
        say(f"{seed}{news.steps:>12,}  {reached}  {baseline:>{width}}  {news.interference_fraction:>12.3f}")
        if not self._has_begun and baseline == "0.0":
            say(
                f"{plan.baseline} scores 0 in such short runs. Longer ones say more (--set "
                "evaluation.horizon_s=SECONDS)."
            )
        self._has_begun = True
