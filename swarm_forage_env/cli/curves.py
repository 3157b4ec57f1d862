"""The command `curves`."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from swarm_forage_env.cli.options import EXIT_FAILURE, NO_PICTURE, Jobs, complain, no_picture
from swarm_forage_env.cli.terminal import output

if TYPE_CHECKING:
    from rich.table import Table

    from swarm_forage_env.training.evaluations import TrainingCurve
    from swarm_forage_env.training.plan import TrainingPlan

SCRIPTED = "crw,dpo,stochm,stochx"
PICTURE_FILE = "curves.png"


def curves(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR ...", help="Folders of trainings in one scenario.")],
    beside: Annotated[
        str, typer.Option("--beside", help="Policies to compare with, separated by commas; none for no others.")
    ] = SCRIPTED,
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help=f"Picture; default {PICTURE_FILE} in the first folder.")
    ] = None,
    jobs: Jobs = None,
) -> None:
    """Draw how trainings went, beside the scripted controllers on the same axes.

    The others make the runs of the trainings' evaluations: same world, same seeds, the caches that they are made for.
    """
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env._internal.files import check_file
    from swarm_forage_env.cli.scenario_options import split_names
    from swarm_forage_env.cli.training_report import points_of, stage_ends
    from swarm_forage_env.rendering.plots import draw_trainings
    from swarm_forage_env.scenarios.performance import quantity

    found = _told_apart(folders)
    plan = found[0].plan
    for one in found[1:]:
        if _judged_by(one.plan) != _judged_by(plan):
            raise ConfigError(
                f"Expected trainings that are judged by the same runs, got {found[0].label} and {one.label}, whose "
                "plans differ in scenario, wrappers or evaluation; draw them one by one."
            )
    picture = out or folders[0] / PICTURE_FILE
    check_file(picture)
    levels = _levels(plan, () if beside == "none" else split_names(beside), jobs)
    output().print(_table(found, levels))
    try:
        picture.parent.mkdir(parents=True, exist_ok=True)
        draw_trainings(
            picture,
            {one.label: points_of(one.evaluations) for one in found},
            beside=levels,
            stage_ends=stage_ends(plan) if len(found) == 1 else (),
            title=f"{plan.scenario.name}, {plan.scenario.robots.n_robots} robots",
            ylabel=f"{quantity(plan.scenario.performance).title} per 1,000 s",
        )
    except ImportError:
        raise typer.Exit(complain(NO_PICTURE, EXIT_FAILURE)) from None
    except OSError as error:  # the table was shown, but a picture was asked for
        raise typer.Exit(complain(no_picture(picture, error), EXIT_FAILURE)) from None
    typer.echo(f"wrote {picture}")


def _told_apart(folders: Sequence[Path]) -> "list[TrainingCurve]":
    """Read trainings; those whose folders have the same name are named by their paths.

    Raises:
        ConfigError: see `read_training`, or a folder is given twice.
    """
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.training.evaluations import read_training

    twice = [folder for folder, count in Counter(folder.resolve() for folder in folders).items() if count > 1]
    if twice:
        raise ConfigError(f"Expected each training once, got {twice[0]} twice.")
    found = [read_training(folder) for folder in folders]
    counts = Counter(one.label for one in found)
    return [
        replace(one, label=str(folder)) if counts[one.label] > 1 else one
        for folder, one in zip(folders, found, strict=True)
    ]


def _judged_by(plan: "TrainingPlan") -> tuple[str, ...]:
    """What decides the runs that a training is judged by."""
    return tuple(spec.to_json() for spec in plan.evaluation.specs(plan.scenario, plan.wrappers, "policy"))


def _levels(plan: "TrainingPlan", names: Sequence[str], jobs: int | None) -> dict[str, tuple[float, float]]:
    """Run other policies as in the evaluations; returns performance per 1,000 s and interference of each, means."""
    import numpy as np

    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.study.runner import run_all
    from swarm_forage_env.study.spec import plan_run

    judged = plan.evaluation.specs(plan.scenario, plan.wrappers, "policy")
    try:
        planned = {
            name: [plan_run(spec.scenario, name, wrappers=spec.wrappers, seed=spec.seed) for spec in judged]
            for name in names
        }
    except ValueError as error:  # an unknown policy, or a file that cannot be opened
        raise ConfigError(str(error)) from error
    result = run_all([spec for specs in planned.values() for spec in specs], jobs=jobs, progress=bool(names))
    if result.failures:
        raise ConfigError(f"Expected runs of {', '.join(names)} beside the training, got {result.failures[0].error}")
    records = {record.run_id: record for record in result.records}
    return {
        name: (
            float(np.mean([records[spec.run_id].rate_per_1000_s("performance") for spec in specs])),
            float(np.mean([records[spec.run_id].interference_fraction.mean() for spec in specs])),
        )
        for name, specs in planned.items()
    }


def _table(found: "Sequence[TrainingCurve]", levels: dict[str, tuple[float, float]]) -> "Table":
    """Return the best evaluation of each training, and the others."""
    from rich.table import Table

    table = Table()
    table.add_column("policy")
    for heading in ("decisions", "per 1,000 s", "interference"):
        table.add_column(heading, justify="right")
    for one in found:
        best = max(one.evaluations, key=lambda evaluation: evaluation.performance)
        table.add_row(
            f"{one.label}, at its best",
            f"{best.steps:,}",
            f"{best.performance:.1f}",
            f"{best.interference_fraction:.3f}",
        )
    for name, (performance, interference) in levels.items():
        table.add_row(name, "", f"{performance:.1f}", f"{interference:.3f}")
    return table
