"""Made worlds in which each rule that judges claims is tried: what it states holds, does not, or nearly does.

At the border, either answer is wrong, or all that can be said is nothing. Scores scatter normally around given curves.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from metrics.claims import orders, shapes
from metrics.claims import rules as general
from metrics.claims.panel import Panel
from metrics.claims.rules import Outcome
from metrics.scoring.frame import pseudo_values
from metrics.scoring.measures import MEASURES, Compared
from metrics.scoring.run_curves import RunCurves

LEVELS = np.arange(1.0, 8.0)
ABOVE_ZERO = 4.0
"""Added to curves, which must not be negative; distances stay as they are."""
Curves = Mapping[str, Any]
"""Policy -> height at each level, or a number."""
Make = Callable[[np.random.Generator], Sequence[Curves]]
"""The curves of each panel in a world."""
FOUR = ("a", "b", "c", "d")


@dataclass(frozen=True, kw_only=True)
class Rule:
    """A rule, and worlds in which it is tried."""

    predicate: Callable[..., Outcome]
    border: Make
    """A world in which some answers are wrong."""
    wrong: tuple[str, ...]
    """Which, there."""
    holds: Make
    fails: Make
    failing: str = "contradicted"
    """The right answer where it fails."""
    parameters: Mapping[str, Any] = field(default_factory=dict[str, Any])
    sd: float = 0.2
    sds: Mapping[str, Mapping[str, float]] = field(default_factory=dict[str, Mapping[str, float]])
    """World -> policy -> its own scatter."""


def fixed(*panels: Curves) -> Make:
    """The same curves in every world."""
    return lambda _: panels


def shuffled(*fields: Curves) -> Make:
    """A panel as it is, then one whose policies have changed places at random."""

    def make(rng: np.random.Generator) -> Sequence[Curves]:
        first = fields[0]
        return first, dict(zip(rng.permutation(list(first)).tolist(), first.values(), strict=True))

    return make


def bent(place: float, height: float = 3.0) -> NDArray[np.float64]:
    """A curve that is flat and rises from a level on."""
    return 1.0 + height * np.maximum(0.0, LEVELS - place)


def of_mean_curves(panel: Panel) -> Panel:
    """The distances of the mean curves of a and b from their ideal ones, where levels are intervals of runs."""

    def runs(name: str) -> RunCurves:
        curves = panel.scores[name].T + ABOVE_ZERO
        return RunCurves(
            criterion="noise", value=1.0, n_robots=1, seeds=tuple(range(len(curves))), curves={"performance": curves}
        )

    scores = {
        name: pseudo_values(
            MEASURES["noise_robustness"], Compared(None, runs(f"ideal {name}"), runs(name), "corrected")
        )[0][None]
        for name in "ab"
    }
    return Panel(levels=LEVELS[:1], scores=scores, confidence=panel.confidence)


PAIR = {"pairs": (("a", "b"),)}
ALIKE, APART = {"a": 1.0, "b": 1.0}, {"a": 2.0, "b": 1.0}
MARGIN = {"a": 1.12, "b": 1.0}
IDEAL = {"ideal a": 1.0, "ideal b": 1.0}
LADDER = {"a": 4.0, "b": 3.0, "c": 2.0, "d": 1.0}
ONE = {"policies": ("a",)}
WILD = np.where(LEVELS == 3.0, -4.0, 1.0)
"""A curve that is constant but for one level."""
EQUAL: Curves = dict.fromkeys(FOUR, 1.0)
RULES: dict[str, Rule] = {
    "ties, at the margin": Rule(
        predicate=general.ties, parameters=PAIR, border=fixed({"a": 1.1, "b": 1.0, "c": 1.0}), wrong=("supported",),
        holds=fixed(ALIKE), fails=fixed(APART),
    ),
    "ties, of equal policies": Rule(
        predicate=general.ties, parameters=PAIR, border=fixed(ALIKE), wrong=("contradicted",), holds=fixed(ALIKE),
        fails=fixed(APART),
    ),
    "never differ, in three panels": Rule(
        predicate=lambda *panels, **given: general.all_of([general.never_differ(p, **given) for p in panels]),
        parameters={**PAIR, "n_panels": 3}, border=fixed(*[ALIKE] * 3), wrong=("contradicted",),
        holds=fixed(*[ALIKE] * 3), fails=fixed(ALIKE, ALIKE, APART), sd=0.1,
    ),
    "is higher": Rule(
        predicate=general.is_higher, parameters={"upper": ("a",), "lower": ("b",)}, border=fixed(ALIKE),
        wrong=("supported",), holds=fixed(APART), fails=fixed({"a": 1.0, "b": 2.0}),
    ),
    "is above zero": Rule(
        predicate=lambda panel, **given: general.is_higher(shapes.with_zero(panel), **given),
        parameters={"upper": ("a",), "lower": (shapes.ZERO,)}, border=fixed({"a": 0.0}), wrong=("supported",),
        holds=fixed({"a": 0.5}), fails=fixed({"a": -0.5}),
    ),
    "is higher, a tie at the margin": Rule(
        predicate=general.is_higher, parameters={"upper": ("a",), "lower": ("b",)}, border=fixed(MARGIN),
        wrong=("tie",), holds=fixed(APART), fails=fixed(ALIKE), failing="tie",
    ),
    "differ, a tie at the margin": Rule(
        predicate=general.differ, parameters=PAIR, border=fixed(MARGIN), wrong=("tie",), holds=fixed(APART),
        fails=fixed(ALIKE), failing="tie",
    ),
    "is higher, of mean curves": Rule(
        predicate=lambda panel, **given: general.is_higher(of_mean_curves(panel), **given),
        parameters={"upper": ("a",), "lower": ("b",)}, border=fixed({**IDEAL, "a": 2.0, "b": 2.0}),
        wrong=("supported", "contradicted"), holds=fixed({**IDEAL, "a": 3.0, "b": 2.0}),
        fails=fixed({**IDEAL, "a": 2.0, "b": 3.0}), sd=0.5,
    ),
    "is higher, of mean curves without a distance": Rule(
        predicate=lambda panel, **given: general.is_higher(of_mean_curves(panel), **given),
        parameters={"upper": ("a",), "lower": ("b",)}, border=fixed({**IDEAL, **ALIKE}),
        wrong=("supported", "contradicted"), holds=fixed({**IDEAL, "a": 2.0, "b": 1.0}),
        fails=fixed({**IDEAL, "a": 1.0, "b": 2.0}), sd=0.5,
    ),
    "is not higher": Rule(
        predicate=general.is_not_higher, parameters={"first": "a", "second": "b"}, border=fixed(ALIKE),
        wrong=("contradicted",), holds=fixed(ALIKE), fails=fixed(APART),
    ),
    "leads by little": Rule(
        predicate=general.leads_by_little, parameters={"leader": "a", "others": ("b",)}, border=fixed(ALIKE),
        wrong=("supported",), holds=fixed({"a": 1.15, "b": 1.0}), fails=fixed(APART),
    ),
    "is constant, at the limit": Rule(
        predicate=general.is_constant, parameters=ONE, border=fixed({"a": np.linspace(0.85, 1.15, 7)}),
        wrong=("supported", "contradicted"), holds=fixed({"a": 1.0}), fails=fixed({"a": LEVELS}),
    ),
    "is constant, but for a wild level": Rule(
        predicate=general.is_constant, parameters=ONE, border=fixed({"a": WILD}), wrong=("contradicted",),
        holds=fixed({"a": WILD}), fails=fixed({"a": WILD * LEVELS}),
    ),
    "is narrow, at the limit": Rule(
        predicate=general.is_narrow, parameters=ONE, border=fixed({"a": 1.0}), wrong=("supported", "contradicted"),
        holds=fixed({"a": 1.0}), fails=fixed({"a": 1.0}), sd=0.0625,
        sds={"holds": {"a": 0.03}, "fails": {"a": 0.2}},
    ),
    "scatters more": Rule(
        predicate=general.is_wider, parameters={"upper": ("a",), "lower": ("b",)}, border=fixed(ALIKE),
        wrong=("supported", "contradicted"), holds=fixed(ALIKE), fails=fixed(ALIKE),
        sds={"holds": {"a": 0.5}, "fails": {"b": 0.5}},
    ),
    "reaches higher": Rule(
        predicate=general.reaches_higher, parameters={"upper": ("a",), "lower": ("b",)}, border=fixed(ALIKE),
        wrong=("supported", "contradicted"), holds=fixed(APART), fails=fixed({"a": 1.0, "b": 2.0}),
    ),
    "differ more, of equal policies": Rule(
        predicate=orders.differs_more, parameters=PAIR, border=fixed(ALIKE, ALIKE), wrong=("supported",),
        holds=fixed(ALIKE, {"a": 3.0, "b": 1.0}), fails=fixed({"a": 3.0, "b": 1.0}, ALIKE),
    ),
    "differ more, of equal differences": Rule(
        predicate=orders.differs_more, parameters=PAIR, border=fixed(APART, APART), wrong=("supported",),
        holds=fixed(ALIKE, {"a": 3.0, "b": 1.0}), fails=fixed({"a": 3.0, "b": 1.0}, ALIKE),
    ),
    "the same order, of random ones": Rule(
        predicate=orders.same_order, parameters={"policies": FOUR}, border=shuffled(LADDER), wrong=("supported",),
        holds=fixed(LADDER, LADDER), fails=fixed(LADDER, {"a": 1.0, "b": 2.0, "c": 3.0, "d": 4.0}),
    ),
    "unrelated orders": Rule(
        predicate=orders.unrelated, parameters={"policies": FOUR},
        border=fixed(LADDER, {"a": 3.0, "b": 1.0, "c": 4.0, "d": 2.0}), wrong=("contradicted",),
        holds=fixed(LADDER, {"a": 3.0, "b": 1.0, "c": 4.0, "d": 2.0}), fails=fixed(LADDER, LADDER),
    ),
    "unrelated orders, of equal policies": Rule(
        predicate=orders.unrelated, parameters={"policies": FOUR}, border=fixed(LADDER, EQUAL),
        wrong=("supported", "contradicted"), holds=fixed(LADDER, {"a": 3.0, "b": 1.0, "c": 4.0, "d": 2.0}),
        fails=fixed(LADDER, LADDER),
    ),
    "changes within, of a straight line": Rule(
        predicate=shapes.changes_within, parameters={**ONE, "between": (3.0, 4.0)}, border=fixed({"a": LEVELS}),
        wrong=("supported",), holds=fixed({"a": bent(3.5)}), fails=fixed({"a": bent(5.5)}),
    ),
    "changes before, of equal bends": Rule(
        predicate=shapes.changes_before, parameters={"first": "a", "others": ("b",)},
        border=fixed({"a": bent(4.0), "b": bent(4.0)}), wrong=("supported",),
        holds=fixed({"a": bent(2.5), "b": bent(5.5)}), fails=fixed({"a": bent(5.5), "b": bent(2.5)}),
    ),
    "is linear": Rule(
        predicate=shapes.is_linear, parameters=ONE, border=fixed({"a": LEVELS}), wrong=("contradicted",),
        holds=fixed({"a": LEVELS}), fails=fixed({"a": bent(6.0, 6.0)}),
    ),
}  # fmt: skip
"""What is said of each -> the rule and its worlds."""


def panels(rule: Rule, world: str, n_runs: int, seed: int) -> list[Panel]:
    """Return the panels of one made world."""
    rng = np.random.default_rng(seed)
    made: list[Panel] = []
    for curves in getattr(rule, world)(rng):
        sds = {name: rule.sds.get(world, {}).get(name, rule.sd) for name in curves}
        noise = {name: sds[name] * rng.standard_normal((LEVELS.size, n_runs)) for name in curves}
        scores = {name: np.broadcast_to(curve, LEVELS.shape)[:, None] + noise[name] for name, curve in curves.items()}
        made.append(Panel(levels=LEVELS, scores=scores))
    return made


def answers(rule: Rule, world: str, n_runs: int, n_worlds: int) -> list[str]:
    """Return what a rule says of so many worlds of a kind."""
    return [rule.predicate(*panels(rule, world, n_runs, seed), **rule.parameters).answer for seed in range(n_worlds)]


def share(found: Sequence[str], wanted: Sequence[str]) -> float:
    """Return how many of the answers are among some."""
    return sum(answer in wanted for answer in found) / len(found)
