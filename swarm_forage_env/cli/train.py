"""The command `train`: it makes a plan by `training.recipe` and carries it out by `training.sb3.training`."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env.cli.options import ConfigFile, Density, Objects, Robots, Settings, Side, Wrappers
from swarm_forage_env.training.defaults import (
    DECISION_TICKS,
    DEFAULT_ARENAS,
    DEFAULT_HIDDEN,
    DEFAULT_STEPS,
    EPISODE_S,
    EVALUATE_EVERY,
)

_HIDDEN = ",".join(map(str, DEFAULT_HIDDEN))


def train(  # long: one parameter per option
    out: Annotated[Path | None, typer.Option(help="Folder of the training; default results/training/NAME.")] = None,
    plan: Annotated[
        str | None,
        typer.Option(
            help="TOML file with a training plan, or name of a shipped policy, instead of all below; but --seed counts."
        ),
    ] = None,
    scenario: Annotated[str | None, typer.Option(help="Preset; default warehouse_small.")] = None,
    algorithm: Annotated[str | None, typer.Option("--algo", help="ppo, a2c, dqn or sac; default ppo.")] = None,
    steps: Annotated[
        int | None, typer.Option(min=1, help=f"Decisions of single robots; default {DEFAULT_STEPS:,}.")
    ] = None,
    arenas: Annotated[
        int | None, typer.Option(min=1, help=f"Arenas side by side; default {DEFAULT_ARENAS}, fewer of large swarms.")
    ] = None,
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of everything; default 0, or that of --plan.")] = None,
    observation: Annotated[str | None, typer.Option(help="compact or full; default compact.")] = None,
    actions: Annotated[
        str | None, typer.Option(help="discrete or continuous; default discrete, for sac continuous.")
    ] = None,
    automatic_gripper: Annotated[
        bool | None,
        typer.Option("--automatic-gripper/--own-gripper", help="Whether the gripper is automatic; default yes."),
    ] = None,
    decision_ticks: Annotated[
        int | None, typer.Option(min=1, help=f"Ticks per decision; default {DECISION_TICKS}.")
    ] = None,
    site_memory: Annotated[
        bool | None,
        typer.Option(
            "--site-memory/--no-site-memory", help="Whether robots remember two places with objects; default yes."
        ),
    ] = None,
    samples: Annotated[
        bool | None,
        typer.Option(
            "--drawn-actions/--likeliest-actions",
            help="Whether the trained policy draws its actions by their probabilities, or takes the likeliest; default "
            "drawn where it has probabilities (ppo, a2c).",
        ),
    ] = None,
    evaluate_every: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Decisions between evaluations and checkpoints; "
            f"default {EVALUATE_EVERY:,}, more where evaluations take long.",
        ),
    ] = None,
    evaluation_horizon: Annotated[
        float | None, typer.Option(help="Seconds per run of an evaluation; default those of the scenario.")
    ] = None,
    small_start: Annotated[
        bool | None,
        typer.Option(
            "--small-start/--no-small-start",
            help="Spend the first third in a smaller arena with short ways; default if deliveries count.",
        ),
    ] = None,
    hidden: Annotated[str | None, typer.Option(help=f"Sizes of the hidden layers; default {_HIDDEN}.")] = None,
    arguments: Annotated[
        list[str] | None,
        typer.Option("--arg", metavar="KEY=NUMBER", help="Argument of the algorithm; may be repeated."),
    ] = None,
    horizon: Annotated[
        float | None,
        typer.Option(help=f"Seconds per episode of the training; default {EPISODE_S:,.0f}, or as measured to be best."),
    ] = None,
    robots: Robots = None,
    objects: Objects = None,
    side: Side = None,
    density: Density = None,
    caches: Annotated[str | None, typer.Option(help="none, static or dynamic; default: those of the preset.")] = None,
    settings: Settings = None,
    wrappers: Wrappers = None,
    config: ConfigFile = None,
    callbacks: Annotated[
        list[str] | None,
        typer.Option(
            "--callback",
            metavar="MODULE:CLASS",
            help="Callback of stable-baselines3, code of yours that runs beside the training; or the name of an entry "
            "point. May be repeated.",
        ),
    ] = None,
    processes: Annotated[int, typer.Option(min=0, help="Processes for the arenas; 0 = all in this process.")] = 0,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="Continue from the checkpoint in --out (needs --trust-models); --steps makes it longer."
        ),
    ] = False,
) -> None:
    """Train one policy that every robot shares, beside evaluations of it and of a scripted controller.

    Rewards are fields of the scenario. Where deliveries count, training sets nest_progress=0.05 and first_pickup=1
    unless --set or --config do, and begins in a smaller arena: deliveries alone are too rare to learn from. plan.json
    holds all that was chosen. Ctrl-C keeps a checkpoint; swarm-forage --trust-models train --out
    FOLDER --resume goes on.
    """
    from swarm_forage_env.cli.scenario_options import ScenarioOptions
    from swarm_forage_env.cli.training_plan import TrainOptions, build_plan, named_plan, resumed_plan
    from swarm_forage_env.cli.training_report import run_training

    options = TrainOptions(
        algorithm=algorithm,
        steps=steps,
        n_arenas=arenas,
        seed=seed,
        observation=observation,
        actions=actions,
        automatic_gripper=automatic_gripper,
        decision_ticks=decision_ticks,
        site_memory=site_memory,
        samples=samples,
        evaluate_every=evaluate_every,
        evaluation_horizon=evaluation_horizon,
        small_start=small_start,
        hidden=hidden,
        horizon_s=horizon,
        arguments=tuple(arguments or ()),
    )
    words = ScenarioOptions(
        scenario=scenario or "warehouse_small",
        robots=robots,
        objects=objects,
        side=side,
        density=density,
        caches=caches,
        settings=tuple(settings or ()),
        wrappers=tuple(wrappers or ()),
        config_file=config,
    )
    plain = (None, ScenarioOptions(scenario=words.scenario))
    says_more = (scenario, words) != plain or options != TrainOptions(steps=steps)
    if plan is not None and ((scenario, words) != plain or options != TrainOptions(seed=seed)):
        raise typer.BadParameter(
            "Expected --plan without options that the plan decides, other than --seed; write them into its file."
        )
    chosen = build_plan(words, options) if plan is None else named_plan(plan, seed)
    name = f"{chosen.scenario.name}_{chosen.algorithm}"
    if plan is not None:
        name = Path(plan).stem if seed is None else f"{Path(plan).stem}_seed_{seed}"
    folder = out or Path("results/training") / name
    if resume and plan is None:
        chosen = resumed_plan(folder, chosen if says_more else None, steps)
    run_training(chosen, folder, n_processes=processes, resume=resume, callbacks=callbacks or ())
