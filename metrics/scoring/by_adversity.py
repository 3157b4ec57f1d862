"""Scores of the measures that vary an adversity: throttled, noisy and failing robots beside undisturbed ones."""

import math
from collections.abc import Callable, Iterator

import numpy as np

from metrics.curves import FloatArray
from metrics.distance import noise_floor
from metrics.environment import environment_distance
from metrics.flexibility import adaptability, reactivity
from metrics.population import availability, population_robustness, population_weight
from metrics.queues import PopulationRates
from metrics.robustness import mean_signed_difference, noise_robustness
from metrics.statistics import Summary

from .columns import HANDLING, NOISE, POPULATION, THROTTLE
from .draft import ScoreDraft, Uncomputable, Values
from .measures import DISTURBANCES, MEASURE_CRITERIA
from .studies import RunCurves, StudyCurves, common_runs
from .table import Score

ENOUGH_SHARE = 0.1
"""Share of the swarm that availability asks for: 5 of 50 and 20 of 200 robots (scenario 1 of the paper)."""

_WORDS = {THROTTLE: "throttle", HANDLING: "handling cost", NOISE: "sigma", POPULATION: "population"}
"""Criterion -> its word in `Score.at`."""


def _levels(study: StudyCurves, *criteria: str) -> tuple[tuple[RunCurves, RunCurves], ...]:
    levels = tuple(level for criterion in criteria for level in study.levels(criterion))
    if not levels:
        raise Uncomputable(f"there are no runs with criterion {' or '.join(criteria)} and a value other than 0")
    return levels


def _draft(measure: str, pair: tuple[RunCurves, RunCurves], *, unit: str, beside: dict[str, float]) -> ScoreDraft:
    """Return the draft of a score that compares a level with its reference."""
    level = pair[1]
    return ScoreDraft(
        measure=measure,
        at=f"{_WORDS[level.criterion]} {level.value:.4g}",
        x=level.value,
        unit=unit,
        experiments=pair,
        compared_with=0,
        beside=beside,
    )


def _reactivity(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
    if disturbed.criterion == HANDLING:
        # Ticks that handling takes, never less than one: twice as many halve the performance of a perfect swarm.
        v, i_ec = (np.maximum(1.0, runs.curves["adversity"]) for runs in (disturbed, ideal))
        return reactivity(ideal.performance, disturbed.performance, v, i_ec, model="reciprocal")
    return reactivity(
        ideal.performance, disturbed.performance, disturbed.curves["adversity"], ideal.curves["adversity"]
    )


def _adaptability(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
    return adaptability(ideal.performance, disturbed.performance)


def _noise_robustness(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
    return noise_robustness(ideal.performance, disturbed.performance)


_DISTANCES: dict[str, Values] = {
    "reactivity": _reactivity,
    "adaptability": _adaptability,
    "noise_robustness": _noise_robustness,
}


def _distance_scores(name: str, study: StudyCurves) -> Iterator[Score]:
    criterion = MEASURE_CRITERIA[name]
    levels = _levels(study, *(DISTURBANCES if criterion in DISTURBANCES else (criterion,)))
    if name == "reactivity" and any("adversity" not in e.curves and e.seeds for pair in levels for e in pair):
        raise Uncomputable("there is no column adversity for the reference run and every level")
    for reference, level in levels:
        floor = float(noise_floor(reference.performance).mean()) if len(reference.seeds) > 1 else None
        draft = _draft(name, (reference, level), unit="objects (DTW)", beside=_beside_distance(reference, level))
        yield draft.score(_DISTANCES[name], floor=floor, order_matters=True)


def _beside_distance(reference: RunCurves, level: RunCurves) -> dict[str, float]:
    """What the distance does not show: its sign, and how far the conditions were from the ideal ones."""
    ideal, disturbed = common_runs(reference, level)
    if not ideal.seeds:
        return {}
    difference = mean_signed_difference(ideal.performance, disturbed.performance)
    beside = {"signed_difference": float(np.mean(difference))}
    if level.criterion in DISTURBANCES and "adversity" in ideal.curves and "adversity" in disturbed.curves:
        applied, wanted = disturbed.curves["adversity"].mean(axis=0), ideal.curves["adversity"].mean(axis=0)
        beside["environment_distance"] = environment_distance(applied, wanted)
    return beside


def _population_scores(name: str, study: StudyCurves) -> Iterator[Score]:
    levels = _levels(study, POPULATION)
    horizon_s = study.horizon_s
    if horizon_s is None:
        raise Uncomputable("there is no column t_end_s, which gives the length of a run")
    for reference, level in levels:
        weight = population_weight(_rates(level), horizon=horizon_s, n=level.n_robots, ideal_rates=reference.rates)

        def values(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
            return population_robustness(
                disturbed.performance,
                ideal.performance,
                _rates(disturbed),
                horizon=horizon_s,
                n=disturbed.n_robots,
                ideal_rates=ideal.rates,
            )

        draft = _draft(name, (reference, level), unit=f"objects in {horizon_s:,.0f} s", beside={"weight": weight})
        yield draft.score(values)


def _rates(level: RunCurves) -> PopulationRates:
    if level.rates is None:
        raise Uncomputable(f"there are no rates (deaths_per_s, malfunctions_per_s, ...) for {level.describe()}")
    return level.rates


def _availability_scores(name: str, study: StudyCurves) -> Iterator[Score]:
    """One score per ratio of rates; it follows from the rates alone and is the same for every policy."""
    seen: set[tuple[int, float]] = set()
    for _, level in _levels(study, POPULATION):
        rates, n_robots = _rates(level), level.n_robots
        ratio_out = 0.0 if rates.lam == 0.0 else math.inf if rates.mu == 0.0 else round(rates.lam / rates.mu, 6)
        if (n_robots, ratio_out) in seen:
            continue
        seen.add((n_robots, ratio_out))
        enough = max(1, round(ENOUGH_SHARE * n_robots))
        value = availability(n_robots, enough, ratio_out)
        yield Score(
            measure=name,
            at=f"{enough} or more at work, lambda/mu {ratio_out:.4g}",
            criterion=POPULATION,
            x=ratio_out,
            n_robots=(n_robots,),
            unit="probability",
            summary=Summary(mean=value, std=math.nan, lower=math.nan, upper=math.nan, n_used=0, n_nan=0),
            per_seed={},
            note="from the rates alone, the same for every policy, in an equilibrium that runs need not reach",
        )


BY_ADVERSITY: dict[str, Callable[[str, StudyCurves], Iterator[Score]]] = {
    **dict.fromkeys(_DISTANCES, _distance_scores),
    "population_robustness": _population_scores,
    "availability": _availability_scores,
}
"""Measure -> what computes its scores."""
