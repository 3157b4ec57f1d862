"""Pairs of policies in a figure: how often one does better, and where they differ beyond chance."""

from collections.abc import Sequence
from itertools import combinations
from typing import TYPE_CHECKING, Any

import numpy as np

from ..curves import FloatArray
from ..distributions import probability_of_improvement
from ..significance import holm, paired_p
from ..statistics import Estimate
from .figure_panels import StudyPanel

if TYPE_CHECKING:
    import polars as pl

FAMILY_ERROR = 0.05
"""Probability that the tests of a panel tell any difference where there is none, as in comparisons of policies."""
_SEED = 1
"""Fixed, so that the same runs give the same table."""


def policy_pairs(panels: Sequence[StudyPanel]) -> "pl.DataFrame":
    """Return one row per panel and pair of policies.

    Args:
        panels: Of one measure, variant and rules, as in `StudyFigure.panels`.

    Returns:
        Columns: the place of the panel; `first`, `second`, two policies; `p_better`, the probability that a run of the
        first does better than one of the second, mean over the levels, with its 95 % bootstrap interval `lower`,
        `upper`; `n_levels`, levels at which both have runs; `first_better`, `second_better`, at how many of them the
        paired t test finds that policy better, after Holm's correction over all pairs and levels of the panel.
    """
    import polars as pl

    rows: list[dict[str, Any]] = []
    for panel in panels:
        pairs = list(combinations(panel.scores, 2))
        differences = [panel.scores[first] - panel.scores[second] for first, second in pairs]
        if not pairs:  # a single policy
            continue
        p_values = holm(np.array([_p(level) for difference in differences for level in difference]))
        adjusted = p_values.reshape(len(pairs), -1)
        for (first, second), difference, of_pair in zip(pairs, differences, adjusted, strict=True):
            gains = difference if panel.higher_is_better else -difference
            means = np.array([_mean(level) for level in gains])
            is_sure = of_pair <= FAMILY_ERROR
            better = _probability(panel, first, second)
            rows.append(
                {
                    "rules": panel.rules,
                    **panel.others,
                    "first": first,
                    "second": second,
                    "p_better": better.value,
                    "lower": better.lower,
                    "upper": better.upper,
                    "n_levels": int(np.isfinite(means).sum()),
                    "first_better": int((is_sure & (means > 0.0)).sum()),
                    "second_better": int((is_sure & (means < 0.0)).sum()),
                }
            )
    return pl.DataFrame(rows, infer_schema_length=None).fill_nan(None)


def _p(differences: FloatArray) -> float:
    return paired_p(differences[np.isfinite(differences)])


def _mean(values: FloatArray) -> float:
    known = values[np.isfinite(values)]
    return float(known.mean()) if known.size else np.nan


def _probability(panel: StudyPanel, first: str, second: str) -> Estimate:
    """Over the levels at which both have a score."""
    a, b = panel.scores[first], panel.scores[second]
    shared = [k for k in range(len(panel.x)) if np.isfinite(a[k]).any() and np.isfinite(b[k]).any()]
    if not shared:
        return Estimate(value=np.nan, lower=np.nan, upper=np.nan, n_runs=0)
    known = ([scores[k][np.isfinite(scores[k])] for k in shared] for scores in (a, b))
    return probability_of_improvement(*known, higher_is_better=panel.higher_is_better, seed=_SEED)
