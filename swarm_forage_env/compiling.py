"""How functions on arrays are compiled: one set of numba options for the whole project."""

from collections.abc import Callable
from typing import Any, TypeVar, cast

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])

# Without numba's memory runtime an allocation is a compile error, and arrays that are handed around, alone or as fields
# of a named tuple, are not reference-counted. That halves the time of functions that call others often.
_OPTIONS: dict[str, Any] = {"_nrt": False}


def kernel(function: F) -> F:
    """Compile a function that allocates nothing; the result is cached on disk."""
    return cast(F, njit(cache=True, **_OPTIONS)(function))


def inline_kernel(function: F) -> F:
    """Compile a function into each of its callers; it may take other compiled functions as arguments."""
    return cast(F, njit(inline="always", **_OPTIONS)(function))
