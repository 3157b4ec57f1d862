"""The command `ablate`."""

from dataclasses import dataclass, fields
from typing import Annotated

import typer

from metrics import PAPER_POLICIES
from swarm_forage_env.cli.option_groups import PlaceOptions, PolicyOptions, RunOptions, WorldOptions


@dataclass(frozen=True, kw_only=True, slots=True)
class SeveralPlaces(PlaceOptions):
    """Options of worlds that differ in scenario and size."""

    scenario: Annotated[
        str,
        typer.Option("--scenario", metavar="NAME|FILE.toml", help="One or more presets or files, separated by commas."),
    ] = "warehouse_small,warehouse_medium"
    robots: Annotated[str, typer.Option("--robots", help="One or more swarm sizes, separated by commas.")] = "32,256"

    def places(self) -> list[WorldOptions]:
        """Return the options of each world."""
        from swarm_forage_env.cli.scenario_options import split_names, split_numbers

        common = {field.name: getattr(self, field.name) for field in fields(PlaceOptions)}
        return [
            WorldOptions(**{**common, "scenario": name}, robots=size)
            for name in split_names(self.scenario)
            for size in split_numbers("--robots", self.robots, int)
        ]


def ablate(
    policies: PolicyOptions,
    described: SeveralPlaces,
    options: RunOptions,
    quirks: Annotated[
        str, typer.Option("--quirks", help="Which to switch, separated by commas; all; or none: both rules only.")
    ] = "all",
    seeds: Annotated[int, typer.Option(min=2, help="Runs per policy, size and switched quirk.")] = 3,
) -> None:
    """Switch one quirk at a time, on in the rules as described and off in the authors' program, and show what it moves.

    The tables are Markdown. Records go to a folder; an interrupted command can simply be given again.
    """
    from pathlib import Path

    from metrics.scoring.ablation import ablation_question
    from swarm_forage_env._internal.fields import MOST_SEEDS, whole
    from swarm_forage_env.cli.printer import ask_and_show, refusing
    from swarm_forage_env.cli.scenario_options import described_world, split_names
    from swarm_forage_env.runs.answer import Answer
    from swarm_forage_env.scenarios.quirks import QUIRK_NAMES

    whole("--seeds", seeds, at_least=2, at_most=MOST_SEEDS)
    every = {"all": QUIRK_NAMES, "none": ()}
    with refusing():
        question = ablation_question(
            [described_world(place)[0] for place in described.places()],
            policies.names(",".join(PAPER_POLICIES)),
            quirks=every[quirks] if quirks in every else split_names(quirks),
            seeds=seeds,
            caches=described.caches,
        )
    folder = options.out or Path("results", "ablation")
    ask_and_show(question, folder, options, text=Answer.markdown)
