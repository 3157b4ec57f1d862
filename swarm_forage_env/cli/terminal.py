"""Where commands print: tables on stdout, notes on stderr."""

from rich.console import Console

_WIDTH_WITHOUT_TERMINAL = 140


def output() -> Console:
    """Return a console on stdout; if the width is unknown, tables are not cut."""
    console = Console(highlight=False)
    if not console.is_terminal:
        console.width = _WIDTH_WITHOUT_TERMINAL
    return console


def notes() -> Console:
    """Return a console on stderr, for what is not the result; it breaks no lines."""
    return Console(stderr=True, highlight=False, soft_wrap=True)
