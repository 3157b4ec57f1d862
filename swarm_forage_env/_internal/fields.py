"""Checks of the fields of configurations: functions that raise ConfigError where a value makes no sense.

Every message says "Expected <where> to be <what>, got <value>"; `where` is the name that people know the value by, such
as `robots.n_robots`. A value of an unknown name is refused with the nearest known one.

Which numbers are accepted: fields of configurations are stored with runs as plain values, so they are Python's own int
and float (numpy's float64 is a float, all its other numbers are not); a number of another kind is refused with a hint
to convert it. True and False are no numbers. Arguments that are only used, such as a seed of a reset, may be numpy
integers as well: `as_whole` takes both and returns an int.
"""

import math
import operator
import sys
from collections.abc import Iterable, Mapping
from numbers import Integral, Real
from typing import Any, cast

from swarm_forage_env._internal.wording import is_printable, nearest, shown, suggestion

MAX_NAME = 60
"""Longest name that files are named by (our choice: with four bytes a character, endings still fit into 255 bytes)."""
MOST = 1e15
"""Largest number of a configuration, and 1 over it the smallest that has to be above 0; our choice. All that is
computed of such numbers, ticks and cells and squares, stays far from the ends of float and of 64-bit whole numbers."""
MOST_SEEDS = 100_000
"""Runs of one kind that a command or a study may ask for; our choice: five hundred times those of the paper."""


class ConfigError(ValueError):
    """A configuration that cannot describe a world; the message says what was expected and what came."""


class UnknownNameError(ConfigError, TypeError):
    """A name of a value that there is not; a TypeError, too, as Python's own of an unknown keyword argument."""


def number(
    where: str,
    value: Any,
    *,
    at_least: float = -math.inf,
    above: float = -math.inf,
    at_most: float = math.inf,
    below: float = math.inf,
) -> None:
    """Refuse what is no finite number, or one out of range.

    Args:
        where: Name of the value, for the message.
        value: What was given.
        at_least: Smallest allowed value.
        above: The value must be larger than this.
        at_most: Largest allowed value.
        below: The value must be smaller than this.

    Raises:
        ConfigError: see above.
    """
    is_in_range = _is_number(value) and at_least <= value <= at_most and above < value < below
    is_too_small = above == 0.0 and is_in_range and value < 1.0 / MOST
    if not is_in_range or is_too_small or abs(value) > MOST:
        wanted = _number_in_range(max(at_least, above), min(at_most, below), above >= at_least, below <= at_most)
        if is_in_range:
            wanted += f", no closer to 0 than {1.0 / MOST:g}" if is_too_small else f", at most {MOST:g} in size"
        hint = _conversion_hint(value, Real, "float")
        raise ConfigError(f"Expected {where} to be {wanted}, got {shown(value)}{hint}.")


def whole(
    where: str, value: Any, *, at_least: int | None = None, at_most: int | None = None, or_none: bool = False
) -> None:
    """Refuse what is no whole number, or one out of range.

    Args:
        where: Name of the value, for the message.
        value: What was given.
        at_least: Smallest allowed value.
        at_most: Largest allowed value.
        or_none: Whether None is allowed, too.

    Raises:
        ConfigError: see above.
    """
    if or_none and value is None:
        return
    is_whole = isinstance(value, int) and not isinstance(value, bool) and _is_between(value, at_least, at_most)
    is_too_large = is_whole and at_most is None and abs(value) > MOST
    if not is_whole or is_too_large:
        wanted = _whole_in_range(at_least, at_most, or_none)
        wanted += f", at most {MOST:,.0f} in size" if is_too_large else ""
        hint = _conversion_hint(value, Integral, "int")
        raise ConfigError(f"Expected {where} to be {wanted}, got {shown(value)}{hint}.")


def as_whole(where: str, value: Any, *, at_least: int, at_most: int | None = None, or_none: bool = False) -> int:
    """Return a whole number, one of numpy's included, as an int; for arguments that no configuration stores.

    Args:
        where: Name of the value, for the message.
        value: What was given.
        at_least: Smallest allowed value.
        at_most: Largest allowed value.
        or_none: Whether the message says that the caller takes None, too.

    Raises:
        ConfigError: no whole number, or one out of range.
    """
    is_whole = not isinstance(value, bool) and isinstance(value, Integral)
    if not (is_whole and _is_between(operator.index(value), at_least, at_most)):
        raise ConfigError(f"Expected {where} to be {_whole_in_range(at_least, at_most, or_none)}, got {shown(value)}.")
    return operator.index(value)


def switch(where: str, value: Any) -> None:
    """Refuse what is neither True nor False."""
    if not isinstance(value, bool):
        raise ConfigError(f"Expected {where} to be True or False, got {shown(value)}.")


def text(where: str, value: Any) -> None:
    """Refuse what is no text, an empty one, or one that no terminal and no file shows as it is."""
    if not isinstance(value, str) or not value or not is_printable(value):
        raise ConfigError(f"Expected {where} to be a non-empty text without control characters, got {shown(value)}.")


def check_file_name(where: str, value: Any) -> None:
    """Refuse what is no text that can be a part of a file name: it would lead files of results to other folders."""
    text(where, value)
    if value.startswith(".") or len(value) > MAX_NAME or not value.isprintable() or any(c in value for c in "/\\:"):
        raise ConfigError(
            f"Expected {where} to be at most {MAX_NAME} characters that can be a part of a file name, without / \\ : "
            f"and no dot first, got {value[: 2 * MAX_NAME]!r}."
        )


def unique_names(where: str, value: Any) -> None:
    """Check a tuple of names, none of them twice; raises ConfigError."""
    parts = _parts(value)
    if not isinstance(value, tuple) or not all(isinstance(name, str) and name for name in parts):
        raise ConfigError(f"Expected {where} as a tuple of names, such as ('one', 'two'), got {value!r}.")
    if len(set(parts)) < len(parts):
        raise ConfigError(f"Expected each name once in {where}, got {value!r}.")


def pair(where: str, value: Any) -> None:
    """Refuse what is no tuple (x, y) of numbers > 0."""
    parts = _parts(value)
    if len(parts) != 2:
        raise ConfigError(f"Expected {where} to be (x, y), got {shown(value)}.")
    for index, part in enumerate(parts):
        number(f"{where}[{index}]", part, above=0.0)


def pairs(where: str, value: Any) -> None:
    """Refuse what is no tuple of tuples (x, y) of numbers > 0; it may be empty."""
    if not isinstance(value, tuple):
        raise ConfigError(f"Expected {where} to be a tuple of places (x, y), got {shown(value)}.")
    for index, part in enumerate(_parts(value)):
        pair(f"{where}[{index}]", part)


def as_tuples(value: Any) -> Any:
    """Return lists, the only sequences of TOML and JSON, as the tuples of configurations, and all else as it is."""
    return tuple(map(as_tuples, cast("list[Any]", value))) if isinstance(value, list) else value


def shares(where: str, value: Any) -> None:
    """Refuse what is no tuple of positive numbers that sum to 1."""
    parts = _parts(value)
    if not all(_is_number(part) and part > 0 for part in parts) or abs(sum(parts) - 1.0) >= 1e-9:
        raise ConfigError(f"Expected {where} to be positive shares that sum to 1, got {shown(value)}.")


def several(where: str, value: Any, what: str) -> None:
    """Refuse what is no tuple, or an empty one; `what` names its members, for the message."""
    if not _parts(value):
        raise ConfigError(f"Expected {where} to be one or more {what}, got {shown(value)}.")


def one_of(where: str, value: Any, known: Iterable[str]) -> None:
    """Refuse a word that is not among `known`; the message has the nearest one."""
    words = tuple(known)
    if not isinstance(value, str) or value not in words:
        hint = suggestion(str(value).lower(), words)
        raise ConfigError(f"Expected {where} to be one of {', '.join(words)}, got {shown(value)}.{hint}")


def instance(where: str, value: Any, kind: type, *, hint: str = "") -> None:
    """Refuse what is no instance of `kind`; `hint` follows what was given and says what to do."""
    if not isinstance(value, kind):
        article = "an" if kind.__name__[0] in "AEIOU" else "a"
        raise ConfigError(f"Expected {where} to be {article} {kind.__name__}, got {shown(value)}{hint}.")


def table(where: str, value: Any) -> Mapping[str, Any]:
    """Return a mapping as it is; anything else is refused."""
    if not isinstance(value, Mapping):
        raise ConfigError(f"Expected {where} to be a table of values by name, got {shown(value)}.")
    return cast("Mapping[str, Any]", value)


def known_keys(mapping: Mapping[str, Any], known: Iterable[str], what: str = "key", *, prefix: str = "") -> None:
    """Refuse keys that are not among `known`.

    Args:
        mapping: Values by name.
        known: Names that there are.
        what: What a key is called, for the message.
        prefix: Where the mapping is, such as "arena."; put before the key.

    Raises:
        UnknownNameError: with the first unknown key and the nearest known one.
    """
    names = tuple(known)
    for key in mapping:
        if key not in names:
            raise UnknownNameError(f"Unknown {what} {f'{prefix}{key}'!r}.{suggestion(str(key), names)}")


def known_name(what: str, name: Any, known: Iterable[str], *, all_by: str = "") -> None:
    """Refuse a name that is not known; the message has the nearest one and lists all.

    Args:
        what: What it is a name of, for the message.
        name: The name.
        known: Names that there are.
        all_by: What shows all of them, where they are too many for a message: it then lists the nearest few.
    """
    names = tuple(known)
    if isinstance(name, str) and name in names:
        return
    others = f"Known: {', '.join(names)}."
    if all_by:
        near = nearest(str(name), names)
        others = (f"Near it: {', '.join(near)}. " if near[1:] else "") + f"All {len(names)}: {all_by}."
    raise ConfigError(f"Unknown {what} {name!r}.{suggestion(str(name), names)} {others}")


def _is_number(value: Any) -> bool:
    # Compared, not asked with math.isfinite, which fails for whole numbers too large for a float.
    return isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max


def _is_between(value: int, at_least: int | None, at_most: int | None) -> bool:
    return (at_least is None or value >= at_least) and (at_most is None or value <= at_most)


def _parts(value: Any) -> tuple[Any, ...]:
    """Return the members of a tuple; nothing else has any."""
    return cast("tuple[Any, ...]", value) if isinstance(value, tuple) else ()


def _conversion_hint(value: Any, kind: type, converter: str) -> str:
    is_foreign = isinstance(value, kind) and not isinstance(value, int | float)
    return f"; convert it with {converter}()" if is_foreign else ""


def _number_in_range(low: float, high: float, is_low_open: bool, is_high_open: bool) -> str:
    has_low, has_high = low > -math.inf, high < math.inf
    if has_low and has_high:
        return f"a number in {'(' if is_low_open else '['}{low:g}, {high:g}{')' if is_high_open else ']'}"
    if has_low:
        return f"a finite number {'>' if is_low_open else '>='} {low:g}"
    if has_high:
        return f"a finite number {'<' if is_high_open else '<='} {high:g}"
    return "a finite number"


def _whole_in_range(at_least: int | None, at_most: int | None, or_none: bool) -> str:
    wanted = "a whole number"
    if at_least is not None and at_most is not None:
        wanted += f" from {at_least:,} to {at_most:,}"
    elif at_least is not None:
        wanted += f" >= {at_least}"
    elif at_most is not None:
        wanted += f" <= {at_most}"
    return f"{wanted} or None" if or_none else wanted
