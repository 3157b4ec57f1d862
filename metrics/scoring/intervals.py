"""Means with their intervals as texts for people, and as plain values for JSON."""

import math

from swarm_forage_env._internal.wording import limits, number, plain

from ..significance import ROUNDING
from ..statistics import Summary

_NO_AMOUNT = 1e-12
"""Smaller amounts are rounding errors and are shown as zero."""


def interval(summary: Summary) -> str:
    """Return the bounds of an interval."""
    return limits(summary.lower, summary.upper)


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
