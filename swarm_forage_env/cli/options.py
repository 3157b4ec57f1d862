"""What several commands share: options, exit codes, complaints. Light, so that `--help` answers at once."""

from pathlib import Path
from typing import Annotated

import typer

from swarm_forage_env._internal.wording import printable

EXIT_FAILURE = 1
EXIT_USAGE = 2
EXIT_UNFORESEEN = 70
"""What sysexits.h calls an internal software error."""

Policies = Annotated[
    tuple[str, ...],
    typer.Argument(
        metavar="POLICY",
        help="Policies, also separated by commas: names, files of trained ones, or classes in Python files "
        "(my_module.py:MyPolicy); docs/policies.md has more.",
    ),
]
NamedPolicies = Annotated[tuple[str, ...], typer.Option("--policy", metavar="POLICY", help="The same, as an option.")]
Scenario = Annotated[
    str,
    typer.Option(
        "--scenario",
        metavar="NAME|FILE.toml",
        help="A preset, see 'swarm-forage list'; or a file with fields and wrappers (docs/adversity.md).",
    ),
]
Robots = Annotated[int | None, typer.Option("--robots", min=1, help="Swarm size.")]
Objects = Annotated[int | None, typer.Option("--objects", min=1, help="Number of objects.")]
Side = Annotated[float | None, typer.Option("--side", help="Side of the arena in m (search_and_rescue only).")]
Density = Annotated[
    str | None,
    typer.Option("--density", help="Robots per m2, e.g. 5% or 0.05; the arena is as large as the swarm needs."),
]
Caches = Annotated[
    str | None,
    typer.Option("--caches", help="none, static or dynamic; default: those of the policy, else of the scenario."),
]
Performance = Annotated[
    str | None,
    typer.Option(
        "--performance",
        metavar="COLUMN",
        help="What performance is: a recorded column (see 'swarm-forage list columns'), 1/COLUMN where less is better, "
        "task_balance or cache_load; default the scenario's. Stored runs are read again, not repeated.",
    ),
]
Horizon = Annotated[
    float | None, typer.Option("--horizon", help="Simulated seconds per run, whole intervals of 200 s.")
]
FirstSeed = Annotated[int, typer.Option("--first-seed", min=0, help="Seed of the first run.")]
Seed = Annotated[int, typer.Option("--seed", min=0, help="Seed of the run.")]
Settings = Annotated[
    tuple[str, ...], typer.Option("--set", metavar="KEY=VALUE", help="Any scenario field; may be repeated.")
]
Wrappers = Annotated[
    tuple[str, ...],
    typer.Option(
        "--wrapper",
        metavar="NAME:KEY=VALUE,...",
        help="Disturb the swarm, e.g. sensor_noise:sigma=0.03 or population:death_per_tick=0.0001; may be repeated.",
    ),
]
Measures = Annotated[str | None, typer.Option("--measures", help="Names separated by commas; default all.")]
Disturbance = Annotated[
    str,
    typer.Option("--disturbance", help="What reactivity and adaptability are scored under: throttle or handling_cost."),
]
Variants = Annotated[
    str,
    typer.Option("--variant", help="corrected, paper (as printed), sierra (authors' program); separated by commas."),
]
Forms = Annotated[
    str,
    typer.Option(
        "--form", help="marginal (against the next smaller swarm), interactive (against N lone robots), or both."
    ),
]
Band = Annotated[
    bool, typer.Option("--band", help="Show the paper's bands, mean ± 2 standard deviations of single runs.")
]
Budget = Annotated[str, typer.Option("--budget", help="quick, standard or paper: how long, how many runs and levels.")]
ScoreSeeds = Annotated[int | None, typer.Option("--seeds", min=1, help="Runs per experiment; default the budget's.")]
Curves = Annotated[
    Path | None,
    typer.Option(
        "--curves", metavar="FILE", help="Read curves from CSV or Parquet, and run nothing (docs/scoring.md)."
    ),
]
OF_RUNS = "which are about runs; leave them out"
"""What is said of other options than those of curves."""
Picture = Annotated[
    Path | None,
    typer.Option(
        "--picture", metavar="FILE", help="Picture to draw, .png, .svg or .pdf; default in the folder of results."
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
    typer.Option("--jobs", min=1, help="Processes; default one per core that it may use; 1 = in this process."),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print the results as JSON.")]
DryRun = Annotated[bool, typer.Option("--dry-run", help="Print the plan and an estimate, run nothing.")]


def no_picture(path: Path, error: OSError) -> str:
    """Return what is said of a picture that cannot be written, beside results that are there."""
    return f"No picture {path}: {error.strerror or error}."


def complain(message: str, code: int) -> int:
    """Print one line on stderr; returns `code`."""
    typer.echo("swarm-forage: " + printable(" ".join(message.split())), err=True)
    return code
