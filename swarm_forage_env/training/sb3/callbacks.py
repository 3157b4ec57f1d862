"""Callbacks of stable-baselines3 by name: code of the user that runs beside a training.

    swarm-forage train --callback my_callbacks:Mine     # class Mine in my_callbacks.py, in this folder or installed

Only the command line and Python name callbacks. A plan, which may come from anywhere, cannot: it holds no code.
"""

import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any

from stable_baselines3.common.callbacks import BaseCallback

from swarm_forage_env._internal.faults import in_words
from swarm_forage_env._internal.fields import ConfigError


def named_callbacks(names: Iterable[str]) -> tuple[BaseCallback, ...]:
    """Return callbacks by their names, each made without arguments.

    Args:
        names: "module:Class". A module may lie in the current folder.

    Raises:
        ConfigError: there is none of that name, it cannot be imported or made, or it is no callback.
    """
    return tuple(map(_made, names))


def check_callbacks(names: Iterable[str]) -> None:
    """Refuse names under which there is nothing to make; nothing is made, as that may begin something.

    Raises:
        ConfigError: see `named_callbacks`.
    """
    for name in names:
        with _refusing(name):
            _found(name)


@contextmanager
def _refusing(name: str) -> Iterator[None]:
    try:
        yield
    except ConfigError:
        raise
    except Exception as error:  # code of the user, which may raise anything
        raise ConfigError(f"Cannot make the callback {name!r}: {in_words(error)}") from error


def _made(name: str) -> BaseCallback:
    with _refusing(name):
        made = _found(name)()
    if not isinstance(made, BaseCallback):
        raise ConfigError(
            f"Expected {name!r} to make a callback of stable-baselines3, got {type(made).__name__}; derive its class "
            "from stable_baselines3.common.callbacks.BaseCallback."
        )
    return made


def _found(name: str) -> Any:
    """The class (or function) of that name; whatever its import raises comes through."""
    module, colon, attribute = name.partition(":")
    if not colon:
        raise ConfigError(f"Expected a callback as module:Class, got {name!r}.")
    return getattr(_imported(module), attribute)


def _imported(module: str) -> Any:
    """Import a module, also from the current folder, which Python does not search for an installed command.

    The folder is searched last, so that no file in it hides what is installed.
    """
    here = str(Path.cwd())
    is_new = here not in sys.path
    if is_new:
        sys.path.append(here)
    try:
        return import_module(module)
    finally:
        if is_new:
            sys.path.remove(here)
