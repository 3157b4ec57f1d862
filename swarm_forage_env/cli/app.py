"""The application: its commands, its own options, and how it ends.

A command has a file of its own and imports what it needs when it runs, so that `--help` answers at once.
"""

import logging
import signal
import sys
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cache
from typing import Annotated, Any

import typer

from swarm_forage_env.cli.ablate import ablate
from swarm_forage_env.cli.availability import availability
from swarm_forage_env.cli.benchmark import benchmark
from swarm_forage_env.cli.check import check
from swarm_forage_env.cli.choose import choose
from swarm_forage_env.cli.curves import curves
from swarm_forage_env.cli.dataset import dataset
from swarm_forage_env.cli.ending import end
from swarm_forage_env.cli.maps import maps
from swarm_forage_env.cli.options import EXIT_INTERRUPTED, EXIT_TERMINATED, complain
from swarm_forage_env.cli.predict import predict
from swarm_forage_env.cli.record import record
from swarm_forage_env.cli.replay import replay
from swarm_forage_env.cli.rerun import rerun
from swarm_forage_env.cli.run import run
from swarm_forage_env.cli.saliency import saliency
from swarm_forage_env.cli.score import score
from swarm_forage_env.cli.show import info, list_everything
from swarm_forage_env.cli.study import study
from swarm_forage_env.cli.terminal import show_any_text
from swarm_forage_env.cli.train import train
from swarm_forage_env.cli.trusting import trust_of
from swarm_forage_env.cli.watch import watch

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
    trust_models: Annotated[
        bool,
        typer.Option(
            "--trust-models",
            help="Also open models (.zip) and Python (.py) that files name: this runs code in them (SECURITY.md).",
        ),
    ] = False,
) -> None:
    if trust_models:
        from swarm_forage_env.policies.trust import trusting

        context.with_resource(trusting())
    if version:
        from importlib.metadata import version as installed_version

        typer.echo(f"swarm-forage {installed_version('swarm-forage-env')}")
        raise typer.Exit
    if context.invoked_subcommand is None:
        typer.echo(context.get_help())


# `--help` lists them in this order.
for command in (run, score):
    app.command()(command)
app.command("compare")(score)
for command in (predict, choose, train, curves, dataset):
    app.command()(command)
app.add_typer(study, name="study")
app.add_typer(benchmark, name="benchmark")
app.command("list")(list_everything)
for command in (info, rerun, watch, record, replay, maps, saliency, check, ablate, availability):
    app.command()(command)


_show_in_full = warnings.showwarning


def _show_warning(message: Warning | str, category: type[Warning], *rest: Any) -> None:
    """Print a warning that is meant for users as one line; those for programmers as Python does."""
    if category.__module__.partition(".")[0] == __name__.partition(".")[0]:
        complain(str(message), 0)
    else:
        _show_in_full(message, category, *rest)


@contextmanager
def _news_shown() -> Iterator[None]:
    """Have the package print on stderr what is no warning, such as that it compiles; Python leaves that out."""
    tellers = [logging.getLogger(__name__.partition(".")[0]), *([logging.lastResort] if logging.lastResort else [])]
    levels = [teller.level for teller in tellers]
    for teller in tellers:
        teller.setLevel(logging.INFO)
    try:
        yield
    finally:
        for teller, level in zip(tellers, levels, strict=True):
            teller.setLevel(level)


def main() -> None:
    """Run the command line and exit; an error is one line on stderr, and `ending` says which exit code it has."""
    from swarm_forage_env.cli.interrupts import heard

    show_any_text()
    with heard() as came, _news_shown():
        code = _outcome(came)
    if signal.SIGTERM in came and code == EXIT_INTERRUPTED:
        code = EXIT_TERMINATED
    sys.exit(code)


def _outcome(came: Sequence[int]) -> int | str | None:
    """Carry out the command and return its exit code; `came` has the interrupts so far, see `heard`."""
    try:
        _refuse_unreadable(sys.argv[1:])
        with trust_of(sys.argv[1:]), warnings.catch_warnings():
            warnings.showwarning = _show_warning
            return _carry_out(sys.argv[1:])
    except SystemExit as ending:
        return ending.code
    except BaseException as error:  # noqa: BLE001 - the last guard: whatever happens ends in one line
        return end(KeyboardInterrupt() if came else error)


def _carry_out(words: list[str]) -> int | None:
    """Carry out the command that words name; returns its exit code.

    Not by `app(...)`: typer turns Ctrl-C into an exit code there, and nobody would say what is kept.
    """
    command = _command()
    try:
        with command.make_context("swarm-forage", words) as context:
            return command.invoke(context)
    except typer.Exit as ending:
        return ending.exit_code


@cache
def _command() -> Any:
    """Return all commands with their options; to make them takes longer than many a command."""
    return typer.main.get_command(app)


def _refuse_unreadable(words: Sequence[str]) -> None:
    """Refuse words that are no text: records, pages and pictures could not hold such a name."""
    for word in words:
        try:
            word.encode("utf-8")
        except UnicodeEncodeError as error:
            raise typer.BadParameter(
                f"Expected words in UTF-8, got {word!r}; rename the file, or check the locale of the terminal."
            ) from error
