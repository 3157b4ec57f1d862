"""The input of every measure: what a curve is, how it is checked, and how it is reduced to a number.

A *curve* is an array of shape (..., T): the last axis is the recording interval, the axes before it (normally one axis
of runs) broadcast against each other. A single number is a curve of one interval. NaN marks a run that cannot be
scored: the result of that run is NaN, and the other runs are not affected. Infinite values are refused, because a count
per interval is finite and a distance between infinite curves has no meaning.
"""

from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from .checks import CurveError, check_option

FloatArray: TypeAlias = NDArray[np.float64]

Variant: TypeAlias = Literal["paper", "corrected"]
"""`paper`: as printed; `corrected`: with the printing errors corrected."""
Form: TypeAlias = Literal["marginal", "interactive"]
"""With what a swarm size is compared: the next smaller size, or N robots that each work alone."""
Reduction: TypeAlias = Literal["sum", "mean", "last", "total"]
"""How intervals become one number: sum, mean or last value of the measure, or the measure of the summed curves."""

FRACTION_TOLERANCE = 1e-9
"""A mean of fractions may exceed 1 by this much, from rounding."""


def as_curve(name: str, values: ArrayLike | None, *, signed: bool = False) -> FloatArray:
    """Return `values` as a float64 curve of shape (..., T), T >= 1; a number becomes shape (1,).

    Args:
        name: Word for the curve in error messages.
        values: Array-like of numbers; NaN is allowed.
        signed: Whether negative values make sense (waveforms, general curves) or not (performance, counts).

    Raises:
        CurveError: `values` is None, not numeric, empty, infinite, or negative where it may not be.
    """
    if values is None:
        raise CurveError(f"Expected {name}, got None; record the missing reference runs and pass their curve.")
    try:
        curve = np.atleast_1d(np.asarray(values, dtype=np.float64))
    except (TypeError, ValueError) as error:
        raise CurveError(f"Expected {name} as numbers of shape (..., T), got {values!r:.80}; {error}.") from error
    if curve.size == 0:
        raise CurveError(f"Expected {name} with at least one run and one interval, got shape {curve.shape}.")
    if np.isinf(curve).any():
        raise CurveError(f"Expected finite {name}, got infinity; where it is an inverse 1/x, let 1/0 be 0.")
    if not signed and (curve < 0.0).any():
        raise CurveError(f"Expected {name} >= 0, got {np.nanmin(curve)}; pass counts or rates, larger being better.")
    return curve


def as_curves(*, signed: bool = False, **curves: ArrayLike | None) -> tuple[FloatArray, ...]:
    """Return the named curves as float64 arrays that share T and broadcast on their leading axes.

    Raises:
        CurveError: One of them is no curve (see `as_curve`), or they differ in T or do not broadcast.
    """
    arrays = {name: as_curve(name, values, signed=signed) for name, values in curves.items()}
    if len({array.shape[-1] for array in arrays.values()}) > 1:
        shapes = ", ".join(f"{name} {array.shape}" for name, array in arrays.items())
        raise CurveError(f"Expected curves with equally many intervals T on the last axis, got {shapes}.")
    check_broadcast(*arrays.values())
    return tuple(arrays.values())


def as_interference(**fractions: ArrayLike | None) -> tuple[FloatArray, ...]:
    """Return the named curves of interference fractions, checked to lie in [0, 1].

    Raises:
        CurveError: As `as_curves`, or a value beyond 1.
    """
    arrays = as_curves(signed=False, **fractions)
    for name, array in zip(fractions, arrays, strict=True):
        if (array > 1.0 + FRACTION_TOLERANCE).any():
            raise CurveError(
                f"Expected {name} as a fraction of the robots in [0, 1], got {np.nanmax(array)}; "
                "divide numbers of robots by the swarm size with t_lost_fraction."
            )
    return arrays


def as_waveforms(*curves: FloatArray, **waveforms: ArrayLike | None) -> tuple[FloatArray, ...]:
    """Return the named environment signals with as many samples as the curves; a number stands for a constant signal.

    Raises:
        CurveError: A signal is missing, infinite or of another length, or does not broadcast with the curves.
    """
    n_intervals = curves[0].shape[-1]
    arrays: list[FloatArray] = []
    for name, values in waveforms.items():
        wave = as_curve(name, values, signed=True)
        if np.ndim(values) == 0:  # pyright: ignore[reportArgumentType]  (None was refused above)
            wave = np.full(n_intervals, wave[0])
        if wave.shape[-1] != n_intervals:
            raise CurveError(f"Expected {name} with one sample per interval, T = {n_intervals}, got {wave.shape}.")
        arrays.append(wave)
    check_broadcast(*curves, *arrays)
    return tuple(arrays)


def check_broadcast(*arrays: FloatArray) -> None:
    """Check that the axes before the last broadcast; CurveError if they do not."""
    try:
        np.broadcast_shapes(*(array.shape[:-1] for array in arrays))
    except ValueError as error:
        shapes = ", ".join(str(array.shape) for array in arrays)
        raise CurveError(f"Expected run axes that broadcast, got {shapes}; pair runs one to one or average.") from error


def reduce_intervals(theta: FloatArray, reduce: Reduction, *inputs: FloatArray) -> FloatArray:
    """Reduce a measure theta(t), shape (..., T), over its intervals to shape (...,).

    `total`, the measure of the summed curves, is the same number as `sum` for measures that are linear in their curves.
    All other measures sum their curves before this call and pass `last`. A run with a NaN anywhere in `inputs` gives
    NaN, also under `last`.
    """
    check_option("reduce", reduce, Reduction)
    if reduce == "last":
        value = theta[..., -1]
    else:
        value = theta.mean(axis=-1) if reduce == "mean" else theta.sum(axis=-1)
    for curve in inputs:
        value = np.where(np.isnan(curve).any(axis=-1), np.nan, value)
    return value[()]


def per_performance(value: FloatArray, perf: FloatArray, reduce: Reduction = "sum") -> FloatArray:
    """Return a measure relative to a performance: value / the likewise reduced `perf`; NaN or +-inf where that is 0.

    Amounts and distances grow with performance, so a swarm that does little scores well without doing anything well.
    Divided by the performance that they are compared with, they are shares of it (our addition, not in the paper).
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return value / reduce_intervals(perf, reduce, perf)
