"""The claims of the paper about its figures, and what its authors expected before, as data.

E are claims about self-organization, C about scalability, P about raw performance, R about reactivity, A about
adaptability, N about noise, V about availability, D about population dynamics, X about several figures together, H the
authors' intuitions. Where the paper does not name a direction but its text implies one, a claim says "(implied)". Where
a caption and the name of a figure's file disagree, the caption counts.
"""

from collections.abc import Callable, Iterable
from itertools import combinations, pairwise
from typing import Any, TypeAlias

from ..population import availability, ratio_for_team
from .contrast import Kind
from .panel import Levels, Number, PanelName, bend, best, rise, scatter, slope, steeper_from, variation
from .statements import Statement, alike, follows, further_apart, group, larger_lead, mostly_tie
from .verdict import Claim

SIMPLE, COMPLEX = "crw dpo", "stochm stochx"
STEADY, UNSTEADY = "crw stochx", "dpo stochm"
ALL = "crw dpo stochm stochx"

MEASURES = {
    "E_S": "spatial_emergence",
    "E_T": "task_emergence",
    "C": "scalability",
    "P": "raw_performance",
    "R": "reactivity",
    "A": "adaptability",
    "N": "noise_robustness",
    "D": "population_robustness",
}
"""Symbol of a place -> measure. E_S stands beside N lone robots in scenario 1, as the paper shows it."""

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
ONSET = 0.03 / 7.0 * 4.0
"""About 0.017: a level of noise in the warehouses."""
NARROW = 0.25 / 5.0
"""Mean distance of a run from the median one in a band that is a quarter of linear growth wide (our choice): four
standard deviations are five such distances."""
LITTLE = 0.25
"""Largest lead that is a little, as a share (our choice)."""

Says: TypeAlias = Callable[[str], tuple[Statement, ...]]
"""What a claim says of a place."""


def place(words: str) -> PanelName:
    """Return the panel of a place: "S1a E_S"."""
    experiment, _, symbol = words.rpartition(" ")
    is_alone = symbol == "E_S" and experiment.startswith("S1")
    return PanelName(experiment, MEASURES[symbol], "interactive" if is_alone else "marginal")


def places(words: str) -> list[str]:
    """Return the places of a list: "S1a C, S1b C"."""
    return words.split(", ") if words else []


def better(sides: str, levels: Levels = "all") -> Says:
    """Policies on the left are better than those on the right, on average: "crw stochx > dpo"."""
    winners, losers = sides.split(" > ")
    return lambda where: (group(place(where), winners, losers, levels=levels),)


def best_is(policy: str, levels: Levels = "all") -> Says:
    """A policy is better than each of the three others."""
    others = [name for name in ALL.split() if name != policy]
    return lambda where: tuple(group(place(where), policy, other, levels=levels) for other in others)


def mostly(policies: str) -> Says:
    """Most comparisons of policies are ties."""
    return lambda where: (mostly_tie(place(where), policies),)


def tie(policies: str, levels: Levels = "all", *, kind: Kind = "tie") -> Says:
    """All pairs of policies tie, on average."""
    return lambda where: tuple(
        group(place(where), a, b, kind=kind, levels=levels) for a, b in combinations(policies.split(), 2)
    )


def each(policies: str, of: Number, **given: Any) -> Says:
    """A number of each policy is above 0 or a limit, below it, or ties with 0; as `group` is given it."""
    return lambda where: tuple(group(place(where), policy, of=of, **given) for policy in policies.split())


def more(upper: str, lower: str, of: Number) -> Says:
    """A number of some policies is larger than that of others."""
    return lambda where: (group(place(where), upper, lower, of=of),)


def of_each(where: Iterable[str], *said: Says) -> tuple[Statement, ...]:
    """What is said of each of some places, one saying after the other."""
    listed = list(where)
    return tuple(statement for say in said for one in listed for statement in say(one))


def about(where: str, **claims: tuple[str, *tuple[Says, ...]]) -> list[Claim]:
    """Return claims about some places, by name: text, and what each says."""
    return [Claim(name, text, of_each(places(where), *said)) for name, (text, *said) in claims.items()]


def follow(first: str, others: str, *, turned: bool = False) -> tuple[Statement, ...]:
    """Whoever is better in one place is better in others, or worse there."""
    return tuple(follows(place(first), place(other), turned=turned) for other in places(others))


_STEADY_AND_NOT = more(UNSTEADY, STEADY, variation)
_SELF_ORGANIZATION = (
    *about(
        "S1a E_S",
        E1=("Every algorithm stays roughly constant over the swarm size.", each(ALL, rise, kind="tie", is_share=True)),
        E2=("CRW differs from the other three; it is higher (implied).", best_is("crw")),
        E3=("STOCHM and STOCHX tie.", tie(COMPLEX)),
    ),
    *about(
        "S1b E_T",
        E4=("CRW, DPO and STOCHM mostly tie.", mostly("crw dpo stochm")),
        E5=("STOCHX is highest.", best_is("stochx")),
        E6=(
            "STOCHX grows nearly linearly with the swarm size.",
            each("stochx", slope),
            each("stochx", bend, kind="tie"),
        ),
    ),
    *about(
        "S2a still E_T",
        E7=("STOCHX and CRW are steady over the swarm size, DPO and STOCHM vary strongly.", _STEADY_AND_NOT),
        E8=(
            "In small swarms STOCHX is best, by a little.",
            best_is("stochx", "low"),
            lambda where: (group(place(where), "stochx", "crw dpo stochm", levels="low", less=LITTLE, sign=-1.0),),
        ),
    ),
    *about("S2a fast E_S", E9=("As E7, for spatial self-organization with moving objects.", _STEADY_AND_NOT)),
    *about("S1b E_S", E10=("Spatial self-organization does not differ between the four.", tie(ALL))),
    Claim(
        "E11",
        "Trends over the swarm size are equal, however fast objects move.",
        tuple(
            alike(place("S2a still E_T"), place(f"S2a {pace} E_T"), policy, of=rise)
            for pace in ("slow", "fast")
            for policy in ALL.split()
        ),
    ),
)

_NARROW = each(SIMPLE, scatter, less=NARROW, sign=-1.0)
_WIDE = each(COMPLEX, scatter, less=NARROW)
_HIGHER_AND_WIDER = (more(COMPLEX, SIMPLE, best), more(COMPLEX, SIMPLE, scatter))
_SIMPLE_BETTER = better(f"{SIMPLE} > {COMPLEX}")
_SCALING = (
    *about(
        "S1b C",
        C1=("CRW and DPO have narrow bands.", _NARROW),
        C2=("STOCHM and STOCHX have wide bands.", _WIDE),
        C3=(
            "The complex algorithms can reach higher values than the simple ones, but less reliably.",
            *_HIGHER_AND_WIDER,
        ),
    ),
    *about("S2a still C, S2a slow C, S2a fast C", C4=("There are no significant differences at all.", tie(ALL))),
    *about(
        "S1a C",
        C5=(
            "The small warehouse shows the same picture: C1, C2 and C3 hold there, too.",
            *(_NARROW, _WIDE, *_HIGHER_AND_WIDER),
        ),
    ),
    *about("S1b C", C6=("The complex algorithms scale less well than the simple ones.", _SIMPLE_BETTER)),
    *about("S1b P", P1=("CRW and DPO deliver more than STOCHM and STOCHX.", _SIMPLE_BETTER)),
    *about("S1a P", P2=("The small warehouse shows the same picture.", _SIMPLE_BETTER)),
    Claim(
        "P3",
        "Performance and self-organization are negatively related.",
        (*follow("S2a still E_T", "S2a still P", turned=True), *follow("S2a fast E_S", "S2a fast P", turned=True)),
    ),
    *about(
        "S2a still P, S2a fast P",
        P4=("Simpler algorithms perform better: CRW and DPO above STOCHM and STOCHX (implied).", _SIMPLE_BETTER),
    ),
)


def _flexibility(letter: str) -> list[Claim]:
    """Return the four claims that the paper makes in the same words about reactivity and about adaptability."""
    small, medium, others = f"S1c {letter}", f"S1d {letter}", "crw dpo stochm"
    return [
        *about(
            f"{small}, {medium}",
            **{
                f"{letter}1": (
                    "Under strong disturbance STOCHM and STOCHX are best; STOCHX is best in general.",
                    *(better(f"{COMPLEX} > {SIMPLE}", "high"), best_is("stochx")),
                ),
                f"{letter}2": ("DPO is worse than CRW.", better("crw > dpo")),
            },
        ),
        Claim(
            f"{letter}3",
            "More differences are significant in the medium warehouse than in the small one.",
            (further_apart(place(medium), place(small)),),
        ),
        *about(
            medium,
            **{
                f"{letter}4": (
                    "STOCHX rises slowly and evenly with the disturbance; the others rise ever faster.",
                    *(more(others, "stochx", slope), each("stochx", bend, kind="tie"), each(others, bend)),
                )
            },
        ),
    ]


_STRONG = better(f"{STEADY} > {UNSTEADY}", "high")
_FLEXIBILITY = (
    *_flexibility("R"),
    *_flexibility("A"),
    *about(
        "S2b 115 R",
        R5=(
            "CRW and STOCHX are best, DPO and STOCHM worst; only under strong disturbance, else they tie.",
            *(_STRONG, tie(ALL, "low")),
        ),
    ),
    *about(
        "S2b 320 A",
        A5=("The algorithms mostly tie.", mostly(ALL)),
        A6=("Under strong disturbance CRW is better than DPO and STOCHM.", better(f"crw > {UNSTEADY}", "high")),
    ),
    Claim(
        "A7",
        "The swarm sizes that are not shown look the same: they have the same order of algorithms.",
        (*follow("S2b 115 R", "S2b 12 R, S2b 320 R"), *follow("S2b 320 A", "S2b 12 A, S2b 115 A")),
    ),
    Claim(
        "A8",
        "There are fewer differences in adaptability than in reactivity.",
        tuple(further_apart(place(f"S2b {n} R"), place(f"S2b {n} A")) for n in (115, 320)),
    ),
)

_THREE = "dpo stochm stochx"
_CHANGE_AND_MOST = (each(ALL, steeper_from(ONSET)), more(UNSTEADY, STEADY, rise))
_NOISE = (
    *about(
        "S1e N",
        N1=("CRW and STOCHX tie.", tie(STEADY)),
        N2=(
            "DPO and STOCHM tie except under strong noise.",
            tie(UNSTEADY, "low"),
            tie(UNSTEADY, "high", kind="differ"),
        ),
        N3=("From a standard deviation of about 0.017 on, all algorithms change their behaviour.", _CHANGE_AND_MOST[0]),
        N4=("The change is strongest for DPO and STOCHM.", _CHANGE_AND_MOST[1]),
    ),
    Claim(
        "N5",
        "The algorithms are further apart than in the small warehouse; N3 and N4 hold again.",
        (further_apart(place("S1f N"), place("S1e N")), *of_each(["S1f N"], *_CHANGE_AND_MOST)),
    ),
    *about(
        "S2c 320 N",
        N6=("CRW and STOCHX tie in most cases.", mostly(STEADY)),
        N7=("DPO, STOCHM and STOCHX get clearly worse with stronger noise.", each(_THREE, rise)),
        N8=(
            "STOCHM changes under weaker noise than DPO and STOCHX.",
            *(better(f"{other} > stochm", "low") for other in ("dpo", "stochx")),
        ),
        N10=("CRW shows no change of phase: it grows evenly.", each("crw", bend, kind="tie")),
    ),
    Claim(
        "N9", "115 robots show the same picture as 320: the same order of algorithms.", follow("S2c 320 N", "S2c 115 N")
    ),
)


def _available(n: int, needed: Iterable[int], team: float) -> list[float]:
    return [availability(n, n_min, ratio_for_team(team)) for n_min in needed]


def _v1() -> tuple[bool, str]:
    (found,) = _available(50, [5], 5.0)
    return abs(found - 0.40) <= 0.005, f"the formula gives {found:.4f}"


def _is_less_available(needed: Iterable[tuple[int, int]]) -> tuple[bool, str]:
    """Whether 200 robots are less available than 50, with so many robots needed of each, for mean teams of 5 to 20."""
    few, many = zip(*needed, strict=True)
    pairs = [(_available(50, few, team), _available(200, many, team)) for team in (5.0, 10.0, 20.0)]
    n_less = sum(b < a for of_50, of_200 in pairs for a, b in zip(of_50, of_200, strict=True))
    return n_less == 3 * len(few), f"200 robots are less available in {n_less} of {3 * len(few)} cases"


_POPULATION = (
    Claim("V1", "With 50 robots, 5 needed and a mean team of 5, availability is about 0.40.", formula=_v1),
    Claim(
        "V2",
        "With 200 robots and 20 needed, larger teams are needed for the same availability.",
        formula=lambda: _is_less_available([(5, 20)]),
    ),
    Claim(
        "V3",
        "Availability drops more steeply with 200 robots than with 50, the more robots are needed.",
        formula=lambda: _is_less_available([(n, n) for n in (1, 5, 10, 20, 40)]),
    ),
    *about(
        "S1g D",
        D1=(
            "Under larger population variance STOCHX is most robust, and STOCHX and CRW are above DPO and STOCHM.",
            *(best_is("stochx", "high"), _STRONG),
        ),
    ),
    Claim(
        "D2",
        "The order is that of task self-organization, STOCHX first.",
        (*best_is("stochx")("S1h D"), *follow("S1b E_T", "S1h D")),
    ),
    *about("S2d 115 D", D3=("CRW and STOCHX are high, DPO and STOCHM much lower.", better(f"{STEADY} > {UNSTEADY}"))),
    *about("S2d 320 D", D4=("With 320 robots all tie.", tie(ALL))),
    Claim(
        "D5",
        "STOCHM and CRW may tie.",
        untestable='"may" leaves room for a tie and claims none: no outcome speaks against it',
    ),
)

_FLEXIBLE_1, _FLEXIBLE_2 = "S1c R, S1d R, S1c A, S1d A", "S2b 115 R, S2b 320 A"
_ROBUST_1, _ROBUST_2 = "S1e N, S1f N, S1g D, S1h D", "S2c 320 N, S2d 115 D"
_EVERYWHERE = places(f"{_FLEXIBLE_1}, {_ROBUST_1}, {_FLEXIBLE_2}, {_ROBUST_2}")
_SELF_2 = "S2a still E_T, S2a fast E_S"


def _together(name: str, text: str, statements: tuple[Statement, ...]) -> Claim:
    return Claim(name, text, statements, needs="most")


_TOGETHER = (
    _together(
        "X1",
        "In flexibility and robustness CRW and STOCHX stand together, better than DPO and STOCHM.",
        of_each(_EVERYWHERE, better(f"{STEADY} > {UNSTEADY}")),
    ),
    _together(
        "X2",
        "Higher self-organization goes with better flexibility and robustness.",
        (
            *follow("S1a E_S", "S1c R, S1c A, S1e N, S1g D"),
            *follow("S1b E_T", "S1d R, S1d A, S1f N, S1h D"),
            *follow("S2a still E_T", f"{_FLEXIBLE_2}, {_ROBUST_2}"),
        ),
    ),
    Claim(
        "X3",
        "Self-organization is not tied to scalability or raw performance.",
        untestable="two unrelated orders of four policies agree, or disagree, in five pairs of six or more in 8 of 24 "
        "cases: no number of runs tells unrelated orders from related ones",
    ),
    _together(
        "X4",
        "For scenario 2 STOCHX is the best choice overall.",
        of_each(places(f"{_SELF_2}, {_FLEXIBLE_2}, {_ROBUST_2}"), better("stochx > crw dpo stochm")),
    ),
    _together(
        "X5",
        'More "intelligent" algorithms are more flexible and robust: STOCHM and STOCHX more than CRW and DPO.',
        of_each(_EVERYWHERE, better(f"{COMPLEX} > {SIMPLE}")),
    ),
    _together(
        "X6",
        "Flexibility and robustness go together.",
        (
            *follow("S1c R", "S1e N, S1g D"),
            *follow("S1d R", "S1f N, S1h D"),
            *follow("S2b 115 R", "S2d 115 D"),
            *follow("S2b 320 A", "S2c 320 N"),
        ),
    ),
    _together(
        "X7",
        "In scenario 1 STOCHM is more flexible and robust than DPO.",
        of_each(places(f"{_FLEXIBLE_1}, {_ROBUST_1}"), better("stochm > dpo")),
    ),
)

CLAIMS: dict[str, Claim] = {
    claim.name: claim for claim in (*_SELF_ORGANIZATION, *_SCALING, *_FLEXIBILITY, *_NOISE, *_POPULATION, *_TOGETHER)
}
"""Name -> claim."""

_SPATIAL = "S1a E_S, S1b E_S"
_BOTH = "S1a C, S1b C"
_EXPECTED: tuple[tuple[str, str, str], ...] = (
    ("CRW: Modest spatial self-organization: above DPO, below STOCHX.", _SPATIAL, "stochx > crw > dpo"),
    (
        "CRW: Moderate reactivity and adaptability: better than DPO, worse than STOCHX.",
        _FLEXIBLE_1,
        "stochx > crw > dpo",
    ),
    ("DPO: Less spatial self-organization than CRW.", _SPATIAL, "crw > dpo"),
    ("DPO: Low reactivity and adaptability: worse than the three others.", _FLEXIBLE_1, "crw stochm stochx > dpo"),
    ("STOCHM: Low self-organization: below CRW and STOCHX.", f"{_SPATIAL}, S1b E_T", "crw stochx > stochm"),
    ("STOCHM: More reactive and adaptable than DPO.", _FLEXIBLE_1, "stochm > dpo"),
    ("STOCHM: Less scalable than CRW and DPO.", _BOTH, "crw dpo > stochm"),
    ("STOCHX: High spatial self-organization.", _SPATIAL, "stochx > crw dpo stochm"),
    ("STOCHX: High reactivity and adaptability.", _FLEXIBLE_1, "stochx > crw dpo stochm"),
    ("STOCHX: High robustness to malfunctions and repairs.", "S1g D, S1h D", "stochx > crw dpo stochm"),
    (
        "STOCHX: Task self-organization in the medium warehouse, where objects lie everywhere, more than in the small.",
        "S1b E_T",
        "stochx > crw dpo stochm",
    ),
    ("STOCHX: Delivers less than CRW, DPO and STOCHM.", "S1a P, S1b P", "crw dpo stochm > stochx"),
    ("STOCHX: Less scalable than STOCHM.", _BOTH, "stochm > stochx"),
    ("CRW: Moving objects do not affect it: it performs alike with objects at rest and at their fastest.", "", ""),
    ("CRW: Robust to deaths and to noise: better than DPO and STOCHM.", _ROBUST_2, "crw > dpo stochm"),
    ("CRW: Reactive and adaptable: better than DPO and STOCHM.", _FLEXIBLE_2, "crw > dpo stochm"),
    ("DPO: Less self-organized than CRW.", _SELF_2, "crw > dpo"),
    (
        "DPO: Low robustness and flexibility: worse than CRW and STOCHX.",
        f"{_ROBUST_2}, {_FLEXIBLE_2}",
        "crw stochx > dpo",
    ),
    ("STOCHM: Poor self-organization: below CRW and STOCHX.", _SELF_2, "crw stochx > stochm"),
    (
        "STOCHM: Low robustness to deaths, but above DPO: below CRW and STOCHX.",
        "S2d 115 D",
        "crw stochx > stochm > dpo",
    ),
    ("STOCHX: Modest self-organization: above STOCHM.", _SELF_2, "stochx > stochm"),
    (
        "STOCHX: Modest robustness to deaths and modest flexibility: worse than CRW, better than DPO.",
        f"S2d 115 D, {_FLEXIBLE_2}",
        "crw > stochx > dpo",
    ),
)
"""Algorithm and words, panels, and who is better than whom. The paper has a table of intuitions per scenario.
Its words are vague; here "high" means better than the three others, "low" worse than CRW and STOCHX, and for one of
these two worse than both others; "modest" lies between (our choice)."""
_FURTHER = {
    11: (larger_lead(place("S1b E_T"), place("S1a E_T"), "stochx", "crw dpo stochm"),),
    14: (alike(place("S2a still P"), place("S2a fast P"), "crw"),),
}
"""Number of an intuition -> what it says in other ways."""

INTUITIONS: dict[str, Claim] = {
    f"H{number}": Claim(
        f"H{number}",
        text,
        (
            *of_each(places(where), *(better(f"{a} > {b}") for a, b in pairwise(chain.split(" > ")))),
            *_FURTHER.get(number, ()),
        ),
    )
    for number, (text, where, chain) in enumerate(_EXPECTED, 1)
}
"""Name -> intuition; H as in hypothesis."""
