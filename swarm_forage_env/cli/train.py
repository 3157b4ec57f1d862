"""The commands `train`, `train curves`, `dataset` and `export`: policies that learn, and what others learn from."""

from collections.abc import Iterable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter
from cyclopts.types import NonNegativeInt, PositiveInt

from swarm_forage_env._internal.fields import ConfigError, known_keys
from swarm_forage_env.cli import CommandError
from swarm_forage_env.cli.options import AsJson, Jobs, Names, Picture, Policy, Scenario, Seeds, WorldOptions
from swarm_forage_env.cli.printer import say

if TYPE_CHECKING:
    from swarm_forage_env.training.plan import TrainingPlan

app = App(name="train")
CURVES_FILE = "curves.png"

OF_THE_RECIPE = ("n_arenas", "hidden", "activation", "small_start", "samples", "interface", "options", "evaluation")
"""Arguments of `training.recipe` that --set takes beside fields of the scenario."""


@app.default
def train(
    *,
    plan: Annotated[str | None, Parameter(help="TOML file with a training plan, or name of a shipped policy.")] = None,
    world: WorldOptions = WorldOptions(),
    algo: str | None = None,
    steps: PositiveInt | None = None,
    seed: NonNegativeInt | None = None,
    seeds: PositiveInt | None = None,
    out: Path | None = None,
    jobs: Jobs = None,
    resume: bool = False,
) -> int:
    """Train one policy that every robot shares, and compare it with a scripted controller meanwhile.

    'swarm-forage train --scenario classroom --steps 500000' is a first try.

    Episodes last --horizon, by default 4,000 s, or as long as runs of the scenario or a third of the training if these
    are shorter. If deliveries count, they alone are too rare to learn from. The training then sets nest_progress=0.05,
    first_pickup=1 and interference=-0.002, unless --set or the file of --scenario does, and begins in a smaller arena.
    plan.json holds all choices. Ctrl-C keeps a checkpoint, from which --resume continues.

    --set takes fields of the scenario, and of the plan: n_arenas, hidden, activation, small_start, samples,
    interface.FIELD, evaluation.FIELD and options.ARGUMENT of the algorithm. For example --set hidden=128,128 --set
    interface.decision_ticks=5 --set evaluation.every_steps=100000 --set options.learning_rate=0.001. Beside --plan, it
    takes all that plan.json holds (docs/training.md).

    Args:
        algo: ppo, a2c, dqn or sac; default ppo.
        steps: Decisions, counted per robot; default 3,400,000. With --resume a new total.
        seed: Seed of the training; default 0, or the plan's.
        seeds: Train so many seeds, from 0 or the plan's upwards, into --out/seed_0 and so on, and show a table.
        out: Folder of the training; default results/training/NAME.
        resume: Continue from the checkpoint in --out (needs --trust-models).
    """
    from swarm_forage_env.cli.training_report import run_seeds, run_training

    if seed is not None and seeds is not None:
        raise ConfigError("Expected --seed for one training or --seeds for several, got both.")
    if resume and out is not None and plan is None and world == WorldOptions() and not algo and seed is None:
        chosen, name = _kept_plan(out, steps), ""
    elif plan is None:
        chosen = _by_recipe(world, algo, steps, seed)
        name = f"{chosen.scenario.name}_{chosen.algorithm}"
    elif replace(world, settings=()) != WorldOptions() or algo or steps:
        raise ConfigError("Expected --plan without a world, --algo and --steps, which it decides; use --set for these.")
    else:
        chosen = _of_file(plan, world.settings, seed)
        name = Path(plan).stem if seed is None else f"{Path(plan).stem}_seed_{seed}"
    folder = out or Path("results/training") / (name if seeds is None else f"{name}_seeds")
    if seeds is None:
        return run_training(chosen, folder, resume=resume)
    return run_seeds(chosen, range(chosen.seed, chosen.seed + seeds), folder, jobs=jobs, resume=resume)


def _kept_plan(folder: Path, steps: int | None) -> "TrainingPlan":
    """Return the plan of the training in a folder, or of several, with so many steps in all."""
    from swarm_forage_env.training.evaluation import PLAN_FILE
    from swarm_forage_env.training.plan import read_plan

    if not (folder / PLAN_FILE).exists():
        raise ConfigError(f"Expected {folder} to hold a training to resume, found no {PLAN_FILE}.")
    kept = read_plan(folder / PLAN_FILE)
    return kept if steps is None else kept.longer(steps)


def _by_recipe(options: WorldOptions, algo: str | None, steps: int | None, seed: int | None) -> "TrainingPlan":
    """Return the plan of a training in the world that is described; raises ConfigError where it cannot be."""
    from swarm_forage_env.cli.worlds import described_fields, parse_setting
    from swarm_forage_env.scenarios.config import SECTIONS
    from swarm_forage_env.scenarios.overrides import field_sections
    from swarm_forage_env.training.recipe import recipe

    of_recipe = [word for word in options.settings if word.partition("=")[0].partition(".")[0] in OF_THE_RECIPE]
    others = tuple(word for word in options.settings if word not in of_recipe)
    world = described_fields(replace(options, settings=others))
    of_worlds = *field_sections(), *SECTIONS, "density", "side_m"
    known_keys(world.fields, (*of_worlds, *OF_THE_RECIPE), "field of the scenario or the training")
    given: dict[str, Any] = {}
    for name, value in map(parse_setting, of_recipe):
        argument, dot, field = name.partition(".")
        if dot:
            given.setdefault(argument, {})[field] = value
        else:
            given[argument] = value
    words = {"algorithm": algo, "steps": steps, "seed": seed}
    given |= {name: value for name, value in words.items() if value is not None}
    return recipe(world.preset, wrappers=world.wrappers, **given, **world.fields)


def _of_file(name: str, settings: Iterable[str], seed: int | None) -> "TrainingPlan":
    """Return the plan of a file or of a shipped policy, with fields set."""
    from swarm_forage_env.cli.worlds import parse_setting
    from swarm_forage_env.training.plan import named_plan

    chosen = named_plan(name).with_settings(dict(map(parse_setting, settings)))
    return chosen if seed is None else replace(chosen, seed=seed)


@app.command
def curves(
    folders: Annotated[tuple[Path, ...], Parameter(help="Folders of trainings in one scenario.")],
    /,
    *,
    policy: Annotated[
        Names, Parameter(help="Policies to compare with, separated by commas, or none; default the paper's.")
    ] = (),
    picture: Picture = None,
    as_json: AsJson = False,
) -> None:
    """Draw the progress of trainings, with the scripted controllers on the same axes.

    The controllers make the same runs as the evaluations: same world and seeds, with the caches that they are made for.
    """
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.training.curves import curves as curves_of
    from swarm_forage_env.training.curves import read_trainings

    file = picture or folders[0] / CURVES_FILE
    read_trainings(folders)  # refuses folders before it looks at the place of the picture
    check_picture(file)
    found = curves_of(folders, beside=() if policy == ("none",) else policy or None)
    say(found.json() if as_json else found.text())
    try:
        found.draw(file)
    except OSError as error:  # the table was shown, but a picture was asked for
        raise CommandError(f"No picture {file}: {error.strerror or error}.") from None


def dataset(
    policy: Policy = "dpo",
    /,
    *,
    world: WorldOptions = WorldOptions(),
    seeds: Seeds = 1,
    observation: str | None = None,
    site_memory: bool | None = None,
    minari: str | None = None,
    out: Path | None = None,
    jobs: Jobs = None,
) -> None:
    """Record what robots see and do, for offline reinforcement learning and imitation.

    Writes the observations, actions, rewards and episode ends of every robot. The command does not repeat runs that the
    folder already holds, so after an interruption, just enter it again.

    Args:
        observation: full or compact; default what a learned policy sees, or full for others.
        site_memory: Record two places that robots remember; default as a learned policy sees them, or no.
        minari: Id of a Minari data set of the whole swarm as one agent, which is made, too.
        out: Folder; default results/datasets/SCENARIO_POLICY.
    """
    from swarm_forage_env._internal.wording import counted
    from swarm_forage_env.cli.worlds import RESULTS, default_file, plan_runs
    from swarm_forage_env.runs.progress import progress_bar
    from swarm_forage_env.training.datasets import record_dataset

    (spec,) = plan_runs(world, [policy], [0])
    folder = out or default_file(RESULTS / "datasets", spec.world, [policy], "")
    if minari is not None:
        from swarm_forage_env.training.datasets import check_minari

        check_minari(minari)  # before hours of work
    recorded = {"observation": observation, "site_memory": site_memory}
    try:
        with progress_bar("runs", seeds * spec.robot_ticks) as advance:
            n_new = record_dataset(spec, range(seeds), folder, jobs=jobs, advance=advance, **recorded)
    except KeyboardInterrupt:
        raise KeyboardInterrupt(
            f"Interrupted. Finished runs are kept in {folder}; the same command does the rest."
        ) from None
    say(f"{counted(n_new, 'run')} recorded in {folder}, {seeds - n_new} there before")
    if minari is not None:
        from swarm_forage_env.training.datasets import export_minari

        say(f"wrote the Minari data set {export_minari(folder, minari).spec.dataset_id}")


def export(policy: Policy, /, *, file: Path, scenario: Scenario = "warehouse_small") -> None:
    """Write a network as a C header, or as ONNX, for robots and other simulators.

    The file says in words what goes in and what comes out; docs/export.md says what a robot must sense. The policy is a
    shipped network, or an .npz file of a training. The scenario says how large the arena is.

    Args:
        file: File to write, .h (C99) or .onnx.
    """
    from swarm_forage_env.training.export import export_policy
    from swarm_forage_env.wrappers.world import world_of

    say(f"wrote {export_policy(policy, file, world_of(scenario).scenario)}")
