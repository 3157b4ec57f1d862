"""A performance of one's own: another column of a table of curves, or a function of the record of a run."""

import difflib
from collections.abc import Callable
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from swarm_forage_env.scenarios.performance import INVERTED, Performance

from ..checks import CurveError
from ..curves import FloatArray
from .columns import CURVE_COLUMNS

if TYPE_CHECKING:
    import polars as pl

RUN_KEYS = ("controller", "criterion", "criterion_value", "n_robots", "seed")
"""Columns that tell the runs of a table apart, where it has them."""

PerformanceLike: TypeAlias = str | Performance | Callable[[Any], ArrayLike]
"""A recorded column by name ("n_carrying", "1/interference_fraction"), or a function as in `Performance`."""


def own_performance(given: PerformanceLike | None) -> Performance | None:
    """Return what was given as a `Performance` if it is a function; None if it is a name or nothing.

    Raises:
        CurveError: it is none of these.
    """
    if given is None or isinstance(given, str):
        return None
    if isinstance(given, Performance):
        return given
    if not callable(given):
        raise CurveError(
            f"Expected performance to be the name of a recorded column, or a function of a record, got {given!r}."
        )
    return Performance(getattr(given, "__name__", type(given).__name__), function=given)


def own_curve(performance: Performance, frame: "pl.DataFrame", where: str) -> FloatArray:
    """Return the performance of one run by its function, (T,).

    Args:
        performance: One with a function.
        frame: Record of the run.
        where: Name of the run in error messages.

    Raises:
        CurveError: the function returns something else than (T,) finite numbers >= 0.
    """
    assert performance.function is not None, "others are columns"
    return checked_performance(performance.function(frame), performance.name, len(frame), where)


def checked_performance(values: ArrayLike, name: str, n_intervals: int, where: str) -> FloatArray:
    """Return a performance as numbers, (T,) float64.

    Args:
        values: What was computed or recorded.
        name: Name of the performance.
        n_intervals: How many intervals T the run has.
        where: Name of the run in error messages.

    Raises:
        CurveError: no numbers, not T of them, or NaN, infinite or negative ones; the message has the first interval.
    """
    try:
        curve = np.asarray(values, dtype=np.float64)
    except (TypeError, ValueError) as error:
        raise CurveError(f"Expected performance {name} of {where} as numbers, got {values!r:.80}; {error}.") from error
    if curve.shape != (n_intervals,):
        raise CurveError(
            f"Expected performance {name} of {where} with one number per interval, shape ({n_intervals},), got shape "
            f"{curve.shape}."
        )
    wrong = np.flatnonzero(~(np.isfinite(curve) & (curve >= 0.0)))
    if len(wrong):
        raise CurveError(
            f"Expected performance {name} of {where} as finite numbers >= 0, got {curve[wrong[0]]} in interval "
            f"{wrong[0]}; let 1/0 be 0, and shift or turn round what can be negative."
        )
    return curve


def with_performance(
    frame: "pl.DataFrame", given: PerformanceLike, where: str
) -> tuple["pl.DataFrame", dict[str, Any]]:
    """Replace the column `performance` of a table of curves.

    Args:
        frame: One row per interval and run.
        given: A column of the table, "1/" and a column, or a function of the rows of one run in the order of intervals.
        where: Name of the table in error messages.

    Returns:
        The table with its rows in the same order; `amount`, `is_total` and `adds_up` of its studies (`StudyCurves`).

    Raises:
        CurveError: there is no such column, or no such numbers.
    """
    import polars as pl

    own = own_performance(given)
    if own is None:
        assert isinstance(given, str), "own_performance returns None for names only"
        curve, told = _column(frame, given, where)
        return frame.with_columns(pl.Series("performance", curve)), told
    keys = [name for name in RUN_KEYS if name in frame.columns]
    ordered = frame.with_row_index(_ROW).sort("interval") if "interval" in frame.columns else frame.with_row_index(_ROW)
    parts = ordered.partition_by(keys, maintain_order=True) if keys else [ordered]
    runs = [
        part.with_columns(pl.Series("performance", own_curve(own, part.drop(_ROW), _run(part, keys, where))))
        for part in parts
    ]
    told = {"amount": own.amount, "is_total": own.is_total, "adds_up": own.adds_up}
    return pl.concat(runs).sort(_ROW).drop(_ROW), told


_ROW = "row of the table"
"""Column for the order of rows; no table of curves has one of this name."""


def _run(part: "pl.DataFrame", keys: list[str], where: str) -> str:
    """Return the name of a run for error messages."""
    first = part.row(0, named=True)
    return f"{', '.join(f'{key} {first[key]}' for key in keys)} in {where}"


def _column(frame: "pl.DataFrame", name: str, where: str) -> tuple[FloatArray, dict[str, Any]]:
    import polars as pl

    own = name.removeprefix(INVERTED)
    if own not in frame.columns:
        close = difflib.get_close_matches(own, frame.columns, n=1)
        hint = f" Did you mean {close[0]!r}?" if close else ""
        raise CurveError(f"Expected a column {own} for performance in {where}, got {', '.join(frame.columns)}.{hint}")
    given = frame[own].cast(pl.Float64, strict=False)
    curve = given.fill_null(np.nan).to_numpy()
    if own != name:
        curve = np.divide(1.0, curve, out=np.zeros_like(curve), where=curve != 0.0)
    curve = checked_performance(curve, name, len(frame), where)
    known = CURVE_COLUMNS.get(name)
    amount = name if known is None or known.unit in ("", "1") else known.unit
    # Of a column of one's own nobody knows whether it is a total, or adds up; a share and an inverse do not.
    return curve, {
        "amount": amount,
        "is_total": False,
        "adds_up": own == name and (known is None or known.kind == "amount"),
    }
