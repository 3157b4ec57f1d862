"""Statements about availability that follow from formulas alone, without any run."""

from collections.abc import Sequence

import numpy as np

from ..population import availability, ratio_for_team
from .outcomes import Answer, Outcome


def availability_is(*, n: int, n_min: int, team: float, expected: float, within: float) -> Outcome:
    """Whether the availability of n_min of n robots with a mean team at work has an expected value, up to rounding."""
    p_v = availability(n, n_min, ratio_for_team(team))
    answer: Answer = "supported" if abs(p_v - expected) <= within else "contradicted"
    why = f"availability of {n_min} of {n} robots, mean team {team:g}, is {p_v:.4f}"
    return Outcome(answer=answer, statistic=p_v, effect=np.nan, n_runs=0, why=why)


def is_less_available(*, few: int, many: int, needed: Sequence[tuple[int, int]], team: float) -> Outcome:
    """Whether a second swarm is less available than the first with the same mean team at work.

    It then needs a larger team for the same availability. Availability is 1 where no robot is needed, so the curve of
    the second swarm has also dropped more steeply.

    Args:
        few: Size of the first swarm.
        many: Size of the second.
        needed: Pairs: robots needed of the first and of the second swarm. The statement must hold for all pairs.
        team: Mean robots at work in both.
    """
    ratio = ratio_for_team(team)
    robots = dict(zip((few, many), zip(*needed, strict=True), strict=True))
    found = {n: [availability(n, n_min, ratio) for n_min in robots[n]] for n in (many, few)}
    share = float(np.mean(np.array(found[many]) < found[few]))
    answer: Answer = "supported" if share == 1.0 else "contradicted"
    told = (
        f"{', '.join(f'{p_v:.4f}' for p_v in of)} for {', '.join(map(str, robots[n]))} of {n}"
        for n, of in found.items()
    )
    why = f"{'; '.join(told)}; mean team {team:g}"
    return Outcome(answer=answer, statistic=share, effect=np.nan, n_runs=0, why=why)
