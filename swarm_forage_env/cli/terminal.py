"""Where commands print: tables on stdout, notes on stderr.

Names of policies, files and scenarios are shown as they are: no console reads markup such as [red] in them.
"""

import io
import sys

from rich.console import Console

_WIDTH_WITHOUT_TERMINAL = 140


def output() -> Console:
    """Return a console on stdout; if the width is unknown, tables are not cut."""
    console = Console(highlight=False, markup=False, emoji=False)
    if not console.is_terminal:
        console.width = _WIDTH_WITHOUT_TERMINAL
    return console


def notes() -> Console:
    """Return a console on stderr, for what is not the result; it breaks no lines."""
    return Console(stderr=True, highlight=False, markup=False, emoji=False, soft_wrap=True)


def show_any_text() -> None:
    """Let stdout and stderr show characters that their encoding has not, as backslash escapes instead of an error."""
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):  # a stream that somebody put in its place may be of another kind
            stream.reconfigure(errors="backslashreplace")
