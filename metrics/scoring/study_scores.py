"""From the curves of a study to scores of all measures that they allow."""

from collections.abc import Sequence

from .by_adversity import BY_ADVERSITY
from .by_size import BY_SIZE
from .draft import Uncomputable
from .measures import ScoreForms, check_measures, label_of
from .studies import StudyCurves
from .table import Score

_SCORES = BY_SIZE | BY_ADVERSITY
"""Measure -> what computes its scores."""


def score_study(
    study: StudyCurves, measures: Sequence[str] | None = None, forms: ScoreForms | None = None
) -> tuple[tuple[Score, ...], dict[str, str]]:
    """Compute the scores of all measures that the curves of a study allow.

    Args:
        study: Curves of one policy.
        measures: Names out of `MEASURE_CRITERIA`; default all.
        forms: Variants and forms; default the corrected marginal one.

    Returns:
        The scores, and for each measure (in a form of it) that could not be computed the reason.

    Raises:
        CurveError: an unknown measure, or curves that a measure refuses.
    """
    scores: list[Score] = []
    missing: dict[str, str] = {}
    for measure in check_measures(measures):
        for variant, form in (forms or ScoreForms()).of(measure):
            try:
                scores += list(_SCORES[measure](measure, study, variant, form))
            except Uncomputable as reason:
                missing[label_of(measure, variant, form)] = str(reason)
    return tuple(scores), missing
