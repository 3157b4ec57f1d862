"""JSON and TOML from files that anybody may have written: read with a bound on how deep they are nested.

Both parsers, and all that walks over what they return, call themselves for each level; a file of brackets alone would
end the process's stack.
"""

import json
import tomllib
from collections.abc import Callable
from typing import Any

MOST_LEVELS = 50
"""Levels of nested tables and lists that a file may have; our choice: our own files have fewer than ten."""


def parse_json(text: str) -> Any:
    """Return what a JSON text holds.

    Raises:
        ValueError: no JSON, or nested deeper than `MOST_LEVELS`.
    """
    return _bounded(json.loads, text, "JSON")


def parse_toml(text: str) -> dict[str, Any]:
    """Return the tables of a TOML text.

    Raises:
        ValueError: no TOML, or nested deeper than `MOST_LEVELS`.
    """
    return _bounded(tomllib.loads, text, "TOML")


def _bounded(parse: Callable[[str], Any], text: str, language: str) -> Any:
    message = f"Expected {language} of at most {MOST_LEVELS} nested levels, got more."
    try:
        content = parse(text)
    except RecursionError as error:
        raise ValueError(message) from error
    level = [content]
    for _ in range(MOST_LEVELS):
        level = [item for value in level for item in _members(value)]
        if not level:
            return content
    raise ValueError(message)


def _members(value: Any) -> list[Any]:
    if isinstance(value, dict):
        return list(value.values())
    return value if isinstance(value, list) else []
