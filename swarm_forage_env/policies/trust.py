"""Which policy files may run code that they hold.

A model of stable-baselines3 (`.zip`) is a pickle: who opens it runs what is in it. A network (`.npz`) is arrays and
text. A Python file (`.py`) is code. A program in Python opens what it names. The console command opens what its user
typed; a file that is named inside a file, which may come from anywhere, it opens only after `--trust-models`.
"""

from collections.abc import Generator, Iterable
from contextlib import contextmanager
from pathlib import Path, PurePath

from swarm_forage_env._internal.fields import ConfigError

SAFE_SUFFIX = ".npz"
"""Of policy files that run no code."""


class UntrustedModelError(ConfigError):
    """A policy file that runs code, which the user of the console command has not named."""


_typed: list[frozenset[Path] | None] = [None]
"""Whole paths of the files that may run code, None = any; the last one counts. A list of one for all threads, because a
context variable would be empty in a new thread."""


@contextmanager
def only_typed(words: Iterable[str]) -> Generator[None]:
    """While the context lasts, only files among these words may run code; words that are no files do no harm."""
    _typed.append(frozenset(map(_whole, words)))
    try:
        yield
    finally:
        _typed.pop()


def check(file: str | Path) -> None:
    """Refuse a file that runs code and that nobody typed.

    Raises:
        UntrustedModelError: see above.
    """
    typed = _typed[-1]
    if typed is not None and PurePath(file).suffix.lower() != SAFE_SUFFIX and _whole(file) not in typed:
        raise UntrustedModelError(
            f"Expected leave to open {file}, which you did not name yourself: opening it runs code in it. "
            "If you trust it: swarm-forage --trust-models and the same words again. A network (.npz) needs no trust."
        )


def _whole(file: str | Path) -> Path:
    try:
        return Path(file).resolve()
    except (OSError, RuntimeError, ValueError):  # too long for a name, a loop of links, a null character: no file
        return Path(file)
