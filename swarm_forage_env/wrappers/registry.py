"""Wrapper configurations by the name that stored specifications use."""

from importlib import import_module
from typing import TYPE_CHECKING

from swarm_forage_env.config import ConfigError, suggestion

if TYPE_CHECKING:
    from swarm_forage_env.wrappers.base import WrapperConfig

WRAPPERS: dict[str, str] = {}
"""Name -> "module:class" of a `WrapperConfig`. Strings, so that reading a specification imports only what it names."""


def wrapper_config_class(name: str) -> "type[WrapperConfig]":
    """Return the configuration class registered under `name`.

    Raises:
        ConfigError: no wrapper has that name.
    """
    if name not in WRAPPERS:
        known = ", ".join(sorted(WRAPPERS)) or "none"
        raise ConfigError(f"Unknown wrapper {name!r}.{suggestion(name, WRAPPERS)} Known: {known}.")
    module, _, class_name = WRAPPERS[name].partition(":")
    return getattr(import_module(module), class_name)
