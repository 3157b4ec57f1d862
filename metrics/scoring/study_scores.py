"""From the curves of a study to scores of all measures that they allow."""

import re
from collections.abc import Sequence
from dataclasses import replace

from ..catalog import METRICS
from .by_adversity import BY_ADVERSITY
from .by_size import BY_SIZE
from .measures import ScoreForms, check_measures, label_of
from .scored_experiments import Uncomputable
from .studies import StudyCurves
from .table import Score

_SCORES = BY_SIZE | BY_ADVERSITY
"""Measure -> what computes its scores."""
_OVER_A_RUN = re.compile(r"(per run|in [\d,]+ s)$")
"""End of a unit of what is summed over a run."""
_NO_SUM = "this performance is no sum over robots, and the measure compares with growth in proportion to them"
_OTHER_SWARMS = {"one robot", "two sizes", "rates", "robots at work"}
"""Input of measures that know how many robots made a performance, and expect it of as many others."""


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
    return tuple(_told(score, study) for score in scores), missing


def _told(score: Score, study: StudyCurves) -> Score:
    """Return the score in the unit of the performance, with a note if the measure expects another kind.

    Measures write units for deliveries, "objects in 4,000 s". With robots carrying, a mean over each interval, it is
    "robots summed over intervals".
    """
    unit = score.unit.replace("objects", study.amount)
    if not study.is_total:
        unit = _OVER_A_RUN.sub("summed over intervals", unit)
    note = score.note
    if not study.adds_up and _is_in_proportion(score.measure):
        note = f"{note}; {_NO_SUM}" if note else _NO_SUM
    return replace(score, unit=unit, note=note)


def _is_in_proportion(measure: str) -> bool:
    """Whether a measure compares with performance in proportion to the robots: of other sizes, at work, or each."""
    needs = METRICS[measure].needs
    return measure == "efficiency" or ("performance" in needs and not _OTHER_SWARMS.isdisjoint(needs))
