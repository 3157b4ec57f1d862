"""From the words of a command line to its function: the command that they name is imported, and no other."""

import io
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager, nullcontext
from functools import cache
from importlib import import_module
from itertools import takewhile
from typing import Any

from swarm_forage_env._internal.faults import PACKAGES
from swarm_forage_env.cli.commands import COMMANDS, Command

_OPTIONS = {
    "--version": "Print the version and exit.",
    "--trust-models": "Open models (.zip) and Python files (.py) that\nother files name: runs code (SECURITY.md).",
    "--help": "Show this message and exit.",
}
_BY_WORDS = {command.words: command for group in COMMANDS.values() for command in group}


class WrongWordsError(ValueError):
    """Words of a command line that mean nothing."""


def carry_out(words: Sequence[str]) -> int:
    """Carry out the command that words name; returns its exit code.

    Raises:
        WrongWordsError: there is no such command or option.
        BaseException: whatever the command raises.
    """
    _show_any_text()
    _check_readable(words)
    options = list(takewhile(lambda word: word.startswith("-"), words))
    named = list(words[len(options) :])
    _check_known("option:", options, _OPTIONS)
    if "--version" in options:
        from importlib.metadata import version

        _say(f"swarm-forage {version('swarm-forage-env')}")
    elif "--help" in options or not named:
        _say(_help())
    else:
        command = _named(named)
        rest = named[len(command.words.split()) :]
        if command.place:
            return _run(command, rest, trusts="--trust-models" in options)
        _check_known("option:", rest, ["--help"])
        _say(_help_of_group(command))
    return 0


def _named(words: Sequence[str]) -> Command:
    """Return the command that the first word, or the first two, name."""
    _check_known("command", words[:1], [name for name in _BY_WORDS if " " not in name])
    below, first = _below(words[0]), _BY_WORDS[words[0]]
    if below and words[1:] and not words[1].startswith("-"):
        if not first.place:
            _check_known(f"command of {words[0]}:", words[1:2], below)
        return below.get(words[1], first)
    return first


def _below(word: str) -> dict[str, Command]:
    """Return the commands of two words of which this is the first, by the second."""
    return {name.split()[1]: command for name, command in _BY_WORDS.items() if name.startswith(f"{word} ")}


def _check_known(what: str, words: Iterable[str], known: Iterable[str]) -> None:
    """Refuse a word that is not known, and say which one may be meant."""
    for word in words:
        if word not in known:
            from swarm_forage_env._internal.wording import suggestion

            raise WrongWordsError(f"No such {what} {word!r}.{suggestion(word, known)}")


def _check_readable(words: Iterable[str]) -> None:
    """Refuse words that are no text: records, pages and pictures could not hold such a name."""
    for word in words:
        try:
            word.encode("utf-8")
        except UnicodeEncodeError as error:
            raise WrongWordsError(
                f"Expected words in UTF-8, got {word!r}; rename the file, or check the locale of the terminal."
            ) from error


def _help() -> str:
    """Return what `swarm-forage --help` shows."""
    groups = {heading: [one for one in group if " " not in one.words] for heading, group in COMMANDS.items()}
    return "\n\n".join(
        [
            "Usage: swarm-forage [OPTIONS] COMMAND [ARGS]...",
            "  Swarm foraging: run, film, train and score policies.",
            _listed("Options", list(_OPTIONS.items())),
            *(_listed(heading, [(one.words, one.about) for one in group]) for heading, group in groups.items()),
        ]
    )


def _help_of_group(command: Command) -> str:
    """Return what the help of a first word shows."""
    usage = f"Usage: swarm-forage {command.words} COMMAND [ARGS]..."
    return f"{usage}\n\n  {command.about}\n\n{_listed_below(command)}"


def _listed_below(command: Command) -> str:
    return _listed("Commands", [(word, one.about) for word, one in _below(command.words).items()])


def _listed(heading: str, rows: Sequence[tuple[str, str]]) -> str:
    width = max(15, *(len(name) + 2 for name, _ in rows))
    lines = (f"  {name:{width}}" + about.replace("\n", "\n" + " " * (width + 2)) for name, about in rows)
    return "\n".join([f"{heading}:", *lines])


@cache
def loaded(command: Command) -> Any:
    """Import a command; returns what typer makes of it."""
    import typer

    from swarm_forage_env.cli.options import spread

    module, _, function = command.place.partition(":")
    app = typer.Typer(add_completion=False, rich_markup_mode=None)
    app.command()(spread(getattr(import_module(f"swarm_forage_env.cli.{module}"), function)))
    return typer.main.get_command(app)


def _run(command: Command, words: Sequence[str], *, trusts: bool) -> int:
    """Import a command and carry it out; returns its exit code."""
    import typer

    parsed = loaded(command)
    # Not `app(...)`: typer turns Ctrl-C into an exit code there, and nobody would say what is kept.
    with _news_shown():
        try:
            context = parsed.make_context(f"swarm-forage {command.words}", list(words))
        except typer.Exit as ending:  # its help was shown
            if _below(command.words):
                _say(f"\n{_listed_below(command)}")
            return ending.exit_code
        from swarm_forage_env.policies.trust import only_typed

        try:
            with context, nullcontext() if trusts else only_typed(_files_typed(words)):
                parsed.invoke(context)
        except typer.Exit as ending:
            return ending.exit_code
    return 0


def _files_typed(words: Sequence[str]) -> Iterator[str]:
    """Yield what may be a policy file among the words of a command."""
    from swarm_forage_env.policies.registry import file_of

    for word in words:
        for piece in (word, *word.split(","), *word.partition("=")[2].split(",")):
            yield from filter(None, (piece.strip(), file_of(piece.strip())))


@contextmanager
def _news_shown() -> Iterator[None]:
    """Show as one line each what our packages warn of, or tell, such as that they compile."""
    import logging
    import warnings

    from swarm_forage_env.cli.options import complain

    class Teller(logging.Handler):
        def emit(self, record: logging.LogRecord) -> None:
            complain(record.getMessage(), 0)

    show_in_full, teller = warnings.showwarning, Teller()

    def show(message: Warning | str, category: type[Warning], *rest: Any) -> None:
        if category.__module__.partition(".")[0] in PACKAGES:
            complain(str(message), 0)
        else:
            show_in_full(message, category, *rest)

    loggers = [logging.getLogger(package) for package in PACKAGES]
    levels = [logger.level for logger in loggers]
    for logger in loggers:
        logger.addHandler(teller)
        logger.setLevel(logging.INFO)
    try:
        with warnings.catch_warnings():
            warnings.showwarning = show
            yield
    finally:
        for logger, level in zip(loggers, levels, strict=True):
            logger.removeHandler(teller)
            logger.setLevel(level)


def _show_any_text() -> None:
    """Let stdout and stderr show characters that their encoding has not, as backslash escapes instead of an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a stream that somebody put in its place may be of another kind
            stream.reconfigure(errors="backslashreplace")


def _say(text: str) -> None:
    sys.stdout.write(f"{text}\n")
