"""Ctrl-C and SIGTERM: one line on stderr and an exit code, whatever a command is doing when they come.

They are heard before anything is imported that takes time, so this module imports little itself.
"""

import os
import signal
import sys
from collections.abc import Callable
from typing import Any

EXIT_INTERRUPTED = 130
"""Exit code that shells report for a program ended by Ctrl-C."""
EXIT_TERMINATED = 143
"""Exit code that shells report for a program ended by SIGTERM, as batch systems and containers send it."""
AGAIN_S = 0.2
"""When an interrupt that was lost is raised again; our choice: soon, and late enough to be elsewhere."""

_HEARD = (signal.SIGINT, signal.SIGTERM)

came: list[int] = []
"""Numbers of the signals that came."""


class Terminated(KeyboardInterrupt):
    """SIGTERM, to be handled as Ctrl-C is: what keeps finished runs then keeps them now, too."""


def hear() -> None:
    """Let Ctrl-C raise KeyboardInterrupt and SIGTERM `Terminated`, and raise them again where they are lost.

    They are lost where a library catches every error, as some do around imports, and where LLVM calls Python, as it
    does in compiling. What they break may fail later, with an error of its own: `came` tells what it was.
    """
    for number in _HEARD:
        signal.signal(number, _interrupt)
    sys.excepthook = _silent_once_interrupted(sys.excepthook)
    sys.unraisablehook = _silent_once_interrupted(sys.unraisablehook)


def _interrupt(number: int, _: object = None) -> None:
    came.append(number)
    if hasattr(signal, "setitimer"):  # Windows has no such clock: there one presses Ctrl-C again
        signal.signal(signal.SIGALRM, _interrupt_again)
        signal.setitimer(signal.ITIMER_REAL, AGAIN_S, AGAIN_S)
    raise Terminated if number == signal.SIGTERM else KeyboardInterrupt


def _interrupt_again(*_: object) -> None:
    """Interrupt once more, unless an interrupt is being handled right now: finished runs may be kept just then."""
    error = sys.exc_info()[1]
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    if error is None:
        _interrupt(came[-1])


def _silent_once_interrupted(show: Callable[..., None]) -> Callable[..., None]:
    """Return a hook of `sys` that shows errors until an interrupt comes: it may leave things half made."""

    def hook(*told: Any) -> None:
        if not came:
            show(*told)

    return hook


def exit_code() -> int:
    """Return the exit code of a command that was interrupted."""
    return EXIT_TERMINATED if signal.SIGTERM in came else EXIT_INTERRUPTED


def end_at_once(code: int) -> None:
    """From now on, let a signal end the process with this exit code: all is done, or an error is being told."""
    if hasattr(signal, "setitimer"):
        signal.setitimer(signal.ITIMER_REAL, 0.0)
    for number in _HEARD:
        signal.signal(number, lambda *_: os._exit(code))


def ignore() -> None:
    """Ignore signals: Python, when it ends, takes away handlers of ours, and the system would end it as interrupted."""
    for number in _HEARD:
        signal.signal(number, signal.SIG_IGN)
