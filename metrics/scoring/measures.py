"""Which measures can be scored, in which forms, what has to be varied for each, and their order in tables."""

import difflib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import get_args

from ..catalog import METRICS
from ..checks import CurveError
from ..curves import Form, Variant
from .columns import HANDLING, NOISE, POPULATION, SIZE, THROTTLE

MEASURE_CRITERIA: dict[str, str] = {
    "raw_performance": SIZE,
    "efficiency": SIZE,
    "t_lost_fraction": SIZE,
    "performance_lost": SIZE,
    "spatial_emergence": SIZE,
    "time_emergence": SIZE,
    "task_emergence": SIZE,
    "interference_gain": SIZE,
    "undisturbed_gain": SIZE,
    "scalability": SIZE,
    "reactivity": THROTTLE,
    "adaptability": THROTTLE,
    "noise_robustness": NOISE,
    "population_robustness": POPULATION,
    "recorded_population_robustness": POPULATION,
    "availability": POPULATION,
}
"""Measure -> what has to be varied for it. The order is that of score tables."""
DISTURBANCES = (THROTTLE, HANDLING)
"""Kinds of disturbance over time, the paper's two, under which reactivity and adaptability can be scored."""


def criteria_of(measures: Sequence[str], disturbance: str) -> set[str]:
    """Return what has to be varied for some measures, with one of `DISTURBANCES` in place of the throttle.

    Raises:
        CurveError: an unknown kind of disturbance.
    """
    if disturbance not in DISTURBANCES:
        raise CurveError(f"Expected disturbance to be one of {', '.join(DISTURBANCES)}, got {disturbance!r}.")
    criteria = (MEASURE_CRITERIA[name] for name in measures)
    return {disturbance if criterion == THROTTLE else criterion for criterion in criteria}


MEASURE_VARIANTS: dict[str, tuple[Variant, ...]] = {
    "raw_performance": ("corrected", "sierra"),
    "efficiency": ("corrected", "sierra"),
    "performance_lost": ("corrected", "sierra"),
    "spatial_emergence": ("corrected", "paper", "sierra"),
    "task_emergence": ("corrected", "sierra"),
    "scalability": ("corrected", "paper", "sierra"),
    "reactivity": ("corrected", "paper", "sierra"),
    "adaptability": ("corrected", "sierra"),
    "noise_robustness": ("corrected", "sierra"),
    "population_robustness": ("corrected", "paper", "sierra"),
}
"""Measure -> its variants that give different numbers. Measures without an entry have the corrected one only."""


@dataclass(frozen=True, kw_only=True, slots=True)
class ScoreForms:
    """The forms in which measures are scored: every variant with every form that a measure has."""

    variants: tuple[Variant, ...] = ("corrected",)
    """Variants as in docs/metrics.md; a measure that has none of them is scored in the corrected one."""
    forms: tuple[Form, ...] = ("marginal",)
    """For measures that compare two sizes."""
    band: bool = False
    """Whether tables and pictures have the authors' bands, too: mean plus and minus two standard deviations."""

    def __post_init__(self) -> None:
        _check_words("variant", self.variants, get_args(Variant))
        _check_words("form", self.forms, get_args(Form))

    def of(self, measure: str) -> Iterator[tuple[Variant, Form]]:
        """Yield each variant and form of a measure that was asked for, once."""
        has = MEASURE_VARIANTS.get(measure, ("corrected",))
        wanted: list[Variant] = [variant if variant in has else "corrected" for variant in self.variants]
        forms: tuple[Form, ...] = self.forms if "two sizes" in METRICS[measure].needs else ("marginal",)
        for variant in dict.fromkeys(wanted):
            for form in dict.fromkeys(forms):
                yield variant, form


def label_of(measure: str, variant: Variant, form: Form) -> str:
    """Return the name of a measure with what differs from the usual form: "spatial_emergence, interactive, sierra"."""
    words = (measure, "interactive" if form == "interactive" else "", "" if variant == "corrected" else variant)
    return ", ".join(word for word in words if word)


def check_measures(measures: Sequence[str] | None) -> tuple[str, ...]:
    """Return measures in the order of tables, each once; None = all.

    Raises:
        CurveError: an unknown name, or none at all.
    """
    if measures is None:
        return tuple(MEASURE_CRITERIA)
    _check_words("measure", measures, tuple(MEASURE_CRITERIA))
    return tuple(name for name in MEASURE_CRITERIA if name in measures)


def _check_words(what: str, words: Sequence[str], known: Sequence[str]) -> None:
    for word in words:
        if word not in known:
            close = difflib.get_close_matches(word, known, n=1)
            hint = f" Did you mean {close[0]!r}?" if close else ""
            raise CurveError(f"Unknown {what} {word!r}.{hint} Known: {', '.join(known)}.")
    if not words:
        raise CurveError(f"Expected one or more {what}s of {', '.join(known)}, got none.")
