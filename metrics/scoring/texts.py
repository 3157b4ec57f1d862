"""Numbers and tables as texts for people, and as plain values for JSON."""

import math
from collections.abc import Sequence

from ..significance import ROUNDING
from ..statistics import Summary

_NO_AMOUNT = 1e-12
"""Smaller amounts are rounding errors and are shown as zero."""


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


def interval(summary: Summary) -> str:
    """Return the bounds of an interval."""
    return limits(summary.lower, summary.upper)


def limits(lower: float, upper: float) -> str:
    """Return two bounds; a dash where there are none."""
    return "-" if math.isnan(lower) else f"{number(lower)} to {number(upper)}"


def plain(value: float | None) -> float | None:
    """Return the value, or None where JSON has no such number."""
    return value if value is not None and math.isfinite(value) else None


def spread(summary: Summary, *, is_share: bool = False) -> str:
    """Return a mean with half of its interval, to two digits of the latter."""
    factor, unit = (100.0, " %") if is_share else (1.0, "")
    mean, half = factor * summary.mean, factor * (summary.upper - summary.mean)
    if not (math.isfinite(mean) and math.isfinite(half)):
        return number(mean) + (unit if math.isfinite(mean) else "")
    if half <= max(ROUNDING * abs(mean), _NO_AMOUNT):
        return f"{number(0.0 if abs(mean) <= _NO_AMOUNT else mean)} ± 0{unit}"
    decimals = max(0, 1 - math.floor(math.log10(half)))
    mean = round(mean, decimals) + 0.0  # no "-0"
    return f"{mean:.{decimals}f} ± {half:.{decimals}f}{unit}"


def bounds(summary: Summary | None) -> list[float | None] | None:
    """Return mean, lower and upper bound as plain values; None where there is no summary."""
    return None if summary is None else [plain(value) for value in (summary.mean, summary.lower, summary.upper)]
