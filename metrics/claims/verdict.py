"""Claims held against panels: each statement is judged, corrected within its family, and joined with the others."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan
from typing import Literal, NamedTuple, TypeAlias, cast

import numpy as np

from ..curves import FloatArray
from ..statistics import SIGNIFICANT
from .contrast import Answer, Contrast, Kind, PValues, all_of, corrected, decide, most_of, p_values
from .panel import HAVE_SHARES, Panel, PanelName
from .statements import Statement, Untestable

Reading: TypeAlias = Literal["amounts", "shares", "bands"]
"""`amounts`: measures as their equations have them. `shares`: of flexibility and robustness, what is above the noise
floor, as a share of what the policy delivers. `bands`: amounts by the mean and two standard deviations of runs."""
_FAMILIES = {
    **dict.fromkeys("E", "self-organization"),
    **dict.fromkeys("C", "scalability"),
    **dict.fromkeys("P", "performance"),
    **dict.fromkeys("RA", "flexibility"),
    **dict.fromkeys("NVD", "robustness"),
    **dict.fromkeys("X", "together"),
    **dict.fromkeys("H", "expected"),
}
"""First letter of the name of a claim -> its family."""


@dataclass(frozen=True)
class Claim:
    """One claim: the statements that it consists of."""

    name: str
    text: str
    """What is claimed, in our words."""
    statements: tuple[Statement, ...] = ()
    needs: Literal["all", "most"] = "all"
    """How many of the statements must hold."""
    formula: Callable[[], tuple[bool, str]] | None = None
    """Whether a claim that needs no runs holds, and what was found."""
    untestable: str = ""
    """Why no run can answer; empty for a claim with statements."""

    @property
    def family(self) -> str:
        """Claims whose contrasts are corrected together."""
        return _FAMILIES[self.name[0]]

    @property
    def panels(self) -> tuple[PanelName, ...]:
        """Panels that its statements need, each once."""
        return tuple(dict.fromkeys(name for statement in self.statements for name in statement.panels))

    @property
    def has_shares(self) -> bool:
        """Whether it is about a measure that is read as shares, too, which is then its main reading."""
        return any(name.measure in HAVE_SHARES for name in self.panels)


class Counts(NamedTuple):
    """Comparisons of two policies at one level, by what they show."""

    claimed: int = 0
    reversed: int = 0
    tied: int = 0
    open: int = 0

    @property
    def words(self) -> str:
        """The counts for people."""
        told = f"{self.claimed} of {sum(self)} comparisons as claimed, {self.reversed} reversed, {self.tied} tie"
        return f"{told}, {self.open} open" if self.open else told


NOTHING = Counts()


@dataclass(frozen=True, kw_only=True, eq=False)
class Part:
    """What runs say of one statement."""

    statement: Statement
    answer: Answer = "open"
    contrast: Contrast | None = None
    """Its number per run, in the unit of the measure; None where there is none."""
    is_band: bool = False
    """Whether it is read by bands of two standard deviations of runs, not by intervals."""
    margin: float = nan
    counts: Counts = NOTHING
    """Of comparisons level by level, without correction."""
    p: PValues | None = None
    """P values, corrected for those of the family; None where comparisons are counted, and by bands."""
    reverses: FloatArray = field(default_factory=lambda: np.empty(0))
    """Of a group, p values that a pair of its members has the claimed order or ties, (pairs,)."""
    why: str = ""

    def numbers(self) -> dict[str, float]:
        """Return mean, lower and upper end, Cohen's d, the p value that decides, margin and number of runs."""
        found = self.contrast
        if found is None:
            return {**dict.fromkeys(("mean", "lower", "upper", "d", "p", "margin"), nan), "n_runs": 0}
        lower, upper = found.band if self.is_band else found.interval
        p = nan if self.p is None else float(self.p[_decides(self.statement.kind, self.answer)])
        p = float(self.reverses.min()) if (self.reverses <= SIGNIFICANT).any() else p
        told = {"mean": float(found.mean), "lower": float(lower), "upper": float(upper), "d": float(found.d)}
        return {**told, "p": p, "margin": self.margin, "n_runs": found.n_runs}


def _decides(kind: Kind, answer: Answer) -> int:
    """Return the place of the p value that decides."""
    if kind == "tie":
        return 2 if answer == "contradicted" else 1
    return 1 if answer == "equivalent" else 0


@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What runs say of a claim."""

    claim: str
    answer: Answer
    parts: tuple[Part, ...] = ()
    why: str = ""

    @property
    def n_held(self) -> int:
        """Number of statements that hold."""
        return sum(part.answer == "supported" for part in self.parts)

    @property
    def counts(self) -> Counts:
        """Comparisons of all statements."""
        return Counts(*map(sum, zip(*(part.counts for part in self.parts), strict=True))) if self.parts else Counts()


def check_claims(
    claims: Mapping[str, Claim],
    panels: Mapping[PanelName, Panel],
    *,
    reading: Reading = "amounts",
    margin: float | None = None,
) -> dict[str, Verdict]:
    """Hold claims against scores.

    Args:
        claims: `CLAIMS`, or claims of your own. Those of a family are corrected together for their number.
        panels: Scores of all policies.
        reading: How scores are read.
        margin: Share that is a tie in all panels; None: that of each.

    Returns:
        Name of a claim -> verdict.

    Raises:
        CurveError: A panel lacks a policy that a claim names.
    """
    seen = {name: [_seen(one, panels, reading, margin) for one in claim.statements] for name, claim in claims.items()}
    found: dict[str, Verdict] = {}
    for family in dict.fromkeys(claim.family for claim in claims.values()):
        mine = {name: claim for name, claim in claims.items() if claim.family == family}
        parts = iter([_answered(one) for one in _corrected([one for name in mine for one in seen[name]])])
        found |= {name: _verdict(claim, [next(parts) for _ in claim.statements]) for name, claim in mine.items()}
    return {name: found[name] for name in claims}


def _seen(statement: Statement, panels: Mapping[PanelName, Panel], reading: Reading, margin: float | None) -> Part:
    """Return a statement with its contrast, without an answer unless there is no contrast."""
    absent = [name.words for name in statement.panels if name not in panels]
    if absent:
        return Part(statement=statement, answer="no runs", why=f"no runs of {', '.join(absent)}")
    shown = [panels[name] for name in statement.panels]
    curves = [
        one.curves(
            statement.policies,
            shares=statement.is_share or (reading == "shares" and name.measure in HAVE_SHARES),
            one_unit=statement.keeps_shape,
            unit=shown[0].unit if statement.has_one_unit else None,
        )
        for name, one in zip(statement.panels, shown, strict=True)
    ]
    if any(0 in one.values.shape for one in curves):
        return Part(statement=statement, answer="no runs", why="no level has enough runs with a score")
    limit = (shown[-1].margin if margin is None else margin) if statement.has_margin else 0.0
    try:
        found = Contrast(statement.number(curves))
    except Untestable as reason:
        return Part(statement=statement, answer="untestable", why=str(reason))
    is_band = reading == "bands"
    p = None if is_band or statement.is_counted else p_values(statement.kind, found, limit)
    part = Part(statement=statement, contrast=found, is_band=is_band, margin=limit, p=p)
    if not statement.pairs:
        return part
    sides = statement.sides(curves[0])
    part = replace(part, counts=_counts(sides, limit, is_band))
    if p is None or statement.kind != "more" or len(statement.pairs) == 1:
        return part
    pairs = Contrast((sides[0] - sides[1]).mean(axis=1))
    return replace(part, reverses=np.where(pairs.mean < 0.0, pairs.p_beyond(limit), 1.0))


def _corrected(family: Sequence[Part]) -> list[Part]:
    """Return parts with p values after correction."""
    pairs = np.concatenate([np.empty(0), *(one.reverses for one in family)])
    found, reverses = corrected([one.p for one in family if one.p is not None], pairs)
    tested = iter(found)
    ends = np.cumsum([one.reverses.size for one in family])
    return [
        one if one.p is None else replace(one, p=next(tested), reverses=reverses[end - one.reverses.size : end])
        for one, end in zip(family, ends, strict=True)
    ]


def _counts(sides: FloatArray, margin: float, is_band: bool) -> Counts:
    """Count comparisons of the first and the second of pairs, (2, pairs, L, R)."""
    gaps = Contrast(sides[0] - sides[1])
    if is_band:
        is_apart = np.abs(gaps.mean) > 2.0 * Contrast(sides).sd.sum(axis=0)
        n_claimed, n_apart = int((is_apart & (gaps.mean > 0.0)).sum()), int(is_apart.sum())
        return Counts(n_claimed, n_apart - n_claimed, is_apart.size - n_apart)
    answers = decide("more", gaps.mean, p_values("more", gaps, margin))
    return Counts(*(int((answers == word).sum()) for word in ("supported", "contradicted", "equivalent", "open")))


def _answered(part: Part) -> Part:
    statement, found = part.statement, part.contrast
    if found is None:
        return part
    if statement.pairs and part.p is None:
        return replace(part, answer=_of_counts(statement, part.counts))
    if part.p is None:
        return replace(part, answer=_of_band(statement, *found.band))
    turned = [pair for pair, p in zip(statement.pairs, part.reverses, strict=False) if p <= SIGNIFICANT]
    if turned:
        told = ", ".join(f"{worse} above {better}" for better, worse in turned)
        return replace(part, answer="contradicted", why=f"{told} in {statement.where}")
    return replace(part, answer=cast(Answer, str(decide(statement.kind, found.mean, part.p))))


def _of_counts(statement: Statement, counts: Counts) -> Answer:
    """The answer of more than half of the comparisons."""
    many, n_apart = sum(counts) / 2.0, counts.claimed + counts.reversed
    if counts.tied > many:
        return "supported" if statement.kind == "tie" else "equivalent"
    if statement.kind != "more":
        return "open" if n_apart <= many else "contradicted" if statement.kind == "tie" else "supported"
    return "supported" if counts.claimed > many else "contradicted" if counts.reversed > many else "open"


def _of_band(statement: Statement, lower: FloatArray, upper: FloatArray) -> Answer:
    """The answer by the band of a number: bands that hold 0 look like a tie."""
    if lower <= 0.0 <= upper:
        return "supported" if statement.kind == "tie" else "equivalent"
    if statement.kind == "tie":
        return "contradicted"
    return "supported" if statement.kind == "differ" or lower > 0.0 else "contradicted"


def _verdict(claim: Claim, parts: Sequence[Part]) -> Verdict:
    if claim.untestable:
        return Verdict(claim=claim.name, answer="untestable", why=claim.untestable)
    if claim.formula is not None:
        holds, why = claim.formula()
        return Verdict(claim=claim.name, answer="supported" if holds else "contradicted", why=why)
    join = all_of if claim.needs == "all" else most_of
    found = Verdict(claim=claim.name, answer=join([part.answer for part in parts]), parts=tuple(parts))
    told: list[str] = []
    if found.answer != "no runs":
        told += [f"{found.n_held} of {len(parts)} statements hold"] if len(parts) > 1 else []
        told += [found.counts.words] if sum(found.counts) else []
    told += dict.fromkeys(part.why for part in parts if part.why)
    return replace(found, why="; ".join(told))
