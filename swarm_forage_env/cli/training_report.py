"""What `swarm-forage train` shows: progress, evaluations as they come, a picture, and where the results are."""

import math
import shlex
from collections.abc import Sequence
from pathlib import Path

from rich.progress import Progress

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.cli import EXIT_FAILURE
from swarm_forage_env.cli.printer import bar, drawn_or_told, note, show
from swarm_forage_env.training.curves import beside_baseline, counted_in, place_of
from swarm_forage_env.training.evaluations import (
    EVALUATIONS_FILE,
    MODEL_FILE,
    PLAN_FILE,
    Evaluation,
    TrainingCurve,
    TrainingStatus,
    read_evaluations,
)
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.training.seeds import TrainingFailure, is_finished, seed_folder

PICTURE_FILE = "training.png"
CURVES_FILE = "curves.png"
_NOTHING_TO_SEE = "{} scores 0 in such short runs. Longer ones say more (--set evaluation.horizon_s=SECONDS)."


def run_training(plan: TrainingPlan, folder: Path, *, resume: bool) -> int:
    """Train, show how it goes, and say where the results are.

    Raises:
        ImportError: stable-baselines3 is not installed.
        ConfigError: see `training.sb3.training.train`.
        KeyboardInterrupt: Ctrl-C; its message says how to go on.
    """
    from swarm_forage_env.training.sb3.training import train

    with bar() as shown:
        report = _Report(plan, [plan.seed], shown)
        try:
            result = train(plan, folder, resume=resume, report=lambda news: report(plan.seed, news))
        except KeyboardInterrupt:
            _draw(plan, folder)
            raise KeyboardInterrupt(_farewell(folder)) from None
    if not result.steps:
        note(
            f"This training was finished: {result.model.num_timesteps:,} of {plan.total_steps:,} decisions. "
            "For more, give --steps beside --resume, or a plan with more."
        )
    files = {"model": folder / MODEL_FILE, "network": result.policy_file, "picture": _draw(plan, folder)}
    note(", ".join(f"{what} {file}" for what, file in files.items() if file is not None))
    return 0


def _farewell(folder: Path) -> str:
    if (folder / MODEL_FILE).exists():
        return f"Stopped. To go on: swarm-forage --trust-models train --out {shlex.quote(str(folder))} --resume"
    return "Stopped before there was anything to keep; the same command starts again."


def _draw(plan: TrainingPlan, folder: Path) -> Path | None:
    """Draw the evaluations of a training; None without any, or where there can be no picture."""
    evaluations = read_evaluations(folder / EVALUATIONS_FILE)
    if not evaluations:
        return None
    curve = TrainingCurve(label="trained policy", plan=plan, evaluations=tuple(evaluations))
    return drawn_or_told(beside_baseline(curve), folder / PICTURE_FILE)


def run_seeds(
    plan: TrainingPlan,
    seeds: Sequence[int],
    folder: Path,
    *,
    jobs: int | None,
    resume: bool,
) -> int:
    """Train several seeds, show how all go, draw them and print a table; arguments as in `train_seeds`.

    Returns:
        1 if a training failed.

    Raises:
        ImportError: stable-baselines3 is not installed.
        ConfigError: see `training.sb3.seeds.train_seeds`.
        KeyboardInterrupt: Ctrl-C; its message says how to go on.
    """
    from swarm_forage_env.training.sb3.seeds import train_seeds

    go_on = f"swarm-forage --trust-models train --out {shlex.quote(str(folder))} --seeds {len(seeds)} --resume"
    with bar() as shown:
        report = _Report(plan, seeds, shown)
        try:
            found = train_seeds(plan, seeds, folder, jobs=jobs, resume=resume, report=report)
        except KeyboardInterrupt:
            if not (folder / PLAN_FILE).exists():
                words = "Interrupted before there was anything to keep; the same command starts again."
            else:
                finished = sum(is_finished(plan, seed_folder(folder, seed)) for seed in seeds)
                words = f"Interrupted: {finished} of {counted(len(seeds), 'training')} finished. To go on: {go_on}"
            raise KeyboardInterrupt(words) from None
    show(found, folder / CURVES_FILE)
    if found.failures:
        note(f"To go on with those that failed: {go_on}")
        return EXIT_FAILURE
    return 0


class _Report:
    """Shows how trainings go: one bar for all of them, and a line per evaluation."""

    def __init__(self, plan: TrainingPlan, seeds: Sequence[int], shown: Progress) -> None:
        self._plan, self._seeds, self._shown = plan, seeds, shown
        self._steps: dict[int, int] = {}
        self._task = shown.add_task("training", total=plan.total_steps * len(seeds))
        self._has_begun = False

    def __call__(self, seed: int, news: "TrainingStatus | Evaluation | TrainingFailure") -> None:
        """Show the news of a training."""
        if isinstance(news, TrainingFailure):
            self._shown.console.out(f"Seed {seed} failed: {news.reason}")
            return
        self._steps[seed] = min(news.steps, self._plan.total_steps)
        self._shown.update(self._task, completed=sum(self._steps.values()))
        if isinstance(news, Evaluation):
            self._show(f"{seed:>6} " if len(self._seeds) > 1 else "", news)
        elif not math.isnan(news.episode_return):
            self._shown.update(self._task, description=f"mean return {news.episode_return:.2f}")

    def _show(self, seed: str, news: Evaluation) -> None:
        what, lines = counted_in(self._plan), list[str]()
        if not self._has_begun:
            runs = counted(self._plan.evaluation.n_runs, "run")
            columns = f"{'decisions':>12}  {what}  {'baseline':>8}  interference"
            lines += [f"Evaluated in {runs} in {place_of(self._plan)}:", f"{'seed':>6} {columns}" if seed else columns]
        baseline = "" if news.worlds else f"{news.baseline:.1f}"
        found = f"{news.performance:>{len(what)}.2f}  {baseline:>8}  {news.interference_fraction:>12.3f}"
        lines.append(f"{seed}{news.steps:>12,}  {found}")
        if not self._has_begun and news.baseline == 0.0 and not news.worlds:
            lines.append(_NOTHING_TO_SEE.format(self._plan.evaluation.baseline))
        self._has_begun = True
        self._shown.console.out("\n".join(lines))
