"""Short ways to write statements: policies, measures, and what is said of them most often."""

from collections.abc import Callable
from typing import Any

from ..controllers import PAPER_POLICIES as POLICIES
from ..curves import Form
from .checking import Place, Statement, named
from .outcomes import Outcome
from .panel import Panel
from .predicates import every_pair, is_higher

SIMPLE, COMPLEX = ("crw", "dpo"), ("stochm", "stochx")
STEADY, UNSTEADY = ("crw", "stochx"), ("dpo", "stochm")
E_S, E_T, C, P = "spatial_emergence", "task_emergence", "scalability", "raw_performance"
R, A, N, D = "reactivity", "adaptability", "noise_robustness", "population_robustness"
ALL_PAIRS = every_pair(POLICIES)


def states(
    predicate: Callable[..., Outcome],
    *panels: Place,
    views: tuple[Callable[[Panel], Panel], ...] = (),
    **parameters: Any,
) -> Statement:
    """Statement that a predicate makes of panels, with these parameters; a panel without a form is the marginal one."""
    return Statement(
        predicate=predicate, panels=tuple(named(name) for name in panels), views=views, parameters=parameters
    )


def spatial(experiment: str) -> tuple[str, str, Form]:
    """Panel of spatial self-organisation as the paper shows it: in scenario 1 N robots beside N lone robots."""
    return (experiment, E_S, "interactive" if experiment.startswith("S1") else "marginal")


def best_of(panel: Place, policy: str, levels: str = "all") -> Statement:
    """Statement that a policy is better than the three others."""
    return better(panel, (policy,), others_of(policy), levels)


def others_of(policy: str) -> tuple[str, ...]:
    """Return the three other policies."""
    return tuple(name for name in POLICIES if name != policy)


def better(
    panel: Place,
    winners: tuple[str, ...],
    losers: tuple[str, ...],
    levels: str = "all",
) -> Statement:
    """Statement that each of some policies is better than each of others; distances are better where they are lower."""
    upper, lower = (losers, winners) if direction_of(panel[1]) < 0 else (winners, losers)
    return states(is_higher, panel, upper=upper, lower=lower, levels=levels)


def direction_of(measure: str) -> int:
    """1 if higher is better, -1 if lower is."""
    return -1 if measure in (R, A, N) else 1
