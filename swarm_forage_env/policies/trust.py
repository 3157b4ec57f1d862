"""Which policy files may run code that they hold.

A model of stable-baselines3 (`.zip`) is a pickle: who opens it runs what is in it. A network (`.npz`) is arrays and
text. A Python file (`.py`) is code.

A program in Python opens what it names, and nothing is asked here. The console command opens files that its
user typed, and says so of models. A file that is named inside a file, which may come from anywhere, it opens only if it
is told to.
"""

from collections.abc import Callable, Generator, Iterable
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path, PurePath

from swarm_forage_env._internal.fields import ConfigError

SAFE_SUFFIXES = ("npz",)
"""Policy files that run no code. Any other is asked for, those that other packages open included."""
TRUST_OPTION = "--trust-models"
"""Option of the console command that allows all files."""


class UntrustedModelError(ConfigError):
    """A policy file that runs code, which the user of the console command has not named."""


def _keep_quiet(_: str) -> None: ...


@dataclass(frozen=True, kw_only=True)
class _Command:
    """What the console command allows while it works."""

    typed: frozenset[Path] | None = None
    """Whole paths of the files that its user typed; None = any file."""
    looks_only: bool = False
    """Whether nothing is to be run (--dry-run), so that no model is opened to plan."""
    tell: Callable[[str], None] = _keep_quiet
    """Told of each model that is opened."""


_ANYTHING = _Command()
_now = [_ANYTHING]
"""The last one counts; a list of one for all threads, because a context variable would be empty in a new thread."""


@contextmanager
def of_a_command(
    typed: Iterable[str], *, looks_only: bool = False, tell: Callable[[str], None] = _keep_quiet
) -> Generator[None]:
    """While the context lasts, only files among `typed` may run code.

    Args:
        typed: Words that the user typed; those that are no files do no harm.
        looks_only: Whether nothing is to be run, so that no model is opened to plan.
        tell: Told, in one line, of each model that is opened.
    """
    _now.append(_Command(typed=frozenset(map(_whole, typed)), looks_only=looks_only, tell=tell))
    try:
        yield
    finally:
        _now.pop()


@contextmanager
def trusting() -> Generator[None]:
    """While the context lasts, any file may run code; they are still told."""
    _now.append(_Command(looks_only=_now[-1].looks_only, tell=_now[-1].tell))
    try:
        yield
    finally:
        _now.pop()


def runs_code(file: str | Path) -> bool:
    """Return whether opening a policy file runs code that it holds."""
    return PurePath(file).suffix.removeprefix(".").lower() not in SAFE_SUFFIXES


def only_looks_at(file: str | Path) -> bool:
    """Return whether a file is not to be opened to plan, because nothing will be run; see `of_a_command`.

    Python files are opened all the same: only so do they show what they are made for.
    """
    is_python = PurePath(file).suffix.lower() == ".py"
    return _now[-1].looks_only and runs_code(file) and not is_python


def check(file: str | Path) -> None:
    """Refuse a file that runs code and that nobody typed.

    Raises:
        UntrustedModelError: see above.
    """
    typed = _now[-1].typed
    if typed is not None and runs_code(file) and _whole(file) not in typed:
        raise UntrustedModelError(
            f"Expected leave to open {file}, which you did not name yourself: opening it runs code in it. "
            f"If you trust it: swarm-forage {TRUST_OPTION} and the same words again. A network (.npz) needs no trust."
        )


def tell(file: str | Path) -> None:
    """Say that a model is opened now."""
    _now[-1].tell(f"opening {file}, a model: this runs code that the file holds")


def _whole(file: str | Path) -> Path:
    try:
        return Path(file).resolve()
    except (OSError, RuntimeError, ValueError):  # too long for a name, a loop of links, a null character: no file
        return Path(file)
