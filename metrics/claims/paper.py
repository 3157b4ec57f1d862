"""The claims of the paper about its figures, as data: what each claim says, where, and the statements that it makes.

E are claims about self-organisation, C about scalability, P about raw performance, R about reactivity, A about
adaptability, N about noise, V about availability, D about population dynamics, X about several figures together. Where
the paper does not name a direction but its text implies one, the text of a claim says "(implied)". Where the paper's
text, captions, file names or program disagree, `otherwise` holds the other possible meanings of a claim.
"""

from .claim import Claim, Place, Statement
from .experiments import (
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
    Says,
    about,
    above,
    as_shares,
    best,
    best_of,
    better,
    direction_of,
    others_of,
    pairs_of,
    says,
    spatial,
    states,
    tie,
)
from .orders import LOOSE, differs_more, opposite_order, same_order, unrelated
from .rules import (
    availability_is,
    differ,
    is_constant,
    is_higher,
    is_less_available,
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


def _changes(policies: tuple[str, ...], between: tuple[float, float]) -> Says:
    return says(changes_within, views=(from_undisturbed,), policies=policies, between=between)


def _constant_shares(panel: Place) -> Statement:
    return states(is_constant, as_shares(panel), policies=POLICIES)  # the figure shows the share that is lost


_NEXT_SMALLER = "beside the next smaller swarm, as the equation is printed"
_STEADY_AND_NOT = (says(is_constant, policies=STEADY), says(varies, policies=UNSTEADY))
_SELF_ORGANISATION = (
    *about(
        "scenario 1, spatial self-organisation beside robots alone, small warehouse",
        (spatial("S1a"),),
        {
            "E1": ("Every algorithm stays roughly constant over the swarm size.", _constant_shares),
            "E2": ("CRW differs from the other three; it is higher (implied).", best("crw")),
            "E3": ("STOCHM and STOCHX tie.", tie(COMPLEX)),
        },
        {_NEXT_SMALLER: ("S1a", E_S)},
    ),
    *about(
        "scenario 1, task self-organisation, medium warehouse",
        (("S1b", E_T),),
        {
            "E4": ("CRW, DPO and STOCHM mostly tie.", tie(*pairs_of(("crw", "dpo", "stochm")))),
            "E5": ("STOCHX is highest.", best("stochx")),
            "E6": (
                "STOCHX grows nearly linearly with the swarm size.",
                says(is_linear, policies=("stochx",)),
            ),
        },
        {"spatial self-organisation, as the text below the figure says": spatial("S1b")},
    ),
    *about(
        "scenario 2, task self-organisation, objects at rest",
        (("S2a still", E_T),),
        {
            "E7": (
                "STOCHX and CRW are steady over the swarm size, DPO and STOCHM vary strongly.",
                *_STEADY_AND_NOT,
            ),
            "E8": (
                "In small swarms STOCHX is best, by a little.",
                says(leads_by_little, leader="stochx", others=others_of("stochx"), levels="low"),
            ),
        },
    ),
    *about(
        "scenario 2, spatial self-organisation, moving objects",
        (spatial("S2a slow"),),
        {"E9": ("As E7, for spatial self-organisation with moving objects.", *_STEADY_AND_NOT)},
        {"objects at their fastest, as the caption says": spatial("S2a fast")},
    ),
    *about(
        "scenario 1, spatial self-organisation (no figure), medium warehouse",
        (spatial("S1b"),),
        {
            "E10": (
                "Spatial self-organisation does not differ between the four.",
                says(never_differ, pairs=ALL_PAIRS),
            )
        },
        {_NEXT_SMALLER: ("S1b", E_S)},
    ),
)

_NARROW, _WIDE = says(is_narrow, policies=SIMPLE), says(is_wide, policies=COMPLEX)
_HIGHER_AND_WIDER = tuple(says(rule, upper=COMPLEX, lower=SIMPLE) for rule in (reaches_higher, is_wider))
_WALKS = ("S2a still", "S2a slow", "S2a fast")
_SIMPLE_BETTER = above(SIMPLE, COMPLEX)
_SCALING = (
    *about(
        "scenario 1, scalability, medium warehouse",
        (("S1b", C),),
        {
            "C1": ("CRW and DPO have narrow bands.", _NARROW),
            "C2": ("STOCHM and STOCHX have wide bands.", _WIDE),
            "C3": (
                "The complex algorithms can reach higher values than the simple ones, but less reliably.",
                *_HIGHER_AND_WIDER,
            ),
        },
    ),
    *about(
        "scenario 2, scalability (no figure), objects at rest and moving",
        tuple((walk, C) for walk in _WALKS),
        {
            "C4": (
                "There are no significant differences at all.",
                says(never_differ, pairs=ALL_PAIRS, n_panels=len(_WALKS)),
            )
        },
    ),
    *about(
        "scenario 1, scalability (no figure), small warehouse, as the caption says",
        (("S1a", C),),
        {
            "C5": (
                "The small warehouse shows the same picture: C1, C2 and C3 hold there, too.",
                *(_NARROW, _WIDE, *_HIGHER_AND_WIDER),
            )
        },
    ),
    *about(
        "scenario 1, scalability, medium warehouse",
        (("S1b", C),),
        {"C6": ("The complex algorithms scale less well than the simple ones.", _SIMPLE_BETTER)},
        {"in the small warehouse": ("S1a", C)},
    ),
    *about(
        "scenario 1, raw performance, medium warehouse",
        (("S1b", P),),
        {"P1": ("CRW and DPO deliver more than STOCHM and STOCHX.", _SIMPLE_BETTER)},
    ),
    *about(
        "scenario 1, raw performance (no figure)",
        (("S1a", P),),
        {"P2": ("The small warehouse shows the same picture.", _SIMPLE_BETTER)},
    ),
    Claim(
        "P3",
        "Performance and self-organisation are negatively related: simpler algorithms perform better, CRW and DPO "
        "above STOCHM and STOCHX (implied).",
        "scenario 2, raw performance and self-organisation, objects at rest and at their fastest",
        (
            states(opposite_order, ("S2a still", E_T), ("S2a still", P), policies=POLICIES, least=LOOSE),
            states(opposite_order, spatial("S2a fast"), ("S2a fast", P), policies=POLICIES, least=LOOSE),
            better(("S2a still", P), SIMPLE, COMPLEX),
            better(("S2a fast", P), SIMPLE, COMPLEX),
        ),
    ),
)


def _flexibility(letter: str, measure: str) -> list[Claim]:
    """Return the four claims that the paper makes in the same words about reactivity and about adaptability."""
    small, medium = ("S1c", measure), ("S1d", measure)
    where, others = f"scenario 1, {measure}, both warehouses", ("crw", "dpo", "stochm")
    return [
        *about(
            where,
            (small, medium),
            {
                f"{letter}1": (
                    "Under strong disturbance STOCHM and STOCHX are best; STOCHX is best in general.",
                    *(above(COMPLEX, SIMPLE, "high"), best("stochx")),
                ),
                f"{letter}2": ("DPO is worse than CRW.", above(("crw",), ("dpo",))),
            },
        ),
        Claim(
            f"{letter}3",
            "More differences are significant in the medium warehouse than in the small one.",
            where,
            (states(differs_more, small, medium, pairs=ALL_PAIRS),),
        ),
        *about(
            f"scenario 1, {measure}, medium warehouse",
            (medium,),
            {
                f"{letter}4": (
                    "STOCHX rises slowly and evenly with the disturbance; the others rise ever faster.",
                    says(is_higher, views=(slope_of,), upper=others, lower=("stochx",)),
                    tie(("stochx", ZERO), views=(bend_of, with_zero)),
                    says(is_higher, views=(bend_of, with_zero), upper=others, lower=(ZERO,)),
                )
            },
        ),
    ]


_BY_FILE_NAME = "{}, as the name of the figure's file says"
_FLEXIBILITY = (
    *_flexibility("R", R),
    *_flexibility("A", A),
    *about(
        "scenario 2, reactivity, 115 robots",
        (("S2b 115", R),),
        {
            "R5": (
                "CRW and STOCHX are best, DPO and STOCHM worst; only under strong disturbance, else they tie.",
                *(above(STEADY, UNSTEADY, "high"), tie(*ALL_PAIRS, levels="low")),
            )
        },
        {_BY_FILE_NAME.format(A): ("S2b 115", A)},
    ),
    *about(
        "scenario 2, adaptability, 320 robots",
        (("S2b 320", A),),
        {
            "A5": ("The algorithms mostly tie.", tie(*ALL_PAIRS)),
            "A6": (
                "Under strong disturbance CRW is better than DPO and STOCHM.",
                above(("crw",), UNSTEADY, "high"),
            ),
        },
        {_BY_FILE_NAME.format(R): ("S2b 320", R)},
    ),
    Claim(
        "A7",
        "The swarm sizes that are not shown look the same: they have the same order of algorithms.",
        "scenario 2, reactivity shown of 115 robots and adaptability of 320, of 12, 115 and 320",
        tuple(
            states(same_order, (shown, measure), (other, measure), policies=POLICIES)
            for measure, shown, others in (
                (R, "S2b 115", ("S2b 12", "S2b 320")),
                (A, "S2b 320", ("S2b 12", "S2b 115")),
            )
            for other in others
        ),
    ),
)

_RISES_MORE = says(is_higher, views=(rise_of,), upper=UNSTEADY, lower=STEADY)
_THREE = ("dpo", "stochm", "stochx")
_NOISE = (
    *about(
        "scenario 1, noise, small warehouse",
        (("S1e", N),),
        {
            "N1": ("CRW and STOCHX tie.", tie(STEADY)),
            "N2": (
                "DPO and STOCHM tie except under strong noise.",
                *(tie(UNSTEADY, levels="low"), says(differ, pairs=(UNSTEADY,), levels="high")),
            ),
            "N3": (
                "From a standard deviation of about 0.017 on, all algorithms change their behaviour.",
                _changes(POLICIES, ONSET),
            ),
            "N4": ("The change is strongest for DPO and STOCHM.", _RISES_MORE),
        },
    ),
    Claim(
        "N5",
        "The algorithms are further apart than in the small warehouse; N3 and N4 hold again.",
        "scenario 1, noise, medium warehouse",
        (
            states(differs_more, ("S1e", N), ("S1f", N), pairs=ALL_PAIRS),
            *(say(("S1f", N)) for say in (_changes(POLICIES, ONSET), _RISES_MORE)),
        ),
    ),
    *about(
        "scenario 2, noise, 320 robots",
        (("S2c 320", N),),
        {
            "N6": ("CRW and STOCHX tie in most cases.", tie(STEADY)),
            "N7": (
                "DPO, STOCHM and STOCHX get clearly worse with stronger noise, from 0.01 to 0.05 on.",
                says(is_higher, views=(rise_of, with_zero), upper=_THREE, lower=(ZERO,)),
                _changes(_THREE, LARGER),
            ),
            "N8": (
                "STOCHM changes under weaker noise than DPO and STOCHX.",
                says(changes_before, views=(from_undisturbed,), first="stochm", others=("dpo", "stochx")),
            ),
        },
    ),
    Claim(
        "N9",
        "115 robots show the same picture as 320: the same order of algorithms.",
        "scenario 2, noise (no figure), 115 robots",
        (states(same_order, ("S2c 320", N), ("S2c 115", N), policies=POLICIES),),
    ),
)


def _less_available(*needed: tuple[int, int]) -> tuple[Statement, ...]:
    """200 robots are less available than 50, with so many robots needed of each, for three mean teams at work."""
    return tuple(states(is_less_available, few=50, many=200, needed=needed, team=team) for team in (5.0, 10.0, 20.0))


_NEEDED = (1, 5, 10, 20, 40)
"""Numbers of robots needed of 50, in the availability figure."""
_FORMULA = "scenario 1, availability (formula)"
_LARGE_POPULATION = "scenario 1, population robustness, medium warehouse"
_POPULATION = (
    Claim(
        "V1",
        "With 50 robots, 5 needed and a mean team of 5, availability is about 0.40.",
        _FORMULA,
        (states(availability_is, n=50, n_min=5, team=5.0, expected=0.40, within=0.005),),
    ),
    Claim(
        "V2",
        "With 200 robots and 20 needed, larger teams are needed for the same availability.",
        _FORMULA,
        _less_available((5, 20)),
    ),
    Claim(
        "V3",
        "Availability drops more steeply with 200 robots than with 50, the more robots are needed.",
        _FORMULA,
        _less_available(*((n, n) for n in _NEEDED)),
        otherwise={"over the share of the swarm that is needed": _less_available(*((n, 4 * n) for n in _NEEDED))},
    ),
    *about(
        "scenario 1, population robustness, small warehouse",
        (("S1g", D),),
        {
            "D1": (
                "Under larger population variance STOCHX is most robust, and STOCHX and CRW are above DPO and STOCHM.",
                *(best("stochx", "high"), above(STEADY, UNSTEADY, "high")),
            )
        },
    ),
    Claim(
        "D2",
        "The order is that of task self-organisation, STOCHX first.",
        _LARGE_POPULATION,
        (best_of(("S1h", D), "stochx"), states(same_order, ("S1b", E_T), ("S1h", D), policies=POLICIES)),
    ),
    *about(
        "scenario 2, population robustness, 115 robots",
        (("S2d 115", D),),
        {"D3": ("CRW and STOCHX are high, DPO and STOCHM much lower.", above(STEADY, UNSTEADY))},
    ),
    Claim(
        "D4",
        "With 320 robots all tie.",
        "scenario 2, population robustness (no figure)",
        tuple(states(ties, ("S2d 320", D), pairs=(pair,)) for pair in ALL_PAIRS),
        otherwise={"as D3, as the caption says": (better(("S2d 320", D), STEADY, UNSTEADY),)},
    ),
    Claim(
        "D5",
        "STOCHM and CRW may tie.",
        _LARGE_POPULATION,
        vague='"May" leaves room for a tie and claims none: no outcome speaks against it.',
    ),
)

_DISTURBED = (("S1c", R), ("S1d", R), ("S1c", A), ("S1d", A), ("S1e", N), ("S1f", N), ("S1g", D), ("S1h", D))
_DISTURBED_2 = (("S2b 115", R), ("S2b 320", A), ("S2c 320", N), ("S2d 115", D))
_EVERYWHERE = (*_DISTURBED, *_DISTURBED_2)
_ORGANISED_AND_DISTURBED: tuple[tuple[Place, tuple[Place, ...]], ...] = (
    (spatial("S1a"), tuple(panel for panel in _DISTURBED if panel[0] in ("S1c", "S1e", "S1g"))),
    (("S1b", E_T), tuple(panel for panel in _DISTURBED if panel[0] in ("S1d", "S1f", "S1h"))),
    (("S2a still", E_T), _DISTURBED_2),
)
"""Self-organisation as the paper shows it of each warehouse and of search and rescue, and what it is held beside."""
_TOGETHER = (
    Claim(
        "X1",
        "In flexibility and robustness CRW and STOCHX stand together, better than DPO and STOCHM.",
        "scenarios 1 and 2, flexibility and robustness",
        tuple(better(panel, STEADY, UNSTEADY) for panel in _EVERYWHERE),
        needs="most",
    ),
    Claim(
        "X2",
        "Higher self-organisation goes with better flexibility and robustness.",
        "scenarios 1 and 2, self-organisation beside flexibility and robustness",
        tuple(
            states(same_order, organised, panel, policies=POLICIES, better=(1, direction_of(panel[1])), least=LOOSE)
            for organised, disturbed in _ORGANISED_AND_DISTURBED
            for panel in disturbed
        ),
        needs="most",
    ),
    Claim(
        "X3",
        "Self-organisation is not tied to scalability or raw performance.",
        "scenarios 1 and 2, self-organisation beside scalability and raw performance",
        tuple(
            states(unrelated, organised, (organised[0], measure), policies=POLICIES)
            for organised, _ in _ORGANISED_AND_DISTURBED
            for measure in (C, P)
        ),
        needs="most",
    ),
    Claim(
        "X4",
        "For scenario 2 STOCHX is the best choice overall.",
        "scenario 2, all figures",
        tuple(best_of(panel, "stochx") for panel in (("S2a still", E_T), spatial("S2a slow"), *_DISTURBED_2)),
        needs="most",
    ),
    Claim(
        "X5",
        'More "intelligent" algorithms are more flexible and robust: STOCHM and STOCHX more than CRW and DPO.',
        "scenarios 1 and 2, flexibility and robustness",
        tuple(better(panel, COMPLEX, SIMPLE) for panel in _EVERYWHERE),
        needs="most",
    ),
)

CLAIMS: dict[str, Claim] = {
    claim.name: claim for claim in (*_SELF_ORGANISATION, *_SCALING, *_FLEXIBILITY, *_NOISE, *_POPULATION, *_TOGETHER)
}
"""Name -> claim."""
