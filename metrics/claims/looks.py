"""Judging several times while runs are still being made, and what each look may decide.

If you look seven times and stop when there is an answer, you are wrong more often than once in twenty. So each look
gets a part of these 5 %, in proportion to the runs that it adds (Lan and DeMets 1983; Kim and DeMets 1987), and uses
intervals with a higher confidence. All intervals of one comparison hold at the same time, so the time and the reason
for stopping do not matter (repeated confidence intervals, Jennison and Turnbull 1990). Welch's t, the two one-sided
tests of a tie and resampled numbers use the same confidence: every test uses a level from the normal distribution.

Policies and panels may have different numbers of runs. A statement is judged on equally many first runs of all its
policies, at the last look that all of them have reached. So further runs of one policy do not count as a further look.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from functools import cache
from itertools import pairwise

import numpy as np
from numpy.polynomial.legendre import leggauss
from scipy.special import ndtr  # pyright: ignore[reportMissingTypeStubs]  (scipy ships none)

from ..curves import FloatArray
from .panel import CONFIDENCE, Looks, Panel, mean_over_runs

LOOKS: Looks = (4, 8, 16, 32, 64, 128, 192)
"""Numbers of runs, doubled each time, up to the number in the paper."""
N_NODES = 200
N_HALVINGS = 60
FARTHEST = 30.0
"""Number of standard deviations that is larger than any bound."""


def looks_up_to(most: int) -> Looks:
    """Return looks, the last one after `most` runs."""
    return (*(n_runs for n_runs in LOOKS if n_runs < most), most)


def confidence_at(looks: Looks, n_runs: int) -> float:
    """Return the confidence of the intervals at one of the looks."""
    return 1.0 - _levels(looks)[looks.index(n_runs)]


@cache
def _levels(looks: Looks) -> tuple[float, ...]:
    """Two-sided level of each look, so that all looks together are wrong once in twenty times.

    The computation follows sums of normal numbers from look to look, as long as they stay within the bounds of all
    earlier looks (Armitage, McPherson and Rowe 1969), by Gauss-Legendre quadrature.
    """
    nodes, weights = leggauss(N_NODES)
    sums, masses = np.zeros(1), np.ones(1)  # before the first run
    levels: list[float] = []
    for before, after in pairwise((0, *looks)):
        share = (1.0 - CONFIDENCE) * (after - before) / looks[-1]
        sd = (after - before) ** 0.5
        bound = _bound(sums, masses, sd, share)
        levels.append(2.0 * float(ndtr(-bound / after**0.5)))
        here = nodes * bound
        density = np.exp(-0.5 * ((here[:, None] - sums) / sd) ** 2) @ masses / (sd * (2.0 * np.pi) ** 0.5)
        sums, masses = here, weights * bound * density
    return tuple(levels)


def _bound(sums: FloatArray, masses: FloatArray, sd: float, share: float) -> float:
    """Bound that a share of the sums exceeds after a normal number is added to each; by bisection."""
    low, high = 0.0, float(np.abs(sums).max()) + FARTHEST * sd
    for _ in range(N_HALVINGS):
        middle = 0.5 * (low + high)
        outside = masses @ (ndtr((sums - middle) / sd) + ndtr((-sums - middle) / sd))
        low, high = (middle, high) if outside > share else (low, middle)
    return high


def last_look(looks: Looks, n_runs: int) -> int:
    """Return the last look that `n_runs` runs have reached; 0 before the first."""
    return max((after for after in looks if after <= n_runs), default=0)


def at_last_look(panels: Sequence[Panel], policies: Collection[str]) -> list[Panel]:
    """Return panels with the runs that some policies have in all of them, and with the confidence of their last look.

    Panels without looks keep their runs, but get this confidence if other panels have looks. If panels have different
    looks, the function uses the last look that all of them share, and the highest confidence.
    """
    several = [panel for panel in panels if panel.looks]
    if not several:
        return list(panels)
    reached = min(panel.reached.get(name, 0) for panel in several for name in policies or panel.scores)
    shared = tuple(look for look in several[0].looks if all(look in panel.looks for panel in several))
    n_runs = last_look(shared, reached)
    confidence = max(confidence_at(panel.looks, n_runs) for panel in several) if n_runs else CONFIDENCE
    return [
        replace(_with_runs(panel, n_runs) if panel.looks else panel, looks=(), reached={}, confidence=confidence)
        for panel in panels
    ]


def _with_runs(panel: Panel, n_runs: int) -> Panel:
    scores, undisturbed = _first(panel.scores, n_runs), panel.undisturbed
    return replace(panel, scores=scores, undisturbed=None if undisturbed is None else _first(undisturbed, n_runs))


def _first(scores: Mapping[str, FloatArray], n_runs: int) -> dict[str, FloatArray]:
    return {name: values[..., :n_runs] for name, values in scores.items()}


def as_if(panel: Panel, n_runs: int) -> Panel:
    """Return the panel that follows if all policies get `n_runs` runs, and further runs are like those they have.

    Means and standard deviations stay as they are. Policies without runs stay without runs.
    """
    reached = {name: n_runs if before else 0 for name, before in panel.reached.items()}

    def grown(scores: Mapping[str, FloatArray]) -> dict[str, FloatArray]:
        return {name: _grown(values, panel.reached.get(name, 0), n_runs) for name, values in scores.items()}

    undisturbed = None if panel.undisturbed is None else grown(panel.undisturbed)
    return replace(panel, scores=grown(panel.scores), undisturbed=undisturbed, reached=reached)


def _grown(values: FloatArray, reached: int, n_runs: int) -> FloatArray:
    if reached >= n_runs:
        return values[..., :n_runs]
    return _repeated(values[..., :reached], n_runs) if reached else np.full((*values.shape[:-1], n_runs), np.nan)


def _repeated(values: FloatArray, n_runs: int) -> FloatArray:
    """Repeat the runs, (..., R) to (..., n_runs), without a change of the standard deviation."""
    few = values.shape[-1]
    middle = mean_over_runs(values)[..., None]
    stretched = middle + (values - middle) * ((1.0 - 1.0 / n_runs) / (1.0 - 1.0 / few)) ** 0.5
    return stretched[..., np.arange(n_runs) % few]
