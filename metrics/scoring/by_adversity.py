"""Scores of the measures that vary an adversity: throttled, noisy and failing robots beside undisturbed ones."""

import math
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from ..checks import PopulationError
from ..curves import FloatArray, Form, Variant
from ..distance import noise_floor
from ..environment import environment_distance
from ..flexibility import adaptability, mean_signed_difference, noise_robustness, reactivity
from ..population import (
    PopulationWeight,
    availability,
    population_robustness,
    population_weight,
    recorded_population_robustness,
)
from ..queues import PopulationRates
from ..statistics import Summary
from .run_curves import HANDLING, NOISE, POPULATION, THROTTLE, RunCurves, StudyCurves, common_runs
from .scores import DISTURBANCES, MEASURE_CRITERIA, Score, Uncomputable, Values, score_runs

ENOUGH_SHARE = 0.1
"""Share of the swarm that availability asks for: 5 of 50 and 20 of 200 robots (scenario 1 of the paper)."""

_WORDS = {THROTTLE: "throttle", HANDLING: "handling cost", NOISE: "sigma", POPULATION: "population"}
"""Criterion -> its word in `Score.at`."""
_WEIGHTS: dict[Variant, PopulationWeight] = {"corrected": "transient", "paper": "paper"}


def _levels(study: StudyCurves, *criteria: str) -> tuple[tuple[RunCurves, RunCurves], ...]:
    levels = tuple(level for criterion in criteria for level in study.levels(criterion))
    if not levels:
        raise Uncomputable(f"there are no runs with criterion {' or '.join(criteria)} and a value other than 0")
    return levels


def _score(values: Values, pair: tuple[RunCurves, RunCurves], **told: Any) -> Score:
    """Return a score that compares a level with its reference; `told` as in `score_runs`."""
    level = pair[1]
    at = f"{_WORDS[level.criterion]} {level.value:.4g}"
    return score_runs(values, pair, at=at, x=level.value, compared_with=0, **told)


def _conditions(runs: RunCurves, disturbance: str, variant: Variant) -> FloatArray:
    """V(t), (R, T): the mean over each interval, or its value at the end of each, as in the paper's waveforms.

    What robots deliver in an interval depends on the conditions in all of it, so the corrected form uses the mean. The
    column of the values at the end has the name of the disturbance.
    """
    sampled = runs.curves.get(disturbance)
    return runs.curves["adversity"] if sampled is None or variant == "corrected" else sampled


def _reactivity(ideal: RunCurves, disturbed: RunCurves, *, variant: Variant) -> FloatArray:
    disturbance = disturbed.criterion
    # Twice the ticks that handling takes halve the performance of a perfect swarm.
    corrected = "reciprocal" if disturbance == HANDLING else "linear"
    return reactivity(
        ideal.performance,
        disturbed.performance,
        v=_conditions(disturbed, disturbance, variant),
        i_ec=_conditions(ideal, disturbance, variant),
        model="paper" if variant == "paper" else corrected,
    )


_DISTANCES = ("reactivity", "adaptability", "noise_robustness")


def _distance(name: str, variant: Variant) -> Values:
    """Return what computes a distance from the reference runs and the disturbed ones."""
    if name == "reactivity":
        return partial(_reactivity, variant=variant)
    formula = adaptability if name == "adaptability" else noise_robustness

    def distance(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
        return formula(ideal.performance, disturbed.performance)

    return distance


def _distance_scores(name: str, study: StudyCurves, variant: Variant, _: Form) -> Iterator[Score]:
    criterion = MEASURE_CRITERIA[name]
    levels = _levels(study, *(DISTURBANCES if criterion in DISTURBANCES else (criterion,)))
    if name == "reactivity" and any("adversity" not in e.curves and e.seeds for pair in levels for e in pair):
        raise Uncomputable("there is no column adversity for the reference run and every level")
    for reference, level in levels:
        if name == "reactivity":
            _check_conditions(reference, level, variant)
        floor = float(noise_floor(reference.performance).mean()) if len(reference.seeds) > 1 else None
        floors = _floor_per_seed(name, reference, variant)
        beside = _beside_distance(reference, level)
        yield _score(
            _distance(name, variant),
            (reference, level),
            measure=name,
            variant=variant,
            unit="objects (DTW)",
            beside=beside,
            floor=floor,
            floor_per_seed=floors,
            order_matters=True,
        )


def _floor_per_seed(name: str, reference: RunCurves, variant: Variant) -> dict[int, float]:
    """Return the distance of each reference run to the next, the last one's to the first; empty for a single run."""
    if len(reference.seeds) < 2:
        return {}
    others = replace(reference, curves={name: np.roll(curve, -1, axis=0) for name, curve in reference.curves.items()})
    found = _distance(name, variant)(reference, others)
    return dict(zip(reference.seeds, np.asarray(found).tolist(), strict=True))


def _check_conditions(reference: RunCurves, level: RunCurves, variant: Variant) -> None:
    """Refuse conditions that the form of reactivity cannot divide by."""
    disturbance = level.criterion
    conditions = [_conditions(runs, disturbance, variant) for runs in (reference, level) if runs.seeds]
    if disturbance == HANDLING and any((ticks <= 0.0).any() for ticks in conditions):
        raise Uncomputable("the conditions under a handling cost are the ticks that handling takes, and 0 or less here")
    if variant == "paper" and reference.seeds and (conditions[0] == 0.0).any():
        raise Uncomputable("the printed form divides by the ideal conditions, which are 0 here")


def _beside_distance(reference: RunCurves, level: RunCurves) -> dict[str, float]:
    """What the distance does not show: its sign, and how far the conditions were from the ideal ones."""
    ideal, disturbed = common_runs(reference, level)
    if not ideal.seeds:
        return {}
    difference = mean_signed_difference(ideal.performance, disturbed.performance)
    beside = {"signed_difference": float(np.mean(difference))}
    if level.criterion in DISTURBANCES and "adversity" in ideal.curves and "adversity" in disturbed.curves:
        # Sampled at interval ends, which gives the paper's x axis.
        applied, wanted = (_conditions(runs, level.criterion, "paper").mean(axis=0) for runs in (disturbed, ideal))
        beside["environment_distance"] = environment_distance(applied, wanted)
    return beside


def _population_scores(name: str, study: StudyCurves, variant: Variant, _: Form) -> Iterator[Score]:
    horizon_s = study.horizon_s
    levels = _levels(study, POPULATION)
    if horizon_s is None:
        raise Uncomputable("there is no column t_end_s, which gives the length of a run")
    for reference, level in levels:
        try:
            weight = population_weight(
                _rates(level),
                horizon=horizon_s,
                n=level.n_robots,
                ideal_rates=reference.rates,
                weight=_WEIGHTS[variant],
            )
        except PopulationError as error:
            raise Uncomputable(str(error)) from error

        def values(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
            return population_robustness(
                disturbed.performance,
                ideal.performance,
                _rates(disturbed),
                horizon=horizon_s,
                n=disturbed.n_robots,
                ideal_rates=ideal.rates,
                weight=_WEIGHTS[variant],
            )

        yield _score(
            values,
            (reference, level),
            measure=name,
            variant=variant,
            unit=f"objects in {horizon_s:,.0f} s",
            beside={"weight": weight},
        )


def _recorded_population(ideal: RunCurves, disturbed: RunCurves) -> FloatArray:
    return recorded_population_robustness(
        disturbed.performance, disturbed.curves["n_active"], ideal.performance, ideal.curves["n_active"]
    )


def _recorded_population_scores(name: str, study: StudyCurves, variant: Variant, _: Form) -> Iterator[Score]:
    levels = _levels(study, POPULATION)
    if any("n_active" not in e.curves and e.seeds for pair in levels for e in pair):
        raise Uncomputable("there is no column n_active for the reference run and every level")
    span = "per run" if study.horizon_s is None else f"in {study.horizon_s:,.0f} s"
    for reference, level in levels:
        if reference.seeds and (reference.curves["n_active"] <= 0.0).any():
            raise Uncomputable("no robot of the reference run was at work in some interval")
        ideal, disturbed = common_runs(reference, level)
        weight = {}
        if ideal.seeds:
            weight = {"weight": float(disturbed.curves["n_active"].mean() / ideal.curves["n_active"].mean())}
        yield _score(
            _recorded_population,
            (reference, level),
            measure=name,
            variant=variant,
            unit=f"objects {span}",
            beside=weight,
        )


def _rates(level: RunCurves) -> PopulationRates:
    if level.rates is None:
        raise Uncomputable(f"there are no rates (deaths_per_s, malfunctions_per_s, ...) for {level.describe()}")
    return level.rates


def _availability_scores(name: str, study: StudyCurves, _variant: Variant, _form: Form) -> Iterator[Score]:
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
            summary=Summary.without_interval(value),
            per_seed={},
            note="from the rates alone, the same for every policy, in an equilibrium that runs need not reach",
        )


BY_ADVERSITY: dict[str, Callable[[str, StudyCurves, Variant, Form], Iterator[Score]]] = {
    **dict.fromkeys(_DISTANCES, _distance_scores),
    "population_robustness": _population_scores,
    "recorded_population_robustness": _recorded_population_scores,
    "availability": _availability_scores,
}
"""Measure -> what computes its scores."""
