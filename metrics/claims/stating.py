"""Short ways to write statements: policies, measures, and what is said of them most often."""

from collections.abc import Callable
from typing import Any

from .checking import PanelName, Statement
from .panel import Panel
from .predicates import Outcome, every_pair, is_higher

POLICIES = ("crw", "dpo", "stochm", "stochx")
SIMPLE, COMPLEX = ("crw", "dpo"), ("stochm", "stochx")
STEADY, UNSTEADY = ("crw", "stochx"), ("dpo", "stochm")
E_S, E_T, C, P = "spatial_emergence", "task_emergence", "scalability", "raw_performance"
R, A, N, D = "reactivity", "adaptability", "noise_robustness", "population_robustness"
ALL_PAIRS = every_pair(POLICIES)


def states(
    predicate: Callable[..., Outcome],
    *panels: PanelName,
    views: tuple[Callable[[Panel], Panel], ...] = (),
    **parameters: Any,
) -> Statement:
    """Statement that a predicate makes of panels, with these parameters."""
    return Statement(predicate=predicate, panels=panels, views=views, parameters=parameters)


def best_of(experiment: str, measure: str, policy: str, levels: str = "all") -> Statement:
    """Statement that a policy is better than the three others."""
    return better(experiment, measure, (policy,), tuple(name for name in POLICIES if name != policy), levels)


def better(
    experiment: str, measure: str, winners: tuple[str, ...], losers: tuple[str, ...], levels: str = "all"
) -> Statement:
    """Statement that each of some policies is better than each of others; distances are better where they are lower."""
    upper, lower = (losers, winners) if measure in (R, A, N) else (winners, losers)
    return states(is_higher, (experiment, measure), upper=upper, lower=lower, levels=levels)
