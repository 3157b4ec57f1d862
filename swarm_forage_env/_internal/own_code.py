"""Functions of users, compiled: what is wrong with one is told in one line, in its own words.

They are compiled anew in each process. What is kept on disk would be out of date as soon as anything is that they use,
and that may lie anywhere.
"""

import dis
import random
import re
from collections.abc import Callable, Iterator, Mapping
from types import CellType, CodeType, FunctionType, ModuleType
from typing import Any

import numpy as np

from swarm_forage_env._internal import numba_settings  # noqa: F401  (before numba)

# isort: split
from numba import njit, types

from swarm_forage_env._internal.compiling import is_compiled, type_of

_OPTIONS: dict[str, Any] = {"error_model": "python", "boundscheck": True}
"""As in Python, a division by zero raises, and so does an index out of range, which would read other memory."""
_ABOUT_THE_COMPILER = re.compile(r"Failed in |During: |Enable logging |\s*$")
"""How lines of numba's messages begin that say nothing about the function."""
_NO_FUNCTION = re.compile(r"No implementation of function .*? found for signature: (>>> )?(?P<call>.*?\))(?= |$).*")
_ONLY_FOR_EXPERTS = re.compile(r"( Return of: |: %).*|\. Raised from None$")
_PLACE = re.compile(r'^File ".*", line (?P<line>\d+):$', re.MULTILINE)

_GENERATORS = (random.Random, np.random.Generator, np.random.RandomState)


class OwnCodeError(ValueError):
    """A function of a user that cannot be compiled; the message is one line: what, and where."""


def own_kernel(function: Callable[..., Any], instead: Mapping[type, Any]) -> Any:
    """Return a function of a user to be compiled, with those that it calls by their names.

    Args:
        function: The function; it is not changed.
        instead: Class that the compiler does not know -> what stands for it.

    Returns:
        The compiled function; `function` itself where the compiler is switched off.
    """
    return _compiled(function, instead, {}) if is_compiled(njit(function)) else function


def _compiled(function: Any, instead: Mapping[type, Any], done: dict[Any, Any]) -> Any:
    if function not in done:
        names = dict(function.__globals__)
        copy = FunctionType(function.__code__, names, function.__name__, function.__defaults__, function.__closure__)
        done[function] = njit(**_OPTIONS)(copy)
        for name in function.__code__.co_names:
            value = names.get(name)
            if isinstance(value, FunctionType):
                names[name] = _compiled(value, instead, done)
            elif isinstance(value, type) and value in instead:
                names[name] = instead[value]
    return done[function]


def own_randomness(function: Any) -> str | None:
    """Return what a function, or one that it calls by name, draws from that no seed of a run reaches; None if nothing.

    These are Python's `random`, `numpy.random`, and generators under global names.
    """
    waiting, done = [function], set[Any]()
    while waiting:
        asked = waiting.pop()
        asked = getattr(asked, "py_func", asked)  # compiled by the user
        if not isinstance(asked, FunctionType) or asked in done:
            continue
        done.add(asked)
        for name, value, line in _named(asked):
            if value is random or value is np.random or isinstance(getattr(value, "__self__", value), _GENERATORS):
                return name + ("" if line is None else f" (line {line})")
            waiting.append(value)
    return None


def _named(function: FunctionType) -> Iterator[tuple[str, Any, int | None]]:
    """Yield what a function names from outside of it, also by way of modules: name, value and line."""
    cells = zip(function.__code__.co_freevars, function.__closure__ or (), strict=True)
    names = function.__globals__ | {name: cell.cell_contents for name, cell in cells if cell != CellType()}
    codes = [function.__code__]
    while codes:
        code = codes.pop()
        codes += [constant for constant in code.co_consts if isinstance(constant, CodeType)]
        said, value = "", None
        for step in dis.get_instructions(code):
            if step.opname in ("LOAD_GLOBAL", "LOAD_DEREF"):
                said, value = step.argval, names.get(step.argval)
            elif step.opname in ("LOAD_ATTR", "LOAD_METHOD") and isinstance(value, ModuleType):
                said, value = f"{said}.{step.argval}", getattr(value, step.argval, None)
            else:
                value = None
                continue
            yield said, value, step.positions.lineno if step.positions is not None else None


def type_of_result(function: Any, arguments: Mapping[str, Any]) -> Any:
    """Compile a function of `own_kernel` for arguments of these types.

    Args:
        function: The function.
        arguments: Name for people -> an argument.

    Returns:
        numba's type of what it returns.

    Raises:
        OwnCodeError: it cannot be compiled.
    """
    kinds = {name: type_of(argument) for name, argument in arguments.items()}
    try:
        function.compile(tuple(kinds.values()))
    except KeyError as error:  # what numba raises about records
        raise OwnCodeError(_unknown_field(error.args[0], function, kinds)) from error
    except Exception as error:  # numba has errors of many kinds
        raise OwnCodeError(_told(str(error) or type(error).__name__, kinds)) from error
    return function.overloads[tuple(kinds.values())].signature.return_type


def are_numbers(kind: Any, count: int) -> bool:
    """Return whether numba's type is that of a tuple of so many real numbers."""
    parts: Any = kind if isinstance(kind, types.BaseTuple) else ()
    return len(parts) == count and all(isinstance(part, types.Integer | types.Float | types.Boolean) for part in parts)


def told_of(kind: Any) -> str:
    """Return words for the type of a result."""
    if kind is types.none:
        return "nothing (None)"
    if isinstance(kind, types.Optional):
        return f"nothing (None) or {told_of(kind.type)}"
    if isinstance(kind, types.BaseTuple):
        parts: Any = kind
        return f"({', '.join(map(told_of, parts))})"
    return str(types.unliteral(kind))


def _unknown_field(name: str, function: Any, kinds: Mapping[str, Any]) -> str:
    """Return words about a field that a record does not have."""
    code = function.py_func.__code__
    people = dict(zip(code.co_varnames, kinds, strict=False))  # what the function calls its arguments -> their names
    asked, where = list(kinds), ""
    for step in dis.get_instructions(code):
        if step.argval == name:
            where = f" (line {step.positions.lineno})" if step.positions is not None else ""
            break
        if step.argval in people:  # what was named last has to have the field
            asked = [people[step.argval]]
    fields = {of: [*kinds[of].fields] for of in asked if isinstance(kinds[of], types.Record)}
    listed = "; ".join(f"{of} has {', '.join(names) or 'nothing'}" for of, names in fields.items())
    return f"{name!r}{where}, but {listed}"


def _told(message: str, kinds: Mapping[str, Any]) -> str:
    """Return the first thing that a message of the compiler says about the function, with the line."""
    place = _PLACE.search(message)
    said = message[: place.start()] if place else message
    for name, kind in kinds.items():
        said = said.replace(str(kind), name)
    lines = [line.strip() for line in said.splitlines() if not _ABOUT_THE_COMPILER.match(line)]
    text = _ONLY_FOR_EXPERTS.sub("", _NO_FUNCTION.sub(r"\g<call>, which it does not have", " ".join(lines)))
    return text.rstrip(". ") + (f" (line {place['line']})" if place else "")
