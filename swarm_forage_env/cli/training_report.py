"""What `swarm-forage train` shows: progress, evaluations as they come, a picture, and where the results are."""

import time
from collections.abc import Callable, Sequence
from pathlib import Path

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.cli.options import complain, no_picture
from swarm_forage_env.cli.signals import EXIT_INTERRUPTED
from swarm_forage_env.runs.cost import duration
from swarm_forage_env.training.curves import curve_of_training, place_of
from swarm_forage_env.training.evaluation_worlds import ALL_WORLDS
from swarm_forage_env.training.evaluations import MODEL_FILE, Evaluation, TrainingCurve, TrainingStatus
from swarm_forage_env.training.plan import TrainingPlan

PICTURE_FILE = "training.png"
LINE_EVERY_S = 60.0
"""Shortest time between two lines about the progress where stderr is no terminal, s."""


def run_training(
    plan: TrainingPlan, folder: Path, *, n_processes: int, resume: bool, callbacks: Sequence[str] = ()
) -> None:
    """Train, show how it goes, and say where the results are; `callbacks` as in `training.sb3.callbacks`.

    Raises:
        ImportError: stable-baselines3 is not installed.
        ConfigError: see `training.sb3.training.train` and `training.sb3.callbacks.named_callbacks`.
    """
    from swarm_forage_env.training.sb3.callbacks import named_callbacks
    from swarm_forage_env.training.sb3.training import train

    added = named_callbacks(callbacks)

    console = Console(stderr=True, highlight=False, markup=False, emoji=False)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        try:
            report = _reporter(plan, bar)
            result = train(plan, folder, n_processes=n_processes, resume=resume, report=report, callbacks=added)
        except KeyboardInterrupt:
            words = _farewell(folder, is_kept=(folder / MODEL_FILE).exists())
            raise typer.Exit(complain(words, EXIT_INTERRUPTED)) from None
    if not result.steps:
        console.print(
            f"This training was finished: {result.model.num_timesteps:,} of {plan.total_steps:,} decisions. "
            "For more, give --steps beside --resume, or a plan with more."
        )
    drawn = _draw(plan, result.evaluations, folder / PICTURE_FILE, console)
    files = {"model": folder / MODEL_FILE, "network": result.policy_file, "picture": drawn}
    console.print(", ".join(f"{what} {file}" for what, file in files.items() if file is not None), soft_wrap=True)


def _farewell(folder: Path, *, is_kept: bool) -> str:
    if is_kept:
        return f"Stopped. To go on: swarm-forage --trust-models train --out {folder} --resume"
    return "Stopped before there was anything to keep; the same command starts again."


def _draw(plan: TrainingPlan, evaluations: Sequence[Evaluation], path: Path, console: Console) -> Path | None:
    """Draw the evaluations; returns `path`, None without any or without matplotlib."""
    if not evaluations:
        return None
    try:
        curve_of_training(TrainingCurve(label="trained policy", plan=plan, evaluations=tuple(evaluations))).draw(path)
    except ImportError as error:
        console.print(str(error))
        return None
    except OSError as error:  # the training is worth more than its picture
        console.print(no_picture(path, error))
        return None
    return path


def _reporter(plan: TrainingPlan, bar: Progress) -> Callable[[TrainingStatus | Evaluation], None]:
    task = bar.add_task("training", total=plan.total_steps)
    first_words = heading(plan)
    has_begun = False
    told: TrainingStatus | None = None
    told_at = time.monotonic()

    def report(news: TrainingStatus | Evaluation) -> None:
        nonlocal first_words, has_begun, told, told_at
        if bar.disable and not has_begun:
            bar.console.print(f"{plan.total_steps:,} decisions; a line about every minute says how many are done.")
            has_begun = True
        if isinstance(news, Evaluation):
            if first_words:
                bar.console.print(first_words)
                first_words = ""
            for line in evaluation_lines(news):
                bar.console.print(line)
        elif not bar.disable:
            bar.update(task, completed=news.steps, description=f"mean return {news.episode_return:.2f}")
        elif time.monotonic() - told_at >= LINE_EVERY_S:
            bar.console.print(progress_line(plan, news, told))
            told, told_at = news, time.monotonic()

    return report


def heading(plan: TrainingPlan) -> str:
    """Return what stands above the evaluations: their runs, and the names of the columns."""
    horizons = {world.scenario.horizon_s for world in plan.judging_worlds}
    runs = f"Evaluated in {counted(plan.evaluation.n_runs, 'run' if len(horizons) == 1 else 'whole run')}"
    if len(horizons) == 1:
        runs += f" of {horizons.pop():,.0f} s"
    if plan.evaluation.worlds:
        return (
            f"{runs} in each of {place_of(plan)}; what counts is the {plan.evaluation.chosen_by} ratio:\n"
            f"{'decisions':>10}  {'world':<20} {'per 1,000 s':>11} {'baseline':>13} {'ratio':>6} {'interference':>12}"
        )
    baseline = plan.evaluation.baseline
    return f"{runs}:\n{'decisions':>12} {'per 1,000 s':>12} {baseline:>8} {'interference':>13}"


def evaluation_lines(news: Evaluation) -> list[str]:
    """Return the lines of an evaluation below `heading`."""
    interference = news.interference_fraction
    if not news.worlds:
        return [f"{news.steps:>12,} {news.performance:>12.1f} {news.baseline:>8.1f} {interference:>13.3f}"]
    lines = [
        f"{'':>10}  {world.world:<20} {world.performance:>11.1f} {f'{world.baseline_policy} {world.baseline:.1f}':>13} "
        f"{world.ratio:>6.2f} {world.interference_fraction:>12.3f}"
        for world in news.worlds
    ]
    return [
        *lines,
        f"{news.steps:>10,}  {ALL_WORLDS:<20} {'':>11} {'':>13} {news.performance:>6.2f} {interference:>12.3f}",
    ]


def progress_line(plan: TrainingPlan, now: TrainingStatus, before: TrainingStatus | None) -> str:
    """Say how far a training is, and how long it takes at the pace since the line before."""
    steps, seconds = (0, 0.0) if before is None else (before.steps, before.wall_time_s)
    left_s = (plan.total_steps - now.steps) * (now.wall_time_s - seconds) / max(1, now.steps - steps)
    return (
        f"{now.steps:,} of {plan.total_steps:,} decisions, mean return {now.episode_return:.2f}, "
        f"about {duration(max(0.0, left_s))} left"
    )
