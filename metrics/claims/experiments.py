"""Short words for statements: experiments, policies, measures, levels, and the most frequent statements."""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np

from ..controllers import PAPER_POLICIES as POLICIES
from ..curves import Form
from .claim import Claim, Place, Statement, named
from .panel import Panel
from .rules import Outcome, is_higher, ties

SIMPLE, COMPLEX = ("crw", "dpo"), ("stochm", "stochx")
STEADY, UNSTEADY = ("crw", "stochx"), ("dpo", "stochm")
E_S, E_T, C, P = "spatial_emergence", "task_emergence", "scalability", "raw_performance"
R, A, N, D = "reactivity", "adaptability", "noise_robustness", "population_robustness"

EXPERIMENTS: dict[str, str] = {
    "S1a": "small warehouse, 1 to 128 robots",
    "S1b": "medium warehouse, 1 to 512 robots",
    "S1c": "small warehouse, 50 robots, throttled while carrying",
    "S1d": "medium warehouse, 200 robots, throttled while carrying",
    "S1e": "small warehouse, 50 robots, noise",
    "S1f": "medium warehouse, 200 robots, noise",
    "S1g": "small warehouse, 50 robots, malfunctions and repairs",
    "S1h": "medium warehouse, 200 robots, malfunctions and repairs",
    "S2a still": "search and rescue, 12 to 819 robots, objects at rest",
    "S2a slow": "search and rescue, 12 to 819 robots, objects that move with the smallest probability",
    "S2a fast": "search and rescue, 12 to 819 robots, objects that move with the largest probability",
    "S2b 12": "search and rescue, 12 robots, throttled motion",
    "S2b 115": "search and rescue, 115 robots, throttled motion",
    "S2b 320": "search and rescue, 320 robots, throttled motion",
    "S2c 115": "search and rescue, 115 robots, noise",
    "S2c 320": "search and rescue, 320 robots, noise",
    "S2d 115": "search and rescue, 115 robots, deaths",
    "S2d 320": "search and rescue, 320 robots, deaths",
}
"""Experiments that the claims are about. The levels are swarm sizes in S1a, S1b and S2a, distances from ideal
conditions in S1c, S1d and S2b, and strengths of the disturbance in the others, without the undisturbed level."""

SIGMAS = 0.03 / 7.0 * np.arange(8)
"""Standard deviations of noise in the warehouses, from none to the largest."""
ONSET = (float(SIGMAS[3]), float(SIGMAS[5]))
"""About 0.017: from the level below the fifth of `SIGMAS` to the level above it."""
LARGER = (0.01, 0.05)
"""Standard deviations between which noise changes behaviour in search and rescue."""


def pairs_of(policies: Sequence[str]) -> tuple[tuple[str, str], ...]:
    """Return all pairs of policies."""
    return tuple(combinations(policies, 2))


ALL_PAIRS = pairs_of(POLICIES)


def states(
    rule: Callable[..., Outcome], *panels: Place, views: tuple[Callable[[Panel], Panel], ...] = (), **parameters: Any
) -> Statement:
    """Statement that panels satisfy a rule with these parameters; panels without a form are marginal."""
    return Statement(rule, tuple(named(name) for name in panels), parameters, views)


def spatial(experiment: str) -> tuple[str, str, Form]:
    """Panel of spatial self-organisation as the paper shows it; in scenario 1, N robots compared with N lone robots."""
    return (experiment, E_S, "interactive" if experiment.startswith("S1") else "marginal")


def as_shares(panel: Place) -> Place:
    """Return a panel whose scores are shares of performance."""
    return named(panel)._replace(is_relative=True)


def best_of(panel: Place, policy: str, levels: str = "all") -> Statement:
    """Statement that a policy is better than the three others."""
    return better(panel, (policy,), others_of(policy), levels)


def others_of(policy: str) -> tuple[str, ...]:
    """Return the three other policies."""
    return tuple(name for name in POLICIES if name != policy)


def better(panel: Place, winners: tuple[str, ...], losers: tuple[str, ...], levels: str = "all") -> Statement:
    """Statement that each of some policies is better than each of others; distances are better where they are lower."""
    upper, lower = (losers, winners) if direction_of(panel[1]) < 0 else (winners, losers)
    return states(is_higher, panel, upper=upper, lower=lower, levels=levels)


def direction_of(measure: str) -> int:
    """1 if higher is better, -1 if lower is."""
    return -1 if measure in (R, A, N) else 1


Says: TypeAlias = Callable[[Place], Statement]
"""What a claim says of each panel of its figure."""


def about(
    words: str,
    panels: tuple[Place, ...],
    claims: Mapping[str, tuple[Any, ...]],
    otherwise: Mapping[str, Place] | None = None,
) -> list[Claim]:
    """Return the claims about a figure.

    Args:
        words: What the figure shows.
        panels: Its panels; each claim is about all of them.
        claims: Name -> text, and what it says (`Says`) of each panel.
        otherwise: Another panel that the claims may mean, by words.
    """
    return [
        Claim(
            name,
            text,
            words,
            tuple(say(panel) for say in said for panel in panels),
            otherwise={told: tuple(say(panel) for say in said) for told, panel in (otherwise or {}).items()},
        )
        for name, (text, *said) in claims.items()
    ]


def says(rule: Callable[..., Outcome], **given: Any) -> Says:
    """What a claim says by a rule with these parameters, and views."""
    return lambda panel: states(rule, panel, **given)


def tie(*pairs: tuple[str, str], **given: Any) -> Says:
    """Pairs of policies tie."""
    return says(ties, pairs=pairs, **given)


def best(policy: str, levels: str = "all") -> Says:
    """A policy is better than the three others."""
    return lambda panel: best_of(panel, policy, levels)


def above(winners: tuple[str, ...], losers: tuple[str, ...], levels: str = "all") -> Says:
    """Each of some policies is better than each of others."""
    return lambda panel: better(panel, winners, losers, levels)
