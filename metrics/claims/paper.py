"""The claims of the paper about its figures, as data: what each claim says, where, and the statements that it makes.

E are claims about self-organisation, C about scalability, P about raw performance, R about reactivity, A about
adaptability, N about noise, V about availability, D about population dynamics, X about several figures together. Where
the paper does not name a direction but its text implies one, the text of a claim says "(implied)". Where the paper's
text, captions, file names or program disagree, `otherwise` holds the other possible meanings of a claim.

The statements come from `predicates`, `shapes` and `orders`. We changed some of their rules after we had seen runs: see
docs/metrics.md, "Rules that changed after runs were seen".
"""

from .adversity import FLEXIBILITY, NOISE, POPULATION
from .checking import Claim, Place
from .orders import LOOSE, same_order, unrelated
from .sizes import SCALING, SELF_ORGANISATION
from .statements import (
    COMPLEX,
    E_T,
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
    best_of,
    better,
    direction_of,
    spatial,
    states,
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
    Claim(
        name="X5",
        text='More "intelligent" algorithms are more flexible and robust: STOCHM and STOCHX more than CRW and DPO.',
        figure="scenarios 1 and 2, flexibility and robustness",
        statements=tuple(better(panel, COMPLEX, SIMPLE) for panel in (*_DISTURBED, *_DISTURBED_2)),
        needs="most",
    ),
)

CLAIMS: dict[str, Claim] = {
    claim.name: claim for claim in (*SELF_ORGANISATION, *SCALING, *FLEXIBILITY, *NOISE, *POPULATION, *_TOGETHER)
}
"""Name -> claim."""
