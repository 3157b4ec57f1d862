"""The paper's claims about swarm sizes: self-organisation (E), scalability (C) and raw performance (P)."""

from .checking import Claim, Place, Statement
from .orders import LOOSE, opposite_order
from .predicates import (
    every_pair,
    is_constant,
    is_narrow,
    is_wide,
    is_wider,
    leads_by_little,
    never_differ,
    reaches_higher,
    ties,
    varies,
)
from .shapes import is_linear
from .statements import (
    ALL_PAIRS,
    COMPLEX,
    E_S,
    E_T,
    POLICIES,
    SIMPLE,
    STEADY,
    UNSTEADY,
    C,
    P,
    as_shares,
    best_of,
    better,
    others_of,
    spatial,
    states,
)


def _about_small_swarms(panel: Place) -> dict[str, tuple[Statement, ...]]:
    """What E1 to E3 say about spatial self-organisation in the small warehouse."""
    return {
        # The figure shows the share of performance that is lost.
        "E1": (states(is_constant, as_shares(panel), policies=POLICIES),),
        "E2": (best_of(panel, "crw"),),
        "E3": (states(ties, panel, pairs=(COMPLEX,)),),
    }


def _about_large_swarms(panel: Place) -> dict[str, tuple[Statement, ...]]:
    """What E4 to E6 say about self-organisation in the medium warehouse."""
    return {
        "E4": (states(ties, panel, pairs=every_pair(("crw", "dpo", "stochm"))),),
        "E5": (best_of(panel, "stochx"),),
        "E6": (states(is_linear, panel, policies=("stochx",)),),
    }


def _steady_and_not(panel: Place) -> tuple[Statement, ...]:
    """What E7 and E9 say about self-organisation in search and rescue."""
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

SELF_ORGANISATION = (
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
    Claim(
        name="E10",
        text="Spatial self-organisation does not differ between the four.",
        figure="scenario 1, spatial self-organisation (no figure), medium warehouse",
        statements=(states(never_differ, spatial("S1b"), pairs=ALL_PAIRS),),
        otherwise={_NEXT_SMALLER: (states(never_differ, ("S1b", E_S), pairs=ALL_PAIRS),)},
    ),
)


def _about_bands(panel: Place) -> dict[str, tuple[Statement, ...]]:
    """What C1 to C3 say about scalability in a warehouse."""
    return {
        "C1": (states(is_narrow, panel, policies=SIMPLE),),
        "C2": (states(is_wide, panel, policies=COMPLEX),),
        "C3": (
            states(reaches_higher, panel, upper=COMPLEX, lower=SIMPLE),
            states(is_wider, panel, upper=COMPLEX, lower=SIMPLE),
        ),
    }


_WORDS_ON_BANDS = {
    "C1": "CRW and DPO have narrow bands.",
    "C2": "STOCHM and STOCHX have wide bands.",
    "C3": "The complex algorithms can reach higher values than the simple ones, but less reliably.",
}
_ALL_WALKS = ("S2a still", "S2a slow", "S2a fast")

SCALING = (
    *(
        Claim(
            name=name,
            text=_WORDS_ON_BANDS[name],
            figure="scenario 1, scalability, medium warehouse",
            statements=statements,
        )
        for name, statements in _about_bands(("S1b", C)).items()
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
        name="C5",
        text="The small warehouse shows the same picture: C1, C2 and C3 hold there, too.",
        figure="scenario 1, scalability (no figure), small warehouse, as the caption says",
        statements=tuple(statement for of in _about_bands(("S1a", C)).values() for statement in of),
    ),
    Claim(
        name="C6",
        text="The complex algorithms scale less well than the simple ones.",
        figure="scenario 1, scalability, medium warehouse",
        statements=(better(("S1b", C), SIMPLE, COMPLEX),),
        otherwise={"in the small warehouse": (better(("S1a", C), SIMPLE, COMPLEX),)},
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
