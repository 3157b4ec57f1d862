"""The command `curves`."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from metrics import PAPER_POLICIES
from swarm_forage_env.cli.options import EXIT_FAILURE, Jobs, complain, no_picture
from swarm_forage_env.cli.terminal import output

if TYPE_CHECKING:
    from rich.table import Table

    from swarm_forage_env.training.evaluations import TrainingCurve
    from swarm_forage_env.training.plan import TrainingPlan

PICTURE_FILE = "curves.png"


def curves(
    folders: Annotated[list[Path], typer.Argument(metavar="DIR ...", help="Folders of trainings in one scenario.")],
    beside: Annotated[
        str, typer.Option("--beside", help="Policies to compare with, separated by commas; none for no others.")
    ] = ",".join(PAPER_POLICIES),
    out: Annotated[
        Path | None, typer.Option("--out", "-o", help=f"Picture; default {PICTURE_FILE} in the first folder.")
    ] = None,
    jobs: Jobs = None,
) -> None:
    """Draw how trainings went, beside the scripted controllers on the same axes.

    The others make the runs of the trainings' evaluations: same world, same seeds, the caches that they are made for.
    """
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.cli.scenario_options import split_names
    from swarm_forage_env.cli.training_report import counted_in, place_of, points_of, stage_ends
    from swarm_forage_env.rendering.figures import check_picture
    from swarm_forage_env.rendering.plots import draw_trainings

    found = _told_apart(folders)
    plan = found[0].plan
    for one in found[1:]:
        if _judged_by(one.plan) != _judged_by(plan):
            raise ConfigError(
                f"Expected trainings that are judged by the same runs, got {found[0].label} and {one.label}, whose "
                "plans differ in scenario, wrappers or evaluation; draw them one by one."
            )
    picture = out or folders[0] / PICTURE_FILE
    check_picture(picture)
    levels = _levels(found[0], () if beside == "none" else split_names(beside), jobs)
    output().print(_table(found, levels, counted_in(plan) if plan.evaluation.worlds else "per 1,000 s"))
    try:
        draw_trainings(
            picture,
            {one.label: points_of(one.evaluations) for one in found},
            beside=levels,
            stage_ends=stage_ends(plan) if len(found) == 1 else (),
            title=place_of(plan),
            ylabel=counted_in(plan),
        )
    except ImportError as error:
        raise typer.Exit(complain(str(error), EXIT_FAILURE)) from None
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
    return (
        plan.evaluation.chosen_by,
        *(f"{world.name} {world.baseline}" for world in plan.evaluation.worlds),
        *(spec.to_json() for spec in plan.judging_runs("policy")),
    )


def _levels(curve: "TrainingCurve", names: Sequence[str], jobs: int | None) -> dict[str, tuple[float, float]]:
    """Run other policies as in the evaluations; returns what each has in them, and its interference.

    That is performance per 1,000 s, and with several worlds what counts of the ratios to their baselines.
    """
    import numpy as np

    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.runs.runner import run_specs
    from swarm_forage_env.runs.spec import plan_run

    judged = curve.plan.judging_runs("policy")
    try:
        planned = {
            name: [plan_run(spec.scenario, name, wrappers=spec.wrappers, seed=spec.seed) for spec in judged]
            for name in names
        }
    except ValueError as error:  # an unknown policy, or a file that cannot be opened
        raise ConfigError(str(error)) from error
    result = run_specs([spec for specs in planned.values() for spec in specs], jobs=jobs, progress=bool(names))
    if result.failures:
        first = next(iter(result.failures.values()))
        raise ConfigError(f"Expected runs of {', '.join(names)} beside the training, got {first.error}")
    records = result.records
    rates = {
        name: [records[spec.run_id].rate_per_1000_s("performance") for spec in specs] for name, specs in planned.items()
    }
    interference = {
        name: [records[spec.run_id].interference_fraction.mean() for spec in specs] for name, specs in planned.items()
    }
    return {name: (_level(curve, rates[name]), float(np.mean(interference[name]))) for name in planned}


def _level(curve: "TrainingCurve", rates: Sequence[float]) -> float:
    """Return what counts of the performances in all runs of an evaluation, which are in the order of the worlds."""
    import numpy as np

    from swarm_forage_env.training.evaluation_worlds import CHOSEN_BY, ratio_to

    worlds = curve.evaluations[-1].worlds
    if not worlds:
        return float(np.mean(rates))
    plan = curve.plan.evaluation
    of_worlds = np.mean(np.reshape(rates, (len(worlds), plan.n_runs)), axis=1)
    runs = [plan.specs(world.scenario, world.wrappers, "policy") for world in plan.worlds]
    ratios = [
        ratio_to(world.baseline, float(rate), specs) for world, rate, specs in zip(worlds, of_worlds, runs, strict=True)
    ]
    return float(CHOSEN_BY[plan.chosen_by](ratios))


def _table(found: "Sequence[TrainingCurve]", levels: dict[str, tuple[float, float]], counted: str) -> "Table":
    """Return the best evaluation of each training, and the others; `counted` says what the numbers are."""
    from rich.table import Table

    digits = 2 if found[0].plan.evaluation.worlds else 1  # ratios are about 1
    table = Table()
    table.add_column("policy")
    for heading in ("decisions", counted, "interference"):
        table.add_column(heading, justify="right")
    for one in found:
        best = max(one.evaluations, key=lambda evaluation: evaluation.performance)
        table.add_row(
            f"{one.label}, at its best",
            f"{best.steps:,}",
            f"{best.performance:.{digits}f}",
            f"{best.interference_fraction:.3f}",
        )
    for name, (performance, interference) in levels.items():
        table.add_row(name, "", f"{performance:.{digits}f}", f"{interference:.3f}")
    return table
