"""Which measures can be scored, what has to be varied for each, and their order in tables."""

import difflib
from collections.abc import Sequence

from metrics.checks import CurveError

from .columns import HANDLING, NOISE, POPULATION, SIZE, THROTTLE

MEASURE_CRITERIA: dict[str, str] = {
    "raw_performance": SIZE,
    "efficiency": SIZE,
    "t_lost_fraction": SIZE,
    "performance_lost": SIZE,
    "spatial_emergence": SIZE,
    "task_emergence": SIZE,
    "scalability": SIZE,
    "reactivity": THROTTLE,
    "adaptability": THROTTLE,
    "noise_robustness": NOISE,
    "population_robustness": POPULATION,
    "availability": POPULATION,
}
"""Measure -> what has to be varied for it. The order is that of score tables."""
DISTURBANCES = (THROTTLE, HANDLING)
"""Kinds of disturbance over time, the paper's two, under which reactivity and adaptability can be scored."""


def criteria_of(measures: Sequence[str], disturbance: str) -> set[str]:
    """Return what has to be varied for some measures, with one of `DISTURBANCES` in place of the throttle.

    Raises:
        CurveError: an unknown kind of disturbance.
    """
    if disturbance not in DISTURBANCES:
        raise CurveError(f"Expected disturbance to be one of {', '.join(DISTURBANCES)}, got {disturbance!r}.")
    criteria = (MEASURE_CRITERIA[name] for name in measures)
    return {disturbance if criterion == THROTTLE else criterion for criterion in criteria}


def check_measures(measures: Sequence[str] | None) -> tuple[str, ...]:
    """Return measures in the order of tables, each once; None = all.

    Raises:
        CurveError: an unknown name, or none at all.
    """
    if measures is None:
        return tuple(MEASURE_CRITERIA)
    for name in measures:
        if name not in MEASURE_CRITERIA:
            close = difflib.get_close_matches(name, MEASURE_CRITERIA, n=1)
            hint = f" Did you mean {close[0]!r}?" if close else ""
            raise CurveError(f"Unknown measure {name!r}.{hint} Known: {', '.join(MEASURE_CRITERIA)}.")
    if not measures:
        raise CurveError(f"Expected one or more measures of {', '.join(MEASURE_CRITERIA)}, got none.")
    return tuple(name for name in MEASURE_CRITERIA if name in measures)
