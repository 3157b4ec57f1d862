"""Formulas of task allocation, written out once more on purpose: the twin of `baselines.stoch_n1`."""

import math
from collections.abc import Mapping

CHILDREN = {
    "generalist": ("harvester", "collector"),
    "harvester": ("starter", "finisher"),
    "collector": ("transferer", "cache_collector"),
}
"""Root of each block -> its subtasks. Blocks are called by their roots."""


def whole(value: float, integer: bool) -> float:
    """Truncate towards zero if asked."""
    return math.trunc(value) if integer else value


def partition(estimates: Mapping[str, float], root: str, k: float, gamma: float, integer: bool) -> float:
    """Probability of a subtask instead of `root`."""
    t, s = estimates[root], sum(estimates[child] for child in CHILDREN[root])
    bracket = whole(t / s, integer) - 1.25 if t > s else 1.25 - whole(s / t, integer)
    return min(1.0, gamma / (1.0 + math.exp(-k * whole(bracket, integer))))


def switch(estimates: Mapping[str, float], last: str, other: str, k: float, gamma: float) -> float:
    """Probability of switching to the other subtask."""
    ratio = min(1.0, estimates[last] / estimates[other])
    return gamma / (1.0 + math.exp(-k * (ratio - 1.25)))


def move(estimates: Mapping[str, float], here: str, there: str, integer: bool) -> float:
    """Probability of moving to a neighbouring block."""
    rho = [
        whole(abs(estimates[root] - sum(estimates[child] for child in CHILDREN[root])) / estimates[root], integer)
        for root in (here, there)
    ]
    if 0 in rho:
        return 0.5
    return 0.5 / (1.0 + math.exp(-4.0 * (rho[0] / rho[1] - 3.0)))
