"""The command `swarm-forage train`: from its options to a plan, and what it shows meanwhile."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from rich.console import Console
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn, TimeRemainingColumn

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.config_file import read_config
from swarm_forage_env.cli.options import NO_PICTURE
from swarm_forage_env.cli.report import PERFORMANCE_WORDS
from swarm_forage_env.cli.scenario_options import ScenarioOptions, build_scenario, build_wrappers
from swarm_forage_env.policies.interface import InterfaceConfig
from swarm_forage_env.policies.pretrained import plan_file
from swarm_forage_env.rendering.plots import draw_training
from swarm_forage_env.scenarios.config import ScenarioConfig, with_overrides
from swarm_forage_env.scenarios.units import CELLS_PER_M
from swarm_forage_env.training.plan import (
    DEFAULT_HIDDEN,
    DEFAULT_STEPS,
    Evaluation,
    EvaluationPlan,
    Stage,
    TrainingPlan,
    TrainingStatus,
    read_plan,
)

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
DEFAULT_REWARDS = {"first_pickup": 1.0, "nest_progress": 0.05}
"""Rewards where deliveries count; our choice: deliveries alone are too rare to learn from. The whole way home is worth
about one delivery."""
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
    small_start: bool | None = None
    horizon_s: float | None = None
    hidden: str | None = None
    """Sizes of hidden layers, separated by commas."""
    arguments: tuple[str, ...] = ()
    """Words of the form key=number, for the algorithm."""


def build_plan(world: ScenarioOptions, options: TrainOptions) -> TrainingPlan:
    """Return the plan that the options describe: one world, where deliveries count after a stage in a smaller one.

    Raises:
        ConfigError: whatever is wrong with them.
    """
    fields, file_wrappers = ({}, ()) if world.config_file is None else read_config(world.config_file)
    world = replace(world, horizon=EPISODE_S if options.horizon_s is None else options.horizon_s)
    scenario, _ = build_scenario(world, fields)
    if _counts_deliveries(scenario):
        scenario, _ = build_scenario(world, {**DEFAULT_REWARDS, **fields})
    algorithm = options.algorithm or "ppo"
    n_arenas = options.n_arenas or 8
    interface = InterfaceConfig(
        observation=options.observation or "compact",
        actions=options.actions or ("continuous" if algorithm == "sac" else "discrete"),
        automatic_gripper=options.automatic_gripper is not False,
        decision_ticks=options.decision_ticks or 5,
    )
    return TrainingPlan(
        scenario=scenario,
        wrappers=build_wrappers(world, file_wrappers),
        algorithm=algorithm,
        interface=interface,
        n_arenas=n_arenas,
        hidden=DEFAULT_HIDDEN if options.hidden is None else _layers(options.hidden),
        options=_algorithm_options(algorithm, n_arenas * scenario.robots.n_robots, options.arguments),
        stages=_stages(scenario, options),
        evaluation=EvaluationPlan(every_steps=options.evaluate_every or 1_000_000),
        seed=options.seed or 0,
    )


def _counts_deliveries(scenario: ScenarioConfig) -> bool:
    return scenario.performance == "collected"


def _algorithm_options(algorithm: str, n_rows: int, words: Sequence[str]) -> dict[str, Any]:
    given = dict(map(_argument, words))
    chosen = DEFAULT_OPTIONS.get(algorithm, {}) | given
    n_steps = chosen.get("n_steps")
    if algorithm == "ppo" and "batch_size" not in given and isinstance(n_steps, int):
        chosen["batch_size"] = _fitting_batch(n_steps * n_rows, DEFAULT_OPTIONS["ppo"]["batch_size"])
    return chosen


def _fitting_batch(n_samples: int, most: int) -> int:
    """Return the largest size from `most` down to half of it that divides `n_samples`, else `most`; or all of few."""
    if 1 < n_samples <= most:
        return n_samples
    return next((size for size in range(most, most // 2, -1) if n_samples % size == 0), most)


def _stages(scenario: ScenarioConfig, options: TrainOptions) -> tuple[Stage, ...]:
    steps = options.steps or DEFAULT_STEPS
    small_start = _counts_deliveries(scenario) if options.small_start is None else options.small_start
    if not small_start:
        return (Stage(steps=steps),)
    small = small_arena(scenario)
    try:
        with_overrides(scenario, **small)
    except ConfigError as error:
        raise ConfigError(
            f"Cannot begin in a smaller arena (--small-start) of {small['width_m']} x {small['height_m']} m: {error} "
            "Or train in the whole arena from the beginning: --no-small-start."
        ) from error
    return Stage(steps=max(1, steps // 3), scenario=small), Stage(steps=steps - steps // 3)


def small_arena(scenario: ScenarioConfig) -> dict[str, Any]:
    """Return fields that shrink the arena to SMALL_START of its size with the nest in proportion.

    Only along x for a single source, which lies opposite the nest: the other axis is no way home.
    """
    arena = scenario.arena
    shares = (SMALL_START, 1.0 if scenario.objects.placement == "single_source" else SMALL_START)
    width_m, height_m = (
        round(extent * share * CELLS_PER_M) / CELLS_PER_M
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


def resumed_plan(folder: Path, described: TrainingPlan | None, steps: int | None) -> TrainingPlan:
    """Return the plan by which the training in a folder goes on: its own, made longer where `steps` says so.

    Args:
        folder: The training.
        described: Plan of the other options, which has to agree; None where there were none.
        steps: Decisions in all; None = those of the plan.

    Raises:
        ConfigError: no training there, options that differ from its plan, or fewer steps.
    """
    from swarm_forage_env.training.sb3.training import PLAN_FILE, kept_plan

    kept = kept_plan(folder)
    plan = kept if steps is None else kept.longer(steps)
    if described is not None:
        begun, wanted = ([(stage.scenario, stage.options) for stage in each.stages] for each in (kept, described))
        # Options divide all steps into stages anew; a training keeps to those that it began.
        wanted_plan = replace(described, stages=plan.stages) if begun == wanted else described
        differences = wanted_plan.differences(kept)
        if differences:
            raise ConfigError(
                f"Expected options that agree with {folder / PLAN_FILE}, got others: {'; '.join(differences)}. "
                "Without options but --out and --steps, --resume goes on by that plan."
            )
    return plan


def _layers(text: str) -> tuple[int, ...]:
    try:
        return tuple(int(size) for size in text.split(","))
    except ValueError as error:
        raise ConfigError(f"Expected --hidden as sizes of layers, such as 128,128, got {text!r}.") from error


def _argument(word: str) -> tuple[str, float | int]:
    name, _, text = word.partition("=")
    if name in ("hidden", "net_arch", "policy_kwargs"):
        raise ConfigError(f"Expected the network as --hidden 128,128 (sizes of hidden layers), got --arg {word}.")
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
    from swarm_forage_env.training.sb3.training import MODEL_FILE, train

    console = Console(stderr=True, highlight=False)
    columns = (TextColumn("{task.description}"), BarColumn(), TimeElapsedColumn(), TimeRemainingColumn())
    with Progress(*columns, console=console, transient=True, disable=not console.is_terminal) as bar:
        try:
            result = train(plan, folder, n_processes=n_processes, resume=resume, report=_reporter(plan, bar))
        except KeyboardInterrupt:
            bar.console.print(_farewell(folder, is_kept=(folder / MODEL_FILE).exists()), soft_wrap=True, markup=False)
            raise
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
        return f"Stopped. To go on: swarm-forage train --out {folder} --resume"
    return "Stopped before there was anything to keep; the same command starts again."


def _draw(plan: TrainingPlan, evaluations: Sequence[Evaluation], path: Path, console: Console) -> Path | None:
    """Draw the evaluations; returns `path`, None without any or without matplotlib."""
    if not evaluations:
        return None
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
        console.print(NO_PICTURE, markup=False)
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
