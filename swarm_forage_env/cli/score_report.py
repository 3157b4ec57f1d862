"""How `score` carries out a plan, and what they print: tables, JSON, a picture."""

import json
from collections import Counter
from collections.abc import Sequence
from pathlib import Path

import typer

from metrics.scoring import ScoreQuestion, ask
from metrics.scoring.comparison import Comparison, compare_tables
from metrics.scoring.plots import draw_scores
from metrics.scoring.table import ScoreTable
from swarm_forage_env._internal.wording import aligned, counted
from swarm_forage_env.cli.errors import resumable
from swarm_forage_env.cli.options import EXIT_FAILURE, no_picture
from swarm_forage_env.cli.report import estimate, estimated_seconds
from swarm_forage_env.runs.plan import Plan
from swarm_forage_env.runs.store import RunStore
from swarm_forage_env.runs.workers import available_cores


def run_and_show(
    question: ScoreQuestion,
    folder: Path,
    picture: Path,
    jobs: int | None,
    *,
    as_json: bool,
    dry_run: bool,
    band: bool = False,
) -> None:
    """Run a plan and show the scores; with `dry_run`, only show the plan.

    Args:
        question: What is asked.
        folder: Where the records go.
        picture: File of the picture.
        jobs: Processes; None = one per core.
        as_json: Print JSON instead of tables.
        dry_run: Run nothing.
        band: Show mean ± 2 standard deviations of single runs beside the intervals.

    Raises:
        typer.Exit: Ctrl-C, or runs have failed.
    """
    remark = _missing_kinds(question.plan)
    if remark:
        typer.echo(remark, err=True)
    if dry_run:
        store, processes = RunStore(folder), jobs or available_cores()
        if as_json:
            typer.echo(plan_json(question.plan, question.measures, store, processes))
        else:
            name = question.world.scenario.name
            typer.echo(plan_text(question.plan, name, f"budget {question.budget}, ", store, processes))
        return
    with resumable(folder):
        tables = ask(question, out=folder, jobs=jobs)
    show_scores(tables, picture, as_json=as_json, band=band)
    if any(table.failures for table in tables):
        raise typer.Exit(EXIT_FAILURE)


def _missing_kinds(plan: Plan) -> str:
    """Say which swarms are too small for some kind of robots; empty where all have all kinds."""
    swarms = {spec.scenario.robots.n_robots: spec.scenario.robots for spec in plan.specs}
    missing: dict[str, list[int]] = {}
    for size, robots in sorted(swarms.items()):
        for kind, rows in zip(robots.robot_kinds, robots.kind_rows, strict=True):
            if rows.start == rows.stop:
                missing.setdefault(kind.name, []).append(size)
    if not missing:
        return ""
    told = "; ".join(f"no {name} with {', '.join(map(str, sizes))} robots" for name, sizes in missing.items())
    return (
        f"Kinds are shares of a swarm, and small swarms lack some: {told}. Measures over the size of the swarm compare "
        "other mixtures there."
    )


def show_scores(tables: Sequence[ScoreTable], picture: Path | None, *, as_json: bool, band: bool = False) -> None:
    """Show the scores of one policy, or compare those of several; draw them into `picture` unless it is None.

    `band` is as in `run_and_show`; the JSON document has the bands in any case.
    """
    comparison = compare_tables(tables) if len(tables) > 1 else None
    drawn = None
    if picture is not None:
        try:
            drawn = _draw(tables, picture, band=band)
        except ImportError as error:
            typer.echo(error, err=True)
        except OSError as error:  # the scores are worth more than their picture
            typer.echo(no_picture(picture, error), err=True)
    if as_json:
        typer.echo(_json_text(tables, comparison, drawn))
    else:
        typer.echo((tables[0] if comparison is None else comparison).text(band=band))
    if drawn is not None:
        typer.echo(f"picture {drawn}", err=True)


def plan_text(plan: Plan, scenario: str, budget: str, store: RunStore, jobs: int) -> str:
    """Return the planned worlds as a table with an estimate.

    Args:
        plan: The runs.
        scenario: Name of the scenario, for the first line.
        budget: Name of the budget as it stands there, empty for none.
        store: Where records go.
        jobs: Processes.
    """
    todo = [spec for spec in plan.specs if spec.run_id not in store]
    left = Counter((spec.world.criterion, spec.world.value, spec.world.n_robots) for spec in todo)
    rows: list[Sequence[str]] = [("varied", "value", "robots", "objects", "seconds", "runs", "to do")]
    for condition in plan.of_policy(plan.policies[0].label):
        world = condition.world
        rows.append(
            (
                world.criterion,
                f"{world.value:g}",
                str(world.n_robots),
                str(world.scenario.objects.n_objects),
                f"{world.scenario.horizon_s:g}",
                str(len(plan.seeds) * len(plan.policies)),
                str(left[world.criterion, world.value, world.n_robots]),
            )
        )
    seconds = estimated_seconds(todo, jobs)
    return "\n".join(
        [
            f"{', '.join(policy.label for policy in plan.policies)} in {scenario}, {budget}"
            f"{counted(len(plan.seeds), 'seed')}, records go to {store.folder}",
            *aligned(rows),
            f"{counted(len(plan.specs), 'run')}, {len(todo):,} to do" + estimate(seconds, jobs, any_left=bool(todo)),
        ]
    )


def plan_json(plan: Plan, measures: Sequence[str], store: RunStore, jobs: int) -> str:
    """Return the planned runs as a JSON document."""
    todo = [spec for spec in plan.specs if spec.run_id not in store]
    runs = [{"run_id": spec.run_id, "stored": spec.run_id in store, "spec": spec.to_mapping()} for spec in plan.specs]
    document = {
        "policies": [policy.label for policy in plan.policies],
        "measures": list(measures),
        "out": str(store.folder),
        "estimated_wall_s": estimated_seconds(todo, jobs),
        "runs": runs,
    }
    return json.dumps(document, indent=1)


def _json_text(tables: Sequence[ScoreTable], comparison: Comparison | None, picture: Path | None) -> str:
    """Return everything as a JSON document; numbers that do not exist are null."""
    document = {"tables": [table.to_mapping() for table in tables]} if comparison is None else comparison.to_mapping()
    return json.dumps({**document, "picture": None if picture is None else str(picture)}, indent=1)


def _draw(tables: Sequence[ScoreTable], path: Path, *, band: bool) -> Path | None:
    """Draw the tables; returns None if there is nothing to draw.

    Raises:
        ImportError: matplotlib is not installed.
    """
    if not any(score.per_seed for table in tables for score in table.scores):
        return None
    draw_scores(tables, path, band=band)
    return path
