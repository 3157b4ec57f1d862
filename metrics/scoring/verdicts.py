"""The claims of the paper held against studies, under all rules and in all variants that the studies can answer."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING, Any

from swarm_forage_env._internal.wording import plain

from ..checks import CurveError
from ..claims import CLAIMS, Claim, PanelName, Verdict, check_claim
from ..claims.statements import POLICIES
from ..curves import Variant
from .figure_panels import StudyPanel, StudyPanels
from .measures import MEASURE_VARIANTS, label_of

if TYPE_CHECKING:
    from swarm_forage_env.studies.study_table import StudyTable

VARIANTS: tuple[Variant, ...] = ("corrected", "paper", "sierra")


@dataclass(frozen=True, kw_only=True)
class Judged:
    """What studies say of one claim under one of the rules and in one variant."""

    claim: Claim
    rules: str
    """Empty for a claim about formulas, which needs no runs."""
    variant: Variant
    verdict: Verdict

    def to_mapping(self) -> dict[str, Any]:
        """Return it as plain values; numbers that JSON does not have are None."""
        return {
            "claim": self.claim.name,
            "text": self.claim.text,
            "figure": self.claim.figure,
            "rules": self.rules,
            "variant": self.variant,
            **_plain(self.verdict),
            "otherwise": {words: _plain(verdict) for words, verdict in self.verdict.otherwise.items()},
        }


def _plain(verdict: Verdict) -> dict[str, Any]:
    return {
        "answer": verdict.answer,
        "by_bands": verdict.by_bands,
        "statistic": plain(verdict.statistic),
        "effect": plain(verdict.effect),
        "n_runs": verdict.n_runs,
        "why": verdict.why,
    }


@dataclass(frozen=True, kw_only=True)
class Waiting:
    """A claim that cannot be answered yet, under one of the rules and in one variant."""

    claim: Claim
    rules: str
    variant: Variant
    lacks: tuple[PanelName, ...]
    """Panels without scores."""
    reasons: tuple[str, ...]
    """Why they have none, where their study is there."""

    def to_mapping(self) -> dict[str, Any]:
        """Return it as plain values."""
        return {
            "claim": self.claim.name,
            "text": self.claim.text,
            "rules": self.rules,
            "variant": self.variant,
            "lacks": [list(name) for name in self.lacks],
            "reasons": list(self.reasons),
        }


def why_no_claims(table: "StudyTable") -> str:
    """Return why the claims cannot be held against a study; empty if they can."""
    sets = {name.split()[0] for claim in CLAIMS.values() for name, *_ in claim.panels}
    name = table.spec.name
    if name not in sets:
        return (
            f"Expected studies of the paper's sets, {', '.join(sorted(sets))}, which its claims are about; got study "
            f"{name!r}."
        )
    absent = [label for label in POLICIES if label not in {policy.label for policy in table.spec.policies}]
    if absent:
        return (
            f"Expected the policies {', '.join(POLICIES)} in study {name}, which the claims of the paper are about; "
            f"it has no {', '.join(absent)}."
        )
    return ""


def judge_claims(
    tables: "Sequence[StudyTable]",
    scored: Sequence[StudyPanels],
    variants: Sequence[Variant] = VARIANTS,
    claims: Mapping[str, Claim] = CLAIMS,
) -> tuple[tuple[Judged, ...], tuple[Waiting, ...]]:
    """Hold claims against studies; a claim is left out in a variant that none of its measures has.

    Args:
        tables: Studies, each once.
        scored: The panels of each in the same order, in these variants and the corrected one.
        variants: Which.
        claims: By name; those of the paper's text, or its `INTUITIONS`.

    Returns:
        The answered claims, by rules, variant and claim, formulas first; and those that wait for runs.

    Raises:
        CurveError: a study twice, one without the policies of the paper, or none of its sets.
    """
    names = [table.spec.name for table in tables]
    if len(set(names)) < len(names):
        raise CurveError(f"Expected each study once, got {', '.join(names)}.")
    for reason in filter(None, map(why_no_claims, tables)):
        raise CurveError(reason)
    found = _Found(
        panels={(panel.rules, panel.variant, panel.name): panel for one in scored for panel in one.panels},
        reasons={
            (name, *key): why for name, one in zip(names, scored, strict=True) for key, why in one.missing.items()
        },
    )
    judged = [
        Judged(claim=claim, rules="", variant="corrected", verdict=check_claim(claim, {}))
        for claim in claims.values()
        if not claim.panels
    ]
    waiting: list[Waiting] = []
    every = dict.fromkeys(rules for table in tables for rules in table.spec.rules)
    for rules, variant, claim in product(every, variants, claims.values()):
        if claim.panels and any(_variant_of(name.measure, variant) == variant for name in claim.panels):
            outcome = _judge(claim, rules, variant, found)
            if isinstance(outcome, Judged):
                judged.append(outcome)
            else:
                waiting.append(outcome)
    return tuple(judged), tuple(waiting)


@dataclass(frozen=True, kw_only=True, eq=False)
class _Found:
    """What studies have."""

    panels: Mapping[tuple[str, Variant, PanelName], StudyPanel]
    """By rules, variant and name."""
    reasons: Mapping[tuple[str, str, str], str]
    """Study, measure in a form of it, and variant -> why there are no scores."""


def _variant_of(measure: str, variant: Variant) -> Variant:
    """Return the variant of a measure that is used: this one if it has it, else the corrected one."""
    return variant if variant in MEASURE_VARIANTS.get(measure, ()) else "corrected"


def _judge(claim: Claim, rules: str, variant: Variant, found: _Found) -> Judged | Waiting:
    places: dict[PanelName, tuple[str, Variant, PanelName]] = {
        name: (rules, _variant_of(name.measure, variant), name) for name in (*claim.panels, *claim.other_panels)
    }
    lacks = tuple(name for name in claim.panels if places[name] not in found.panels)
    if not lacks:
        panels = {name: found.panels[place].for_claims() for name, place in places.items() if place in found.panels}
        return Judged(claim=claim, rules=rules, variant=variant, verdict=check_claim(claim, panels))
    keys = [
        (name.experiment.split()[0], label_of(name.measure, "corrected", name.form), _variant_of(name.measure, variant))
        for name in lacks
    ]
    reasons = tuple(dict.fromkeys(found.reasons[key] for key in keys if key in found.reasons))
    return Waiting(claim=claim, rules=rules, variant=variant, lacks=lacks, reasons=reasons)
