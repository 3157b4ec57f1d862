"""Options that several commands share, as classes: what they describe, each is a parameter of a command.

    def watch(policies: PolicyOptions, described: WorldOptions, speed: ...) -> None:

The command line shows `--scenario`, `--robots` and the rest where `described` stands, and the function gets them as
one object.
"""

import functools
import inspect
from collections.abc import Callable, Collection
from dataclasses import Field, dataclass, fields, is_dataclass
from typing import Annotated, Any, get_args, get_origin

import typer

from swarm_forage_env.cli import options


@dataclass(frozen=True, kw_only=True, slots=True)
class PlaceOptions:
    """Options that describe a world, but for the size of its swarm; None = the scenario's own value."""

    scenario: options.Scenario = "warehouse_small"
    """Name of a preset, or a file."""
    objects: options.Objects = None
    side: options.Side = None
    caches: options.Caches = None
    horizon: options.Horizon = None
    performance: options.Performance = None
    settings: options.Settings = ()
    """Words of the form key=value."""
    wrappers: options.Wrappers = ()
    """Words of the form name:key=value,key=value."""


@dataclass(frozen=True, kw_only=True, slots=True)
class WorldOptions(PlaceOptions):
    """Options that describe a world."""

    robots: options.Robots = None
    density: options.Density = None
    """A share, "0.05" or "5%"."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PolicyOptions:
    """Which policies, in one of two ways."""

    policies: options.Policies = ()
    named_policies: options.NamedPolicies = ()

    def names(self, default: str = "") -> tuple[str, ...]:
        """Return the policies, each once.

        Args:
            default: Names separated by commas, for a command without any.

        Raises:
            typer.BadParameter: there is none.
            ConfigError: a word without a name.
        """
        from swarm_forage_env.cli.scenario_options import split_names

        words = (*self.policies, *self.named_policies) or ((default,) if default else ())
        if not words:
            raise typer.BadParameter("Expected a policy, by name or file; 'swarm-forage list' has the names.")
        return tuple(dict.fromkeys(name for word in words for name in split_names(word)))

    def one(self, default: str = "") -> str:
        """Return the only policy; raises typer.BadParameter where there are several, or none."""
        name, *more = self.names(default)
        if more:
            raise typer.BadParameter(f"Expected one policy, got {', '.join((name, *more))}.")
        return name


@dataclass(frozen=True, kw_only=True, slots=True)
class RunOptions:
    """How the runs of a question are made, and in which form its answer is shown."""

    out: options.Out = None
    jobs: options.Jobs = None
    as_json: options.AsJson = False
    dry_run: options.DryRun = False


def spread(command: Callable[..., None]) -> Callable[..., None]:
    """Return a command with the fields of its option classes as parameters; it gets objects of these classes."""
    signature = inspect.signature(command)
    kinds: dict[str, Any] = {name: each.annotation for name, each in signature.parameters.items()}
    groups = {name: kind for name, kind in kinds.items() if is_dataclass(kind)}
    parameters: list[inspect.Parameter] = []
    for name, parameter in signature.parameters.items():
        if name in groups:
            parameters += [_parameter(field) for field in fields(groups[name])]
        else:
            parameters.append(parameter.replace(kind=parameter.KEYWORD_ONLY))

    @functools.wraps(command)
    def with_options(**words: Any) -> None:
        given = {name: _gathered(kind, words) for name, kind in groups.items()}
        command(**given, **words)

    vars(with_options)["__signature__"] = signature.replace(parameters=parameters)  # what typer reads
    with_options.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return with_options


def _gathered(kind: Any, words: dict[str, Any]) -> Any:
    """Return the object of an option class; what it takes is taken out of the words."""
    given = {field.name: words.pop(field.name) for field in fields(kind)}
    lists = {name: tuple(value or ()) for name, value in given.items() if _is_list(kind, name)}
    return kind(**{**given, **lists})


def _is_list(kind: Any, name: str) -> bool:
    (field,) = (field for field in fields(kind) if field.name == name)
    return field.default == ()


def _parameter(field: "Field[Any]") -> inspect.Parameter:
    """Return the parameter of a field; typer means by a tuple so many words, and by a list any number."""
    annotation, default = field.type, field.default
    kind, *words = get_args(annotation)
    if get_origin(kind) is tuple:
        annotation, default = Annotated[list[str] | None, *words], None
    return inspect.Parameter(field.name, inspect.Parameter.KEYWORD_ONLY, annotation=annotation, default=default)


def refuse_others(context: typer.Context, what: str, allowed: Collection[str], why: str) -> None:
    """Refuse words that would have no effect.

    Args:
        context: Of the command.
        what: What they have no effect on, `--curves` or "a stored run".
        allowed: Parameters that have one.
        why: What the others are about, and what to do.

    Raises:
        typer.BadParameter: others were given.
    """
    given = given_options(context, besides=allowed)
    if given:
        raise typer.BadParameter(f"Expected {what} without {', '.join(given)}, {why}.")


def given_options(context: typer.Context, *, besides: Collection[str] = ()) -> list[str]:
    """Return the options and arguments that the words of a command give, as they are written.

    Args:
        context: Of the command.
        besides: Parameters that are left out.
    """
    return [
        option.opts[0] if option.opts[0].startswith("-") else str(option.metavar)
        for option in context.command.params
        if option.name not in besides
        and (source := context.get_parameter_source(str(option.name))) is not None
        and source.name == "COMMANDLINE"
    ]
