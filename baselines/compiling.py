"""How the controllers' functions are compiled."""

from collections.abc import Callable
from typing import Any, TypeVar

from numba import njit

F = TypeVar("F", bound=Callable[..., Any])


def kernel(function: F) -> F:
    """Compile a function that allocates nothing.

    Without numba's memory runtime an allocation is a compile error, and views of arrays are not reference-counted,
    which halves the time of code that hands rows of arrays around.
    """
    return njit(cache=True, _nrt=False)(function)


def inline_kernel(function: F) -> F:
    """Compile a function into each of its callers; it may take other compiled functions as arguments."""
    return njit(inline="always", _nrt=False)(function)
