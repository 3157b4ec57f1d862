"""Which commands there are. Each is a function in a file of this folder, imported when somebody asks for it.

Its parameters are its arguments and options, its docstring is its help. A line of `COMMANDS` adds one.
"""

import io
import sys
from collections.abc import Iterator, Sequence
from contextlib import nullcontext

from cyclopts import App, CycloptsError, Group, MissingArgumentError, Parameter

from swarm_forage_env.cli import EXIT_USAGE, NothingAskedError, complain

COMMANDS: dict[str, dict[str, tuple[str, str]]] = {
    "Run and look": {
        "run": ("runs:run", "Run policies in a scenario and compare them."),
        "play": ("look:play", "Steer and disturb a run in the browser."),
        "record": ("look:record", "Film a run, or draw it at one time."),
        "replay": ("look:replay", "Write runs as one HTML page that plays them."),
        "maps": ("look:maps", "Draw maps of where things happened."),
    },
    "Score": {"score": ("runs:score", "Score policies by all measures.")},
    "Train": {
        "train": ("train:app", "Train one policy that every robot shares."),
        "export": ("train:export", "Write a network as a C header, or as ONNX."),
        "dataset": ("train:dataset", "Record what robots see and do, for learners."),
    },
    "Studies and benchmark": {
        "study": ("studies:app", "Run the paper's experiments, or your own."),
        "benchmark": ("benchmark:app", "Score policies in a fixed set of worlds."),
    },
    "Look up": {
        "list": ("look:list_everything", "List scenarios, policies, wrappers or columns."),
        "info": ("look:info", "Describe a scenario or a policy."),
    },
    "Checks": {
        "check": ("runs:check", "Check that policies keep the rules."),
        "rerun": ("runs:rerun", "Repeat a stored run, and compare."),
    },
}
"""Heading in `--help` -> name -> place of the function, or of an app with commands below it, and what is said of it."""


def _version() -> str:
    from importlib.metadata import version  # slow to import and rarely asked for

    return f"swarm-forage {version('swarm-forage-env')}"


def _shown(default: object) -> object:
    """Return a default as a user would type it, None where help leaves it out."""
    return (",".join(default) if isinstance(default, tuple) else default) or None


def made(words: Sequence[str] = ()) -> App:
    """Return the app; the commands that words name tell of themselves by their docstrings, not by a line."""
    names = [name for commands in COMMANDS.values() for name in commands]
    app = App(
        name="swarm-forage",
        help="Swarm foraging: run, film, train and score policies.\n\n'swarm-forage --trust-models COMMAND ...' opens "
        "models (.zip) and Python files (.py) that other files name, too: runs code (SECURITY.md).",
        help_format="markdown" if words and words[0] in names else "plaintext",  # markdown takes time
        version=_version,
        default_parameter=Parameter(negative_bool=(), negative_iterable=(), show_default=_shown),
        print_error=False,
        exit_on_error=False,
        suppress_keyboard_interrupt=False,
        result_action="return_value",
    )
    for heading, commands in COMMANDS.items():
        group = Group.create_ordered(heading)
        for name, (place, about) in commands.items():
            line = None if name in words else about
            app.command(f"swarm_forage_env.cli.{place}", name=name, help=line, group=group, sort_key=names.index(name))
    app.group_commands = Group.create_ordered("Commands")  # after ours
    app.register_install_completion_command(help="Let the shell complete commands and options.")
    return app


def carry_out(words: Sequence[str]) -> int:
    """Carry out the command that words name and return its exit code; raises whatever the command raises."""
    from swarm_forage_env.policies.trust import only_typed

    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # names of files may hold what their encoding has not
            stream.reconfigure(errors="backslashreplace")
    trusts = "--trust-models" in words[:1]
    app, words = made(words), words[trusts:]
    try:
        with nullcontext() if trusts else only_typed(_files_typed(words)):
            return app(words) or 0
    except (CycloptsError, NothingAskedError) as error:
        if isinstance(error, MissingArgumentError | NothingAskedError) and not any(
            word.startswith("-") for word in words
        ):
            app.help_print(words)
        complain(str(error))
        return EXIT_USAGE


def _files_typed(words: Sequence[str]) -> Iterator[str]:
    """Yield what may be a policy file among the words of a command."""
    for word in words:
        for piece in map(str.strip, (word, *word.split(","), *word.partition("=")[2].split(","))):
            if "." in piece:
                from swarm_forage_env.policies.registry import file_of  # late: help names no files

                yield from (piece, file_of(piece))
