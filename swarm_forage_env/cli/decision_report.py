"""How `predict` and `choose` carry out their plans, and what they print: a table, JSON, a picture."""

import json
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import TypeVar

import typer

from metrics.scoring.choosing import choice_question
from metrics.scoring.prediction import (
    PredictionTable,
    counted_inside,
    predict_curves,
    prediction_question,
)
from metrics.scoring.prediction_plots import draw_predictions
from metrics.scoring.question import ask
from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.cli.errors import resumable
from swarm_forage_env.cli.options import EXIT_FAILURE, complain, no_picture
from swarm_forage_env.cli.score_report import plan_json, plan_text
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.store import RunStore
from swarm_forage_env.runs.workers import available_cores
from swarm_forage_env.wrappers.world import World

_PICTURE = "prediction.png"
_Result = TypeVar("_Result")


@dataclass(frozen=True, kw_only=True, slots=True)
class Demands:
    """The constraints of a choice; see `metrics.choose_policy`."""

    deliver: float
    keep: float
    failures: float | None
    deaths: float | None
    noise: float | None


def predict_runs(
    policies: Sequence[str],
    world: World,
    caches: str | None,
    sizes: tuple[Sequence[int] | None, Sequence[int]],
    seeds: int,
    folder: Path,
    picture: Path | None,
    jobs: int | None,
    *,
    as_json: bool,
    dry_run: bool,
) -> None:
    """Run policies in swarms of the given sizes, predict, print and draw; with `dry_run`, only show the plan.

    Raises:
        ConfigError: whatever is wrong with the words.
        typer.Exit: Ctrl-C, or runs have failed.
    """
    fit, hold = sizes
    try:
        question = prediction_question(policies, world, fit=fit, hold=hold, seeds=seeds, caches=caches)
    except ValueError as error:  # of a policy or a size
        raise ConfigError(str(error)) from error
    if dry_run:
        _show_plan(question.plan, question.world.scenario.name, folder, jobs, as_json=as_json)
        return
    tables = _carried_out(lambda: ask(question, out=folder, jobs=jobs), folder)
    _show_predictions(tables, picture or folder / _PICTURE, as_json=as_json)
    if any(table.failures for table in tables):
        raise typer.Exit(EXIT_FAILURE)


def predict_file(
    path: Path,
    fit: Sequence[int] | None,
    hold: Sequence[int],
    performance: str | None,
    picture: Path | None,
    *,
    as_json: bool,
) -> None:
    """Predict from a file of curves and print; draw only where a picture is asked for.

    Raises:
        ConfigError: whatever is wrong with the file or the sizes.
    """
    try:
        tables = predict_curves(path, fit=fit, hold=hold, performance=performance)
    except ValueError as error:
        raise ConfigError(str(error)) from error
    _show_predictions(tables, picture, as_json=as_json)


def choose_runs(
    policies: Sequence[str],
    world: World,
    caches: str | None,
    demands: Demands,
    seeds: int,
    folder: Path,
    jobs: int | None,
    *,
    as_json: bool,
    dry_run: bool,
) -> None:
    """Run policies under every constraint and print the ranking; with `dry_run`, only show the plan.

    Raises:
        ConfigError: whatever is wrong with the words.
        typer.Exit: Ctrl-C, or runs have failed.
    """
    try:
        question = choice_question(policies, world, seeds=seeds, caches=caches, **asdict(demands))
    except ValueError as error:  # of a policy or a demand
        raise ConfigError(str(error)) from error
    if dry_run:
        _show_plan(question.plan, world.scenario.name, folder, jobs, as_json=as_json)
        return
    choice = _carried_out(lambda: ask(question, out=folder, jobs=jobs), folder)
    typer.echo(json.dumps(choice.to_mapping(), indent=1) if as_json else str(choice))
    if any(candidate.failures for candidate in choice.candidates):
        raise typer.Exit(EXIT_FAILURE)


def _show_plan(plan: Plan, scenario: str, folder: Path, jobs: int | None, *, as_json: bool) -> None:
    store, processes = RunStore(folder), jobs or available_cores()
    if as_json:
        typer.echo(plan_json(plan, ("raw_performance",), store, processes))
    else:
        typer.echo(plan_text(plan, scenario, "", store, processes))


def _carried_out(run: Callable[[], _Result], folder: Path) -> _Result:
    """Call `run`; Ctrl-C, and results that failed runs leave too few for, end the command with one line."""
    from metrics.checks import CurveError

    try:
        with resumable(folder):
            return run()
    except CurveError as error:
        complain(str(error), EXIT_FAILURE)
        raise typer.Exit(EXIT_FAILURE) from None


def _show_predictions(tables: Sequence[PredictionTable], picture: Path | None, *, as_json: bool) -> None:
    if picture is not None:
        try:
            draw_predictions(tables, picture)
        except ImportError as error:
            picture = None
            typer.echo(error, err=True)
        except OSError as error:  # the predictions are worth more than their picture
            typer.echo(no_picture(picture, error), err=True)
            picture = None
    if as_json:
        document = {
            "tables": [table.to_mapping() for table in tables],
            "picture": None if picture is None else str(picture),
        }
        typer.echo(json.dumps(document, indent=1))
    else:
        parts = [*map(str, tables), *filter(None, [counted_inside(tables)])]
        typer.echo("\n\n".join(parts))
    if picture is not None:
        typer.echo(f"picture {picture}", err=True)
