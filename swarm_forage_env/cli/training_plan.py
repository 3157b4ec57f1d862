"""From the words of `swarm-forage train` to a plan: by the recipe, from a file, or of a training to resume."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.option_groups import WorldOptions
from swarm_forage_env.cli.scenario_options import described_fields
from swarm_forage_env.policies.pretrained import plan_file
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.plan import TrainingPlan, read_plan
from swarm_forage_env.training.recipe import recipe

_INTERFACE_FIELDS = ("observation", "actions", "automatic_gripper", "decision_ticks", "site_memory")


@dataclass(frozen=True, kw_only=True, slots=True)
class TrainOptions:
    """The options of the command that do not describe the scenario; None = the default of `training.recipe`."""

    algorithm: str | None = None
    steps: int | None = None
    n_arenas: int | None = None
    seed: int | None = None
    observation: str | None = None
    actions: str | None = None
    automatic_gripper: bool | None = None
    decision_ticks: int | None = None
    site_memory: bool | None = None
    samples: bool | None = None
    evaluate_every: int | None = None
    evaluation_horizon: float | None = None
    small_start: bool | None = None
    hidden: str | None = None
    """Sizes of hidden layers, separated by commas."""
    arguments: tuple[str, ...] = ()
    """Words of the form key=number, for the algorithm."""


def build_plan(words: WorldOptions, options: TrainOptions) -> TrainingPlan:
    """Return the plan that the command line describes, made by `training.recipe`.

    Raises:
        ConfigError: anything wrong with the options.
    """
    described = described_fields(words)
    scenario(described.preset, **described.fields)  # or the recipe could take unknown fields for its own arguments
    interface = {name: getattr(options, name) for name in _INTERFACE_FIELDS}
    names = ("algorithm", "steps", "n_arenas", "small_start", "seed", "samples")
    chosen = {name: getattr(options, name) for name in names}
    if options.hidden is not None:
        chosen["hidden"] = _layers(options.hidden)
    evaluation = {"every_steps": options.evaluate_every, "horizon_s": options.evaluation_horizon}
    return recipe(
        described.preset,
        interface=_given(interface),
        wrappers=described.wrappers,
        options=dict(map(_argument, options.arguments)),
        evaluation=_given(evaluation),
        **_given(chosen),
        **described.fields,
    )


def _given(values: dict[str, Any]) -> dict[str, Any]:
    """Leave out options that were not given, so that the defaults stand in one place."""
    return {name: value for name, value in values.items() if value is not None}


def named_plan(name: str, seed: int | None = None) -> TrainingPlan:
    """Return the plan of a file, or of a shipped policy by its name, with another seed if one is given.

    Raises:
        ConfigError: there is none, or it cannot be used.
    """
    shipped = plan_file(name)
    plan = read_plan(Path(name) if shipped is None else shipped)
    return plan if seed is None else replace(plan, seed=seed)


def resumed_plan(folder: Path, described: TrainingPlan | None, steps: int | None) -> TrainingPlan:
    """Return the plan of the training in a folder, to resume it; `steps` can make it longer.

    Args:
        folder: Folder of the training.
        described: Plan of the other options, which must agree with it; None if there were none.
        steps: Decisions in all; None = those of the plan.

    Raises:
        ConfigError: no training in the folder, options that differ from its plan, or fewer steps.
    """
    from swarm_forage_env.training.sb3.training import PLAN_FILE, kept_plan

    kept = kept_plan(folder)
    plan = kept if steps is None else kept.longer(steps)
    if described is not None:
        begun, wanted = ([(stage.scenario, stage.options) for stage in each.stages] for each in (kept, described))
        # The options would divide the steps into other stages; a training keeps its own stages.
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
