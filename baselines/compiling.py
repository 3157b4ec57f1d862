"""How the controllers' functions are compiled, and when what was compiled before is out of date."""

import hashlib
from collections.abc import Callable
from pathlib import Path
from typing import Any, TypeAlias, TypeVar, cast

from numba import njit
from numba.core.caching import FunctionCache

from swarm_forage_env import types

Row: TypeAlias = Any
"""One row of an array inside a kernel, such as the observation of one robot, (D,) float32."""

F = TypeVar("F", bound=Callable[..., Any])

# Without numba's memory runtime an allocation is a compile error, and rows of arrays that are handed around are not
# reference-counted, which halves the time of these functions.
_OPTIONS: dict[str, Any] = {"_nrt": False}

_FROM_ENVIRONMENT = ("codes", "compiling", "detection", "layout")
"""Modules of `swarm_forage_env` whose functions and constants are compiled into controllers."""


def _digest_of_sources() -> bytes:
    """Digest of every source from which something may be compiled into a controller."""
    environment = Path(types.__file__).parent
    files = [*sorted(Path(__file__).parent.glob("*.py")), *(environment / f"{name}.py" for name in _FROM_ENVIRONMENT)]
    return hashlib.sha256(b"".join(file.read_bytes() for file in files)).digest()


_SOURCES = _digest_of_sources()


def kernel(function: F) -> F:
    """Compile a function that allocates nothing; the result is cached on disk until one of our sources changes."""
    compiled = njit(cache=True, **_OPTIONS)(function)
    cache = getattr(compiled, "_cache", None)
    if isinstance(cache, FunctionCache):  # there is none with the compiler switched off
        # By itself numba watches only the file of the function, and would keep what it has compiled into it from
        # others. It offers no public way to watch more.
        cache_file = cache._cache_file
        cache_file._source_stamp = (cache_file._source_stamp, _SOURCES)
    return cast(F, compiled)


def inline_kernel(function: F) -> F:
    """Compile a function into each of its callers; it may take other compiled functions as arguments."""
    return cast(F, njit(inline="always", **_OPTIONS)(function))
