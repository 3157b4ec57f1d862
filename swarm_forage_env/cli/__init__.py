"""The console command `swarm-forage`. It may import everything; nothing imports it.

Signals are heard before anything is imported that takes time.
"""

import atexit
import os
import sys
from collections.abc import Sequence

from swarm_forage_env.cli import signals


def main() -> None:
    """Run the command line and exit, in a process that does nothing else."""
    try:
        signals.hear()
        atexit.register(signals.ignore)  # what is registered first is done last
        # Or processes that start would look for Python's own modules in the current folder first (SECURITY.md).
        os.environ["PYTHONSAFEPATH"] = "1"
        code = answer(sys.argv[1:])
    except KeyboardInterrupt:
        code = _interrupted()
    signals.end_at_once(code)
    sys.exit(code)


def answer(words: Sequence[str]) -> int:
    """Carry out a command and return its exit code; whatever error comes is told on stderr."""
    try:
        from swarm_forage_env.cli.app import carry_out

        code = carry_out(words)
        sys.stdout.flush()
        return signals.exit_code() if code == signals.EXIT_INTERRUPTED else code
    except BaseException as error:  # noqa: BLE001 - the last guard: whatever happens is told
        if signals.came or isinstance(error, KeyboardInterrupt):
            return _interrupted()
        signals.end_at_once(signals.exit_code())
        from swarm_forage_env.cli.errors import end

        return end(error)


def _interrupted() -> int:
    """Tell it, where no command has told what is kept; returns the exit code."""
    code = signals.exit_code()
    signals.end_at_once(code)
    sys.stderr.write("swarm-forage: Interrupted. Unfinished work is not kept; run the same command to start again.\n")
    return code
