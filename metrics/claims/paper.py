"""The claims of the paper about its figures, as data: what is said, where, and which statements that makes.

E are claims about self-organisation, C about scalability, P about raw performance, R about reactivity, A about
adaptability, N about noise, V about availability, D about population dynamics, X about several figures together. Where
the paper says nothing of a direction but its text implies one, the text below says "(implied)". Where its words, its
captions, its file names or its program disagree on what was meant, `otherwise` has what else a claim may mean.

The statements are the general ones of `predicates`, `shapes` and `orders`. Some of their rules were changed after runs
had been seen: see docs/metrics.md, "Rules that changed after runs were seen".
"""

from .checking import Claim, Place, Statement
from .formulas import availability_is, needs_larger_team
from .orders import LOOSE, opposite_order, same_order, unrelated
from .predicates import (
    differ,
    differs_more,
    every_pair,
    is_constant,
    is_higher,
    is_narrow,
    is_wide,
    is_wider,
    leads_by_little,
    never_differ,
    reaches_higher,
    ties,
    varies,
)
from .shapes import (
    ZERO,
    bend_of,
    changes_before,
    changes_within,
    from_undisturbed,
    is_linear,
    rise_of,
    slope_of,
    with_zero,
)
from .statements import (
    ALL_PAIRS,
    COMPLEX,
    E_S,
    E_T,
    LARGER,
    ONSET,
    POLICIES,
    SIMPLE,
    STEADY,
    UNSTEADY,
    A,
    C,
    D,
    N,
    P,
    R,
    as_shares,
    best_of,
    better,
    direction_of,
    others_of,
    spatial,
    states,
)


def _flexibility(letter: str, measure: str) -> tuple[Claim, ...]:
    """Return the four claims that the paper makes of reactivity and of adaptability in the same words."""
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


def _about_small_swarms(panel: Place) -> dict[str, tuple[Statement, ...]]:
    """What E1 to E3 say of spatial self-organisation in the small warehouse."""
    return {
        # The figure shows the share of performance that is lost.
        "E1": (states(is_constant, as_shares(panel), policies=POLICIES),),
        "E2": (best_of(panel, "crw"),),
        "E3": (states(ties, panel, pairs=(COMPLEX,)),),
    }


def _about_large_swarms(panel: Place) -> dict[str, tuple[Statement, ...]]:
    """What E4 to E6 say of self-organisation in the medium warehouse."""
    return {
        "E4": (states(ties, panel, pairs=every_pair(("crw", "dpo", "stochm"))),),
        "E5": (best_of(panel, "stochx"),),
        "E6": (states(is_linear, panel, policies=("stochx",)),),
    }


def _steady_and_not(panel: Place) -> tuple[Statement, ...]:
    """What E7 and E9 say of self-organisation in search and rescue."""
    return (states(is_constant, panel, policies=STEADY), states(varies, panel, policies=UNSTEADY))


_WORDS = {
    "E1": "Every algorithm stays roughly constant over the swarm size.",
    "E2": "CRW differs from the other three; it is higher (implied).",
    "E3": "STOCHM and STOCHX tie.",
    "E4": "CRW, DPO and STOCHM mostly tie.",
    "E5": "STOCHX is highest.",
    "E6": "STOCHX grows nearly linearly with the swarm size.",
}
_NEXT_SMALLER = "beside the next smaller swarm, as the equation is printed"
_SPATIAL_TEXT = "spatial self-organisation, as the text below the figure says"

_SELF_ORGANISATION = (
    *(
        Claim(
            name=name,
            text=_WORDS[name],
            figure="scenario 1, spatial self-organisation beside robots alone, small warehouse",
            statements=statements,
            otherwise={_NEXT_SMALLER: _about_small_swarms(("S1a", E_S))[name]},
        )
        for name, statements in _about_small_swarms(spatial("S1a")).items()
    ),
    *(
        Claim(
            name=name,
            text=_WORDS[name],
            figure="scenario 1, task self-organisation, medium warehouse",
            statements=statements,
            otherwise={_SPATIAL_TEXT: _about_large_swarms(spatial("S1b"))[name]},
        )
        for name, statements in _about_large_swarms(("S1b", E_T)).items()
    ),
    Claim(
        name="E7",
        text="STOCHX and CRW are steady over the swarm size, DPO and STOCHM vary strongly.",
        figure="scenario 2, task self-organisation, objects at rest",
        statements=_steady_and_not(("S2a still", E_T)),
    ),
    Claim(
        name="E8",
        text="In small swarms STOCHX is best, by a little.",
        figure="scenario 2, task self-organisation, objects at rest",
        statements=(
            states(leads_by_little, ("S2a still", E_T), leader="stochx", others=others_of("stochx"), levels="low"),
        ),
    ),
    Claim(
        name="E9",
        text="As E7, for spatial self-organisation with moving objects.",
        figure="scenario 2, spatial self-organisation, moving objects",
        statements=_steady_and_not(spatial("S2a slow")),
        otherwise={"objects at their fastest, as the caption says": _steady_and_not(spatial("S2a fast"))},
    ),
)

_ALL_WALKS = ("S2a still", "S2a slow", "S2a fast")

_SCALING = (
    Claim(
        name="C1",
        text="CRW and DPO have narrow bands.",
        figure="scenario 1, scalability, medium warehouse",
        statements=(states(is_narrow, ("S1b", C), policies=SIMPLE),),
    ),
    Claim(
        name="C2",
        text="STOCHM and STOCHX have wide bands.",
        figure="scenario 1, scalability, medium warehouse",
        statements=(states(is_wide, ("S1b", C), policies=COMPLEX),),
    ),
    Claim(
        name="C3",
        text="The complex algorithms can reach higher values than the simple ones, but less reliably.",
        figure="scenario 1, scalability, medium warehouse",
        statements=(
            states(reaches_higher, ("S1b", C), upper=COMPLEX, lower=SIMPLE),
            states(is_wider, ("S1b", C), upper=COMPLEX, lower=SIMPLE),
        ),
    ),
    Claim(
        name="C4",
        text="There are no significant differences at all.",
        figure="scenario 2, scalability (no figure), objects at rest and moving",
        statements=tuple(
            states(never_differ, (experiment, C), pairs=ALL_PAIRS, n_panels=len(_ALL_WALKS))
            for experiment in _ALL_WALKS
        ),
    ),
    Claim(
        name="P1",
        text="CRW and DPO deliver more than STOCHM and STOCHX.",
        figure="scenario 1, raw performance, medium warehouse",
        statements=(better(("S1b", P), SIMPLE, COMPLEX),),
    ),
    Claim(
        name="P2",
        text="The small warehouse shows the same picture.",
        figure="scenario 1, raw performance (no figure)",
        statements=(better(("S1a", P), SIMPLE, COMPLEX),),
    ),
    Claim(
        name="P3",
        text=(
            "Performance and self-organisation are negatively related: simpler algorithms perform better, CRW and DPO "
            "above STOCHM and STOCHX (implied)."
        ),
        figure="scenario 2, raw performance and self-organisation, objects at rest and at their fastest",
        statements=(
            states(opposite_order, ("S2a still", E_T), ("S2a still", P), policies=POLICIES, least=LOOSE),
            states(opposite_order, spatial("S2a fast"), ("S2a fast", P), policies=POLICIES, least=LOOSE),
            better(("S2a still", P), SIMPLE, COMPLEX),
            better(("S2a fast", P), SIMPLE, COMPLEX),
        ),
    ),
)


def _groups_under_strong(panel: Place) -> tuple[Statement, ...]:
    return (better(panel, STEADY, UNSTEADY, "high"), states(ties, panel, pairs=ALL_PAIRS, levels="low"))


_BY_FILE_NAME = "{}, as the name of the figure's file says"

_FLEXIBILITY_2 = (
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

_NOISE = (
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
)

_POPULATION = (
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
        statements=tuple(
            states(needs_larger_team, few=(50, 5), many=(200, 20), team=team) for team in (5.0, 10.0, 20.0)
        ),
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
)

_DISTURBED = (("S1c", R), ("S1d", R), ("S1c", A), ("S1d", A), ("S1e", N), ("S1f", N), ("S1g", D), ("S1h", D))
_DISTURBED_2 = (("S2b 115", R), ("S2b 320", A), ("S2c 320", N), ("S2d 115", D))
_ORGANISED_AND_DISTURBED: tuple[tuple[Place, tuple[Place, ...]], ...] = (
    (spatial("S1a"), tuple(panel for panel in _DISTURBED if panel[0] in ("S1c", "S1e", "S1g"))),
    (("S1b", E_T), tuple(panel for panel in _DISTURBED if panel[0] in ("S1d", "S1f", "S1h"))),
    (("S2a still", E_T), _DISTURBED_2),
)
"""Self-organisation as the paper shows it of each warehouse and of search and rescue, and what it is held beside."""

_TOGETHER = (
    Claim(
        name="X1",
        text="In flexibility and robustness CRW and STOCHX stand together, better than DPO and STOCHM.",
        figure="scenarios 1 and 2, flexibility and robustness",
        statements=tuple(better(panel, STEADY, UNSTEADY) for panel in (*_DISTURBED, *_DISTURBED_2)),
        needs="most",
    ),
    Claim(
        name="X2",
        text="Higher self-organisation goes with better flexibility and robustness.",
        figure="scenarios 1 and 2, self-organisation beside flexibility and robustness",
        statements=tuple(
            states(same_order, organised, panel, policies=POLICIES, better=(1, direction_of(panel[1])), least=LOOSE)
            for organised, disturbed in _ORGANISED_AND_DISTURBED
            for panel in disturbed
        ),
        needs="most",
    ),
    Claim(
        name="X3",
        text="Self-organisation is not tied to scalability or raw performance.",
        figure="scenarios 1 and 2, self-organisation beside scalability and raw performance",
        statements=tuple(
            states(unrelated, organised, (organised[0], measure), policies=POLICIES)
            for organised, _ in _ORGANISED_AND_DISTURBED
            for measure in (C, P)
        ),
        needs="most",
    ),
    Claim(
        name="X4",
        text="For scenario 2 STOCHX is the best choice overall.",
        figure="scenario 2, all figures",
        statements=tuple(
            best_of(panel, "stochx") for panel in (("S2a still", E_T), spatial("S2a slow"), *_DISTURBED_2)
        ),
        needs="most",
    ),
)

CLAIMS: dict[str, Claim] = {
    claim.name: claim
    for claim in (
        *_SELF_ORGANISATION,
        *_SCALING,
        *_flexibility("R", R),
        *_flexibility("A", A),
        *_FLEXIBILITY_2,
        *_NOISE,
        *_POPULATION,
        *_TOGETHER,
    )
}
"""Name -> claim."""
