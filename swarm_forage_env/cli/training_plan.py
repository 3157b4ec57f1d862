"""From the words of `swarm-forage train` to a plan by the recipe."""

from collections.abc import Mapping, Sequence
from typing import Any

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.option_groups import WorldOptions
from swarm_forage_env.cli.scenario_options import described_fields
from swarm_forage_env.scenarios.presets import scenario
from swarm_forage_env.training.plan import TrainingPlan
from swarm_forage_env.training.recipe import recipe


def build_plan(
    words: WorldOptions,
    *,
    interface: Mapping[str, Any] | None = None,
    evaluation: Mapping[str, Any] | None = None,
    hidden: str | None = None,
    arguments: Sequence[str] = (),
    **chosen: Any,
) -> TrainingPlan:
    """Return the plan that the command line describes, made by `training.recipe`.

    Args:
        words: What describes the scenario.
        interface: Fields of the interface.
        evaluation: Fields of `EvaluationPlan`.
        hidden: Sizes of hidden layers, separated by commas.
        arguments: Words of the form key=number, for the algorithm.
        chosen: Further arguments of the recipe. None, here and above, is its default.

    Raises:
        ConfigError: anything wrong with the options.
    """
    described = described_fields(words)
    scenario(described.preset, **described.fields)  # or the recipe could take unknown fields for its own arguments
    layers = {} if hidden is None else {"hidden": _layers(hidden)}
    return recipe(
        described.preset,
        interface=_given(interface or {}),
        wrappers=described.wrappers,
        options=dict(map(_argument, arguments)),
        evaluation=_given(evaluation or {}),
        **_given(chosen),
        **layers,
        **described.fields,
    )


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
