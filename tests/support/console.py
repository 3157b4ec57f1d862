"""The console command in this process."""

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager

from swarm_forage_env import cli
from swarm_forage_env.cli import signals


@contextmanager
def heard() -> Iterator[None]:
    """While the context lasts, hear signals as the command does."""
    handlers = {number: signal.getsignal(number) for number in (signal.SIGINT, signal.SIGTERM)}
    hooks = sys.excepthook, sys.unraisablehook
    signals.hear()
    try:
        yield
    finally:
        signals.end_at_once(0)
        signals.came.clear()
        for number, handler in handlers.items():
            signal.signal(number, handler)
        sys.excepthook, sys.unraisablehook = hooks


def answer(*words: str) -> int:
    """Give words to the command; returns its exit code."""
    with heard():
        return cli.answer(words)
