"""From the curves of a study to scores of all measures that they allow."""

from collections.abc import Sequence
from dataclasses import replace

from .by_adversity import BY_ADVERSITY
from .by_size import BY_SIZE
from .draft import Uncomputable
from .measures import check_measures
from .studies import StudyCurves
from .table import Score

_IN_PROPORTION = (
    "efficiency",
    "performance_lost",
    "spatial_emergence",
    "task_emergence",
    "scalability",
    "population_robustness",
)
"""Measures that compare with performance in proportion to the robots."""
_NO_SUM = "this performance is no sum over robots, and the measure compares with growth in proportion to them"

_SCORES = BY_SIZE | BY_ADVERSITY
"""Measure -> what computes its scores."""


def score_study(study: StudyCurves, measures: Sequence[str] | None = None) -> tuple[tuple[Score, ...], dict[str, str]]:
    """Compute the scores of all measures that the curves of a study allow.

    Args:
        study: Curves of one policy.
        measures: Names out of `MEASURE_CRITERIA`; default all.

    Returns:
        The scores, and for each measure that could not be computed the reason.

    Raises:
        CurveError: an unknown measure, or curves that a measure refuses.
    """
    scores: list[Score] = []
    missing: dict[str, str] = {}
    for measure in check_measures(measures):
        try:
            found = list(_SCORES[measure](measure, study))
        except Uncomputable as reason:
            missing[measure] = str(reason)
            continue
        if not study.adds_up and measure in _IN_PROPORTION:
            found = [replace(score, note="; ".join(filter(None, (score.note, _NO_SUM)))) for score in found]
        scores += found
    return tuple(scores), missing
