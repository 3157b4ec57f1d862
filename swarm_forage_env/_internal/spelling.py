"""The known name nearest to a mistyped one, for error messages."""

import difflib
from collections.abc import Iterable

MOST_NEAR = 4
"""Names that a message lists where there are too many to list all."""

_NEAR = 0.5
"""Likeness of such names; less than is asked of one that is meant (our choice)."""


def nearest(name: str, known: Iterable[str]) -> list[str]:
    """Return the few known names that are most like a mistyped one, the nearest first."""
    return difflib.get_close_matches(name, list(known), n=MOST_NEAR, cutoff=_NEAR)


def suggestion(name: str, known: Iterable[str]) -> str:
    """Return " Did you mean ...?" with the nearest known name, or an empty string."""
    close = difflib.get_close_matches(name, list(known), n=1)
    return f" Did you mean {close[0]!r}?" if close else ""
