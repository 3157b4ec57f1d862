"""Text that comes from elsewhere, made fit to be shown: on any terminal, in one line of an error."""

import unicodedata
from typing import Any

_MOST_SHOWN = 200
"""Characters of a value that a message shows; our choice: two lines of a terminal."""
_UNSEEN = ("Cc", "Cf", "Cs")
"""Unicode categories of characters that steer a terminal, that nobody sees, or that no encoding has."""
_REFUSED = ("Cc", "Cs")
"""Those that no text may have. Others that nobody sees are part of ordinary words, such as U+200C in Persian."""
_TURNING = frozenset("\u061c\u200e\u200f\u202a\u202b\u202c\u202d\u202e\u2066\u2067\u2068\u2069")
"""Characters that steer the direction of writing, Bidi_Control of Unicode; those of `curves_table` of the metrics."""


def is_printable(text: str) -> bool:
    """Return whether a text is one line that shows as what it is: no control characters, no broken encoding."""
    return not any(unicodedata.category(character) in _REFUSED or character in _TURNING for character in text)


def printable(text: str) -> str:
    """Return a text with control characters, escape sequences among them, written as backslash escapes.

    Ends of lines stay, so that a text of several lines remains one.
    """
    return "".join(_escaped(character) for character in text)


def shown(value: Any) -> str:
    """Return the representation of a value for a message, cut where it is long."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # a whole number of thousands of digits; tables nested too deep
        return f"a value of type {type(value).__name__} that is too large to show"
    return text if len(text) <= _MOST_SHOWN else f"{text[:_MOST_SHOWN]}... ({len(text):,} characters)"


def _escaped(character: str) -> str:
    if character == "\n" or unicodedata.category(character) not in _UNSEEN:
        return character
    return character.encode("unicode_escape").decode("ascii")
