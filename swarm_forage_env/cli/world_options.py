"""The options that describe a world, for commands that take all of them.

    @takes_world
    def watch(described: World, policy: ..., speed: ...) -> None:

The command line then shows `--scenario`, `--robots` and the rest where `described` stands, and the function gets them
as one object.
"""

import functools
import inspect
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

from swarm_forage_env.cli import options

if TYPE_CHECKING:
    from swarm_forage_env.cli.scenario_options import ScenarioOptions

World: TypeAlias = "ScenarioOptions"
"""Type of the parameter that stands for all of them."""
_PARAMETER = "described"
_OPTIONS: dict[str, tuple[Any, Any]] = {
    "scenario": (options.Scenario, "warehouse_small"),
    "robots": (options.Robots, None),
    "objects": (options.Objects, None),
    "side": (options.Side, None),
    "density": (options.Density, None),
    "caches": (options.Caches, None),
    "settings": (options.Settings, None),
    "wrappers": (options.Wrappers, None),
    "config": (options.ConfigFile, None),
}
"""Name of a parameter -> its type with the words of the command line, and its default."""


def takes_world(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of a world; it gets them as `described`, a `ScenarioOptions`."""
    signature = inspect.signature(command)
    parameters: list[inspect.Parameter] = []
    for name, parameter in signature.parameters.items():
        if name == _PARAMETER:
            parameters += [parameter.replace(name=one, annotation=kind, default=default, kind=parameter.KEYWORD_ONLY)
                           for one, (kind, default) in _OPTIONS.items()]  # fmt: skip
        else:
            parameters.append(parameter.replace(kind=parameter.KEYWORD_ONLY))

    @functools.wraps(command)
    def with_options(**words: Any) -> None:
        from swarm_forage_env.cli.scenario_options import ScenarioOptions

        given = {name: words.pop(name) for name in _OPTIONS}
        described = ScenarioOptions(
            settings=tuple(given.pop("settings") or ()),
            wrappers=tuple(given.pop("wrappers") or ()),
            config_file=given.pop("config"),
            **given,
        )
        command(**words, described=described)

    vars(with_options)["__signature__"] = signature.replace(parameters=parameters)  # what typer reads
    with_options.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return with_options
