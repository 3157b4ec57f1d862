"""What `swarm-forage train` shows: progress, evaluations as they come, a picture, and where the results are."""

import math
import shlex
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import Protocol

import typer
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from swarm_forage_env._internal.wording import counted
from swarm_forage_env.cli.options import EXIT_FAILURE, complain, no_picture
from swarm_forage_env.cli.signals import EXIT_INTERRUPTED
from swarm_forage_env.runs.progress import duration
from swarm_forage_env.runs.workers import processes_of
from swarm_forage_env.training.curves import beside_baseline, place_of
from swarm_forage_env.training.evaluation_plan import ALL_WORLDS
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
from swarm_forage_env.training.seeds import TrainingFailure, is_finished, read_seeds, seed_folder

PICTURE_FILE = "training.png"
_TRAINED = "trained policy"
"""Its label in the picture of a single training."""
_NOTHING_TO_SEE = "{} scores 0 in such short runs. Longer ones say more (--evaluation-horizon, or that of the plan)."
LINE_EVERY_S = 60.0
"""Shortest time between two lines about the progress where stderr is no terminal, s."""


def run_training(plan: TrainingPlan, folder: Path, *, resume: bool, callbacks: Sequence[str] = ()) -> None:
    """Train, show how it goes, and say where the results are; `callbacks` as in `training.sb3.callbacks`.

    Raises:
        ImportError: stable-baselines3 is not installed.
        ConfigError: see `training.sb3.training.train` and `training.sb3.callbacks.named_callbacks`.
    """
    from swarm_forage_env.training.sb3.callbacks import named_callbacks
    from swarm_forage_env.training.sb3.training import train

    added = named_callbacks(callbacks)

    with _bar() as bar:
        console = bar.console
        try:
            report = _reporter(plan, bar, plan.total_steps)
            result = train(plan, folder, resume=resume, report=report, callbacks=added)
        except KeyboardInterrupt:
            _draw(plan, read_evaluations(folder / EVALUATIONS_FILE), folder / PICTURE_FILE, console)
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


def _bar() -> Progress:
    console = Console(stderr=True, highlight=False, markup=False, emoji=False)
    columns = (TextColumn("{task.description}", markup=False), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    return Progress(*columns, console=console, transient=True, disable=not console.is_terminal)


def _farewell(folder: Path, *, is_kept: bool) -> str:
    if is_kept:
        return f"Stopped. To go on: swarm-forage --trust-models train --out {shlex.quote(str(folder))} --resume"
    return "Stopped before there was anything to keep; the same command starts again."


def _draw(plan: TrainingPlan, evaluations: Sequence[Evaluation], path: Path, console: Console) -> Path | None:
    """Draw the evaluations; returns `path`, None without any or without matplotlib."""
    if not evaluations:
        return None
    try:
        beside_baseline(TrainingCurve(label=_TRAINED, plan=plan, evaluations=tuple(evaluations))).draw(path)
    except ImportError as error:
        console.print(str(error))
        return None
    except OSError as error:  # the training is worth more than its picture
        console.print(no_picture(path, error))
        return None
    return path


def run_seeds(
    plan: TrainingPlan,
    seeds: Sequence[int],
    folder: Path,
    *,
    jobs: int | None,
    resume: bool,
    callbacks: Sequence[str],
    picture: Path,
    as_json: bool,
) -> None:
    """Train several seeds, show how all go and draw them meanwhile, and print a table; arguments as in `train_seeds`.

    Raises:
        ImportError: stable-baselines3 is not installed.
        ConfigError: see `training.sb3.seeds.train_seeds` and `rendering.figures.check_picture`.
        typer.Exit: Ctrl-C, or a training failed.
    """
    from swarm_forage_env.cli.printer import show
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.training.sb3.seeds import train_seeds

    check_picture(picture)
    with _bar() as bar:
        shown = _SeedsShown(plan, seeds, folder, picture, processes_of(len(seeds), jobs), bar)
        try:
            found = train_seeds(plan, seeds, folder, jobs=jobs, resume=resume, report=shown, callbacks=callbacks)
        except KeyboardInterrupt:
            raise typer.Exit(complain(_farewell_of_seeds(plan, seeds, folder), EXIT_INTERRUPTED)) from None
    show(found, picture if found.has_picture and shown.can_draw else None, as_json=as_json)
    for seed in found.failures:
        place = seed_folder(folder, seed)
        trust, resuming = ("--trust-models ", " --resume") if (place / MODEL_FILE).exists() else ("", "")
        words = shlex.join(["train", "--plan", str(folder / PLAN_FILE), "--seed", str(seed), "--out", str(place)])
        further = "".join(f" --callback {shlex.quote(name)}" for name in callbacks)
        typer.echo(f"again, alone: swarm-forage {trust}{words}{further}{resuming}", err=True)
    if found.failures:
        raise typer.Exit(EXIT_FAILURE)


def _farewell_of_seeds(plan: TrainingPlan, seeds: Sequence[int], folder: Path) -> str:
    if not (folder / PLAN_FILE).exists():
        return "Interrupted before there was anything to keep; the same command starts again."
    finished = sum(is_finished(plan, seed_folder(folder, seed)) for seed in seeds)
    return (
        f"Interrupted: {finished} of {counted(len(seeds), 'training')} finished. To go on: "
        f"swarm-forage --trust-models train --out {shlex.quote(str(folder))} --seeds {len(seeds)} --resume"
    )


class _SeedsShown:
    """Shows how several trainings go, as if they were one, and draws whenever there is a new evaluation.

    Attributes:
        can_draw: Whether matplotlib is installed, as far as is known.
    """

    def __init__(
        self, plan: TrainingPlan, seeds: Sequence[int], folder: Path, picture: Path, n_at_once: int, bar: Progress
    ) -> None:
        self._plan, self._seeds, self._folder, self._picture = plan, seeds, folder, picture
        self._n_at_once = n_at_once
        self._failures: dict[int, str] = {}
        self._latest: dict[int, TrainingStatus] = {}
        for seed, training in read_seeds(plan, folder, seeds).trainings.items():
            self._note(seed, training.evaluations[-1])
        total = plan.total_steps * len(seeds)
        self._report = _reporter(plan, bar, total, begun=self._together().steps, whose=f"{'seed':>6}")
        self._console = bar.console
        self.can_draw = True

    def __call__(self, seed: int, news: TrainingStatus | Evaluation | TrainingFailure) -> None:
        """Show the news of a training."""
        if isinstance(news, TrainingFailure):
            self._failures[seed] = news.reason
            self._console.print(f"Seed {seed} failed: {news.reason}", soft_wrap=True)
            return
        self._note(seed, news)
        if isinstance(news, Evaluation):
            self._report(news, f"{seed:>6}")
            self._draw(seed)
        else:
            self._report(self._together())

    def _note(self, seed: int, news: TrainingStatus | Evaluation) -> None:
        before = self._latest.get(seed)
        known = math.nan if before is None else before.episode_return
        self._latest[seed] = TrainingStatus(
            steps=min(news.steps, self._plan.total_steps),  # the last rollout is a whole one
            wall_time_s=news.wall_time_s,
            episode_return=news.episode_return if isinstance(news, TrainingStatus) else known,
        )

    def _together(self) -> TrainingStatus:
        """All trainings as one that makes the decisions of all in the time that they take side by side."""
        known = [one.episode_return for one in self._latest.values() if not math.isnan(one.episode_return)]
        return TrainingStatus(
            steps=sum(one.steps for one in self._latest.values()),
            wall_time_s=sum(one.wall_time_s for one in self._latest.values()) / self._n_at_once,
            episode_return=sum(known) / len(known) if known else math.nan,
        )

    def _draw(self, seed: int) -> None:
        """Draw all trainings, and the one that was evaluated alone."""
        if not self.can_draw:
            return
        found = read_seeds(self._plan, self._folder, self._seeds, self._failures)
        one = replace(found.trainings[seed], label=_TRAINED)
        alone = beside_baseline(one), seed_folder(self._folder, seed) / PICTURE_FILE
        for what, path in ((found, self._picture), alone):
            try:
                what.draw(path)
            except ImportError as error:
                self._console.print(str(error))
                self.can_draw = False
                return
            except OSError as error:  # the next picture may find room
                self._console.print(no_picture(path, error))


class _Reporter(Protocol):
    def __call__(self, news: TrainingStatus | Evaluation, whose: str = "") -> None:
        """Show the news; `whose` evaluation stands before it."""


def _reporter(plan: TrainingPlan, bar: Progress, total: int, *, begun: int = 0, whose: str = "") -> _Reporter:
    """Return what shows how trainings go that make `total` decisions together; `whose` stands above names of them."""
    task = bar.add_task("training", total=total, completed=begun)
    *first_words, names = heading(plan).splitlines()
    first_words += _beside(whose, [names])
    has_begun = False
    shorter_s = plan.evaluation.horizon_s
    is_short = not plan.evaluation.worlds and shorter_s is not None and shorter_s < plan.scenario.horizon_s
    told: TrainingStatus | None = None
    told_at = time.monotonic()

    def report(news: TrainingStatus | Evaluation, whose: str = "") -> None:
        nonlocal first_words, has_begun, told, told_at
        if bar.disable and not has_begun:
            bar.console.print(f"At least {total:,} decisions; a line about every minute says how many are done.")
            has_begun = True
        if isinstance(news, Evaluation):
            for line in (*first_words, *_beside(whose, evaluation_lines(news))):
                bar.console.print(line)
            if first_words and is_short and news.baseline == 0.0:
                bar.console.print(_NOTHING_TO_SEE.format(plan.evaluation.baseline))
            first_words = []
        elif not bar.disable:
            bar.update(task, completed=news.steps, description=_returned(news))
        elif time.monotonic() - told_at >= LINE_EVERY_S:
            bar.console.print(progress_line(total, news, told))
            told, told_at = news, time.monotonic()

    return report


def _beside(whose: str, lines: Sequence[str]) -> list[str]:
    """Lines beside the name of a training."""
    return [f"{whose} {line}" for line in lines] if whose else [*lines]


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


def _returned(now: TrainingStatus) -> str:
    """Say what episodes returned; none has ended at the beginning."""
    return "no episode has ended" if math.isnan(now.episode_return) else f"mean return {now.episode_return:.2f}"


def progress_line(total: int, now: TrainingStatus, before: TrainingStatus | None) -> str:
    """Say how far a training of `total` decisions is, and how long it takes at the pace since the line before."""
    steps, seconds = (0, 0.0) if before is None else (before.steps, before.wall_time_s)
    left_s = (total - now.steps) * (now.wall_time_s - seconds) / max(1, now.steps - steps)
    return (
        f"{min(now.steps, total):,} of {total:,} decisions, {_returned(now)}, about {duration(max(0.0, left_s))} left"
    )
