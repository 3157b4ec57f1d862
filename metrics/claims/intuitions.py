"""What the paper's authors expected of each algorithm before their experiments, as claims that scores can answer.

The paper has two tables of intuitions, one per scenario. Their words are vague: "modest", "moderate", "low". Here each
is a comparison with the other algorithms. "High" means better than all three others. "Low" means worse than CRW and
STOCHX, and for one of these two worse than both others. "Modest" lies between. This is our choice.
"""

from .claim import Claim, Place, Statement
from .experiments import E_T, SIMPLE, STEADY, UNSTEADY, A, C, D, N, P, R, best_of, better, spatial, states
from .rules import is_not_higher, stays_alike

_SPATIAL = (spatial("S1a"), spatial("S1b"))
_FLEXIBLE = tuple((experiment, measure) for measure in (R, A) for experiment in ("S1c", "S1d"))
_SCALING = (("S1a", C), ("S1b", C))
_SELF_2 = (("S2a still", E_T), spatial("S2a slow"))
_FLEXIBLE_2 = (("S2b 115", R), ("S2b 320", A))
_NOISE_2 = (("S2c 320", N),)
_POPULATION_2 = (("S2d 115", D),)


def _all_better(panels: tuple[Place, ...], winners: tuple[str, ...], losers: tuple[str, ...]) -> tuple[Statement, ...]:
    return tuple(better(panel, winners, losers) for panel in panels)


def _between(panels: tuple[Place, ...], above: str, middle: str, below: str) -> tuple[Statement, ...]:
    return (*_all_better(panels, (above,), (middle,)), *_all_better(panels, (middle,), (below,)))


_WRITTEN: tuple[tuple[int, str, str, tuple[Statement, ...]], ...] = (
    (
        1,
        "CRW",
        "Modest spatial self-organisation: above DPO, below STOCHX.",
        _between(_SPATIAL, "stochx", "crw", "dpo"),
    ),
    (
        1,
        "CRW",
        "Moderate reactivity and adaptability: better than DPO, worse than STOCHX.",
        _between(_FLEXIBLE, "stochx", "crw", "dpo"),
    ),
    (1, "DPO", "Less spatial self-organisation than CRW.", _all_better(_SPATIAL, ("crw",), ("dpo",))),
    (
        1,
        "DPO",
        "Low reactivity and adaptability: worse than the three others.",
        _all_better(_FLEXIBLE, ("crw", "stochm", "stochx"), ("dpo",)),
    ),
    (
        1,
        "STOCHM",
        "Low self-organisation: below CRW and STOCHX.",
        _all_better((*_SPATIAL, ("S1b", E_T)), STEADY, ("stochm",)),
    ),
    (1, "STOCHM", "More reactive and adaptable than DPO.", _all_better(_FLEXIBLE, ("stochm",), ("dpo",))),
    (1, "STOCHM", "Less scalable than CRW and DPO.", _all_better(_SCALING, SIMPLE, ("stochm",))),
    (1, "STOCHX", "High spatial self-organisation.", tuple(best_of(panel, "stochx") for panel in _SPATIAL)),
    (1, "STOCHX", "High reactivity and adaptability.", tuple(best_of(panel, "stochx") for panel in _FLEXIBLE)),
    (
        1,
        "STOCHX",
        "High robustness to malfunctions and repairs.",
        tuple(best_of((experiment, D), "stochx") for experiment in ("S1g", "S1h")),
    ),
    (
        1,
        "STOCHX",
        "Task self-organisation in the medium warehouse, where objects lie everywhere, not in the small one.",
        (
            best_of(("S1b", E_T), "stochx"),
            *(states(is_not_higher, ("S1a", E_T), first="stochx", second=other) for other in SIMPLE),
        ),
    ),
    (
        1,
        "STOCHX",
        "Delivers less than CRW and DPO.",
        _all_better((("S1a", P), ("S1b", P)), SIMPLE, ("stochx",)),
    ),
    (1, "STOCHX", "Less scalable than STOCHM.", _all_better(_SCALING, ("stochm",), ("stochx",))),
    (
        2,
        "CRW",
        "Moving objects do not affect it: it performs alike with objects at rest and at their fastest.",
        (states(stays_alike, ("S2a still", P), ("S2a fast", P), policy="crw"),),
    ),
    (
        2,
        "CRW",
        "Robust to deaths and to noise: better than DPO and STOCHM.",
        _all_better((*_POPULATION_2, *_NOISE_2), ("crw",), UNSTEADY),
    ),
    (
        2,
        "CRW",
        "Reactive and adaptable: better than DPO and STOCHM.",
        _all_better(_FLEXIBLE_2, ("crw",), UNSTEADY),
    ),
    (2, "DPO", "Less self-organised than CRW.", _all_better(_SELF_2, ("crw",), ("dpo",))),
    (
        2,
        "DPO",
        "Low robustness and flexibility: worse than CRW and STOCHX.",
        _all_better((*_NOISE_2, *_POPULATION_2, *_FLEXIBLE_2), STEADY, ("dpo",)),
    ),
    (2, "STOCHM", "Poor self-organisation: below CRW and STOCHX.", _all_better(_SELF_2, STEADY, ("stochm",))),
    (
        2,
        "STOCHM",
        "Low robustness to deaths, but above DPO: below CRW and STOCHX.",
        (*_all_better(_POPULATION_2, STEADY, ("stochm",)), *_all_better(_POPULATION_2, ("stochm",), ("dpo",))),
    ),
    (2, "STOCHX", "Modest self-organisation: above STOCHM.", _all_better(_SELF_2, ("stochx",), ("stochm",))),
    (
        2,
        "STOCHX",
        "Modest robustness to deaths and modest flexibility: worse than CRW, better than DPO.",
        _between((*_POPULATION_2, *_FLEXIBLE_2), "crw", "stochx", "dpo"),
    ),
)

INTUITIONS: dict[str, Claim] = {
    f"H{number}": Claim(f"H{number}", f"{policy}: {text}", f"scenario {scenario}, intuitions", statements)
    for number, (scenario, policy, text, statements) in enumerate(_WRITTEN, 1)
}
"""Name -> intuition; H as in hypothesis."""
