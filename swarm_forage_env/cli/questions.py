"""The commands `run`, `score`, `compare`, `predict`, `choose` and `ablate`: questions about policies."""

import json
from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from metrics.controllers import PAPER_POLICIES
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.options import (
    OF_RUNS,
    AllPanels,
    AsJson,
    Band,
    Budget,
    Curves,
    Disturbance,
    FirstSeed,
    Forms,
    Measures,
    Performance,
    Picture,
    PlaceOptions,
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


_CURVES_OF_SCORE = ("curves", "measures", "performance", "variant", "form", "band", "all_panels", "picture", "as_json")
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
    all_panels: AllPanels = False,
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

    forms = score_forms(variant, form, band=band, all_panels=all_panels)
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


def score_forms(variants: str, forms: str, *, band: bool = False, all_panels: bool = False) -> "ScoreForms":
    """Return the variants and forms that the words name, separated by commas.

    Raises:
        ConfigError: an unknown word, or none.
    """
    from metrics.scoring import ScoreForms
    from swarm_forage_env.cli.printer import refusing
    from swarm_forage_env.cli.scenario_options import split_names

    words: dict[str, Any] = {"variants": split_names(variants), "forms": split_names(forms)}
    with refusing():
        return ScoreForms(**words, band=band, all_panels=all_panels)


_CURVES_OF_PREDICT = ("curves", "fit", "hold", "performance", "picture", "as_json")
"""Options of `predict` that go with --curves."""


def predict(
    context: typer.Context,
    policies: PolicyOptions,
    described: PlaceOptions,
    options: RunOptions,
    curves: Curves = None,
    fit: Annotated[
        str | None,
        typer.Option(
            help="Swarm sizes to fit, four or more; default 1,2,4,8,16,32 (search_and_rescue: 12,51,115,204,320), or "
            "those of the file."
        ),
    ] = None,
    hold: Annotated[
        str | None,
        typer.Option(help="Larger sizes that test the prediction: run, or read from the file, but not fitted."),
    ] = None,
    seeds: Annotated[int, typer.Option(min=2, help="Runs per size.")] = 4,
    from_scenario: Annotated[
        bool,
        typer.Option(
            "--from-scenario",
            help="Predict performance, time lost, E_S, E_T and C for the sizes of --fit and --hold, from arena, "
            "objects and walk alone. Fits nothing and runs only --hold. For policies that search at random, like crw.",
        ),
    ] = False,
    picture: Picture = None,
) -> None:
    """Predict the performance of larger swarms from smaller ones, with intervals, and the critical size.

    Fits a law to small swarms and predicts twice and four times the largest of them. At the critical size, performance
    is largest. The command also runs the sizes of --hold and compares them with the prediction. It does not repeat runs
    that the folder already holds.
    """
    from metrics.scoring.from_scenario import predict_from_scenario, scenario_question
    from metrics.scoring.prediction import Predictions, predict_curves, prediction_question
    from swarm_forage_env.cli.printer import ask_and_show, refusing, show
    from swarm_forage_env.cli.scenario_options import default_folder, described_world, split_numbers

    fitted = None if fit is None else split_numbers("--fit", fit, int)
    held = () if hold is None else split_numbers("--hold", hold, int)
    if curves is not None:
        refuse_others(context, "--curves", _CURVES_OF_PREDICT, OF_RUNS)
        with refusing():
            tables = predict_curves(curves, fit=fitted, hold=held, performance=described.performance)
        show(Predictions(tables=tables), picture, as_json=options.as_json)
        return
    if any(word.partition("=")[0] == "n_robots" for word in described.settings):
        raise typer.BadParameter("Expected no --set n_robots=..., because sizes are varied; use --fit and --hold.")
    world, caches = described_world(described)
    names = policies.names()
    if from_scenario and not held:
        with refusing():
            found = predict_from_scenario(names, world, fitted, caches=caches)
        show(found, picture, as_json=options.as_json)
        return
    with refusing():
        question = (
            scenario_question(names, world, fitted, hold=held, seeds=seeds, caches=caches)
            if from_scenario
            else prediction_question(names, world, fit=fitted, hold=held, seeds=seeds, caches=caches)
        )
    folder = options.out or default_folder(world)
    file = picture or _picture(folder, "from_scenario" if from_scenario else "prediction", world)
    ask_and_show(question, folder, options, picture=file)


def availability(
    robots: Annotated[str, typer.Option("--robots", help="Swarm sizes, separated by commas.")] = "50,200",
    teams: Annotated[
        str, typer.Option("--teams", help="Mean teams M: numbers of robots at work on average.")
    ] = "5,10,20",
    needed: Annotated[str, typer.Option("--needed", help="Numbers of robots needed, in the table.")] = "1,5,10,20,40",
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Show how likely it is that enough robots are at work, for each number needed.

    The command computes this in equilibrium, without runs.
    """
    from metrics.scoring.theory import availability as computed
    from swarm_forage_env.cli.printer import notes
    from swarm_forage_env.cli.scenario_options import split_numbers
    from swarm_forage_env.rendering.figures import check_picture

    sizes = split_numbers("--robots", robots, int)
    means = split_numbers("--teams", teams, float)
    demands = split_numbers("--needed", needed, int)
    if picture is not None:
        check_picture(picture)
    try:
        found = computed(sizes, means, demands)
    except ValueError as error:  # a size or a team that cannot be
        raise ConfigError(str(error)) from error
    told = {**found.to_mapping(), "picture": None if picture is None else str(picture)}
    typer.echo(json.dumps(told) if as_json else found.text())
    if picture is not None:
        found.draw(picture)
        notes().print(f"picture {picture}")


def choose(
    policies: PolicyOptions,
    described: WorldOptions,
    options: RunOptions,
    deliver: Annotated[
        float,
        typer.Option(
            help="Total performance that an undisturbed run must reach: objects, or what --performance counts."
        ),
    ],
    keep: Annotated[
        float, typer.Option(help="Share of --deliver that a run must still reach under each disturbance.")
    ] = 1.0,
    failures: Annotated[
        float | None,
        typer.Option(
            metavar="RATE",
            help="Malfunctions per tick (0.2 s) in the whole swarm; 0.001 in the study. Robots stop and are repaired "
            "one after the other, a little faster than they fail (docs/deciding.md).",
        ),
    ] = None,
    deaths: Annotated[
        float | None,
        typer.Option(metavar="COUNT", help="Expected deaths in a run, at random times; dead robots do not come back."),
    ] = None,
    noise: Annotated[
        float | None,
        typer.Option(metavar="SIGMA", help="Standard deviation of noise on all sensors and wheels."),
    ] = None,
    seeds: Annotated[int, typer.Option(min=2, help="Runs per policy and condition.")] = 4,
) -> None:
    """Rank policies by the constraints that they meet: how much they deliver, also under failures, deaths and noise.

    Each policy runs undisturbed and under each disturbance alone. A policy meets a constraint if the whole 95 %
    interval of its mean performance reaches the demand. The command does not repeat runs that the folder already holds.
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
    ask_and_show(question, options.out or default_folder(world), options)


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
        str,
        typer.Option("--quirks", help="Quirks to switch, separated by commas; all; or none, for the two rules only."),
    ] = "all",
    seeds: Annotated[int, typer.Option(min=2, help="Runs per policy, size and switched quirk.")] = 3,
) -> None:
    """Switch one quirk at a time and show what it changes: on in the described rules, off in the authors' program.

    The tables are Markdown. Records go to a folder, so after an interruption, just enter the command again.
    """
    from metrics.scoring.ablation import ablation_question
    from swarm_forage_env._internal.fields import MOST_SEEDS, whole
    from swarm_forage_env.cli.printer import ask_and_show, refusing
    from swarm_forage_env.cli.scenario_options import described_world, split_names
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
    ask_and_show(question, folder, options, as_markdown=True)
