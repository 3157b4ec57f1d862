"""What claims say of panels: each statement is a number per run, above 0 where it holds."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import combinations, product
from typing import Any, TypeAlias

import numpy as np

from ..controllers import PAPER_POLICIES
from ..curves import FloatArray
from ..statistics import SIGNIFICANT, holm
from .contrast import Contrast, Kind
from .panel import LOWER_IS_BETTER, Curves, Levels, Number, PanelName, height

Pair: TypeAlias = tuple[str, str]


class Untestable(Exception):  # noqa: N818 - not an error: it is an answer
    """No such runs could answer; the message says why."""


@dataclass(frozen=True, kw_only=True)
class Statement:
    """One statement about one or two panels."""

    words: str
    panels: tuple[PanelName, ...]
    number: Callable[[Sequence[Curves]], FloatArray]
    """Curves of `policies` in each panel -> a number per run, (R,)."""
    policies: tuple[str, ...] = PAPER_POLICIES
    kind: Kind = "more"
    pairs: tuple[Pair, ...] = ()
    """Comparisons that are counted level by level: policies of which the first is claimed to be better."""
    levels: Levels = "all"
    keeps_shape: bool = False
    """Whether all levels have one unit, because it is about the shape of curves."""
    has_one_unit: bool = False
    """Whether the second panel is read in the unit of the first, because amounts are compared."""
    is_share: bool = False
    """Whether it is about shares of performance in every reading."""
    is_counted: bool = False
    """Whether most comparisons must be as it says ("mostly"), instead of their mean."""
    has_margin: bool = True
    """Whether a number near 0 is a tie; not if it is compared with a limit."""

    @property
    def where(self) -> str:
        """Its panels for people."""
        return " and ".join(name.words for name in self.panels)

    def sides(self, curves: Curves) -> FloatArray:
        """Return the scores of the first and of the second of each pair, higher is better, (2, pairs, L, R)."""
        places = np.array([[self.policies.index(name) for name in pair] for pair in self.pairs]).T
        return _sign(self.panels[0]) * curves.part(self.levels).values[places]


def _sign(panel: PanelName) -> float:
    return -1.0 if panel.measure in LOWER_IS_BETTER else 1.0


def group(
    panel: PanelName,
    upper: str,
    lower: str = "",
    *,
    of: Number = height,
    kind: Kind = "more",
    levels: Levels = "all",
    less: float = 0.0,
    sign: float | None = None,
    is_share: bool = False,
) -> Statement:
    """Mean of some policies less that of others, and less a limit: better on average, tied, steeper, ...

    Args:
        panel: The panel.
        upper: Names of policies, with spaces between.
        lower: Names of the others; none compares with the limit alone.
        of: Number of each policy and run.
        kind: What is said of the difference.
        levels: At which levels.
        less: Limit, which has no margin.
        sign: -1 where lower numbers are meant; None: heights have the direction of the measure, others 1.
        is_share: As in `Statement`.
    """
    up, low = upper.split(), lower.split()
    side = sign or (_sign(panel) if of is height else 1.0)

    def number(curves: Sequence[Curves]) -> FloatArray:
        found = of(curves[0].part(levels))
        others = found[len(up) :].mean(axis=0) if low else 0.0
        return side * (found[: len(up)].mean(axis=0) - others - less)

    name = "" if of is height else f"{of.__name__.replace('_', ' ')}: "
    than = f" - {', '.join(low)}" if low else ""
    half = {"all": "", "low": " (weak)", "high": " (strong)"}[levels]
    told = f"{name}{', '.join(up)}{than}{f' - {less:g}' if less else ''}{half}"
    return Statement(
        words=f"-({told})" if side < 0.0 and of is not height else told,
        panels=(panel,),
        number=number,
        policies=(*up, *low),
        kind=kind,
        pairs=tuple(product(up, low)) if of is height else (),
        levels=levels,
        keeps_shape=of.__name__ in ("rise", "slope", "bend", "steeper", "variation"),
        is_share=is_share,
        has_margin=not less,
    )


def mostly_tie(panel: PanelName, policies: str) -> Statement:
    """Most comparisons of two policies at a level are ties; the number is how far the policies are apart."""
    names = tuple(policies.split())
    return Statement(
        words=f"mostly tie: {', '.join(names)}",
        panels=(panel,),
        number=lambda curves: height(curves[0]).std(axis=0),
        policies=names,
        kind="tie",
        pairs=tuple(combinations(names, 2)),
        is_counted=True,
    )


def alike(first: PanelName, second: PanelName, policy: str, *, of: Number = height) -> Statement:
    """A policy ties with itself in two panels."""
    words = f"{policy} in both" if of is height else f"{of.__name__}: {policy} in both"
    told: dict[str, Any] = {"kind": "tie", "has_one_unit": True, "keeps_shape": of is not height}
    return _of_two(words, first, second, lambda a, b: a[0] - b[0], (policy,), of, **told)


def further_apart(first: PanelName, second: PanelName) -> Statement:
    """The policies scatter more about their common mean in the first panel than in the second."""
    return _of_two("apart: all", first, second, lambda a, b: a.std(axis=0) - b.std(axis=0))


def larger_lead(first: PanelName, second: PanelName, leader: str, others: str) -> Statement:
    """A policy leads others by more in the first panel than in the second."""
    names = (leader, *others.split())

    def lead(numbers: FloatArray) -> FloatArray:
        return numbers[0] - numbers[1:].mean(axis=0)

    return _of_two(f"lead of {leader} in the first", first, second, lambda a, b: lead(a) - lead(b), names)


def _of_two(
    words: str,
    first: PanelName,
    second: PanelName,
    compare: Callable[[FloatArray, FloatArray], FloatArray],
    policies: tuple[str, ...] = PAPER_POLICIES,
    of: Number = height,
    **told: Any,
) -> Statement:
    """Return a statement about numbers of policies in two panels, (P, R) each, in the runs that both have."""

    def number(curves: Sequence[Curves]) -> FloatArray:
        n_runs = min(one.runs.size for one in curves)
        both = np.logical_and(*(one.runs[:n_runs] for one in curves))
        return compare(*(of(one)[:, (np.cumsum(one.runs) - 1)[:n_runs][both]] for one in curves))

    return Statement(words=words, panels=(first, second), number=number, policies=policies, **told)


def follows(first: PanelName, second: PanelName, *, turned: bool = False) -> Statement:
    """Policies that are better in the first panel are better in the second, mean over the pairs that differ there.

    Untestable if fewer than half of the pairs differ in the first panel: a tie has no order.
    """
    pairs = list(combinations(range(len(PAPER_POLICIES)), 2))

    def number(curves: Sequence[Curves]) -> FloatArray:
        of_first, of_second = (_sign(name) * height(one) for name, one in zip((first, second), curves, strict=True))
        gaps = [Contrast(of_first[a] - of_first[b]) for a, b in pairs]
        is_ordered = holm(np.array([float(gap.p_differs) for gap in gaps])) <= SIGNIFICANT
        if 2 * is_ordered.sum() < len(pairs):
            told = f"{is_ordered.sum()} of {len(pairs)} pairs of policies have an order in {first.words}"
            raise Untestable(f"{told}, and policies that tie have none")
        signs = np.sign([gap.mean for gap in gaps]) * is_ordered * (-1.0 if turned else 1.0)
        leads = np.array([of_second[a] - of_second[b] for a, b in pairs])
        return signs @ leads / is_ordered.sum()

    words = "who is worse leads" if turned else "who is better leads"
    return Statement(words=words, panels=(first, second), number=number)
