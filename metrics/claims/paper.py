"""The claims of the paper about its figures, and what its authors expected before, as data.

E are claims about self-organisation, C about scalability, P about raw performance, R about reactivity, A about
adaptability, N about noise, V about availability, D about population dynamics, X about several figures together. Where
the paper does not name a direction but its text implies one, the text of a claim says "(implied)". Where the paper's
text, captions, file names or program disagree, `otherwise` holds the other possible meanings of a claim.
"""

from itertools import pairwise

from . import rules, shapes
from .claim import Claim, Statement
from .orders import LOOSE, differs_more, same_order, unrelated
from .rules import is_higher
from .shapes import ZERO, bend_of, from_undisturbed, rise_of, with_zero
from .words import (
    ALL,
    COMPLEX,
    LARGER,
    LOWER_IS_BETTER,
    ONSET,
    SIMPLE,
    STEADY,
    UNSTEADY,
    Says,
    about,
    best,
    better,
    of_each,
    pairs_of,
    place,
    places,
    says,
    states,
    tie,
)


def _changes(policies: str, between: tuple[float, float]) -> Says:
    return says(shapes.changes_within, views=(from_undisturbed,), policies=policies, between=between)


def _constant_shares(where: str) -> tuple[Statement, ...]:  # the figure shows the share that is lost
    return (states(rules.is_constant, place(where)._replace(is_relative=True), policies=ALL),)


_NEXT_SMALLER = "beside the next smaller swarm, as the equation is printed"
_STEADY_AND_NOT = (says(rules.is_constant, policies=STEADY), says(rules.varies, policies=UNSTEADY))
_SELF_ORGANISATION = (
    *about(
        "scenario 1, spatial self-organisation beside robots alone, small warehouse",
        "S1a E_S",
        E1=("Every algorithm stays roughly constant over the swarm size.", _constant_shares),
        E2=("CRW differs from the other three; it is higher (implied).", best("crw")),
        E3=("STOCHM and STOCHX tie.", tie(COMPLEX)),
        otherwise={_NEXT_SMALLER: "S1a E_N"},
    ),
    *about(
        "scenario 1, task self-organisation, medium warehouse",
        "S1b E_T",
        E4=("CRW, DPO and STOCHM mostly tie.", tie("crw dpo stochm")),
        E5=("STOCHX is highest.", best("stochx")),
        E6=("STOCHX grows nearly linearly with the swarm size.", says(shapes.is_linear, policies="stochx")),
        otherwise={"spatial self-organisation, as the text below the figure says": "S1b E_S"},
    ),
    *about(
        "scenario 2, task self-organisation, objects at rest",
        "S2a still E_T",
        E7=("STOCHX and CRW are steady over the swarm size, DPO and STOCHM vary strongly.", *_STEADY_AND_NOT),
        E8=(
            "In small swarms STOCHX is best, by a little.",
            says(rules.leads_by_little, leader="stochx", others="crw dpo stochm", levels="low"),
        ),
    ),
    *about(
        "scenario 2, spatial self-organisation, moving objects",
        "S2a slow E_S",
        E9=("As E7, for spatial self-organisation with moving objects.", *_STEADY_AND_NOT),
        otherwise={"objects at their fastest, as the caption says": "S2a fast E_S"},
    ),
    *about(
        "scenario 1, spatial self-organisation (no figure), medium warehouse",
        "S1b E_S",
        E10=("Spatial self-organisation does not differ between the four.", says(rules.never_differ, pairs=ALL)),
        otherwise={_NEXT_SMALLER: "S1b E_N"},
    ),
)

_NARROW, _WIDE = says(rules.is_narrow, policies=SIMPLE), says(rules.is_wide, policies=COMPLEX)
_HIGHER_AND_WIDER = tuple(says(rule, upper=COMPLEX, lower=SIMPLE) for rule in (rules.reaches_higher, rules.is_wider))
_SIMPLE_BETTER = better(f"{SIMPLE} > {COMPLEX}")
_SCALING = (
    *about(
        "scenario 1, scalability, medium warehouse",
        "S1b C",
        C1=("CRW and DPO have narrow bands.", _NARROW),
        C2=("STOCHM and STOCHX have wide bands.", _WIDE),
        C3=(
            "The complex algorithms can reach higher values than the simple ones, but less reliably.",
            *_HIGHER_AND_WIDER,
        ),
    ),
    *about(
        "scenario 2, scalability (no figure), objects at rest and moving",
        "S2a still C, S2a slow C, S2a fast C",
        C4=("There are no significant differences at all.", says(rules.never_differ, pairs=ALL, n_panels=3)),
    ),
    *about(
        "scenario 1, scalability (no figure), small warehouse, as the caption says",
        "S1a C",
        C5=(
            "The small warehouse shows the same picture: C1, C2 and C3 hold there, too.",
            *(_NARROW, _WIDE, *_HIGHER_AND_WIDER),
        ),
    ),
    *about(
        "scenario 1, scalability, medium warehouse",
        "S1b C",
        C6=("The complex algorithms scale less well than the simple ones.", _SIMPLE_BETTER),
        otherwise={"in the small warehouse": "S1a C"},
    ),
    *about(
        "scenario 1, raw performance, medium warehouse",
        "S1b P",
        P1=("CRW and DPO deliver more than STOCHM and STOCHX.", _SIMPLE_BETTER),
    ),
    *about(
        "scenario 1, raw performance (no figure)",
        "S1a P",
        P2=("The small warehouse shows the same picture.", _SIMPLE_BETTER),
    ),
    Claim(
        "P3",
        "Performance and self-organisation are negatively related: simpler algorithms perform better, CRW and DPO "
        "above STOCHM and STOCHX (implied).",
        "scenario 2, raw performance and self-organisation, objects at rest and at their fastest",
        (
            states(same_order, "S2a still E_T", "S2a still P", policies=ALL, better=(1, -1), least=LOOSE),
            states(same_order, "S2a fast E_S", "S2a fast P", policies=ALL, better=(1, -1), least=LOOSE),
            *of_each(("S2a still P", "S2a fast P"), _SIMPLE_BETTER),
        ),
    ),
)


def _flexibility(letter: str, measure: str) -> list[Claim]:
    """Return the four claims that the paper makes in the same words about reactivity and about adaptability."""
    small, medium, others = f"S1c {letter}", f"S1d {letter}", "crw dpo stochm"
    where = f"scenario 1, {measure}, both warehouses"
    return [
        *about(
            where,
            f"{small}, {medium}",
            otherwise=None,
            **{
                f"{letter}1": (
                    "Under strong disturbance STOCHM and STOCHX are best; STOCHX is best in general.",
                    *(better(f"{COMPLEX} > {SIMPLE}", "high"), best("stochx")),
                ),
                f"{letter}2": ("DPO is worse than CRW.", better("crw > dpo")),
            },
        ),
        Claim(
            f"{letter}3",
            "More differences are significant in the medium warehouse than in the small one.",
            where,
            (states(differs_more, small, medium, pairs=ALL),),
        ),
        *about(
            f"scenario 1, {measure}, medium warehouse",
            medium,
            otherwise=None,
            **{
                f"{letter}4": (
                    "STOCHX rises slowly and evenly with the disturbance; the others rise ever faster.",
                    says(is_higher, views=(shapes.slope_of,), upper=others, lower="stochx"),
                    tie(f"stochx {ZERO}", views=(bend_of, with_zero)),
                    says(is_higher, views=(bend_of, with_zero), upper=others, lower=ZERO),
                )
            },
        ),
    ]


_STRONG = better(f"{STEADY} > {UNSTEADY}", "high")
_BY_FILE_NAME = "{}, as the name of the figure's file says"
_FLEXIBILITY = (
    *_flexibility("R", "reactivity"),
    *_flexibility("A", "adaptability"),
    *about(
        "scenario 2, reactivity, 115 robots",
        "S2b 115 R",
        R5=(
            "CRW and STOCHX are best, DPO and STOCHM worst; only under strong disturbance, else they tie.",
            *(_STRONG, tie(ALL, levels="low")),
        ),
        otherwise={_BY_FILE_NAME.format("adaptability"): "S2b 115 A"},
    ),
    *about(
        "scenario 2, adaptability, 320 robots",
        "S2b 320 A",
        A5=("The algorithms mostly tie.", tie(ALL)),
        A6=(
            "Under strong disturbance CRW is better than DPO and STOCHM.",
            better(f"crw > {UNSTEADY}", "high"),
        ),
        otherwise={_BY_FILE_NAME.format("reactivity"): "S2b 320 R"},
    ),
    Claim(
        "A7",
        "The swarm sizes that are not shown look the same: they have the same order of algorithms.",
        "scenario 2, reactivity shown of 115 robots and adaptability of 320, of 12, 115 and 320",
        tuple(
            states(same_order, shown, other, policies=ALL)
            for shown, others in (("S2b 115 R", "S2b 12 R, S2b 320 R"), ("S2b 320 A", "S2b 12 A, S2b 115 A"))
            for other in places(others)
        ),
    ),
)

_RISES_MORE = says(is_higher, views=(rise_of,), upper=UNSTEADY, lower=STEADY)
_THREE = "dpo stochm stochx"
_NOISE = (
    *about(
        "scenario 1, noise, small warehouse",
        "S1e N",
        N1=("CRW and STOCHX tie.", tie(STEADY)),
        N2=(
            "DPO and STOCHM tie except under strong noise.",
            *(tie(UNSTEADY, levels="low"), says(rules.differ, pairs=UNSTEADY, levels="high")),
        ),
        N3=(
            "From a standard deviation of about 0.017 on, all algorithms change their behaviour.",
            _changes(ALL, ONSET),
        ),
        N4=("The change is strongest for DPO and STOCHM.", _RISES_MORE),
    ),
    Claim(
        "N5",
        "The algorithms are further apart than in the small warehouse; N3 and N4 hold again.",
        "scenario 1, noise, medium warehouse",
        (states(differs_more, "S1e N", "S1f N", pairs=ALL), *of_each(["S1f N"], _changes(ALL, ONSET), _RISES_MORE)),
    ),
    *about(
        "scenario 2, noise, 320 robots",
        "S2c 320 N",
        N6=("CRW and STOCHX tie in most cases.", tie(STEADY)),
        N7=(
            "DPO, STOCHM and STOCHX get clearly worse with stronger noise, from 0.01 to 0.05 on.",
            says(is_higher, views=(rise_of, with_zero), upper=_THREE, lower=ZERO),
            _changes(_THREE, LARGER),
        ),
        N8=(
            "STOCHM changes under weaker noise than DPO and STOCHX.",
            says(shapes.changes_before, views=(from_undisturbed,), first="stochm", others="dpo stochx"),
        ),
    ),
    Claim(
        "N9",
        "115 robots show the same picture as 320: the same order of algorithms.",
        "scenario 2, noise (no figure), 115 robots",
        (states(same_order, "S2c 320 N", "S2c 115 N", policies=ALL),),
    ),
)


def _less_available(*needed: tuple[int, int]) -> tuple[Statement, ...]:
    """200 robots are less available than 50, with so many robots needed of each, for three mean teams at work."""
    return tuple(
        states(rules.is_less_available, few=50, many=200, needed=needed, team=team) for team in (5.0, 10.0, 20.0)
    )


_NEEDED = (1, 5, 10, 20, 40)
"""Numbers of robots needed of 50, in the availability figure."""
_FORMULA = "scenario 1, availability (formula)"
_POPULATION = (
    Claim(
        "V1",
        "With 50 robots, 5 needed and a mean team of 5, availability is about 0.40.",
        _FORMULA,
        (states(rules.availability_is, n=50, n_min=5, team=5.0, expected=0.40, within=0.005),),
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
        "S1g D",
        D1=(
            "Under larger population variance STOCHX is most robust, and STOCHX and CRW are above DPO and STOCHM.",
            *(best("stochx", "high"), _STRONG),
        ),
    ),
    Claim(
        "D2",
        "The order is that of task self-organisation, STOCHX first.",
        "scenario 1, population robustness, medium warehouse",
        (*best("stochx")("S1h D"), states(same_order, "S1b E_T", "S1h D", policies=ALL)),
    ),
    *about(
        "scenario 2, population robustness, 115 robots",
        "S2d 115 D",
        D3=("CRW and STOCHX are high, DPO and STOCHM much lower.", better(f"{STEADY} > {UNSTEADY}")),
    ),
    Claim(
        "D4",
        "With 320 robots all tie.",
        "scenario 2, population robustness (no figure)",
        tuple(states(rules.ties, "S2d 320 D", pairs=" ".join(pair)) for pair in pairs_of(ALL)),
        otherwise={"as D3, as the caption says": better(f"{STEADY} > {UNSTEADY}")("S2d 320 D")},
    ),
    Claim(
        "D5",
        "STOCHM and CRW may tie.",
        "scenario 1, population robustness, medium warehouse",
        vague='"May" leaves room for a tie and claims none: no outcome speaks against it.',
    ),
)

_DISTURBED_2 = places("S2b 115 R, S2b 320 A, S2c 320 N, S2d 115 D")
_EVERYWHERE = [*places("S1c R, S1d R, S1c A, S1d A, S1e N, S1f N, S1g D, S1h D"), *_DISTURBED_2]
_ORGANISED_AND_DISTURBED = {
    "S1a E_S": places("S1c R, S1c A, S1e N, S1g D"),
    "S1b E_T": places("S1d R, S1d A, S1f N, S1h D"),
    "S2a still E_T": _DISTURBED_2,
}
"""Self-organisation as the paper shows it of each warehouse and of search and rescue, and what it is held beside."""
_TOGETHER = (
    Claim(
        "X1",
        "In flexibility and robustness CRW and STOCHX stand together, better than DPO and STOCHM.",
        "scenarios 1 and 2, flexibility and robustness",
        of_each(_EVERYWHERE, better(f"{STEADY} > {UNSTEADY}")),
        needs="most",
    ),
    Claim(
        "X2",
        "Higher self-organisation goes with better flexibility and robustness.",
        "scenarios 1 and 2, self-organisation beside flexibility and robustness",
        tuple(
            states(same_order, organised, panel, policies=ALL, better=(1, direction), least=LOOSE)
            for organised, disturbed in _ORGANISED_AND_DISTURBED.items()
            for panel in disturbed
            for direction in (-1 if place(panel).measure in LOWER_IS_BETTER else 1,)
        ),
        needs="most",
    ),
    Claim(
        "X3",
        "Self-organisation is not tied to scalability or raw performance.",
        "scenarios 1 and 2, self-organisation beside scalability and raw performance",
        tuple(
            states(unrelated, organised, f"{organised.rpartition(' ')[0]} {symbol}", policies=ALL)
            for organised in _ORGANISED_AND_DISTURBED
            for symbol in ("C", "P")
        ),
        needs="most",
    ),
    Claim(
        "X4",
        "For scenario 2 STOCHX is the best choice overall.",
        "scenario 2, all figures",
        of_each(("S2a still E_T", "S2a slow E_S", *_DISTURBED_2), best("stochx")),
        needs="most",
    ),
    Claim(
        "X5",
        'More "intelligent" algorithms are more flexible and robust: STOCHM and STOCHX more than CRW and DPO.',
        "scenarios 1 and 2, flexibility and robustness",
        of_each(_EVERYWHERE, better(f"{COMPLEX} > {SIMPLE}")),
        needs="most",
    ),
)

CLAIMS: dict[str, Claim] = {
    claim.name: claim for claim in (*_SELF_ORGANISATION, *_SCALING, *_FLEXIBILITY, *_NOISE, *_POPULATION, *_TOGETHER)
}
"""Name -> claim."""

_SPATIAL = "S1a E_S, S1b E_S"
_FLEXIBLE = "S1c R, S1d R, S1c A, S1d A"
_BOTH_WAREHOUSES = "S1a C, S1b C"
_SELF_2 = "S2a still E_T, S2a slow E_S"
_FLEXIBLE_2, _NOISE_2, _DEATHS_2 = "S2b 115 R, S2b 320 A", "S2c 320 N", "S2d 115 D"
_NOT_IN_THE_SMALL = tuple(
    states(rules.is_not_higher, "S1a E_T", first="stochx", second=other) for other in SIMPLE.split()
)
_EXPECTED: tuple[tuple[int, str, str, str], ...] = (
    (1, "CRW: Modest spatial self-organisation: above DPO, below STOCHX.", _SPATIAL, "stochx > crw > dpo"),
    (
        1,
        "CRW: Moderate reactivity and adaptability: better than DPO, worse than STOCHX.",
        _FLEXIBLE,
        "stochx > crw > dpo",
    ),
    (1, "DPO: Less spatial self-organisation than CRW.", _SPATIAL, "crw > dpo"),
    (1, "DPO: Low reactivity and adaptability: worse than the three others.", _FLEXIBLE, "crw stochm stochx > dpo"),
    (1, "STOCHM: Low self-organisation: below CRW and STOCHX.", f"{_SPATIAL}, S1b E_T", "crw stochx > stochm"),
    (1, "STOCHM: More reactive and adaptable than DPO.", _FLEXIBLE, "stochm > dpo"),
    (1, "STOCHM: Less scalable than CRW and DPO.", _BOTH_WAREHOUSES, "crw dpo > stochm"),
    (1, "STOCHX: High spatial self-organisation.", _SPATIAL, "stochx > crw dpo stochm"),
    (1, "STOCHX: High reactivity and adaptability.", _FLEXIBLE, "stochx > crw dpo stochm"),
    (1, "STOCHX: High robustness to malfunctions and repairs.", "S1g D, S1h D", "stochx > crw dpo stochm"),
    (
        1,
        "STOCHX: Task self-organisation in the medium warehouse, where objects lie everywhere, not in the small one.",
        "S1b E_T",
        "stochx > crw dpo stochm",
    ),
    (1, "STOCHX: Delivers less than CRW and DPO.", "S1a P, S1b P", "crw dpo > stochx"),
    (1, "STOCHX: Less scalable than STOCHM.", _BOTH_WAREHOUSES, "stochm > stochx"),
    (2, "CRW: Moving objects do not affect it: it performs alike with objects at rest and at their fastest.", "", ""),
    (
        2,
        "CRW: Robust to deaths and to noise: better than DPO and STOCHM.",
        f"{_DEATHS_2}, {_NOISE_2}",
        "crw > dpo stochm",
    ),
    (2, "CRW: Reactive and adaptable: better than DPO and STOCHM.", _FLEXIBLE_2, "crw > dpo stochm"),
    (2, "DPO: Less self-organised than CRW.", _SELF_2, "crw > dpo"),
    (
        2,
        "DPO: Low robustness and flexibility: worse than CRW and STOCHX.",
        f"{_NOISE_2}, {_DEATHS_2}, {_FLEXIBLE_2}",
        "crw stochx > dpo",
    ),
    (2, "STOCHM: Poor self-organisation: below CRW and STOCHX.", _SELF_2, "crw stochx > stochm"),
    (
        2,
        "STOCHM: Low robustness to deaths, but above DPO: below CRW and STOCHX.",
        _DEATHS_2,
        "crw stochx > stochm > dpo",
    ),
    (2, "STOCHX: Modest self-organisation: above STOCHM.", _SELF_2, "stochx > stochm"),
    (
        2,
        "STOCHX: Modest robustness to deaths and modest flexibility: worse than CRW, better than DPO.",
        f"{_DEATHS_2}, {_FLEXIBLE_2}",
        "crw > stochx > dpo",
    ),
)  # fmt: skip
"""Scenario, algorithm and words, panels, and who is better than whom. The paper has a table of intuitions per scenario.
Its words are vague; here "high" means better than all three others, "low" worse than CRW and STOCHX, and for one of
these two worse than both others; "modest" lies between (our choice)."""
_FURTHER = {11: _NOT_IN_THE_SMALL, 14: (states(rules.stays_alike, "S2a still P", "S2a fast P", policy="crw"),)}
"""Number of an intuition -> what it says by other rules."""


def _steps(chain: str) -> list[Says]:
    return [better(f"{winners} > {losers}") for winners, losers in pairwise(chain.split(" > "))]


INTUITIONS: dict[str, Claim] = {
    f"H{number}": Claim(
        f"H{number}",
        text,
        f"scenario {scenario}, intuitions",
        (*of_each(filter(None, places(where)), *_steps(chain)), *_FURTHER.get(number, ())),
    )
    for number, (scenario, text, where, chain) in enumerate(_EXPECTED, 1)
}
"""Name -> intuition; H as in hypothesis."""
