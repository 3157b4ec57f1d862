"""The words in which claims are written: places, policies, and what a claim says of each place.

    better("crw stochx > dpo stochm", "high")("S1c R")   # each of the first is better than each of the others

A place is an experiment and the symbol of a measure, policies are names between spaces.
"""

from collections.abc import Callable, Iterable, Mapping
from itertools import combinations
from typing import Any, TypeAlias

import numpy as np

from .claim import Claim, PanelName, Statement
from .panel import Panel
from .rules import Outcome, is_higher, ties

SIMPLE, COMPLEX = "crw dpo", "stochm stochx"
STEADY, UNSTEADY = "crw stochx", "dpo stochm"
ALL = "crw dpo stochm stochx"

MEASURES = {
    "E_S": ("spatial_emergence", "interactive"),
    "E_N": ("spatial_emergence", "marginal"),
    "E_T": ("task_emergence", "marginal"),
    "C": ("scalability", "marginal"),
    "P": ("raw_performance", "marginal"),
    "R": ("reactivity", "marginal"),
    "A": ("adaptability", "marginal"),
    "N": ("noise_robustness", "marginal"),
    "D": ("population_robustness", "marginal"),
}
"""Symbol of a place -> measure and form. E_S stands beside N lone robots in scenario 1, as the paper shows it, and
beside the next smaller swarm in scenario 2; E_N stands beside the next smaller swarm in both."""
LOWER_IS_BETTER = ("reactivity", "adaptability", "noise_robustness")

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
    **{f"S2b {n}": f"search and rescue, {n} robots, throttled motion" for n in (12, 115, 320)},
    **{f"S2c {n}": f"search and rescue, {n} robots, noise" for n in (115, 320)},
    **{f"S2d {n}": f"search and rescue, {n} robots, deaths" for n in (115, 320)},
}
"""Experiments that the claims are about. The levels are swarm sizes in S1a, S1b and S2a, distances from ideal
conditions in S1c, S1d and S2b, and strengths of the disturbance in the others, without the undisturbed level."""

SIGMAS = 0.03 / 7.0 * np.arange(8)
"""Standard deviations of noise in the warehouses, from none to the largest."""
ONSET = (float(SIGMAS[3]), float(SIGMAS[5]))
"""About 0.017: from the level below the fifth of `SIGMAS` to the level above it."""
LARGER = (0.01, 0.05)
"""Standard deviations between which noise changes behaviour in search and rescue."""

Says: TypeAlias = Callable[[str], tuple[Statement, ...]]
"""What a claim says of a place."""
_NAMES = ("policies", "upper", "lower", "others", "pairs")
"""Parameters of rules that are written as names between spaces."""


def place(words: str) -> PanelName:
    """Return the panel of a place: "S1a E_S"."""
    experiment, _, symbol = words.rpartition(" ")
    measure, form = MEASURES[symbol]
    alone = form == "interactive" and experiment.startswith("S1")
    return PanelName(experiment, measure, "interactive" if alone else "marginal")


def places(words: str) -> list[str]:
    """Return the places of a list: "S1a C, S1b C"."""
    return words.split(", ")


def pairs_of(policies: str) -> tuple[tuple[str, str], ...]:
    """Return all pairs of policies."""
    return tuple(combinations(policies.split(), 2))


def states(
    rule: Callable[..., Outcome],
    *panels: str | PanelName,
    views: tuple[Callable[[Panel], Panel], ...] = (),
    **given: Any,
) -> Statement:
    """Statement that panels satisfy a rule with these parameters."""
    for name in {*given} & {*_NAMES}:
        given[name] = pairs_of(given[name]) if name == "pairs" else tuple(given[name].split())
    return Statement(rule, tuple(one if isinstance(one, PanelName) else place(one) for one in panels), given, views)


def says(rule: Callable[..., Outcome], **given: Any) -> Says:
    """What a claim says by a rule with these parameters, and views."""
    return lambda where: (states(rule, where, **given),)


def tie(policies: str, **given: Any) -> Says:
    """All pairs of policies tie."""
    return says(ties, pairs=policies, **given)


def better(sides: str, levels: str = "all") -> Says:
    """Each policy on the left is better than each on the right: "crw stochx > dpo"; distances are better if lower."""
    winners, losers = sides.split(" > ")

    def say(where: str) -> tuple[Statement, ...]:
        panel = place(where)
        upper, lower = (losers, winners) if panel.measure in LOWER_IS_BETTER else (winners, losers)
        return (states(is_higher, panel, upper=upper, lower=lower, levels=levels),)

    return say


def best(policy: str, levels: str = "all") -> Says:
    """A policy is better than the three others."""
    return better(f"{policy} > {' '.join(name for name in ALL.split() if name != policy)}", levels)


def of_each(where: Iterable[str], *said: Says) -> tuple[Statement, ...]:
    """What is said of each of some places, one saying after the other."""
    listed = list(where)
    return tuple(statement for say in said for panel in listed for statement in say(panel))


def about(
    figure: str, where: str, *, otherwise: Mapping[str, str] | None = None, **claims: tuple[Any, ...]
) -> list[Claim]:
    """Return the claims about a figure.

    Args:
        figure: What it shows, in words.
        where: Its panels; each claim is about all of them.
        otherwise: Words -> another panel that the claims may mean.
        claims: Name -> text, and what it says (`Says`) of each panel.
    """
    return [
        Claim(
            name,
            text,
            figure,
            of_each(places(where), *said),
            otherwise={told: of_each([other], *said) for told, other in (otherwise or {}).items()},
        )
        for name, (text, *said) in claims.items()
    ]
