"""The paper's claims about adversity: reactivity (R), adaptability (A), noise (N), availability (V), population (D)."""

from .checking import Claim, Place, Statement
from .formulas import availability_is, is_less_available
from .orders import same_order
from .predicates import differ, differs_more, is_higher, ties
from .shapes import ZERO, bend_of, changes_before, changes_within, from_undisturbed, rise_of, slope_of, with_zero
from .statements import (
    ALL_PAIRS,
    COMPLEX,
    E_T,
    LARGER,
    ONSET,
    POLICIES,
    SIMPLE,
    STEADY,
    UNSTEADY,
    A,
    D,
    N,
    R,
    best_of,
    better,
    states,
)


def _flexibility(letter: str, measure: str) -> tuple[Claim, ...]:
    """Return the four claims that the paper makes in the same words about reactivity and about adaptability."""
    small, medium = ("S1c", measure), ("S1d", measure)
    where = f"scenario 1, {measure}"
    others = ("crw", "dpo", "stochm")
    return (
        Claim(
            name=f"{letter}1",
            text="Under strong disturbance STOCHM and STOCHX are best; STOCHX is best in general.",
            figure=f"{where}, both warehouses",
            statements=(
                better(small, COMPLEX, SIMPLE, "high"),
                better(medium, COMPLEX, SIMPLE, "high"),
                best_of(small, "stochx"),
                best_of(medium, "stochx"),
            ),
        ),
        Claim(
            name=f"{letter}2",
            text="DPO is worse than CRW.",
            figure=f"{where}, both warehouses",
            statements=tuple(better(panel, ("crw",), ("dpo",)) for panel in (small, medium)),
        ),
        Claim(
            name=f"{letter}3",
            text="More differences are significant in the medium warehouse than in the small one.",
            figure=f"{where}, both warehouses",
            statements=(states(differs_more, small, medium, pairs=ALL_PAIRS),),
        ),
        Claim(
            name=f"{letter}4",
            text="STOCHX rises slowly and evenly with the disturbance; the others rise ever faster.",
            figure=f"{where}, medium warehouse",
            statements=(
                states(is_higher, medium, views=(slope_of,), upper=others, lower=("stochx",)),
                states(ties, medium, views=(bend_of, with_zero), pairs=(("stochx", ZERO),)),
                states(is_higher, medium, views=(bend_of, with_zero), upper=others, lower=(ZERO,)),
            ),
        ),
    )


def _groups_under_strong(panel: Place) -> tuple[Statement, ...]:
    return (better(panel, STEADY, UNSTEADY, "high"), states(ties, panel, pairs=ALL_PAIRS, levels="low"))


_BY_FILE_NAME = "{}, as the name of the figure's file says"

FLEXIBILITY = (
    *_flexibility("R", R),
    *_flexibility("A", A),
    Claim(
        name="R5",
        text="CRW and STOCHX are best, DPO and STOCHM worst; only under strong disturbance, else they tie.",
        figure="scenario 2, reactivity, 115 robots",
        statements=_groups_under_strong(("S2b 115", R)),
        otherwise={_BY_FILE_NAME.format(A): _groups_under_strong(("S2b 115", A))},
    ),
    Claim(
        name="A5",
        text="The algorithms mostly tie.",
        figure="scenario 2, adaptability, 320 robots",
        statements=(states(ties, ("S2b 320", A), pairs=ALL_PAIRS),),
        otherwise={_BY_FILE_NAME.format(R): (states(ties, ("S2b 320", R), pairs=ALL_PAIRS),)},
    ),
    Claim(
        name="A6",
        text="Under strong disturbance CRW is better than DPO and STOCHM.",
        figure="scenario 2, adaptability, 320 robots",
        statements=(better(("S2b 320", A), ("crw",), UNSTEADY, "high"),),
        otherwise={_BY_FILE_NAME.format(R): (better(("S2b 320", R), ("crw",), UNSTEADY, "high"),)},
    ),
    Claim(
        name="A7",
        text="The swarm sizes that are not shown look the same: they have the same order of algorithms.",
        figure="scenario 2, reactivity shown of 115 robots and adaptability of 320, of 12, 115 and 320",
        statements=tuple(
            states(same_order, (shown, measure), (other, measure), policies=POLICIES)
            for measure, shown, others in (
                (R, "S2b 115", ("S2b 12", "S2b 320")),
                (A, "S2b 320", ("S2b 12", "S2b 115")),
            )
            for other in others
        ),
    ),
)

NOISE = (
    Claim(
        name="N1",
        text="CRW and STOCHX tie.",
        figure="scenario 1, noise, small warehouse",
        statements=(states(ties, ("S1e", N), pairs=(STEADY,)),),
    ),
    Claim(
        name="N2",
        text="DPO and STOCHM tie except under strong noise.",
        figure="scenario 1, noise, small warehouse",
        statements=(
            states(ties, ("S1e", N), pairs=(UNSTEADY,), levels="low"),
            states(differ, ("S1e", N), pairs=(UNSTEADY,), levels="high"),
        ),
    ),
    Claim(
        name="N3",
        text="From a standard deviation of about 0.017 on, all algorithms change their behaviour.",
        figure="scenario 1, noise, small warehouse",
        statements=(states(changes_within, ("S1e", N), views=(from_undisturbed,), policies=POLICIES, between=ONSET),),
    ),
    Claim(
        name="N4",
        text="The change is strongest for DPO and STOCHM.",
        figure="scenario 1, noise, small warehouse",
        statements=(states(is_higher, ("S1e", N), views=(rise_of,), upper=UNSTEADY, lower=STEADY),),
    ),
    Claim(
        name="N5",
        text="The algorithms are further apart than in the small warehouse; N3 and N4 hold again.",
        figure="scenario 1, noise, medium warehouse",
        statements=(
            states(differs_more, ("S1e", N), ("S1f", N), pairs=ALL_PAIRS),
            states(changes_within, ("S1f", N), views=(from_undisturbed,), policies=POLICIES, between=ONSET),
            states(is_higher, ("S1f", N), views=(rise_of,), upper=UNSTEADY, lower=STEADY),
        ),
    ),
    Claim(
        name="N6",
        text="CRW and STOCHX tie in most cases.",
        figure="scenario 2, noise, 320 robots",
        statements=(states(ties, ("S2c 320", N), pairs=(STEADY,)),),
    ),
    Claim(
        name="N7",
        text="DPO, STOCHM and STOCHX get clearly worse with stronger noise, from 0.01 to 0.05 on.",
        figure="scenario 2, noise, 320 robots",
        statements=(
            states(
                is_higher,
                ("S2c 320", N),
                views=(rise_of, with_zero),
                upper=("dpo", "stochm", "stochx"),
                lower=(ZERO,),
            ),
            states(
                changes_within,
                ("S2c 320", N),
                views=(from_undisturbed,),
                policies=("dpo", "stochm", "stochx"),
                between=LARGER,
            ),
        ),
    ),
    Claim(
        name="N8",
        text="STOCHM changes under weaker noise than DPO and STOCHX.",
        figure="scenario 2, noise, 320 robots",
        statements=(
            states(changes_before, ("S2c 320", N), views=(from_undisturbed,), first="stochm", others=("dpo", "stochx")),
        ),
    ),
    Claim(
        name="N9",
        text="115 robots show the same picture as 320: the same order of algorithms.",
        figure="scenario 2, noise (no figure), 115 robots",
        statements=(states(same_order, ("S2c 320", N), ("S2c 115", N), policies=POLICIES),),
    ),
)

_NEEDED = (1, 5, 10, 20, 40)
"""Numbers of robots needed of 50, in the availability figure."""
_TEAMS = (5.0, 10.0, 20.0)


def _less_available(times: int) -> tuple[Statement, ...]:
    """Statements that 200 robots are less available than 50 at each number needed, or at so many times that number."""
    needed = tuple((robots, times * robots) for robots in _NEEDED)
    return tuple(states(is_less_available, few=50, many=200, needed=needed, team=team) for team in _TEAMS)


POPULATION = (
    Claim(
        name="V1",
        text="With 50 robots, 5 needed and a mean team of 5, availability is about 0.40.",
        figure="scenario 1, availability (formula)",
        statements=(states(availability_is, n=50, n_min=5, team=5.0, expected=0.40, within=0.005),),
    ),
    Claim(
        name="V2",
        text="With 200 robots and 20 needed, larger teams are needed for the same availability.",
        figure="scenario 1, availability (formula)",
        statements=tuple(states(is_less_available, few=50, many=200, needed=((5, 20),), team=team) for team in _TEAMS),
    ),
    Claim(
        name="V3",
        text="Availability drops more steeply with 200 robots than with 50, the more robots are needed.",
        figure="scenario 1, availability (formula)",
        statements=_less_available(1),
        otherwise={"over the share of the swarm that is needed": _less_available(4)},
    ),
    Claim(
        name="D1",
        text="Under larger population variance STOCHX is most robust, and STOCHX and CRW are above DPO and STOCHM.",
        figure="scenario 1, population robustness, small warehouse",
        statements=(
            best_of(("S1g", D), "stochx", "high"),
            better(("S1g", D), STEADY, UNSTEADY, "high"),
        ),
    ),
    Claim(
        name="D2",
        text="The order is that of task self-organisation, STOCHX first.",
        figure="scenario 1, population robustness, medium warehouse",
        statements=(
            best_of(("S1h", D), "stochx"),
            states(same_order, ("S1b", E_T), ("S1h", D), policies=POLICIES),
        ),
    ),
    Claim(
        name="D3",
        text="CRW and STOCHX are high, DPO and STOCHM much lower.",
        figure="scenario 2, population robustness, 115 robots",
        statements=(better(("S2d 115", D), STEADY, UNSTEADY),),
    ),
    Claim(
        name="D4",
        text="With 320 robots all tie.",
        figure="scenario 2, population robustness (no figure)",
        statements=tuple(states(ties, ("S2d 320", D), pairs=(pair,)) for pair in ALL_PAIRS),
        otherwise={"as D3, as the caption says": (better(("S2d 320", D), STEADY, UNSTEADY),)},
    ),
    Claim(
        name="D5",
        text="STOCHM and CRW may tie.",
        figure="scenario 1, population robustness, medium warehouse",
        vague='"May" leaves room for a tie and claims none: no outcome speaks against it.',
    ),
)
