"""Numbers and tables as texts for people, and as plain values for JSON."""

import math
from collections.abc import Sequence


def paragraph(lines: Sequence[str]) -> list[str]:
    """Return the lines with an empty one before them; nothing if there are none."""
    return ["", *lines] if lines else []


def aligned(rows: Sequence[Sequence[str]]) -> list[str]:
    """Return rows of texts as lines with columns under each other."""
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    return ["  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip() for row in rows]


def counted(count: int, noun: str) -> str:
    """Return a number with its noun, "1 run" or "2,000 runs"."""
    return f"{count:,} {noun}" + ("" if count == 1 else "s")


def number(value: float) -> str:
    """Return a number with about four digits; a dash where there is none."""
    if math.isnan(value):
        return "-"
    if math.isinf(value):
        return "inf" if value > 0 else "-inf"
    return f"{value:.0f}" if abs(value) >= 1000 else f"{value:.4g}"


def percent(value: float) -> str:
    """Return a share in percent; a dash where there is none."""
    return "-" if not math.isfinite(value) else f"{100.0 * value:.3g} %"


def limits(lower: float, upper: float) -> str:
    """Return two bounds; a dash where there are none."""
    return "-" if math.isnan(lower) else f"{number(lower)} to {number(upper)}"


def plain(value: float | None) -> float | None:
    """Return the value, or None where JSON has no such number."""
    return value if value is not None and math.isfinite(value) else None
