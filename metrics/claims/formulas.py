"""Statements about availability that follow from formulas alone, without any run."""

import numpy as np

from ..population import availability, ratio_for_team
from .outcomes import Answer, Outcome


def availability_is(*, n: int, n_min: int, team: float, expected: float, within: float) -> Outcome:
    """Whether the availability of n_min of n robots with a mean team at work has an expected value, up to rounding."""
    p_v = availability(n, n_min, ratio_for_team(team))
    answer: Answer = "supported" if abs(p_v - expected) <= within else "contradicted"
    why = f"availability of {n_min} of {n} robots, mean team {team:g}, is {p_v:.4f}"
    return Outcome(answer=answer, statistic=p_v, effect=np.nan, n_runs=0, why=why)


def is_less_available(*, few: tuple[int, int], many: tuple[int, int], team: float) -> Outcome:
    """Whether a second swarm is less available than the first with the same mean team at work.

    Then it needs a larger team for the same availability. Availability is 1 where no robot is needed, so it has also
    dropped more steeply on the way there.

    Args:
        few: Swarm size and robots needed of the first.
        many: The same of the second.
        team: Mean robots at work in both.
    """
    wanted = availability(*few, ratio_for_team(team))
    got = availability(*many, ratio_for_team(team))
    answer: Answer = "supported" if got < wanted else "contradicted"
    why = (
        f"a mean team of {team:g} gives {got:.4f} for {many[1]} of {many[0]} and {wanted:.4f} for {few[1]} of {few[0]}"
    )
    return Outcome(answer=answer, statistic=got, effect=np.nan, n_runs=0, why=why)
