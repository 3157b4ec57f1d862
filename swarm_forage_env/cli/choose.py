"""The command `choose`."""

from typing import Annotated

import typer

from swarm_forage_env.cli.option_groups import PolicyOptions, RunOptions, WorldOptions


def choose(
    policies: PolicyOptions,
    described: WorldOptions,
    options: RunOptions,
    deliver: Annotated[
        float,
        typer.Option(help="Performance that an undisturbed run must reach, in all: objects or what is asked for."),
    ],
    keep: Annotated[
        float, typer.Option(help="Share of --deliver that is still demanded under each disturbance.")
    ] = 1.0,
    failures: Annotated[
        float | None,
        typer.Option(
            metavar="RATE",
            help="Malfunctions per tick (0.2 s) of the whole swarm, 0.001 in the study. Robots stop and are repaired "
            "one after the other, a little faster than they fail (docs/deciding.md).",
        ),
    ] = None,
    deaths: Annotated[
        float | None,
        typer.Option(
            metavar="COUNT", help="Robots that are expected to die in a run, at random times; they do not come back."
        ),
    ] = None,
    noise: Annotated[
        float | None,
        typer.Option(metavar="SIGMA", help="Standard deviation of the noise of all sensors and wheels."),
    ] = None,
    seeds: Annotated[int, typer.Option(min=2, help="Runs per policy and condition.")] = 4,
) -> None:
    """Rank policies by the constraints that they meet: deliver so much, despite failures, deaths and noise.

    Each policy runs undisturbed and under each disturbance alone. A constraint is met if the whole 95 % interval of
    mean performance reaches the demand. Runs that the folder holds already are not repeated.
    """
    from metrics.scoring.choosing import choice_question
    from swarm_forage_env.cli.printer import ask_and_show, refusing
    from swarm_forage_env.cli.scenario_options import default_folder, described_world

    world, caches = described_world(described)
    with refusing():
        question = choice_question(
            policies.names(),
            world,
            deliver=deliver,
            keep=keep,
            failures=failures,
            deaths=deaths,
            noise=noise,
            seeds=seeds,
            caches=caches,
        )
    ask_and_show(question, options.out or default_folder(world.scenario.name), options)
