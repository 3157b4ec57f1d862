"""Environment signals: waveforms, the scaling c_t of the ideal performance, and distance from ideal conditions."""

import math
from typing import Literal, TypeAlias

import numpy as np
from numpy.typing import ArrayLike

from .checks import CurveError, check_option
from .curves import FloatArray, as_curve, as_waveforms
from .distance import dtw

WaveformKind: TypeAlias = Literal["constant", "sine", "square", "sawtooth"]
ScalingModel: TypeAlias = Literal["paper", "linear", "reciprocal"]


def waveform(
    kind: WaveformKind,
    ticks: ArrayLike,
    *,
    frequency: float = 0.0,
    amplitude: float = 0.0,
    offset: float = 0.0,
    phase: float = 0.0,
) -> FloatArray:
    """Signal of the environment at the given ticks, for example the throttle V(t) as a fraction of speed lost.

        constant    a                                       (offset, frequency and phase are not used)
        sine        a sin(2 pi f t + phase) + o
        square      a sgn(sin(2 pi f t + phase)) + o        sgn(0) = +1
        sawtooth    2 a (f t - floor(f t + 1/2) + phase) + o

    The study's sweeps set o = a, so a signal runs from 0 to 2a, and the paper's throttling "levels" are half the peak.
    A square wave with f = 1 / (2 s) makes a step at tick s: down with phase 0 and o = 0, up with phase pi and o = a.

    At multiples of half the period, the sign of a square wave depends on rounding: sin(2 pi) comes out slightly
    negative. Here and in the environment, the formula is evaluated as written.

    Args:
        kind: Name of the signal, in lower or upper case.
        ticks: Times t in ticks, any shape; the study samples at interval ends 1000, 2000, ..., 50000.
        frequency: f >= 0 in cycles per tick.
        amplitude: a, in the unit of the signal.
        offset: o, in the unit of the signal.
        phase: In radians; for the sawtooth in cycles.

    Returns:
        V(t), shape of `ticks`.

    Raises:
        ValueError: Unknown kind, or a parameter that is not finite, or f < 0.
    """
    kind_name = kind.lower()
    check_option("kind", kind_name, WaveformKind)
    if frequency < 0.0 or not all(map(math.isfinite, (frequency, amplitude, offset, phase))):
        raise ValueError(
            "Expected finite numbers and frequency >= 0 cycles per tick, got "
            f"frequency={frequency}, amplitude={amplitude}, offset={offset}, phase={phase}."
        )
    cycles = np.asarray(ticks, dtype=np.float64) / _period(frequency)
    if kind_name == "constant":
        return np.full_like(cycles, amplitude)[()]
    if kind_name == "sawtooth":
        return 2.0 * amplitude * (cycles - np.floor(cycles + 0.5) + phase) + offset
    sine = np.sin(2.0 * math.pi * cycles + phase)
    if kind_name == "square":
        sine = np.where(sine >= 0.0, 1.0, -1.0)
    return (amplitude * sine + offset)[()]


def _period(frequency: float) -> float:
    """Period in ticks, whole where the frequency is the reciprocal of a whole number.

    The environment divides by the period. Multiplying ticks by the frequency, or rounding the period twice, would give
    results on the other side of some half periods, where a square wave has the other sign.
    """
    if frequency == 0.0:
        return math.inf
    period = 1.0 / frequency
    return float(round(period)) if math.isclose(period, round(period), rel_tol=1e-12) else period


def environment_scaling(v: ArrayLike, i_ec: ArrayLike, *, model: ScalingModel = "linear") -> FloatArray:
    """Factor c_t by which the performance of a perfectly reactive swarm changes, Eqs. (5) and (6).

        linear        c_t = 1 - (V - I_ec)        throttles: fractions of speed lost
        reciprocal    c_t = I_ec / V              penalties: ticks lost
        paper         c_t = V / I_ec              as printed, (V_dev + I_ec) / I_ec with V_dev = V - I_ec

    The printed form is the reciprocal of what the paper means: under adverse conditions (V above I_ec), c_t is above 1,
    so the best swarm would improve when conditions get worse. For I_ec = 0, as in the paper's own example, the printed
    form is undefined. The authors' program uses the other two. For throttles, (1 - V) / (1 - I_ec) would be physically
    proportional; `linear` equals it only for I_ec = 0.

    Args:
        v: Applied conditions V(t), shape (..., T) or one number.
        i_ec: Ideal conditions I_ec(t), broadcasting with v.
        model: Which of the three. `linear` gives negative factors for V - I_ec > 1.

    Returns:
        c_t, shape of the broadcast inputs.

    Raises:
        CurveError: A signal is missing, empty or infinite, they do not broadcast, or the model divides by zero.
        ValueError: Unknown model.
    """
    check_option("model", model, ScalingModel)
    scalars = np.ndim(v) == np.ndim(i_ec) == 0
    v, i_ec = as_curve("v", v, signed=True), as_curve("i_ec", i_ec, signed=True)
    try:
        np.broadcast_shapes(v.shape, i_ec.shape)
    except ValueError as error:
        raise CurveError(f"Expected v and i_ec on the same intervals, got {v.shape} and {i_ec.shape}.") from error
    if model == "linear":
        scaling = 1.0 - (v - i_ec)
    else:
        name, above, below = ("v", i_ec, v) if model == "reciprocal" else ("i_ec", v, i_ec)
        if (below == 0.0).any():
            raise CurveError(f"Expected {name} != 0, by which model={model!r} divides; use model='linear'.")
        scaling = above / below
    return scaling[0] if scalars else scaling


def environment_distance(v: ArrayLike, i_ec: ArrayLike) -> float:
    """Distance of the applied from the ideal conditions, DTW(I_ec, V): the x axis of the flexibility figures.

    The authors round this distance to 4 decimals, and leave the ideal experiment, at 0, out of their figures. For a
    constant I_ec, the distance is sum_t |V(t) - I_ec|.

    Args:
        v: Applied conditions V(t) at the recording instants, shape (T,); all of V, not its deviation.
        i_ec: Ideal conditions I_ec(t), shape (T,) or one number.

    Raises:
        CurveError: The signals are missing, infinite, of different length, or not one signal each.
    """
    v, i_ec = as_waveforms(as_curve("v", v, signed=True), v=v, i_ec=i_ec)
    if v.ndim != 1 or i_ec.ndim != 1:
        raise CurveError(f"Expected one signal each, shape (T,), got v {v.shape} and i_ec {i_ec.shape}.")
    return float(dtw(i_ec, v))
