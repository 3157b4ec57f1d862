"""What scripts that time two programs in turn share: a program that answers lines with times, and a cell of ratios."""

import os
import statistics
import subprocess
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import IO

ONE_THREAD = dict.fromkeys(("NUMBA_NUM_THREADS", "OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1")


class TimedProcess:
    """A program that reads a question per line from standard input and answers it with a line."""

    def __init__(self, command: Sequence[str], folder: Path, environment: Mapping[str, str]) -> None:
        """Start the program in a folder, with one thread per library."""
        self._process = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
            cwd=folder,
            env={**os.environ, **ONE_THREAD, **environment},
        )

    def ask(self, question: str) -> str:
        """Return the answer; raises RuntimeError where the program has ended instead."""
        print(question, file=_pipe(self._process.stdin), flush=True)
        answer = _pipe(self._process.stdout).readline()
        if not answer:
            raise RuntimeError(f"The process that timed {question} has ended with {self._process.wait()}; see above.")
        return answer.strip()

    def close(self) -> None:
        """End the program."""
        self._process.kill()
        self._process.communicate()  # closes the pipes, too


def _pipe(pipe: IO[str] | None) -> IO[str]:
    assert pipe is not None, "asked for above"
    return pipe


def short(number: float) -> str:
    """Return two decimals below 100 and none from there: "0.15", "1,660"."""
    return f"{number:.2f}" if number < 100 else f"{number:,.0f}"


def ratio_cell(ratios: Sequence[float]) -> str:
    """Return the median, smallest and largest: "3.10 (3.02 to 3.20)"."""
    return f"{short(statistics.median(ratios))} ({short(min(ratios))} to {short(max(ratios))})"
