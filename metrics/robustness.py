"""Robustness to sensor and actuator noise, Eq. (8). Robustness to a changing population is in `population`."""

from numpy.typing import ArrayLike

from .curves import FloatArray, Variant, as_curves, per_performance, reduce_intervals
from .distance import curve_distance


def noise_robustness(
    perf_ideal: ArrayLike,
    perf: ArrayLike,
    *,
    variant: Variant = "corrected",
    clock: ArrayLike | None = None,
    relative: bool = False,
) -> FloatArray:
    """Sensor and actuator noise robustness B_sa = DTW( P_ideal, P ), Eq. (8). Lower is better.

    It has no sign: a swarm that does better under noise scores badly, too. Report `mean_signed_difference` and
    `noise_floor` beside it. The paper's x axis is the standard deviation of the noise, starting at 0 = P_ideal.

    Args:
        perf_ideal: Performance without noise, shape (..., T), objects per interval.
        perf: Performance P(N, t) with noise, same intervals.
        variant: Distance, as in `reactivity`.
        clock: For `sierra`, sample times as in `dtw`; the authors used sample numbers, the default.
        relative: Divide by the summed P_ideal, see `metrics.curves.per_performance`.

    Returns:
        B_sa >= 0, shape (...,), in the unit of `perf`; a pure number if relative.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length.
        ValueError: Unknown variant.
    """
    perf_ideal, perf = as_curves(perf_ideal=perf_ideal, perf=perf)
    distance = curve_distance(perf_ideal, perf, variant, clock)
    return per_performance(distance, perf_ideal) if relative else distance


def mean_signed_difference(perf_ideal: ArrayLike, perf: ArrayLike) -> FloatArray:
    """Mean over intervals of P(N, t) - P_ideal(t), shape (...,): positive if the swarm did better when disturbed.

    Args:
        perf_ideal: Performance without the disturbance, shape (..., T), objects per interval.
        perf: Performance with it, same intervals.

    Raises:
        CurveError: Curves are missing, negative, infinite or of different length.
    """
    perf_ideal, perf = as_curves(perf_ideal=perf_ideal, perf=perf)
    return reduce_intervals(perf - perf_ideal, "mean", perf_ideal, perf)
