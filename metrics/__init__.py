"""Measures of swarm behaviour after Harwell and Gini: arrays in, numbers out.

Every measure is a function of curves, arrays of shape (..., T) over recording intervals; it knows nothing of robots,
files or policies. `docs/metrics.md` explains inputs and variants, `docs/errata.md` the errors in the paper.
`score_policy` runs a policy in all experiments that the measures need and makes one table (`docs/scoring.md`).

Names load on first use (PEP 562), so importing the package compiles nothing. No public name equals the name of a
module: a module that loads later would replace it.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .breakdown import Breakdowns, Survival, breakdown_probability, find_breakdowns, time_to_breakdown
    from .catalog import METRICS, Measure
    from .checks import CurveError, PopulationError
    from .claims import CLAIMS, Claim, Panel, Verdict, check_claim
    from .distance import aligned_l1, dtw, noise_floor
    from .distributions import interquartile_mean, probability_of_improvement
    from .earlier_papers import fractional_maintenance, projective_performance, weighted_combination
    from .emergence import interference_gain, spatial_emergence, task_emergence, time_emergence, undisturbed_gain
    from .environment import environment_distance, environment_scaling, waveform
    from .flexibility import adaptability, reactivity
    from .foraging_model import ForagingRates, MeanField, SteadyState, estimate_rates, mean_field, steady_state
    from .interference import fractional_loss, performance_lost, t_lost_fraction
    from .ladder import Ladder, LawFit, fit_ladder
    from .laws import SizeLaw, fit_law
    from .population import (
        availability,
        availability_curves,
        population_robustness,
        population_weight,
        ratio_for_availability,
        ratio_for_team,
        recorded_population_robustness,
    )
    from .prediction import SizePrediction, forward_error, predict_performance
    from .queues import (
        PopulationComparison,
        PopulationRates,
        QueueStats,
        compare_population,
        mean_away,
        queue_statistics,
        robots_at_work,
    )
    from .robustness import mean_signed_difference, noise_robustness
    from .scaling import efficiency, raw_performance, scalability, skipped_intervals
    from .scoring import (
        Choice,
        Comparison,
        Performance,
        PredictionTable,
        Score,
        ScoreForms,
        ScoreTable,
        choose_policy,
        compare_policies,
        compare_tables,
        predict_curves,
        predict_policy,
        score_curves,
        score_policy,
    )
    from .significance import paired_tests
    from .statistics import Estimate, Summary, aggregate, bootstrap_measure, normalize

PAPER_POLICIES = ("crw", "dpo", "stochm", "stochx")
"""The paper's four controllers, by the names under which they are registered."""

__all__ = [
    "PAPER_POLICIES",
    # from policies and files of curves to tables of scores
    "score_policy",
    "compare_policies",
    "score_curves",
    "compare_tables",
    "Score",
    "ScoreTable",
    "ScoreForms",
    "Comparison",
    "Performance",
    # decisions: larger swarms, and which policy
    "predict_policy",
    "predict_curves",
    "choose_policy",
    "PredictionTable",
    "Choice",
    # interference
    "t_lost_fraction",
    "performance_lost",
    "fractional_loss",
    # emergence
    "spatial_emergence",
    "time_emergence",
    "task_emergence",
    "interference_gain",
    "undisturbed_gain",
    # scalability
    "scalability",
    "skipped_intervals",
    "efficiency",
    "raw_performance",
    # distance
    "dtw",
    "aligned_l1",
    "noise_floor",
    # environment
    "waveform",
    "environment_scaling",
    "environment_distance",
    # flexibility
    "reactivity",
    "adaptability",
    # robustness
    "noise_robustness",
    "mean_signed_difference",
    # queues and population
    "PopulationRates",
    "PopulationError",
    "QueueStats",
    "queue_statistics",
    "mean_away",
    "robots_at_work",
    "compare_population",
    "PopulationComparison",
    "population_robustness",
    "recorded_population_robustness",
    "population_weight",
    "availability",
    "availability_curves",
    "ratio_for_availability",
    "ratio_for_team",
    # laws of swarm size, and prediction of larger swarms
    "fit_ladder",
    "Ladder",
    "LawFit",
    "predict_performance",
    "fit_law",
    "forward_error",
    "SizeLaw",
    "SizePrediction",
    # mean-field model of foraging
    "estimate_rates",
    "mean_field",
    "steady_state",
    "ForagingRates",
    "MeanField",
    "SteadyState",
    # statistics
    "normalize",
    "Summary",
    "aggregate",
    "bootstrap_measure",
    "Estimate",
    "interquartile_mean",
    "probability_of_improvement",
    "paired_tests",
    # runs that break down
    "find_breakdowns",
    "breakdown_probability",
    "time_to_breakdown",
    "Breakdowns",
    "Survival",
    # claims of the paper
    "CLAIMS",
    "check_claim",
    "Claim",
    "Panel",
    "Verdict",
    # measures of earlier papers
    "fractional_maintenance",
    "projective_performance",
    "weighted_combination",
    # overview and errors
    "METRICS",
    "Measure",
    "CurveError",
]

_HOMES = {
    "Breakdowns": "breakdown",
    "Survival": "breakdown",
    "breakdown_probability": "breakdown",
    "find_breakdowns": "breakdown",
    "time_to_breakdown": "breakdown",
    "METRICS": "catalog",
    "Measure": "catalog",
    "CurveError": "checks",
    "PopulationError": "checks",
    "CLAIMS": "claims",
    "Claim": "claims",
    "Panel": "claims",
    "Verdict": "claims",
    "check_claim": "claims",
    "aligned_l1": "distance",
    "dtw": "distance",
    "noise_floor": "distance",
    "interquartile_mean": "distributions",
    "probability_of_improvement": "distributions",
    "fractional_maintenance": "earlier_papers",
    "projective_performance": "earlier_papers",
    "weighted_combination": "earlier_papers",
    "interference_gain": "emergence",
    "spatial_emergence": "emergence",
    "task_emergence": "emergence",
    "time_emergence": "emergence",
    "undisturbed_gain": "emergence",
    "environment_distance": "environment",
    "environment_scaling": "environment",
    "waveform": "environment",
    "adaptability": "flexibility",
    "reactivity": "flexibility",
    "ForagingRates": "foraging_model",
    "MeanField": "foraging_model",
    "SteadyState": "foraging_model",
    "estimate_rates": "foraging_model",
    "mean_field": "foraging_model",
    "steady_state": "foraging_model",
    "fractional_loss": "interference",
    "performance_lost": "interference",
    "t_lost_fraction": "interference",
    "availability": "population",
    "availability_curves": "population",
    "population_robustness": "population",
    "population_weight": "population",
    "ratio_for_availability": "population",
    "ratio_for_team": "population",
    "recorded_population_robustness": "population",
    "Ladder": "ladder",
    "LawFit": "ladder",
    "fit_ladder": "ladder",
    "SizeLaw": "laws",
    "fit_law": "laws",
    "SizePrediction": "prediction",
    "forward_error": "prediction",
    "predict_performance": "prediction",
    "PopulationComparison": "queues",
    "PopulationRates": "queues",
    "compare_population": "queues",
    "robots_at_work": "queues",
    "QueueStats": "queues",
    "mean_away": "queues",
    "queue_statistics": "queues",
    "mean_signed_difference": "robustness",
    "noise_robustness": "robustness",
    "efficiency": "scaling",
    "raw_performance": "scaling",
    "scalability": "scaling",
    "skipped_intervals": "scaling",
    "Choice": "scoring",
    "Comparison": "scoring",
    "Performance": "scoring",
    "PredictionTable": "scoring",
    "Score": "scoring",
    "ScoreForms": "scoring",
    "ScoreTable": "scoring",
    "choose_policy": "scoring",
    "compare_policies": "scoring",
    "compare_tables": "scoring",
    "predict_curves": "scoring",
    "predict_policy": "scoring",
    "score_curves": "scoring",
    "score_policy": "scoring",
    "paired_tests": "significance",
    "Estimate": "statistics",
    "Summary": "statistics",
    "aggregate": "statistics",
    "bootstrap_measure": "statistics",
    "normalize": "statistics",
}
"""Public name -> submodule that defines it, loaded when the name is first used."""


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    value = getattr(import_module(f"{__name__}.{_HOMES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
