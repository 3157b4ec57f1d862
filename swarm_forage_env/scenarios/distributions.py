"""Values that are drawn: one field of a world as a distribution, in the form that TOML, JSON and Python share.

Example: `{"n_robots": {"log_uniform": [8, 512]}, "density": {"uniform": [0.02, 0.1]}}`. A table of fields is read once
by `read_fields`; `draw_fields` then makes values of it, and `corners` all combinations of its ends.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, cast

import numpy as np

from swarm_forage_env._internal.fields import ConfigError, known_keys, number, text
from swarm_forage_env._internal.wording import shown

KINDS = ("uniform", "log_uniform", "choice", "same_as")
"""Ways to draw a value: all numbers of a range alike, all orders of magnitude alike, one of a list, and the value of
another field of the same table."""


@dataclass(frozen=True, slots=True)
class Drawn:
    """A distribution of one value.

    Raises:
        ConfigError: an unknown kind, or values that make no such distribution.
    """

    kind: str
    """One of `KINDS`."""
    values: tuple[Any, ...]
    """(low, high) of a range, both included; what to choose from; or the name of the other field."""

    def __post_init__(self) -> None:
        known_keys({self.kind: None}, KINDS, "distribution")
        if self.kind == "choice":
            if not self.values:
                raise ConfigError("Expected a choice of one or more values, got none.")
        elif self.kind == "same_as":
            text("same_as", self.values[0])
        else:
            if len(self.values) != 2:
                raise ConfigError(f"Expected {self.kind} to be [low, high], got {shown(list(self.values))}.")
            low, high = self.values
            number(f"the low end of {self.kind}", low, above=0.0 if self.kind == "log_uniform" else -math.inf)
            number(f"the high end of {self.kind}", high, at_least=low)

    def to_mapping(self) -> dict[str, Any]:
        """Return what `read_value` reads."""
        return {self.kind: self.values[0] if self.kind == "same_as" else list(self.values)}

    def ends(self, grain: float | None) -> tuple[Any, ...]:
        """Return what bounds the values: the two ends of a range, or every choice.

        Args:
            grain: As in `at`.

        Raises:
            ConfigError: a range of a field of whole numbers that has other ends.
        """
        if self.kind == "choice":
            return self.values
        low, high = self.at(0.0, grain), self.at(1.0, grain)
        return (low,) if low == high else (low, high)

    def at(self, share: float, grain: float | None) -> Any:
        """Return the value below which a share of the draws lies.

        Args:
            share: 0 to 1; a uniform random number gives a random value.
            grain: Values are whole multiples of it: 1 for whole numbers, the side of a cell for extents of an arena.
                None = any number.

        Raises:
            ConfigError: see `ends`.
        """
        if self.kind == "choice":
            return self.values[min(int(share * len(self.values)), len(self.values) - 1)]
        low, high = self.values
        if grain is None:
            value = low * (high / low) ** share if self.kind == "log_uniform" else low + share * (high - low)
            return min(max(float(value), float(low)), float(high))
        first, last = round(low / grain), round(high / grain)
        if max(abs(first * grain - low), abs(last * grain - high)) > 1e-9:
            raise ConfigError(f"Expected {self.kind} with ends that are multiples of {grain:g}, got [{low}, {high}].")
        if self.kind == "log_uniform":  # each whole number stands for the range from it to the next
            step = math.floor(first * ((last + 1) / first) ** share)
        else:
            step = first + math.floor(share * (last + 1 - first))
        step = min(max(step, first), last)
        return step if grain == 1 else round(step * grain, 9)


def read_value(value: Any) -> Any:
    """Return a value in which tables such as `{"uniform": [1, 2]}` are `Drawn`, lists are tuples.

    Raises:
        ConfigError: a table that begins like a distribution and is none.
    """
    if isinstance(value, Mapping):
        given = cast("Mapping[str, Any]", value)
        if len(given) == 1 and next(iter(given)) in KINDS:
            ((kind, values),) = given.items()
            if kind == "same_as":
                return Drawn(kind, (values,))
            if not isinstance(values, list | tuple):
                raise ConfigError(f"Expected {kind} to be a list, got {shown(values)}.")
            return Drawn(kind, tuple(read_value(item) for item in cast("list[Any]", values)))
        return read_fields(given)
    if isinstance(value, list | tuple):
        return tuple(read_value(item) for item in cast("list[Any]", value))
    return value


def read_fields(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table of fields, each read by `read_value`; an error says which field it was.

    Raises:
        ConfigError: see `read_value`.
    """
    read: dict[str, Any] = {}
    for name, value in fields.items():
        try:
            read[name] = read_value(value)
        except ConfigError as error:
            raise ConfigError(f"Cannot draw {name}: {error}") from error
    return read


def plain_fields(fields: Mapping[str, Any]) -> dict[str, Any]:
    """Return a table as plain values, ready for JSON; `read_fields` reads it back."""
    return {name: _plain(value) for name, value in fields.items()}


def _plain(value: Any) -> Any:
    if isinstance(value, Drawn):
        return value.to_mapping()
    if isinstance(value, Mapping):
        return plain_fields(cast("Mapping[str, Any]", value))
    return [_plain(item) for item in cast("tuple[Any, ...]", value)] if isinstance(value, tuple) else value


def draw_fields(fields: Mapping[str, Any], grains: Mapping[str, float], rng: np.random.Generator) -> dict[str, Any]:
    """Return the table with values for its distributions; each draws one number, in the order of the table.

    Args:
        fields: As `read_fields` returns them.
        grains: Field -> grain of its values, see `Drawn.at`; others have none.
        rng: Where chance comes from.

    Raises:
        ConfigError: `same_as` without such a field.
    """
    places = list(_places(fields))
    values = {place: drawn.at(float(rng.random()), grains.get(place[-1])) for place, drawn in places}
    return _filled(fields, values)


def corners(fields: Mapping[str, Any], grains: Mapping[str, float], *, at_most: int) -> Iterator[dict[str, Any]]:
    """Yield the table for every combination of the ends of its ranges and of its choices.

    Args:
        fields: As in `draw_fields`.
        grains: As in `draw_fields`.
        at_most: Most combinations.

    Raises:
        ConfigError: more combinations, or as `draw_fields`.
    """
    places = list(_places(fields))
    ends: list[tuple[Any, ...]] = []
    for place, drawn in places:
        try:
            ends.append(drawn.ends(grains.get(place[-1])))
        except ConfigError as error:
            raise ConfigError(f"Cannot draw {'.'.join(place)}: {error}") from error
    n_corners = math.prod(len(each) for each in ends)
    if n_corners > at_most:
        raise ConfigError(
            f"Expected at most {at_most:,} combinations of the ends of all ranges and of all choices, which are tried "
            f"one by one, got {n_corners:,}; fix some fields, or divide them among several worlds."
        )
    for chosen in product(*ends):
        yield _filled(fields, dict(zip((place for place, _ in places), chosen, strict=True)))


def drawn_names(fields: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the names of the fields that are drawn, with dots inside of tables."""
    return tuple(".".join(place) for place, _ in _places(fields))


_Place = tuple[str, ...]


def _places(fields: Mapping[str, Any], above: _Place = ()) -> Iterator[tuple[_Place, Drawn]]:
    """Yield where the distributions of a table are, those of tables in it included, and of tables in lists."""
    for name, value in fields.items():
        if isinstance(value, Drawn):
            if value.kind != "same_as":
                yield (*above, name), value
        elif isinstance(value, Mapping):
            yield from _places(cast("Mapping[str, Any]", value), (*above, name))
        elif isinstance(value, tuple):
            yield from _places(_tables_in(cast("tuple[Any, ...]", value)), (*above, name))


def _tables_in(entries: tuple[Any, ...]) -> dict[str, Any]:
    """Return the tables of a list by their places in it, "0" for the first."""
    return {str(place): entry for place, entry in enumerate(entries) if isinstance(entry, Mapping)}


def _filled(fields: Mapping[str, Any], values: Mapping[_Place, Any], above: _Place = ()) -> dict[str, Any]:
    filled: dict[str, Any] = {}
    for name, value in fields.items():
        if isinstance(value, Mapping):
            filled[name] = _filled(cast("Mapping[str, Any]", value), values, (*above, name))
        elif isinstance(value, tuple):
            entries = cast("tuple[Any, ...]", value)
            tables = _filled(_tables_in(entries), values, (*above, name))
            filled[name] = tuple(tables.get(str(place), entry) for place, entry in enumerate(entries))
        else:
            filled[name] = values.get((*above, name), value)
    for name, value in filled.items():
        if isinstance(value, Drawn):
            (other,) = value.values
            if other not in filled or isinstance(filled[other], Drawn):
                raise ConfigError(f"Expected {name} to be the same as a field with a value beside it, got {other!r}.")
            filled[name] = filled[other]
    return filled
