"""How commands ask questions and show answers: text or JSON on stdout, a picture in a file, notes on stderr.

Names of policies, files and scenarios are shown as they are: no console reads markup such as [red] in them.
"""

import json
import shutil
import sys
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from swarm_forage_env._internal.wording import counted, printable
from swarm_forage_env.cli import CommandError
from swarm_forage_env.rendering.figures import SCREEN, FigureStyle

if TYPE_CHECKING:
    from swarm_forage_env.cli.options import RunOptions
    from swarm_forage_env.runs.plan import Plan, Table
    from swarm_forage_env.sheet import Answer
    from swarm_forage_env.wrappers.world import World


def say(text: object) -> None:
    """Print a result on stdout."""
    sys.stdout.write(f"{printable(str(text)).rstrip()}\n")


def note(text: object) -> None:
    """Print on stderr what is not the result."""
    sys.stderr.write(f"{printable(str(text))}\n")


def ask_and_show(
    plan: "Plan",
    answer: "Callable[[Table], Answer]",
    options: "RunOptions",
    world: "World",
    policies: Sequence[str],
    *,
    ending: str = ".png",
    seed: int = 0,
) -> int:
    """Make the runs of a plan and show the answer of their table, or only the plan; returns 1 if runs have failed.

    Folder and picture are named by `options`, else by the other arguments: see `cli.worlds.default_file`.

    Raises:
        ConfigError: a picture whose ending is none of figures.
        KeyboardInterrupt: Ctrl-C; its message says what is kept.
        CommandError: too many runs have failed for an answer.
    """
    from metrics.checks import CurveError
    from swarm_forage_env.cli.worlds import default_file, default_folder
    from swarm_forage_env.rendering.figures import picture_ending
    from swarm_forage_env.runs.plan import planned_line, run_plan
    from swarm_forage_env.sheet import check_form

    folder = options.out or default_folder(world)
    picture = options.picture or default_file(folder, world, policies, ending, seed=seed)
    if options.file is not None:
        check_form(options.file)
    picture_ending(picture)  # before the work; a place that cannot be written to is told of beside the answer
    if options.dry_run:
        specs = plan.specs
        planned = json.dumps([spec.to_mapping() for spec in specs], indent=1)
        say(planned if options.as_json else planned_line(specs, folder))
        return 0
    table = run_plan(plan, out=folder, jobs=options.jobs, progress=True)
    try:
        found = answer(table)
    except CurveError as error:
        if not table.failures:
            raise
        raise CommandError(str(error)) from None
    show(found, picture, as_json=options.as_json, file=options.file, style=options.style())
    _tell_of_records(table, folder)
    return int(bool(table.failures))


def show(
    answer: "Answer",
    picture: Path | None = None,
    *,
    as_json: bool = False,
    file: Path | None = None,
    style: FigureStyle = SCREEN,
) -> None:
    """Print an answer, draw it, and write it.

    Args:
        answer: What was found.
        picture: File for the picture; one that cannot be made is told of, because the answer is worth more.
        as_json: Print JSON; it names the picture.
        file: See `Answer.write`.
        style: Of the picture.
    """
    drawn = None if picture is None or not answer.has_picture else drawn_or_told(answer, picture, style)
    if as_json:
        told = {"picture": None if drawn is None else str(drawn)} if picture is not None or answer.has_picture else {}
        say(json.dumps({**answer.to_mapping(), **told}, indent=1))
    else:
        say(answer.text(width=width_of_terminal()))
    if drawn is not None:
        note(f"picture {drawn}")
    if file is not None:
        answer.write(file)
        note(f"written {file}")


def width_of_terminal() -> int | None:
    """Return how many characters a line on stdout may have; None for a file or a pipe, which get one line per row."""
    return shutil.get_terminal_size().columns if sys.stdout.isatty() else None


def drawn_or_told(answer: "Answer", picture: Path, style: FigureStyle = SCREEN) -> Path | None:
    """Draw an answer, which is worth more than its picture; where that fails, say why and return None."""
    try:
        answer.draw(picture, style=style)
    except ImportError as error:
        note(error)
    except OSError as error:
        note(f"No picture {picture}: {error.strerror or error}.")
    else:
        return picture
    return None


def _tell_of_records(table: "Table", folder: Path) -> None:
    """Say on stderr where the records are, and how a failed run is made again."""
    from swarm_forage_env.runs.store import failure_file

    if table.records:
        note(f"{counted(len(table.records), 'record')} in {folder}")
    for run_id in list(table.failures)[:1]:
        note(f"again, alone: swarm-forage rerun {failure_file(folder, run_id)}")
