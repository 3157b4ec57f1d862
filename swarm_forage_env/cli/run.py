"""The command `run`."""

from typing import Annotated

import typer

from swarm_forage_env.cli.option_groups import PolicyOptions, RunOptions, WorldOptions
from swarm_forage_env.cli.options import FirstSeed, Picture


def run(
    policies: PolicyOptions,
    described: WorldOptions,
    options: RunOptions,
    seeds: Annotated[int, typer.Option(min=1, help="Runs per policy.")] = 1,
    first_seed: FirstSeed = 0,
    picture: Picture = None,
) -> None:
    """Run policies in a scenario and compare how they perform.

    Runs in parallel, shows a table, stores one record per run and draws performance over time. Runs that the folder
    holds already are not repeated, so an interrupted command can simply be given again.
    """
    from metrics.scoring.summary import run_question
    from swarm_forage_env._internal.fields import MOST_SEEDS, whole
    from swarm_forage_env.cli.printer import ask_and_show, refusing
    from swarm_forage_env.cli.scenario_options import default_folder, described_world

    whole("--seeds", seeds, at_least=1, at_most=MOST_SEEDS)
    world, caches = described_world(described)
    chosen = range(first_seed, first_seed + seeds)
    with refusing():
        question = run_question(policies.names("crw"), world, seeds=chosen, caches=caches)
    folder = options.out or default_folder(world.scenario.name)
    ask_and_show(question, folder, options, picture=picture or folder / "performance.png")
