"""How the controllers' functions are compiled."""

from collections.abc import Callable
from typing import Any, TypeAlias, TypeVar, cast

from numba import njit

Row: TypeAlias = Any
"""One row of an array inside a kernel, such as the observation of one robot, (D,) float32."""

F = TypeVar("F", bound=Callable[..., Any])

# Without numba's memory runtime an allocation is a compile error, and rows of arrays that are handed around are not
# reference-counted, which halves the time of these functions.
_OPTIONS: dict[str, Any] = {"_nrt": False}


def kernel(function: F) -> F:
    """Compile a function that allocates nothing; the result is cached on disk."""
    return cast(F, njit(cache=True, **_OPTIONS)(function))


def inline_kernel(function: F) -> F:
    """Compile a function into each of its callers; it may take other compiled functions as arguments."""
    return cast(F, njit(inline="always", **_OPTIONS)(function))
