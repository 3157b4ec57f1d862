"""The commands `train`, `train curves` and `dataset`: policies that learn, and what others learn from."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from swarm_forage_env._internal.fields import MOST_SEEDS, ConfigError, whole
from swarm_forage_env.cli.options import (
    EXIT_FAILURE,
    AsJson,
    FirstSeed,
    Jobs,
    Picture,
    PolicyOptions,
    WorldOptions,
    complain,
    given_options,
    no_picture,
    refuse_others,
)
from swarm_forage_env.cli.signals import EXIT_INTERRUPTED
from swarm_forage_env.training.defaults import (
    DECISION_TICKS,
    DEFAULT_ACTIVATION,
    DEFAULT_ARENAS,
    DEFAULT_HIDDEN,
    DEFAULT_STEPS,
    EVALUATE_EVERY,
    FRAME_DECISIONS,
)

if TYPE_CHECKING:
    from swarm_forage_env.training.plan import TrainingPlan

PICTURE_FILE = "curves.png"
_HIDDEN = ",".join(map(str, DEFAULT_HIDDEN))
_OF_SEEDS = ("picture", "as_json", "jobs")
"""Options that go with --seeds only."""
_OF_PLAN = ("plan", "out", "seed", "frame_decisions", "seeds", *_OF_SEEDS, "callbacks", "resume")
"""Options that go with --plan."""
_OF_RESUMING = ("steps", "out", "seeds", *_OF_SEEDS, "callbacks", "resume")
"""Options that say nothing of the plan that is resumed."""


@dataclass(frozen=True, kw_only=True, slots=True)
class RecipeOptions:
    """What the recipe of a training is asked for; None = its default."""

    algorithm: Annotated[str | None, typer.Option("--algo", help="ppo, a2c, dqn or sac; default ppo.")] = None
    steps: Annotated[
        int | None, typer.Option(min=1, help=f"Decisions, counted per robot; default {DEFAULT_STEPS:,}.")
    ] = None
    arenas: Annotated[
        int | None, typer.Option(min=1, help=f"Arenas side by side; default {DEFAULT_ARENAS}, fewer for large swarms.")
    ] = None
    seed: Annotated[int | None, typer.Option(min=0, help="Seed of the training; default 0, or the plan's.")] = None
    observation: Annotated[str | None, typer.Option(help="compact or full; default compact.")] = None
    actions: Annotated[
        str | None, typer.Option(help="discrete or continuous; default discrete, or continuous for sac.")
    ] = None
    automatic_gripper: Annotated[
        bool | None,
        typer.Option("--automatic-gripper/--own-gripper", help="Whether the gripper is automatic; default yes."),
    ] = None
    decision_ticks: Annotated[
        int | None, typer.Option(min=1, help=f"Ticks per decision; default {DECISION_TICKS}.")
    ] = None
    site_memory: Annotated[
        bool | None,
        typer.Option(
            "--site-memory/--no-site-memory", help="Whether robots remember two places with objects; default yes."
        ),
    ] = None
    frame_decisions: Annotated[
        int | None,
        typer.Option(
            min=0,
            help="Decisions for which each robot sees the world turned in a way of its own; 0: as it is; "
            f"default {FRAME_DECISIONS} (0 with messages or own sensors), or the plan's. With --plan it holds for "
            "runs, too.",
        ),
    ] = None
    samples: Annotated[
        bool | None,
        typer.Option(
            "--drawn-actions/--likeliest-actions",
            help="Whether the trained policy draws its actions by their probabilities or takes the likeliest one; "
            "default drawn if it has probabilities (ppo, a2c).",
        ),
    ] = None
    evaluate_every: Annotated[
        int | None,
        typer.Option(
            min=1,
            help="Decisions between evaluations and checkpoints; "
            f"default {EVALUATE_EVERY:,}, or more if evaluations take long.",
        ),
    ] = None
    evaluation_horizon: Annotated[
        float | None, typer.Option(help="Simulated seconds per run of an evaluation; default the scenario's.")
    ] = None
    small_start: Annotated[
        bool | None,
        typer.Option(
            "--small-start/--no-small-start",
            help="Whether to spend the first third in a smaller arena; default yes if deliveries count and there are "
            "enough steps.",
        ),
    ] = None
    hidden: Annotated[str | None, typer.Option(help=f"Sizes of the hidden layers; default {_HIDDEN}.")] = None
    activation: Annotated[
        str | None,
        typer.Option(help=f"What hidden layers do to their sums, tanh or relu; default {DEFAULT_ACTIVATION}."),
    ] = None
    arguments: Annotated[
        tuple[str, ...],
        typer.Option("--arg", metavar="KEY=NUMBER", help="Set an argument of the algorithm; may be repeated."),
    ] = ()

    def plan(self, described: WorldOptions) -> "TrainingPlan":
        """Return the plan of a training in the world that is described, made by `training.recipe`.

        Raises:
            ConfigError: anything wrong with the options.
        """
        from swarm_forage_env.cli.scenario_options import described_fields
        from swarm_forage_env.scenarios.presets import scenario
        from swarm_forage_env.training.recipe import recipe

        world = described_fields(described)
        scenario(world.preset, **world.fields)  # or the recipe could take unknown fields for its own arguments
        return recipe(
            world.preset,
            interface=self._chosen(
                "observation", "actions", "automatic_gripper", "decision_ticks", "site_memory", "frame_decisions"
            ),
            wrappers=world.wrappers,
            options=dict(map(_argument, self.arguments)),
            evaluation=_given({"every_steps": self.evaluate_every, "horizon_s": self.evaluation_horizon}),
            **self._chosen("algorithm", "steps", "small_start", "seed", "samples", "activation"),
            **_given({"n_arenas": self.arenas, "hidden": None if self.hidden is None else _layers(self.hidden)}),
            **world.fields,
        )

    def _chosen(self, *names: str) -> dict[str, Any]:
        return _given({name: getattr(self, name) for name in names})


@dataclass(frozen=True, kw_only=True, slots=True)
class SeedsOptions:
    """Several seeds of one training, and what only they have."""

    seeds: Annotated[
        int | None,
        typer.Option(
            "--seeds",
            min=1,
            help="Train so many seeds, from 0 or the plan's upwards, into --out/seed_0 and so on (docs/training.md).",
        ),
    ] = None
    picture: Picture = None
    as_json: AsJson = False

    def check(self, context: typer.Context, seed: int | None) -> None:
        """Refuse seeds that are said twice, or too many, and options that go with several only.

        Raises:
            typer.BadParameter: see above.
            ConfigError: too many.
        """
        if self.seeds is None:
            others = [str(param.name) for param in context.command.params if param.name not in _OF_SEEDS]
            refuse_others(context, "one training", others, "which go with --seeds")
            return
        whole("--seeds", self.seeds, at_least=1, at_most=MOST_SEEDS)
        if seed is not None:
            raise typer.BadParameter("Expected --seed for one training or --seeds for several, got both.")


def train(
    context: typer.Context,
    described: WorldOptions,
    *,
    out: Annotated[Path | None, typer.Option(help="Folder of the training; default results/training/NAME.")] = None,
    plan: Annotated[
        str | None,
        typer.Option(
            help="TOML file with a training plan, or name of a shipped policy; replaces all options below that "
            "describe the training, but for --seed and --frame-decisions."
        ),
    ] = None,
    asked: RecipeOptions,
    several: SeedsOptions,
    callbacks: Annotated[
        list[str] | None,
        typer.Option(
            "--callback",
            metavar="MODULE:CLASS",
            help="Your own callback of stable-baselines3, whose code runs during the training; or the name of an entry "
            "point. May be repeated.",
        ),
    ] = None,
    jobs: Annotated[
        int | None,
        typer.Option(
            "--jobs",
            min=1,
            help="Trainings at a time, each in a process; default one per usable core.",
        ),
    ] = None,
    resume: Annotated[
        bool,
        typer.Option(
            "--resume", help="Continue from the checkpoint in --out (needs --trust-models); --steps sets a new total."
        ),
    ] = False,
) -> None:
    """Train one policy that every robot shares, and compare it with a scripted controller meanwhile.

    Episodes last --horizon, by default 4,000 s, or as long as runs of the scenario or a third of the training if these
    are shorter. Rewards are fields of the scenario. If deliveries count, they alone are too rare to learn from. The
    training then sets nest_progress=0.05, first_pickup=1 and interference=-0.002, unless --set or the file of
    --scenario does, and begins in a smaller arena. plan.json holds all choices. Ctrl-C keeps a checkpoint; swarm-forage
    --trust-models train --out FOLDER --resume continues.

    With --seeds, it trains several seeds, draws them and their mean into curves.png after every evaluation, and shows a
    table at the end, as JSON with --json.
    """
    from swarm_forage_env.cli.training_report import run_seeds, run_training
    from swarm_forage_env.training.evaluations import resumed_plan
    from swarm_forage_env.training.plan import named_plan

    several.check(context, asked.seed)
    if plan is not None:
        refuse_others(context, "--plan", _OF_PLAN, "which it decides; write them into its file")
        chosen = named_plan(plan, seed=asked.seed, frame_decisions=asked.frame_decisions)
        name = Path(plan).stem if asked.seed is None else f"{Path(plan).stem}_seed_{asked.seed}"
    else:
        chosen = asked.plan(described)
        name = f"{chosen.scenario.name}_{chosen.algorithm}"
    folder = out or Path("results/training") / (name if several.seeds is None else f"{name}_seeds")
    if resume and plan is None:
        says_more = bool(given_options(context, besides=_OF_RESUMING))
        chosen = resumed_plan(folder, chosen if says_more else None, asked.steps, is_shared=several.seeds is not None)
    how: dict[str, Any] = {"resume": resume, "callbacks": callbacks or ()}
    if several.seeds is None:
        run_training(chosen, folder, **how)
    else:
        seeds, picture = range(chosen.seed, chosen.seed + several.seeds), several.picture or folder / PICTURE_FILE
        run_seeds(chosen, seeds, folder, jobs=jobs, picture=picture, as_json=several.as_json, **how)


def _given(values: Mapping[str, Any]) -> dict[str, Any]:
    """Leave out options that were not given, so that the defaults stand in one place."""
    return {name: value for name, value in values.items() if value is not None}


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


def curves(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR ...", help="Folders of trainings in one scenario.")],
    policies: Annotated[
        str | None,
        typer.Option("--policy", help="Policies to compare with, separated by commas, or none; default the paper's."),
    ] = None,
    picture: Picture = None,
    jobs: Jobs = None,
    as_json: AsJson = False,
) -> None:
    """Draw the progress of trainings, with the scripted controllers on the same axes.

    The controllers make the same runs as the evaluations: same world and seeds, with the caches that they are made for.
    """
    from swarm_forage_env.cli.scenario_options import split_names
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.training.curves import curves as curves_of
    from swarm_forage_env.training.curves import read_trainings

    file = picture or folders[0] / PICTURE_FILE
    read_trainings(folders)  # refuses folders before it looks at the place of the picture
    check_picture(file)
    beside = () if policies == "none" else None if policies is None else split_names(policies)
    found = curves_of(folders, beside=beside, jobs=jobs)
    typer.echo(found.json() if as_json else found.text())
    try:
        found.draw(file)
    except ImportError as error:
        raise typer.Exit(complain(str(error), EXIT_FAILURE)) from None
    except OSError as error:  # the table was shown, but a picture was asked for
        raise typer.Exit(complain(no_picture(file, error), EXIT_FAILURE)) from None
    typer.echo(f"wrote {file}", err=as_json)


@dataclass(frozen=True, kw_only=True, slots=True)
class RecordedOptions:
    """What a data set holds of a run; names as in `record_dataset`."""

    observation: Annotated[
        str | None,
        typer.Option(help="full or compact; default what a learned policy sees, or full for others."),
    ] = None
    site_memory: Annotated[
        bool | None,
        typer.Option(
            "--site-memory/--no-site-memory",
            help="Whether to record two places that robots remember; default as a learned policy sees them, or no.",
        ),
    ] = None


def dataset(
    policies: PolicyOptions,
    described: WorldOptions,
    *,
    seeds: Annotated[int, typer.Option(min=1, help="Number of runs.")] = 1,
    first_seed: FirstSeed = 0,
    recorded: RecordedOptions,
    minari: Annotated[
        str | None, typer.Option(metavar="ID", help="Also make a Minari data set of the whole swarm as one agent.")
    ] = None,
    out: Annotated[Path | None, typer.Option("--out", help="Folder; default results/datasets/SCENARIO_POLICY.")] = None,
    jobs: Jobs = None,
) -> None:
    """Record what robots see and do, for offline reinforcement learning and imitation.

    Writes the observations, actions, rewards and episode ends of every robot. The command does not repeat runs that the
    folder already holds, so after an interruption, just enter it again.
    """
    from swarm_forage_env._internal.files import as_file_name
    from swarm_forage_env._internal.wording import counted
    from swarm_forage_env.cli.printer import progress_bar
    from swarm_forage_env.cli.scenario_options import described_world, plan_runs
    from swarm_forage_env.policies.registry import policy_label
    from swarm_forage_env.training.datasets import record_dataset

    spec = plan_runs(described, (policies.one("dpo"),), n_seeds=1, first_seed=first_seed)[0]
    world, _ = described_world(described)
    folder = out or Path("results", "datasets", as_file_name(f"{world.file_name}_{policy_label(spec.policy)}"))
    if minari is not None:
        from swarm_forage_env.training.minari_export import check_minari

        check_minari(minari)  # before hours of work
    try:
        with progress_bar("runs", seeds * spec.robot_ticks) as advance:
            chosen = range(first_seed, first_seed + seeds)
            n_new = record_dataset(spec, chosen, folder, jobs=jobs, advance=advance, **asdict(recorded))
    except KeyboardInterrupt:
        words = f"Interrupted. Finished runs are kept in {folder}; the same command does the rest."
        raise typer.Exit(complain(words, EXIT_INTERRUPTED)) from None
    typer.echo(f"{counted(n_new, 'run')} recorded in {folder}, {seeds - n_new} there before")
    if minari is not None:
        from swarm_forage_env.training.minari_export import export_minari

        typer.echo(f"wrote the Minari data set {export_minari(folder, minari).spec.dataset_id}")


def export(
    policies: PolicyOptions,
    described: WorldOptions,
    *,
    file: Annotated[Path, typer.Option("--file", metavar="FILE", help="File to write, .h (C99) or .onnx.")],
) -> None:
    """Write a network as a C header, or as ONNX, for robots and other simulators.

    The file says in words what goes in and what comes out; docs/export.md says what a robot must sense. The policy is a
    shipped network, or an .npz file of a training. The world says how large the arena is.
    """
    from swarm_forage_env.cli.scenario_options import described_world
    from swarm_forage_env.training.export.exporting import export_policy

    world, _ = described_world(described)
    typer.echo(f"wrote {export_policy(policies.one(), file, world.scenario)}")
