"""The console command `swarm-forage`. It may import everything; nothing imports it."""

import atexit
import logging
import os
import signal
import sys
import traceback
import warnings
from collections.abc import Sequence
from typing import Any

EXIT_FAILURE = 1
EXIT_USAGE = 2
EXIT_INTERRUPTED = 130
"""What shells report for a program ended by Ctrl-C."""
EXIT_TERMINATED = 143
"""What shells report for a program ended by SIGTERM, as batch systems and containers send it."""
AGAIN_S = 0.2
"""When an interrupt that was lost is raised again; our choice: soon, and late enough to be elsewhere."""
PACKAGES = ("swarm_forage_env", "baselines", "metrics")

came: list[int] = []
"""Numbers of the signals that came."""


class CommandError(Exception):
    """What was asked for failed, though the words of the command were right: one line and exit code 1."""


class NothingAskedError(ValueError):
    """A command without the words that it needs: it shows its help."""


def main() -> None:
    """Run the command line and exit, in a process that does nothing else."""
    # Or processes that start would look for Python's own modules in the current folder first (SECURITY.md).
    os.environ["PYTHONSAFEPATH"] = "1"
    os.environ["MPLBACKEND"] = "agg"  # pictures go to files; one that is not installed would end every command
    try:
        atexit.register(_die_of_signal)  # registered first, so done last
        hear()
        _tell_news()
        code = answer(sys.argv[1:])
    except KeyboardInterrupt as interrupt:
        code = _interrupted(str(interrupt))
    for number in (signal.SIGINT, signal.SIGTERM):  # all is said: from here on nothing is worth a traceback
        signal.signal(number, signal.SIG_IGN)
    sys.exit(code)


def _die_of_signal() -> None:
    """End by the signal that came, not by an exit code, so that a shell ends the loop around the command, too."""
    if came:
        signal.signal(came[0], signal.SIG_DFL)
        os.kill(os.getpid(), came[0])


def hear() -> None:
    """Let Ctrl-C and SIGTERM raise KeyboardInterrupt, and raise it again where it is lost.

    Whoever started the command may have had it ignore one of them, as nohup and shells do for the background.
    """
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _interrupt)
    sys.unraisablehook = _unraisable


def _tell_news() -> None:
    """Show warnings, and what our packages tell, such as that they compile, as one line each."""
    warnings.showwarning = lambda message, *_, **__: complain(str(message))
    logging.basicConfig(format="swarm-forage: %(message)s")
    for package in PACKAGES:
        logging.getLogger(package).setLevel(logging.INFO)


def answer(words: Sequence[str]) -> int:
    """Carry out a command and return its exit code.

    What a user can mend is told in one line; other errors are raised, once no interrupt is their reason.
    """
    try:
        if sys.stdout is None:  # pyright: ignore[reportUnnecessaryComparison] - that is what Python makes of it
            raise CommandError("Expected a standard output to write to, got a closed one; > /dev/null drops it.")
        from swarm_forage_env.cli.app import carry_out

        code = carry_out(words)
        sys.stdout.flush()
        return code
    except KeyboardInterrupt as interrupt:
        return _interrupted(str(interrupt))
    except Exception as error:
        if came:  # it left something half made
            return _interrupted("")
        code = _told(error)
        if code is None:
            raise
        return code
    finally:
        if hasattr(signal, "setitimer"):
            signal.setitimer(signal.ITIMER_REAL, 0.0)


def complain(message: str) -> None:
    """Print one line on stderr, if there is one."""
    from swarm_forage_env._internal.wording import printable

    if sys.stderr is not None:  # pyright: ignore[reportUnnecessaryComparison] - it is where it was closed
        sys.stderr.write(f"swarm-forage: {printable(' '.join(message.split()))}\n")


def _told(error: Exception) -> int | None:
    """Tell an error in one line and return the exit code; None where nobody foresaw it."""
    if isinstance(error, BrokenPipeError):  # whoever read our output has enough, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())  # or the last flush fails again
        return EXIT_FAILURE
    if isinstance(error, OSError) and error.strerror and error.filename:
        complain(f"{error.strerror}: {error.filename}")
    elif isinstance(error, ImportError) and (package := _raised_in(error)) not in PACKAGES:
        complain(f"Cannot import {package}: {error}")
    elif isinstance(error, ImportError | OSError) or type(error).__module__.partition(".")[0] in PACKAGES:
        complain(str(error))
    else:
        return None
    return EXIT_USAGE if isinstance(error, ValueError) else EXIT_FAILURE


def _raised_in(error: Exception) -> str:
    """Return the name of the package whose code raised an error."""
    *_, (frame, _) = traceback.walk_tb(error.__traceback__)
    return str(frame.f_globals.get("__name__")).partition(".")[0]


def _interrupt(number: int, _: object = None) -> None:
    """Raise KeyboardInterrupt, and once more where a library swallows it, as LLVM does where it calls Python."""
    came.append(number)
    if hasattr(signal, "setitimer"):  # Windows has no such clock: there one presses Ctrl-C again
        signal.signal(signal.SIGALRM, _interrupt_again)
        signal.setitimer(signal.ITIMER_REAL, AGAIN_S, AGAIN_S)
    raise KeyboardInterrupt


def _interrupt_again(*_: object) -> None:
    """Interrupt once more, unless an interrupt is being handled right now: finished runs may be kept just then."""
    error = sys.exception()
    while error is not None and not isinstance(error, KeyboardInterrupt):
        error = error.__context__
    if error is None:
        raise KeyboardInterrupt


def _unraisable(unraisable: Any) -> None:
    """Show what failed where nobody can catch it, unless an interrupt left things half made."""
    if not came:
        sys.__unraisablehook__(unraisable)


def _interrupted(message: str) -> int:
    complain(message or "Interrupted. Unfinished work is not kept; run the same command to start again.")
    return EXIT_TERMINATED if signal.SIGTERM in came else EXIT_INTERRUPTED
