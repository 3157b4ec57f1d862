"""The options that describe a world, for commands that take all or some of them.

    @takes_world()
    def watch(described: World, policy: ..., speed: ...) -> None:

The command line then shows `--scenario`, `--robots` and the rest where `described` stands, and the function gets them
as one object. `@takes_world("scenario", "caches")` takes these two alone.
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
    "performance": (options.Performance, None),
}
"""Name of a parameter -> its type with the words of the command line, and its default."""
_LISTS = ("settings", "wrappers")
_ALL = tuple(name for name in _OPTIONS if name != "performance")
SCORED = ("scenario", "robots", "objects", "side", "density", "caches", "performance", "settings")
"""Options of commands that bring adversity of their own."""


def takes_world(*names: str) -> Callable[[Callable[..., None]], Callable[..., None]]:
    """Give a command options of a world; it gets them as `described`, a `ScenarioOptions`.

    Args:
        names: Which options, default all that describe the world; how it is judged, "performance", is one more.
    """
    taken = names or _ALL

    def give(command: Callable[..., None]) -> Callable[..., None]:
        parameters: list[inspect.Parameter] = []
        signature = inspect.signature(command)
        for name, parameter in signature.parameters.items():
            if name == _PARAMETER:
                parameters += [_parameter(one) for one in taken]
            else:
                parameters.append(parameter.replace(kind=parameter.KEYWORD_ONLY))

        @functools.wraps(command)
        def with_options(**words: Any) -> None:
            command(described=_described({name: words.pop(name) for name in taken}), **words)

        vars(with_options)["__signature__"] = signature.replace(parameters=parameters)  # what typer reads
        with_options.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
        return with_options

    return give


def _parameter(name: str) -> inspect.Parameter:
    kind, default = _OPTIONS[name]
    return inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, annotation=kind, default=default)


def _described(given: dict[str, Any]) -> "ScenarioOptions":
    from swarm_forage_env.cli.scenario_options import ScenarioOptions

    given.setdefault("scenario", "")  # a command with a list of scenarios fills it in
    lists = {name: tuple(given.pop(name) or ()) for name in _LISTS if name in given}
    return ScenarioOptions(config_file=given.pop("config", None), **lists, **given)
