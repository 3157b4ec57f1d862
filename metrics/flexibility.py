"""Flexibility and robustness to noise: does performance follow the conditions, or stay the same? Eqs. (5) to (8).

Robustness to a changing population is in `population`.
"""

from numpy.typing import ArrayLike

from .curves import FloatArray, as_curves, as_waveforms, per_performance, reduce_intervals
from .distance import dtw
from .environment import ScalingModel, environment_scaling


def reactivity(
    perf_ideal: ArrayLike,
    perf: ArrayLike,
    v: ArrayLike,
    i_ec: ArrayLike,
    *,
    model: ScalingModel = "linear",
    relative: bool = False,
) -> FloatArray:
    """Reactivity R(N), Eqs. (5) and (6): distance from a swarm whose performance changes just as the environment does.

        P_R*(t) = c_t P_ideal(t)        R = DTW( P_R*, P )

    Lower is better. Reactivity and adaptability exclude each other: a perfectly reactive swarm is not adaptable. If
    conditions are ideal (V = I_ec), the two are equal. Report `noise_floor`, too.

    Args:
        perf_ideal: Performance under ideal conditions, same swarm size and controller, shape (..., T), objects per
            interval.
        perf: Performance P(N, t) under the applied conditions, same intervals.
        v: Applied conditions V(t) at the same instants, shape (..., T) or one number.
        i_ec: Ideal conditions I_ec(t), likewise.
        model: How c_t is computed, see `environment_scaling`; the equation as printed needs model="paper".
        relative: Divide by the summed P_ideal, see `metrics.curves.per_performance`.

    Returns:
        R >= 0, shape (...,), in the unit of `perf`; a pure number if relative.

    Raises:
        CurveError: Curves or signals are missing, negative (performance only), infinite, of different length or for
            different numbers of runs, or the model divides by zero.
        ValueError: Unknown option.
    """
    perf_ideal, perf = as_curves(perf_ideal=perf_ideal, perf=perf)
    v, i_ec = as_waveforms(perf_ideal, perf, v=v, i_ec=i_ec)
    distance = dtw(environment_scaling(v, i_ec, model=model) * perf_ideal, perf)
    return per_performance(distance, perf_ideal) if relative else distance


def adaptability(perf_ideal: ArrayLike, perf: ArrayLike, *, relative: bool = False) -> FloatArray:
    """Adaptability A(N), Eq. (7): distance from a swarm whose performance does not change at all.

        P_A*(t) = P_ideal(t)        A = DTW( P_A*, P )

    Lower is better. Report `noise_floor`, too.

    Args:
        perf_ideal: Performance under ideal conditions, same swarm size and controller, shape (..., T), objects per
            interval.
        perf: Performance P(N, t) under the applied conditions, same intervals.
        relative: As in `reactivity`.

    Returns:
        A >= 0, shape (...,), in the unit of `perf`; a pure number if relative.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length.
    """
    perf_ideal, perf = as_curves(perf_ideal=perf_ideal, perf=perf)
    distance = dtw(perf_ideal, perf)
    return per_performance(distance, perf_ideal) if relative else distance


def noise_robustness(perf_ideal: ArrayLike, perf: ArrayLike, *, relative: bool = False) -> FloatArray:
    """Sensor and actuator noise robustness B_sa = DTW( P_ideal, P ), Eq. (8). Lower is better.

    A distance has no sign: a swarm that delivers more under noise scores badly, too. Report `mean_signed_difference`
    and `noise_floor` as well. The x axis of the paper's figures is the standard deviation of the noise; it starts at 0,
    where P = P_ideal.

    Args:
        perf_ideal: Performance without noise, shape (..., T), objects per interval.
        perf: Performance P(N, t) with noise, same intervals.
        relative: As in `reactivity`.

    Returns:
        B_sa >= 0, shape (...,), in the unit of `perf`; a pure number if relative.

    Raises:
        CurveError: As in `adaptability`.
    """
    return adaptability(perf_ideal, perf, relative=relative)


def mean_signed_difference(perf_ideal: ArrayLike, perf: ArrayLike) -> FloatArray:
    """Mean over intervals of P(N, t) - P_ideal(t), shape (...,): positive if the disturbed swarm delivers more.

    Args:
        perf_ideal: Performance without the disturbance, shape (..., T), objects per interval.
        perf: Performance with it, same intervals.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length.
    """
    perf_ideal, perf = as_curves(perf_ideal=perf_ideal, perf=perf)
    return reduce_intervals(perf - perf_ideal, "mean", perf_ideal, perf)
