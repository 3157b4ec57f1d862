"""Plain values of files, JSON's and TOML's, as the types that the code has for them; the reader of every format.

    Count = Annotated[int, Within(at_least=0)]

    @dataclass(frozen=True, kw_only=True)
    class Part:
        name: Name
        sizes: tuple[Count, ...]

    typed(Part, {"name": "a", "sizes": [1, 2]}, "part")    # Part(name="a", sizes=(1, 2))
    typed(Part, {"name": "a", "sizes": [1, -2]}, "part")   # ConfigError: Expected part.sizes[1] to be ..., got -2.

A table becomes a dataclass or a mapping, a list a tuple. Everything else is refused by the name of its field, and so is
a field that nobody knows or that is missing without a default. Numbers stay as they are: 1 does not become 1.0, so that
digests fit. The bounds stand in the type.
"""

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, TypeAlias, Union, cast, get_args, get_origin, get_type_hints

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_keys, number, switch, table, text, whole
from swarm_forage_env._internal.wording import shown


@dataclass(frozen=True, kw_only=True, slots=True)
class Within:
    """Bounds of a number, or of the length of a list."""

    at_least: int | None = None
    at_most: int | None = None


@dataclass(frozen=True, slots=True)
class Shown:
    """A text that people read: not empty, and without control characters."""


Count: TypeAlias = Annotated[int, Within(at_least=0)]
Amount: TypeAlias = Annotated[float, Within(at_least=0)]
Name: TypeAlias = Annotated[str, Shown()]


def typed(kind: Any, value: Any, where: str) -> Any:
    """Return a plain value as a type.

    Args:
        kind: bool, int, float, str or Any; one of them or None, or one of several; a tuple or a mapping from texts of
            what is in this list; a dataclass with such fields. `Annotated` adds `Within` or `Shown`.
        value: What a parser returned.
        where: Name of the value, for the message.

    Raises:
        ConfigError: it is of another type, or out of bounds.
    """
    bounds: Any = None
    if get_origin(kind) is Annotated:
        kind, bounds = get_args(kind)
    origin, parts = get_origin(kind), get_args(kind)
    if kind is Any:
        return value
    if origin in (Union, UnionType):
        if value is None and NoneType in parts:
            return None
        return typed(_alternative(parts, value, where), value, where)
    if dataclasses.is_dataclass(kind):
        return _record(cast("type", kind), value, where)
    if origin is tuple:
        return _listed(parts, value, where, bounds or Within())
    if origin is not None:
        return {key: typed(parts[-1], item, f"{where}.{key}") for key, item in table(where, value).items()}
    _scalar(kind, value, where, bounds)
    return value


def _alternative(kinds: tuple[Any, ...], value: Any, where: str) -> Any:
    """Return which of several types a value is meant to have."""
    others = [kind for kind in kinds if kind is not NoneType]
    if len(others) == 1:
        return others[0]
    fitting = [kind for kind in (bool, float, str) if isinstance(value, kind | int if kind is float else kind)]
    if not fitting or fitting[0] not in others:
        raise ConfigError(f"Expected {where} to be one of {', '.join(map(_word, others))}, got {shown(value)}.")
    return fitting[0]


def _word(kind: type) -> str:
    return {bool: "True or False", float: "a number", str: "a text"}[kind]


def _scalar(kind: type, value: Any, where: str, bounds: Any) -> None:
    if kind is bool:
        switch(where, value)
    elif kind is str:
        if isinstance(bounds, Shown):
            text(where, value)
        elif not isinstance(value, str):
            raise ConfigError(f"Expected {where} to be a text, got {shown(value)}.")
    elif kind is int:
        limits = bounds or Within()
        whole(where, value, at_least=limits.at_least, at_most=limits.at_most)
    else:
        assert kind is float, f"no type of plain values: {kind}"
        limits = {} if bounds is None else {k: v for k, v in dataclasses.asdict(bounds).items() if v is not None}
        number(where, value, **limits)


def _listed(parts: tuple[Any, ...], value: Any, where: str, bounds: Within) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise ConfigError(f"Expected {where} to be a list, got {shown(value)}.")
    given = cast("list[Any] | tuple[Any, ...]", value)
    is_long = parts[-1] is Ellipsis
    least, most = (bounds.at_least or 0, bounds.at_most) if is_long else (len(parts), len(parts))
    if len(given) < least or (most is not None and len(given) > most):
        wanted = f"{least} entries" if most == least else f"at least {least}" if most is None else f"{least} to {most}"
        raise ConfigError(f"Expected {where} to have {wanted}, got {len(given)}.")
    kinds = parts[:1] * len(given) if is_long else parts
    return tuple(typed(kind, item, f"{where}[{k}]") for k, (kind, item) in enumerate(zip(kinds, given, strict=True)))


def _record(kind: type, value: Any, where: str) -> Any:
    own = _fields_of(kind)
    prefix = f"{where}." if where else ""
    mapping = table(where or f"a {kind.__name__}", value)
    known_keys(mapping, own, prefix=prefix)
    missing = [name for name, (_, is_needed) in own.items() if is_needed and name not in mapping]
    if missing:
        raise ConfigError(f"Missing key {prefix + missing[0]!r}.")
    return kind(**{name: typed(own[name][0], item, f"{prefix}{name}") for name, item in mapping.items()})


@cache
def _fields_of(kind: Any) -> Mapping[str, tuple[Any, bool]]:
    """Field of a dataclass -> its type, and whether a file must have it."""
    hints = get_type_hints(kind, include_extras=True)
    lacking = dataclasses.MISSING
    return {
        item.name: (hints[item.name], item.default is lacking and item.default_factory is lacking)
        for item in dataclasses.fields(kind)
    }


def check_array(where: str, given: np.ndarray, dtype: Any, shape: tuple[int | None, ...]) -> None:
    """Refuse an array of another type or shape, or one of numbers that are not finite.

    Args:
        where: Name of the array, for the message.
        given: The array.
        dtype: What it must be, byte order included; nothing is converted.
        shape: The same; None = any length.

    Raises:
        ConfigError: see above.
    """
    fits = given.ndim == len(shape) and all(
        length in (None, there) for length, there in zip(shape, given.shape, strict=True)
    )
    if not fits or given.dtype != dtype:
        lengths, wanted = ", ".join("any" if length is None else str(length) for length in shape), np.dtype(dtype).name
        raise ConfigError(
            f"Expected {where} to be an array ({lengths}) of {wanted}, got {given.shape} of {given.dtype.name}."
        )
    if given.dtype.kind == "f" and not np.isfinite(given).all():
        raise ConfigError(f"Expected {where} to hold finite numbers, got some that are none.")
