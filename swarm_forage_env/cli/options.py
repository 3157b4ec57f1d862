"""Arguments and options that several commands share; light, so that help is quick.

A parameter of a command is an option, or a class of options that describe one thing: the command line shows
`--scenario`, `--robots` and the rest where `world: WorldOptions` stands, and the function gets them as one object.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter, Token
from cyclopts.types import NonNegativeInt, PositiveInt
from cyclopts.validators import Number

from swarm_forage_env._internal.fields import MOST_SEEDS, ConfigError
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle


def _names(_: Any, tokens: Sequence[Token]) -> tuple[str, ...]:
    """Return the names in words, each once."""
    from swarm_forage_env.cli.worlds import split_names

    return tuple(dict.fromkeys(name for token in tokens for name in split_names(token.value)))


Names = Annotated[tuple[str, ...], Parameter(converter=_names)]
"""Names separated by commas."""
Policies = Annotated[
    Names,
    Parameter(
        name="POLICIES",
        help="Names, files of trained policies, or classes in Python files (my_module.py:MyPolicy), separated by "
        "spaces or commas (docs/policies.md).",
    ),
]
Policy = Annotated[str, Parameter(help="Name, file of a trained policy, or class in a Python file.")]
Scenario = Annotated[
    str, Parameter(help="A preset (see 'swarm-forage list'), or a .toml file with fields and wrappers.")
]
Seeds = Annotated[
    int, Parameter(help="Runs of each policy, with seeds one after the other.", validator=Number(gte=1, lte=MOST_SEEDS))
]
Seed = Annotated[NonNegativeInt, Parameter(help="Seed of the run; of several runs the first one.")]
Jobs = Annotated[
    PositiveInt | None, Parameter(help="Number of processes; default one per usable core; 1 = only this process.")
]
Picture = Annotated[Path | None, Parameter(help="Picture to draw: .png, .svg or .pdf; default beside the results.")]
AnswerFile = Annotated[
    Path | None, Parameter(name="--file", help="Also write the answer to a file: .txt, .md, .tex, .csv or .json.")
]
AsJson = Annotated[bool, Parameter(name="--json", help="Print the results as JSON.")]
DryRun = Annotated[bool, Parameter(help="Say how many runs there are, how many are stored, and how large the rest is.")]


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True, slots=True)
class WorldOptions:
    """Options that describe a world; None = the scenario's own value."""

    scenario: Scenario = "warehouse_small"
    robots: Annotated[PositiveInt | None, Parameter(help="Number of robots; default the scenario's.")] = None
    horizon: Annotated[float | None, Parameter(help="Simulated seconds per run, a multiple of 200.")] = None
    settings: Annotated[
        tuple[str, ...],
        Parameter(
            name="--set",
            help="KEY=VALUE: set any field of the scenario, such as n_objects=100, density=0.05 (robots per m2: the "
            "arena becomes as large as the swarm needs) or performance=cache_pickups (see 'swarm-forage list "
            "columns'); may be repeated.",
        ),
    ] = ()
    wrappers: Annotated[
        tuple[str, ...],
        Parameter(
            name="--wrapper",
            help="NAME:KEY=VALUE,...: disturb the swarm, e.g. sensor_noise:sigma=0.03 or "
            "population:death_per_tick=0.0001; may be repeated.",
        ),
    ] = ()


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class StyleOptions:
    """How figures look."""

    width_in: Annotated[float | None, Parameter(help="Width in inches; default what the panels want.")] = None
    title: Annotated[
        bool, Parameter(negative="--no-title", help="Whether there is a headline; in a paper, the caption says it.")
    ] = True

    def style(self) -> FigureStyle:
        """Return the style; raises ConfigError for a width that no page has."""
        return replace(SCREEN, width_in=self.width_in, title=self.title)


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class RunOptions(StyleOptions):
    """How the runs of a question are made, and in which form its answer is shown."""

    out: Annotated[Path | None, Parameter(help="Folder for records; default results/SCENARIO.")] = None
    jobs: Jobs = None
    dry_run: DryRun = False
    as_json: AsJson = False
    file: AnswerFile = None
    picture: Picture = None


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True, slots=True)
class CurveOptions:
    """Curves of other simulators or of real robots, beside those of policies (docs/scoring.md)."""

    curves: Annotated[
        Path | None, Parameter(help="Score the curves of a .csv or .parquet file; policies run as long as these.")
    ] = None
    columns: Annotated[
        str, Parameter(help="OURS=THEIRS,...: names of columns in the file, or 1/COLUMN, or a number for all rows.")
    ] = ""
    events: Annotated[bool, Parameter(negative="", help="A row of the file is a delivery with its time_s.")] = False
    interval: Annotated[float | None, Parameter(help="Length of an interval, s; needed for --events.")] = None

    def named_columns(self) -> dict[str, str]:
        """Return our name of a column -> theirs.

        Raises:
            ConfigError: a word without a name on each side.
        """
        words = [word.partition("=") for word in self.columns.split(",")] if self.columns else []
        for ours, _, theirs in words:
            if not (ours.strip() and theirs.strip()):
                raise ConfigError(f"Expected --columns OURS=THEIRS,..., got {self.columns!r}.")
        return {ours.strip(): theirs.strip() for ours, _, theirs in words}
