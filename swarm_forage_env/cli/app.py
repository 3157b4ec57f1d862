"""The application: its commands, its own options, and how it ends.

A command has a file of its own and imports what it needs when it runs, so that `--help` answers at once.
"""

import sys
import warnings
from typing import Annotated, Any

import typer

from swarm_forage_env.cli.ablate import ablate
from swarm_forage_env.cli.availability import availability
from swarm_forage_env.cli.choose import choose
from swarm_forage_env.cli.compare import compare
from swarm_forage_env.cli.curves import curves
from swarm_forage_env.cli.maps import maps
from swarm_forage_env.cli.options import EXIT_FAILURE, EXIT_INTERRUPTED, EXIT_TERMINATED, EXIT_USAGE, complain
from swarm_forage_env.cli.predict import predict
from swarm_forage_env.cli.record import record
from swarm_forage_env.cli.replay import replay
from swarm_forage_env.cli.rerun import rerun
from swarm_forage_env.cli.run import run
from swarm_forage_env.cli.saliency import saliency
from swarm_forage_env.cli.score import score
from swarm_forage_env.cli.show import info, list_everything, schema
from swarm_forage_env.cli.stuck import stuck
from swarm_forage_env.cli.study import study
from swarm_forage_env.cli.train import train
from swarm_forage_env.cli.watch import watch

_USAGE_ERROR: type[Exception] = typer.BadParameter.__bases__[0]
"""Base of typer's complaints about arguments; typer gives it no public name."""

app = typer.Typer(
    help="Swarm foraging: run, film, train and score policies, inspect scenarios.",
    add_completion=False,
    invoke_without_command=True,
    rich_markup_mode=None,
    pretty_exceptions_enable=False,
)


@app.callback()
def _options(
    context: typer.Context,
    version: Annotated[bool, typer.Option("--version", help="Print the version and exit.")] = False,
) -> None:
    if version:
        from importlib.metadata import version as installed_version

        typer.echo(f"swarm-forage {installed_version('swarm-forage-env')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


# `--help` lists them in this order.
for command in (run, score, compare, predict, choose, train, curves):
    app.command()(command)
app.add_typer(study, name="study")
app.command("list")(list_everything)
for command in (info, schema, rerun, watch, record, replay, maps, saliency, stuck, ablate, availability):
    app.command()(command)


_show_in_full = warnings.showwarning


def _show_warning(message: Warning | str, category: type[Warning], *rest: Any) -> None:
    """Print a warning that is meant for users as one line; those for programmers as Python does."""
    if category.__module__.partition(".")[0] == __name__.partition(".")[0]:
        complain(str(message), 0)
    else:
        _show_in_full(message, category, *rest)


def main() -> None:
    """Run the command line and exit; an error of the user is one line on stderr."""
    from swarm_forage_env.cli.interrupts import terminated_as_interrupted

    with terminated_as_interrupted() as came:
        code = _outcome()
    if came and code == EXIT_INTERRUPTED:
        code = EXIT_TERMINATED
    sys.exit(code)


def _outcome() -> int | None:
    """Carry out the command and return its exit code."""
    from swarm_forage_env._internal.fields import ConfigError
    from swarm_forage_env.study.record import RecordError
    from swarm_forage_env.study.runner import WorkerError

    try:
        with warnings.catch_warnings():
            warnings.showwarning = _show_warning
            return app(standalone_mode=False)
    except _USAGE_ERROR as error:
        return complain(error.format_message(), EXIT_USAGE)  # type: ignore[attr-defined] - see _USAGE_ERROR
    except (ConfigError, RecordError) as error:
        return complain(str(error), EXIT_USAGE)
    except OSError as error:
        named = f"{error.strerror}: {error.filename}" if error.strerror and error.filename else str(error)
        return complain(named, EXIT_FAILURE)
    except (ImportError, WorkerError) as error:
        return complain(str(error), EXIT_FAILURE)
    except MemoryError as error:
        return complain(f"Memory ran out: {error or 'no more could be had'}.", EXIT_FAILURE)
    except (KeyboardInterrupt, typer.Abort):
        return complain("interrupted", EXIT_INTERRUPTED)
