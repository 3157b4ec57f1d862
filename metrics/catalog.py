"""The measures in one table: what each is called, how to read it, and what it needs."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from .curves import Variant
from .emergence import interference_gain, spatial_emergence, task_emergence, time_emergence, undisturbed_gain
from .flexibility import adaptability, noise_robustness, reactivity
from .interference import performance_lost, t_lost_fraction
from .population import availability, population_robustness, recorded_population_robustness
from .scaling import efficiency, raw_performance, scalability

Input: TypeAlias = Literal[
    "performance", "interference", "one robot", "two sizes", "ideal run", "waveforms", "rates", "robots at work"
]


@dataclass(frozen=True, kw_only=True)
class Measure:
    """One measure of the paper."""

    function: Callable[..., Any]
    """Computes it in the corrected form by default."""
    symbol: str
    """Symbol in the paper."""
    equation: str
    """Displayed equation of the paper, or where else it comes from; "ours" is not in the paper."""
    higher_is_better: bool
    """Direction of the corrected form."""
    neutral: float | None
    """Value that separates better from worse: robots that do not affect each other, or an undisturbed swarm."""
    needs: tuple[Input, ...]
    """What has to be run to compute it."""
    lowest: float = -math.inf
    """Lower end of the range."""
    highest: float = math.inf
    """Upper end of the range."""
    is_distance: bool = False
    """Whether `normalize` needs distance=True."""
    variants: tuple[Variant, ...] = ("corrected",)
    """Its variants that give different numbers."""


METRICS: dict[str, Measure] = {
    "t_lost_fraction": Measure(
        function=t_lost_fraction,
        symbol="t_lost(N, t)",
        equation="notation table",
        higher_is_better=False,
        neutral=0.0,
        lowest=0.0,
        highest=1.0,
        needs=("interference",),
    ),
    "performance_lost": Measure(
        function=performance_lost,
        symbol="P_lost(N, t)",
        equation="Eq. (1)",
        higher_is_better=False,
        neutral=0.0,
        needs=("performance", "interference", "one robot"),
    ),
    "spatial_emergence": Measure(
        function=spatial_emergence,
        symbol="E_S(N1, N2)",
        equation="Eq. (2)",
        higher_is_better=True,
        neutral=0.0,
        needs=("performance", "interference", "one robot", "two sizes"),
        variants=("corrected", "paper"),
    ),
    "time_emergence": Measure(
        function=time_emergence,
        symbol="E_R(N1, N2)",
        equation="ours, Eq. (2) in robot time",
        higher_is_better=True,
        neutral=0.0,
        needs=("interference", "two sizes"),
    ),
    "task_emergence": Measure(
        function=task_emergence,
        symbol="E_T(N1, N2)",
        equation="Eq. (3)",
        higher_is_better=True,
        neutral=0.0,
        needs=("performance", "two sizes"),
    ),
    "interference_gain": Measure(
        function=interference_gain,
        symbol="E_I(N1, N2)",
        equation="ours, part of Eq. (3)",
        higher_is_better=True,
        neutral=0.0,
        needs=("performance", "interference", "two sizes"),
    ),
    "undisturbed_gain": Measure(
        function=undisturbed_gain,
        symbol="E_U(N1, N2)",
        equation="ours, part of Eq. (3)",
        higher_is_better=True,
        neutral=0.0,
        needs=("performance", "interference", "two sizes"),
    ),
    "scalability": Measure(
        function=scalability,
        symbol="C(N1, N2)",
        equation="Eq. (4)",
        higher_is_better=True,
        neutral=1.0,
        needs=("performance", "two sizes"),
        variants=("corrected", "paper"),
    ),
    "reactivity": Measure(
        function=reactivity,
        symbol="R(N)",
        equation="Eqs. (5) and (6)",
        higher_is_better=False,
        neutral=0.0,
        lowest=0.0,
        is_distance=True,
        needs=("performance", "ideal run", "waveforms"),
        variants=("corrected", "paper"),
    ),
    "adaptability": Measure(
        function=adaptability,
        symbol="A(N)",
        equation="Eq. (7)",
        higher_is_better=False,
        neutral=0.0,
        lowest=0.0,
        is_distance=True,
        needs=("performance", "ideal run"),
    ),
    "noise_robustness": Measure(
        function=noise_robustness,
        symbol="B_sa",
        equation="Eq. (8)",
        higher_is_better=False,
        neutral=0.0,
        lowest=0.0,
        is_distance=True,
        needs=("performance", "ideal run"),
    ),
    "population_robustness": Measure(
        function=population_robustness,
        symbol="B_pd",
        equation="Eq. (12)",
        higher_is_better=True,
        neutral=0.0,
        needs=("performance", "ideal run", "rates"),
        variants=("corrected", "paper"),
    ),
    "recorded_population_robustness": Measure(
        function=recorded_population_robustness,
        symbol="B_pd'",
        equation="ours, Eq. (12) with the robots recorded at work",
        higher_is_better=True,
        neutral=0.0,
        needs=("performance", "ideal run", "robots at work"),
    ),
    "availability": Measure(
        function=availability,
        symbol="p_v",
        equation="Eq. (13)",
        higher_is_better=True,
        neutral=1.0,
        lowest=0.0,
        highest=1.0,
        needs=("rates",),
    ),
    "efficiency": Measure(
        function=efficiency,
        symbol="P(N) / N",
        equation="Hecker and Moses 2015",
        higher_is_better=True,
        neutral=None,
        lowest=0.0,
        needs=("performance",),
    ),
    "raw_performance": Measure(
        function=raw_performance,
        symbol="P(N)",
        equation="raw performance figures",
        higher_is_better=True,
        neutral=None,
        lowest=0.0,
        needs=("performance",),
    ),
}
"""Public function name -> what the measure is."""
