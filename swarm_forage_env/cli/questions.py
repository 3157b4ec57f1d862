"""The commands `run`, `plot` and `score`: questions about policies."""

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.options import (
    OF_RUNS,
    Band,
    Budget,
    Curves,
    Disturbance,
    FirstSeed,
    Forms,
    Measures,
    Performance,
    Picture,
    PolicyOptions,
    RunOptions,
    ScoreSeeds,
    StyleOptions,
    Variants,
    WorldOptions,
    refuse_others,
)

if TYPE_CHECKING:
    from metrics.scoring import ScoreForms, ScoreQuestion
    from swarm_forage_env.wrappers.world import World


def run(
    policies: PolicyOptions,
    described: WorldOptions,
    options: RunOptions,
    seeds: Annotated[int, typer.Option(min=1, help="Runs per policy.")] = 1,
    first_seed: FirstSeed = 0,
    picture: Picture = None,
) -> None:
    """Run policies in a scenario and compare how they perform.

    Makes the runs in parallel, shows a table, stores one record per run and draws performance over time. The command
    does not repeat runs that the folder already holds, so after an interruption, just enter it again.
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
    folder = options.out or default_folder(world)
    ask_and_show(question, folder, options, picture=picture or _picture(folder, "performance", world))


def plot(
    folder: Annotated[Path, typer.Argument(metavar="FOLDER", help="Folder of records that 'run' has stored.")],
    looks: StyleOptions,
    performance: Performance = None,
    picture: Picture = None,
) -> None:
    """Draw stored runs anew: performance over time, one curve per policy. Nothing is run.

    'swarm-forage plot results/warehouse_small --width 3.5 --no-title --picture figure.pdf' draws it for a column of a
    paper. 'study plot' draws studies.
    """
    from metrics.scoring.summary import summarize_runs
    from swarm_forage_env.cli.printer import refusing
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.runs.table import read_table
    from swarm_forage_env.studies.study_folder import StudyFolder

    if folder.suffix == ".parquet" or StudyFolder(folder).study_file.exists():
        raise ConfigError(f"Expected a folder of runs, got a study; it is 'swarm-forage study plot {folder}'.")
    with refusing():
        found = summarize_runs(read_table(folder, performance=performance))
        file = picture or _picture(folder, "performance", found.world)
        check_picture(file)
        found.draw(file, style=looks.style())
    typer.echo(f"picture {file}")


def _picture(folder: Path, name: str, world: "World") -> Path:
    """Return the file of a picture: a folder has the runs of one world, which may be read in several ways."""
    from swarm_forage_env._internal.files import as_file_name
    from swarm_forage_env.scenarios.differences import preset_of

    read_as, preset = world.scenario.performance, preset_of(world.scenario)
    is_usual = preset is None or read_as == preset.performance
    return folder / (f"{name}.png" if is_usual else f"{name}_{as_file_name(read_as)}.png")


_CURVES_OF_SCORE = ("curves", "measures", "performance", "variant", "form", "band", "picture", "as_json")
"""Options that go with --curves."""


def score(
    context: typer.Context,
    policies: PolicyOptions,
    described: WorldOptions,
    options: RunOptions,
    curves: Curves = None,
    measures: Measures = None,
    variant: Variants = "corrected",
    form: Forms = "marginal",
    band: Band = False,
    budget: Budget = "standard",
    seeds: ScoreSeeds = None,
    disturbance: Disturbance = "throttle",
    picture: Picture = None,
) -> None:
    """Run the experiments that the measures of swarm engineering need, and score and compare policies.

    The experiments vary swarm size, throttle, noise and failures. One table shows all scores, with intervals and
    noise floors. For several policies, the command compares runs with the same seed and shows which differences are
    significant. It does not repeat runs that the folder already holds. The budget sets the length of runs, unless
    --horizon does.
    """
    from metrics.scoring.policy_scores import score_curves
    from metrics.scoring.score_tables import side_by_side
    from swarm_forage_env.cli.printer import ask_and_show, refusing, show
    from swarm_forage_env.cli.scenario_options import default_folder, split_names

    forms = score_forms(variant, form, band=band)
    wanted = None if measures is None else split_names(measures)
    if curves is not None:
        refuse_others(context, "--curves", _CURVES_OF_SCORE, OF_RUNS)
        with refusing():
            tables = score_curves(curves, measures=wanted, performance=described.performance, forms=forms)
        show(side_by_side(tables), picture, as_json=options.as_json)
        return
    question = asked_scores(
        policies.names(),
        described,
        measures=wanted,
        budget=budget,
        seeds=seeds,
        disturbance=disturbance,
        forms=forms,
    )
    folder = options.out or default_folder(question.world)
    name = "scores" if len(question.plan.policies) == 1 else "comparison"
    file = picture or _picture(folder, name, question.world)
    ask_and_show(question, folder, options, picture=file)


_OF_THE_BUDGET = ("horizon_s", "interval_s")


def asked_scores(policies: Sequence[str], described: WorldOptions, **options: Any) -> "ScoreQuestion":
    """Return the question that the words ask.

    Args:
        policies: Names and files.
        described: Options of the world.
        options: Further ones of `score_question`.

    Raises:
        ConfigError: whatever is wrong with the words.
        ImportError: the policy is a model, and stable-baselines3 is not installed.
    """
    from metrics.scoring import score_question
    from swarm_forage_env.cli.printer import refusing
    from swarm_forage_env.cli.scenario_options import described_fields, described_world

    for word in described.settings:
        if word.partition("=")[0] in _OF_THE_BUDGET:
            raise ConfigError(f"Expected no --set {word}, which the budget sets; --horizon changes the length of runs.")
    density = described_fields(described).fields.get("density")
    world, caches = described_world(replace(described, horizon=None))
    with refusing():
        return score_question(policies, world, horizon_s=described.horizon, caches=caches, density=density, **options)


def score_forms(variants: str, forms: str, *, band: bool = False) -> "ScoreForms":
    """Return the variants and forms that the words name, separated by commas.

    Raises:
        ConfigError: an unknown word, or none.
    """
    from metrics.scoring import ScoreForms
    from swarm_forage_env.cli.printer import refusing
    from swarm_forage_env.cli.scenario_options import split_names

    words: dict[str, Any] = {"variants": split_names(variants), "forms": split_names(forms)}
    with refusing():
        return ScoreForms(**words, band=band)
