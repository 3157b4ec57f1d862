"""Give malformed commands to the console command until the time is over, and show those that end badly.

    scripts/fuzz --minutes 30

A command may end with an exit code that is documented, and with one line on stderr. A traceback, another exit code, or
a command that takes too long is a fault; it is shown with its words and its number. The same number gives the same
command: `--first 123 --count 1` repeats it. Nothing is run, only begun; `tests/support/malformed.py` says how.
"""

import argparse
import os
import resource
import shlex
import signal
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from random import Random

sys.path.insert(0, str(Path(__file__).parent.parent))

from scripts.arguments import whole
from tests.support.malformed import malformed_command, outcome

LIMIT_S = 120
"""A command that only begins takes a second; our choice for a machine that does other work, too."""
MEMORY_BYTES = 12 * 2**30
"""Address space of this process: a command that asks for more fails here and not the machine."""


class TooLongError(Exception):
    """A command that does not come to its end; no OSError as TimeoutError is, which a command may catch."""


def main() -> int:
    """Return 1 if a command ended badly."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--minutes", type=float, default=30.0, help="how long; default 30")
    parser.add_argument("--first", type=whole(at_least=0), default=0, help="number of the first command; default 0")
    parser.add_argument("--count", type=whole(at_least=1), default=None, help="commands; default as many as fit")
    given = parser.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY_BYTES, MEMORY_BYTES))
    signal.signal(signal.SIGALRM, _too_long)
    ends = time.monotonic() + 60.0 * given.minutes
    number, codes, n_faults = given.first, Counter(), 0
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        while time.monotonic() < ends and (given.count is None or number < given.first + given.count):
            words = malformed_command(Random(number), Path(folder))
            signal.alarm(LIMIT_S)
            found = outcome(words)
            signal.alarm(0)
            codes[found.code] += not found.fault
            if found.fault:
                n_faults += 1
                print(f"--- command {number}: swarm-forage {shlex.join(words)[:2000]}\n{found.fault}", flush=True)
            number += 1
    ended = ", ".join(f"{count} with exit code {code}" for code, count in sorted(codes.items()))
    print(f"{number - given.first} commands, {n_faults} faults; of the others {ended}")
    return 1 if n_faults else 0


def _too_long(*_: object) -> None:
    raise TooLongError(f"took longer than {LIMIT_S} s")


if __name__ == "__main__":
    sys.exit(main())
