"""What several commands share: options, alone and in groups, exit codes, complaints; light, so that help is quick.

    def record(policies: PolicyOptions, described: WorldOptions, speedup: ...) -> None:

A parameter of a command is an option, or a class of options that describe one thing. The command line shows
`--scenario`, `--robots` and the rest where `described` stands, and the function gets them as one object.
"""

import functools
import inspect
from collections.abc import Callable, Collection
from dataclasses import Field, dataclass, fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_origin

import typer

from swarm_forage_env._internal.wording import printable

if TYPE_CHECKING:
    from swarm_forage_env.rendering.figures import FigureStyle

EXIT_FAILURE = 1
EXIT_USAGE = 2
EXIT_UNFORESEEN = 70
"""What sysexits.h calls an internal software error."""

Policies = Annotated[
    tuple[str, ...],
    typer.Argument(
        metavar="POLICY",
        help="One or more policies: names, files of trained policies, or classes in Python files "
        "(my_module.py:MyPolicy). Separate them by spaces or commas (docs/policies.md).",
    ),
]
NamedPolicies = Annotated[
    tuple[str, ...], typer.Option("--policy", metavar="POLICY", help="The same as POLICY, as an option.")
]
Scenario = Annotated[
    str,
    typer.Option(
        "--scenario",
        metavar="NAME|FILE.toml",
        help="A preset (see 'swarm-forage list'), or a file with fields and wrappers (docs/adversity.md).",
    ),
]
Robots = Annotated[int | None, typer.Option("--robots", min=1, help="Number of robots.")]
Objects = Annotated[int | None, typer.Option("--objects", min=1, help="Number of objects.")]
Density = Annotated[
    str | None,
    typer.Option("--density", help="Robots per m2, e.g. 0.05 or 5%. The arena becomes as large as the swarm needs."),
]
Performance = Annotated[
    str | None,
    typer.Option(
        "--performance",
        metavar="COLUMN",
        help="What counts as performance: a recorded column (see 'swarm-forage list columns'), 1/COLUMN if less is "
        "better, task_balance or cache_load; default the scenario's. Stored runs are read again, not repeated.",
    ),
]
Horizon = Annotated[float | None, typer.Option("--horizon", help="Simulated seconds per run, a multiple of 200.")]
FirstSeed = Annotated[int, typer.Option("--first-seed", min=0, help="Seed of the first run.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the run.")]
Settings = Annotated[
    tuple[str, ...], typer.Option("--set", metavar="KEY=VALUE", help="Set any field of the scenario; may be repeated.")
]
Wrappers = Annotated[
    tuple[str, ...],
    typer.Option(
        "--wrapper",
        metavar="NAME:KEY=VALUE,...",
        help="Disturb the swarm, e.g. sensor_noise:sigma=0.03 or population:death_per_tick=0.0001; may be repeated.",
    ),
]
Measures = Annotated[
    str | None, typer.Option("--measures", help="Names of measures, separated by commas; default all.")
]
Disturbance = Annotated[
    str,
    typer.Option("--disturbance", help="Disturbance for reactivity and adaptability: throttle or handling_cost."),
]
Variants = Annotated[
    str,
    typer.Option(
        "--variant",
        help="Forms of equations: corrected, paper (as printed); separated by commas.",
    ),
]
Forms = Annotated[
    str,
    typer.Option(
        "--form", help="Compare with the next smaller swarm (marginal), with N lone robots (interactive), or both."
    ),
]
Band = Annotated[
    bool, typer.Option("--band", help="Show the paper's bands, mean ± 2 standard deviations of single runs.")
]
Budget = Annotated[
    str, typer.Option("--budget", help="quick, standard or paper: sets the length and number of runs, and the levels.")
]
ScoreSeeds = Annotated[
    int | None, typer.Option("--seeds", min=1, help="Runs per experiment; default the budget's number.")
]
Curves = Annotated[
    Path | None,
    typer.Option("--curves", metavar="FILE", help="Read curves from a CSV or Parquet file; no runs (docs/scoring.md)."),
]
OF_RUNS = "which are about runs; leave them out"
"""What is said of other options than those of curves."""
Picture = Annotated[
    Path | None,
    typer.Option(
        "--picture", metavar="FILE", help="Picture to draw: .png, .svg or .pdf; default in the folder of results."
    ),
]


def _a_folder(path: Path | None) -> Path | None:
    """Refuse names of files, which other options take."""
    if path is not None and path.suffix in _FILES:
        raise typer.BadParameter(f"Expected --out as a folder, got {path}; --file and --picture take files.")
    return path


_FILES = (".csv", ".gif", ".html", ".json", ".mp4", ".parquet", ".pdf", ".png", ".svg")
"""Endings of files that commands write."""
Out = Annotated[
    Path | None,
    typer.Option("--out", metavar="FOLDER", callback=_a_folder, help="Folder for records; default results/SCENARIO."),
]
Jobs = Annotated[
    int | None,
    typer.Option("--jobs", min=1, help="Number of processes; default one per usable core; 1 = only this process."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the results as JSON.")]
DryRun = Annotated[
    bool,
    typer.Option(
        "--dry-run",
        help="Say how many runs there are, how many of them are stored, and how large the rest is; no runs.",
    ),
]


def no_picture(path: Path, error: OSError) -> str:
    """Return what is said of a picture that cannot be written, beside results that are there."""
    return f"No picture {path}: {error.strerror or error}."


def complain(message: str, code: int) -> int:
    """Print one line on stderr; returns `code`."""
    typer.echo("swarm-forage: " + printable(" ".join(message.split())), err=True)
    return code


@dataclass(frozen=True, kw_only=True, slots=True)
class PlaceOptions:
    """Options that describe a world, but for the size of its swarm; None = the scenario's own value."""

    scenario: Scenario = "warehouse_small"
    """Name of a preset, or a file."""
    objects: Objects = None
    horizon: Horizon = None
    performance: Performance = None
    settings: Settings = ()
    """Words of the form key=value."""
    wrappers: Wrappers = ()
    """Words of the form name:key=value,key=value."""


@dataclass(frozen=True, kw_only=True, slots=True)
class WorldOptions(PlaceOptions):
    """Options that describe a world."""

    robots: Robots = None
    density: Density = None
    """A share, "0.05" or "5%"."""


@dataclass(frozen=True, kw_only=True, slots=True)
class PolicyOptions:
    """Which policies, in one of two ways."""

    policies: Policies = ()
    named_policies: NamedPolicies = ()

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

    out: Out = None
    jobs: Jobs = None
    as_json: AsJson = False
    dry_run: DryRun = False


@dataclass(frozen=True, kw_only=True, slots=True)
class StyleOptions:
    """How figures look."""

    width: Annotated[
        float | None,
        typer.Option("--width", min=2.0, max=100.0, help="Of a figure, in inches; default what its panels need."),
    ] = None
    font_size: Annotated[float, typer.Option("--font-size", min=4.0, max=40.0, help="Of words, in points.")] = 9.0
    title: Annotated[bool, typer.Option("--title/--no-title", help="Headlines; in a paper, captions say it.")] = True

    def style(self) -> "FigureStyle":
        """Return the style that they describe."""
        from swarm_forage_env.rendering.figures import FigureStyle

        return FigureStyle(width_in=self.width, font_size=self.font_size, title=self.title)


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
