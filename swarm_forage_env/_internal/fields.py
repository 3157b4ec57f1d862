"""Values of configurations: types with bounds, declared once, that constructors and the reader of files check.

    @dataclass(frozen=True, kw_only=True, slots=True)
    class Part(Checked):
        called: ClassVar[str] = "part"
        name: Name
        shares: tuple[Share, ...] = ()

    Part(name="a", shares=(0.5, 1))                   # Part(name="a", shares=(0.5, 1.0))
    read(Part, {"name": "a", "shares": [2]}, "part")  # ConfigError: Expected part.shares[0] to be a number ..., got 2.

A value of another type is refused with the name that people know it by, and never guessed at; only a list becomes a
tuple, a whole number a float, a number of numpy one of Python, and a table a dataclass, where that is declared.
"""

import dataclasses
from collections.abc import Iterable, Mapping
from functools import cache
from types import NoneType, UnionType
from typing import Annotated, Any, ClassVar, Literal, TypeAlias, Union, cast, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from msgspec import Meta

from swarm_forage_env._internal.wording import nearest, shown, suggestion

MOST = 1e15
"""Largest number of a configuration, and 1 over it the smallest that has to be above 0; our choice. All that is
computed of such numbers, ticks and cells and squares, stays far from the ends of float and of 64-bit whole numbers."""
MOST_SEEDS = 100_000
"""Runs of one kind that a command or a study may ask for; our choice: five hundred times those of the paper."""
_UNSEEN = r"\x00-\x1f\x7f-\x9f\ud800-\udfff\u061c\u200e\u200f\u202a-\u202e\u2066-\u2069"
"""Characters that steer a terminal or the direction of writing, or that no encoding has."""

Number: TypeAlias = Annotated[float, Meta(ge=-MOST, le=MOST, description="a finite number")]
Positive: TypeAlias = Annotated[float, Meta(ge=1.0 / MOST, le=MOST, description="a finite number > 0")]
Amount: TypeAlias = Annotated[float, Meta(ge=0.0, le=MOST, description="a finite number >= 0")]
Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
Count: TypeAlias = Annotated[int, Meta(ge=0, le=int(MOST))]
Whole: TypeAlias = Annotated[int, Meta(ge=1, le=int(MOST))]
Name: TypeAlias = Annotated[
    str, Meta(pattern=rf"^[^{_UNSEEN}]+\Z", description="a non-empty text without control characters")
]
FileName: TypeAlias = Annotated[
    str,
    Meta(
        pattern=rf"^(?!\.)[^{_UNSEEN}/\\:\u200b-\u200f\u2028\u2029\u2060-\u206f\ufeff]{{1,60}}\Z",
        description="at most 60 characters that can be a part of a file name, without / \\ : and no dot first",
    ),
]
"""With four bytes a character, endings still fit into the 255 bytes of a name."""


_WORDS = {float: "a number", int: "a whole number", bool: "True or False", str: "a text"}
_SIGNS = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}


class ConfigError(ValueError):
    """A configuration that cannot describe a world; the message says what was expected and what came."""


class UnknownNameError(ConfigError, TypeError):
    """A name of a value that there is not; a TypeError, too, as Python's own of an unknown keyword argument."""


class Checked:
    """Base of frozen dataclasses whose values are checked, and converted, as their fields declare when one is made."""

    __slots__ = ()
    called: ClassVar[str] = ""
    """What people know it by; put before the names of its fields in messages."""

    def __post_init__(self) -> None:
        where = f"{self.called}." if self.called else ""
        for name, (kind, _) in _fields_of(type(self)).items():
            object.__setattr__(self, name, checked(where + name, getattr(self, name), kind))
        self.check()

    def check(self) -> None:
        """Refuse values that do not fit together; ConfigError."""


def checked(where: str, value: Any, kind: Any) -> Any:
    """Return a value as a declared type has it.

    Args:
        where: Name of the value, for the message.
        value: What was given.
        kind: A type with bounds, such as `Share`; one of several, `Literal` words, a tuple, a list or a mapping of such
            types; a dataclass; a type of our own, of which it must be an instance.

    Raises:
        ConfigError: it is of another type, or out of bounds.
    """
    bare, notes = _apart(kind)
    origin, parts = get_origin(bare), get_args(bare)
    if isinstance(value, np.generic):
        value = cast("Any", value.item())
    if bare is Any or (isinstance(bare, type) and bare not in _WORDS and origin is None):
        return _of_class(where, value, bare)
    if origin is Literal:
        one_of(where, value, parts)
        return value
    if origin in (Union, UnionType):
        return _one_of_kinds(where, value, parts)
    if origin is tuple:
        return _listed(where, value, parts, notes)
    if origin is list:
        return list(_listed(where, value, (*parts, Ellipsis), notes))
    if origin is not None:
        return {key: checked(f"{where}.{key}", item, parts[-1]) for key, item in table(where, value).items()}
    try:
        return msgspec.convert(value, kind)
    except msgspec.ValidationError:
        raise ConfigError(f"Expected {where} to be {_wanted(bare, notes)}, got {shown(value)}.") from None


def number(
    where: str,
    value: Any,
    *,
    at_least: float | None = None,
    above: float | None = None,
    at_most: float | None = None,
    below: float | None = None,
) -> float:
    """Return a number between bounds that only the caller knows; raises ConfigError otherwise."""
    low: dict[str, Any] = {"ge": -MOST if at_least is None else at_least} if above is None else {"gt": above}
    high: dict[str, Any] = {"le": MOST if at_most is None else at_most} if below is None else {"lt": below}
    return checked(where, value, Annotated[float, Meta(**low, **high)])


def whole(where: str, value: Any, *, at_least: int | None = None, at_most: int | None = None) -> int:
    """Return a whole number between bounds that only the caller knows; raises ConfigError otherwise."""
    return checked(where, value, Annotated[int, Meta(ge=at_least, le=int(MOST) if at_most is None else at_most)])


def read(kind: type, given: Any, where: str = "") -> Any:
    """Return a dataclass of the values of a table, as JSON and TOML have it.

    Args:
        kind: The dataclass.
        given: Its values by name; fields with a default may be missing.
        where: Name of the table, for messages.

    Raises:
        ConfigError: no table, an unknown name (with the nearest known one), a missing one, or a value that is refused.
    """
    own, prefix = _fields_of(kind), f"{where}." if where else ""
    values = table(where or f"a {kind.__name__}", given)
    known_keys(values, own, prefix=prefix)
    missing = [name for name, (_, is_needed) in own.items() if is_needed and name not in values]
    if missing:
        raise ConfigError(f"Missing key {prefix + missing[0]!r}.")
    return kind(**{name: checked(prefix + name, item, own[name][0]) for name, item in values.items()})


@cache
def _fields_of(kind: Any) -> Mapping[str, tuple[Any, bool]]:
    """Field of a dataclass -> its type, and whether it must be given."""
    hints, lacking = get_type_hints(kind, include_extras=True), dataclasses.MISSING
    return {
        item.name: (hints[item.name], item.default is lacking and item.default_factory is lacking)
        for item in dataclasses.fields(kind)
    }


def _of_class(where: str, value: Any, kind: Any) -> Any:
    if kind is Any or isinstance(value, kind):
        return value
    if dataclasses.is_dataclass(kind) and isinstance(value, Mapping):
        return read(cast("type", kind), value, where)
    raise _no_instance(where, value, kind)


def _one_of_kinds(where: str, value: Any, kinds: tuple[Any, ...]) -> Any:
    if value is None and NoneType in kinds:
        return None
    others = [kind for kind in kinds if kind is not NoneType]
    refusals: list[ConfigError] = []
    for kind in others:
        try:
            return checked(where, value, kind)
        except ConfigError as error:
            refusals.append(error)
            if dataclasses.is_dataclass(kind) and isinstance(value, Mapping):
                raise
    if len(refusals) == 1:
        raise refusals[0]
    wanted = " or ".join(_wanted(*_apart(kind)) for kind in others)
    raise ConfigError(f"Expected {where} to be {wanted}, got {shown(value)}.")


def _apart(kind: Any) -> tuple[Any, tuple[Any, ...]]:
    """Return a type without its notes, and the notes."""
    return (kind.__origin__, kind.__metadata__) if get_origin(kind) is Annotated else (kind, ())


def _listed(where: str, value: Any, parts: tuple[Any, ...], notes: tuple[Meta, ...]) -> tuple[Any, ...]:
    if not isinstance(value, list | tuple):
        raise ConfigError(f"Expected {where} to be a list, got {shown(value)}.")
    given = cast("list[Any] | tuple[Any, ...]", value)
    is_long = parts[-1] is Ellipsis
    least, most = len(parts), len(parts)
    if is_long:
        least = max([0, *(note.min_length for note in notes if note.min_length)])
        most = min([len(given), *(note.max_length for note in notes if note.max_length)])
    if not least <= len(given) <= most:
        wanted = (
            f"{least} entries" if least == most else f"at least {least}" if len(given) < least else f"at most {most}"
        )
        raise ConfigError(f"Expected {where} to have {wanted}, got {len(given)}: {shown(value)}.")
    kinds = parts[:1] * len(given) if is_long else parts
    return tuple(checked(f"{where}[{k}]", item, kind) for k, (kind, item) in enumerate(zip(kinds, given, strict=True)))


def _wanted(bare: Any, notes: Iterable[Meta]) -> str:
    """Return a declared type in words."""
    words = _WORDS.get(bare, f"a {bare.__name__}")
    for note in notes:
        if note.description:
            return note.description
        if note.ge is not None and note.le is not None and note.ge > -MOST and note.le < MOST:
            return f"{words} from {note.ge:,.15g} to {note.le:,.15g}"
        limits = [(sign, getattr(note, name)) for name, sign in _SIGNS.items()]
        words += " and".join(f" {sign} {at:,.15g}" for sign, at in limits if at is not None and abs(at) < MOST)
    return words


def one_of(where: str, value: Any, known: Iterable[str]) -> None:
    """Refuse a word that is not among `known`; the message has the nearest one."""
    words = tuple(known)
    if not isinstance(value, str) or value not in words:
        hint = suggestion(str(value).lower(), words)
        raise ConfigError(f"Expected {where} to be one of {', '.join(words)}, got {shown(value)}.{hint}")


def instance(where: str, value: Any, kind: type, *, hint: str = "") -> None:
    """Refuse what is no instance of `kind`; `hint` follows what was given and says what to do."""
    if not isinstance(value, kind):
        raise _no_instance(where, value, kind, hint)


def _no_instance(where: str, value: Any, kind: Any, hint: str = "") -> ConfigError:
    article = "an" if kind.__name__[0] in "AEIOU" else "a"
    return ConfigError(f"Expected {where} to be {article} {kind.__name__}, got {shown(value)}{hint}.")


def table(where: str, value: Any) -> Mapping[str, Any]:
    """Return a mapping as it is; anything else is refused."""
    if not isinstance(value, Mapping):
        raise ConfigError(f"Expected {where} to be a table of values by name, got {shown(value)}.")
    return cast("Mapping[str, Any]", value)


def known_keys(mapping: Iterable[str], known: Iterable[str], what: str = "key", *, prefix: str = "") -> None:
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
            raise UnknownNameError(f"Unknown {what} {f'{prefix}{key}'!r}.{suggestion(str(key), names, prefix=prefix)}")


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


def settings(what: str, text: str) -> dict[str, Any]:
    """Return the words of "key=value,key=value" by name. A dot names a key inside a table, "+" joins members of a list.

    Args:
        what: What is set, for the message.
        text: At least one such word.

    Raises:
        ConfigError: a word that is no key=value, or a key that comes twice.
    """
    mapping: dict[str, Any] = {}
    for setting in text.split(","):
        key, equals, value = (part.strip() for part in setting.partition("="))
        if not (key and equals and value):
            raise ConfigError(f"Expected {what} as key=value, got {setting!r} in {text!r}.")
        *parents, last = key.split(".")
        target = mapping
        for parent in parents:
            target = target.setdefault(parent, {})
        if not isinstance(target, dict) or last in target:
            raise ConfigError(f"Expected {key} once, and either as a value or as a table, got {text!r}.")
        target[last] = _plain_value(value)
    return mapping


def _plain_value(text: str) -> Any:
    """Read a word as a truth value, a number or a text; if it is no number and has a "+", as a list."""
    if text.lower() in ("true", "false"):
        return text.lower() == "true"
    for kind in (int, float):
        try:
            return kind(text)
        except ValueError:
            continue
    return [_plain_value(word) for word in text.split("+")] if "+" in text else text
