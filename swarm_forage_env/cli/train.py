"""The command `swarm-forage train`: from its options to a plan, and what it shows meanwhile."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from swarm_forage_env.cli.config_file import read_config
from swarm_forage_env.cli.plan import WorldOptions, build_scenario
from swarm_forage_env.cli.report import PERFORMANCE_WORDS
from swarm_forage_env.config import ConfigError, ScenarioConfig
from swarm_forage_env.layout import CELL_M
from swarm_forage_env.learning.interface import InterfaceConfig
from swarm_forage_env.learning.plan import (
    DEFAULT_STEPS,
    Evaluation,
    EvaluationPlan,
    Stage,
    TrainingPlan,
    TrainingStatus,
    read_plan,
)
from swarm_forage_env.learning.pretrained import plan_file
from swarm_forage_env.plots import draw_training
from swarm_forage_env.wrappers.registry import parse_wrapper

DEFAULT_OPTIONS: dict[str, dict[str, Any]] = {
    "ppo": {
        "n_steps": 128,
        "batch_size": 3200,
        "n_epochs": 4,
        "gamma": 0.99,
        "gae_lambda": 0.98,
        "learning_rate": 0.001,
        "ent_coef": 0.003,
    },
    "a2c": {"n_steps": 32, "gamma": 0.99},
    "dqn": {"buffer_size": 1_000_000, "learning_starts": 50_000, "batch_size": 1024, "train_freq": 4},
    "sac": {"buffer_size": 1_000_000, "learning_starts": 50_000, "batch_size": 1024},
}
"""Arguments that suit hundreds of robots at once; our choice, the rest is the library's."""
EPISODE_S = 1000.0
"""Length of an episode, s; our choice: a start puts robots all over the arena, which teaches more than a long run."""
PICTURE_FILE = "training.png"
SMALL_START = 0.4
"""Share of its size that an arena has in a small start; our choice."""


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainOptions:
    """The options of the command that are not about the world; None = the default."""

    algorithm: str | None = None
    steps: int | None = None
    n_arenas: int | None = None
    seed: int | None = None
    observation: str | None = None
    actions: str | None = None
    automatic_gripper: bool | None = None
    decision_ticks: int | None = None
    evaluate_every: int | None = None
    small_start: bool = False
    horizon_s: float | None = None
    arguments: tuple[str, ...] = ()
    """Words of the form key=number, for the algorithm."""


def build_plan(world: WorldOptions, options: TrainOptions) -> TrainingPlan:
    """Return the plan that the options describe: one stage in one world.

    Raises:
        ConfigError: whatever is wrong with them.
    """
    fields, wrappers = ({}, ()) if world.config_file is None else read_config(world.config_file)
    scenario, _ = build_scenario(
        replace(world, horizon=EPISODE_S if options.horizon_s is None else options.horizon_s), fields
    )
    algorithm = options.algorithm or "ppo"
    interface = InterfaceConfig(
        observation=options.observation or "compact",
        actions=options.actions or ("continuous" if algorithm == "sac" else "discrete"),
        automatic_gripper=options.automatic_gripper is not False,
        decision_ticks=options.decision_ticks or 5,
    )
    return TrainingPlan(
        scenario=scenario,
        wrappers=(*wrappers, *map(parse_wrapper, world.wrappers)),
        algorithm=algorithm,
        interface=interface,
        n_arenas=options.n_arenas or 8,
        options=DEFAULT_OPTIONS.get(algorithm, {}) | dict(map(_argument, options.arguments)),
        stages=_stages(scenario, options),
        evaluation=EvaluationPlan(every_steps=options.evaluate_every or 1_000_000),
        seed=options.seed or 0,
    )


def _stages(scenario: ScenarioConfig, options: TrainOptions) -> tuple[Stage, ...]:
    steps = options.steps or DEFAULT_STEPS
    if not options.small_start:
        return (Stage(steps=steps),)
    return Stage(steps=max(1, steps // 3), scenario=small_arena(scenario)), Stage(steps=steps - steps // 3)


def small_arena(scenario: ScenarioConfig) -> dict[str, Any]:
    """Return fields that shrink the arena to SMALL_START of its size with the nest in proportion.

    Only along x for a single source, which lies opposite the nest: the other axis is no way home.
    """
    arena = scenario.arena
    shares = (SMALL_START, 1.0 if scenario.objects.placement == "single_source" else SMALL_START)
    width_m, height_m = (
        round(extent * share / CELL_M) * CELL_M
        for extent, share in zip((arena.width_m, arena.height_m), shares, strict=True)
    )
    (centre_x, centre_y), (size_x, size_y) = arena.nest_centre_m, arena.nest_size_m
    return {
        "width_m": width_m,
        "height_m": height_m,
        "nest_centre_m": (centre_x * shares[0], centre_y * shares[1]),
        "nest_size_m": (size_x * shares[0], size_y * shares[1]),
    }


def named_plan(name: str) -> TrainingPlan:
    """Return the plan of a file, or of a shipped policy by its name.

    Raises:
        ConfigError: there is none, or it cannot be used.
    """
    shipped = plan_file(name)
    return read_plan(Path(name) if shipped is None else shipped)


def _argument(word: str) -> tuple[str, float | int]:
    name, _, text = word.partition("=")
    for kind in (int, float):
        try:
            return name, kind(text)
        except ValueError:
            continue
    raise ConfigError(f"Expected an argument of the algorithm as key=number, got {word!r}.")


def run_training(plan: TrainingPlan, folder: Path, *, n_processes: int, resume: bool) -> None:
    """Train, show how it goes, and say where the results are.

    Raises:
        ImportError: stable-baselines3 is not installed.
        ConfigError: see `training.train`.
    """
    from swarm_forage_env.learning.sb3.training import MODEL_FILE, train

    console = Console(stderr=True, highlight=False)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        try:
            result = train(plan, folder, n_processes=n_processes, resume=resume, report=_reporter(plan, bar))
        except KeyboardInterrupt:
            bar.console.print("Stopped. The same command with --resume goes on.")
            raise
    drawn = _draw(plan, result.evaluations, folder / PICTURE_FILE, console)
    files = {"model": folder / MODEL_FILE, "network": result.policy_file, "picture": drawn}
    console.print(", ".join(f"{what} {file}" for what, file in files.items() if file is not None), soft_wrap=True)


def _draw(plan: TrainingPlan, evaluations: Sequence[Evaluation], path: Path, console: Console) -> Path | None:
    """Draw the evaluations; returns `path`, None without matplotlib."""
    try:
        draw_training(
            path,
            [evaluation.steps for evaluation in evaluations],
            [evaluation.performance for evaluation in evaluations],
            [evaluation.interference_fraction for evaluation in evaluations],
            baseline=(plan.evaluation.baseline, evaluations[-1].baseline),
            stage_ends=np.cumsum([stage.steps for stage in plan.stages]).tolist(),
            title=f"{plan.algorithm} in {plan.scenario.name}, {plan.scenario.robots.n_robots} robots",
            ylabel=f"{PERFORMANCE_WORDS[plan.scenario.performance]} per 1,000 s",
        )
    except ImportError:
        console.print("No picture without matplotlib: pip install 'swarm-forage-env[plots]'", markup=False)
        return None
    return path


def _reporter(plan: TrainingPlan, bar: Progress) -> Callable[[TrainingStatus | Evaluation], None]:
    task = bar.add_task("training", total=plan.total_steps)
    heading = f"{'decisions':>12} {'per 1,000 s':>12} {plan.evaluation.baseline:>8} {'interference':>13}"

    def report(news: TrainingStatus | Evaluation) -> None:
        nonlocal heading
        if isinstance(news, Evaluation):
            if heading:
                bar.console.print(heading)
                heading = ""
            bar.console.print(
                f"{news.steps:>12,} {news.performance:>12.1f} {news.baseline:>8.1f} {news.interference_fraction:>13.3f}"
            )
        else:
            bar.update(task, completed=news.steps, description=f"mean return {news.episode_return:.2f}")

    return report
