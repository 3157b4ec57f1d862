"""The table of measures: what each compares, by hand, and why some cannot be computed."""

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import metrics
from metrics import MEASURES, CurveError, PopulationRates
from metrics.scoring.measures import checked_request
from tests.support.curve_tables import CLOCK, IDEAL, SIGNAL, SLOWED, missing, rows, scored, throttled

DOCS = Path(__file__).resolve().parents[3] / "docs"


def test_a_measure_is_named_after_a_public_function_and_stands_on_its_page():
    page = (DOCS / "equations.md").read_text()
    for name, measure in MEASURES.items():
        assert callable(getattr(metrics, name))
        assert f"`{name}`" in page
        assert measure.lowest < measure.highest
        assert measure.neutral is None or measure.lowest <= measure.neutral <= measure.highest
        best = (measure.higher_is_better, measure.neutral, measure.lowest)
        assert not measure.is_distance or best == (False, 0.0, 0.0)


@pytest.mark.parametrize(("names", "message"), [(["scalabilty"], "Did you mean 'scalability'"), ([], "got none")])
def test_unknown_measures_are_refused(names, message):
    with pytest.raises(CurveError, match=message):
        checked_request(names, ["corrected"], ["marginal"])
    twice = ["scalability", "efficiency", "scalability"]
    assert checked_request(twice, ["paper"], ["marginal"]) == ("efficiency", "scalability")
    for variants, forms in ((["papr"], ["marginal"]), (["paper"], [])):
        with pytest.raises(CurveError, match=r"variant 'papr'\. Did you mean 'paper'|one or more forms"):
            checked_request(twice, variants, forms)


ONE, TWO = np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([[3.0, 5.0], [2.0, 6.0]])
F1, F2 = np.full((2, 2), 0.1), np.full((2, 2), 0.2)
SIZES = (
    rows(1, ONE.tolist(), interference_fraction=0.1, t_end_s=[10.0, 20.0]),
    rows(2, TWO.tolist(), interference_fraction=0.2, t_end_s=[10.0, 20.0]),
)
BY_HAND: dict[str, Any] = {
    "raw_performance": [8.0, 8.0],
    "efficiency": [4.0, 4.0],
    "t_lost_fraction": [0.2, 0.2],
    "performance_lost": metrics.performance_lost(TWO, F2, 2, ONE, F1).sum(axis=-1),
    "spatial_emergence": metrics.spatial_emergence(ONE, F1, 1, TWO, F2, 2, ONE, F1),
    "spatial_emergence, paper": metrics.spatial_emergence(ONE, F1, 1, TWO, F2, 2, ONE, F1, variant="paper"),
    "time_emergence": metrics.time_emergence(F1, 1, F2, 2),
    "task_emergence": metrics.task_emergence(ONE, 1, TWO, 2),
    "interference_gain": metrics.interference_gain(ONE, F1, 1, TWO, F2, 2),
    "undisturbed_gain": metrics.undisturbed_gain(ONE, F1, 1, TWO, F2, 2),
    "scalability": metrics.scalability(ONE, 1, TWO, 2),
    "scalability, paper": [2 * (1 - 3.0) + 2 * (1 - 2.5), 2 * (1 - 1.0) + 2 * (1 - 6.0)],
}


@pytest.mark.parametrize("label", BY_HAND)
def test_measures_of_size_by_hand(label):
    measure, _, variant = label.partition(", ")
    found = scored(*SIZES, measures=[measure], variants=[variant or "corrected"]).filter(x=2.0)
    np.testing.assert_allclose(found["value"], BY_HAND[label])
    assert ("reverses the order" in found["remark"][0]) == (label == "scalability, paper")


def test_sizes_are_compared_with_the_next_smaller_one():
    found = scored(rows(1, IDEAL), rows(2, IDEAL), rows(8, IDEAL), measures=["task_emergence", "scalability"])
    assert found.select("measure", "at", "x", "n_robots").unique(maintain_order=True).rows() == [
        ("task_emergence", "N = 1 to 2", 2.0, 2),
        ("task_emergence", "N = 2 to 8", 8.0, 8),
        ("scalability", "N = 1 to 2", 2.0, 2),
        ("scalability", "N = 2 to 8", 8.0, 8),
    ]


COLLAPSE = (
    rows(1, [[5.0], [5.0]], interference_fraction=0.0),
    rows(2, [[8.0], [8.0]], interference_fraction=0.2),
    rows(4, [[1.6], [1.6]], interference_fraction=0.6),
)
"""A swarm that delivers a fifth when its size doubles from 2 to 4."""


def test_where_performance_falls_spatial_emergence_misleads():
    found = scored(*COLLAPSE, measures=["spatial_emergence", "time_emergence", "task_emergence"])
    falling = found.filter(x=4.0).group_by("measure", maintain_order=True).first()
    assert falling["value"].to_list() == pytest.approx([2.24, -1.6, -14.4])
    assert falling["misleads"].to_list() == [True, False, False]
    assert "read time_emergence beside it" in falling["remark"][0]
    assert not found.filter(x=2.0)["misleads"].any()


def test_the_interactive_form_compares_with_lone_robots():
    found = scored(*COLLAPSE, measures=["spatial_emergence"], forms=["interactive", "marginal"])
    levels = found.unique("at", keep="first", maintain_order=True).select("form", "at")
    assert found.select("form", "at").unique(maintain_order=True).rows() == [
        ("interactive", "N = 1 to 2"),
        ("interactive", "N = 1 to 4"),
        ("marginal", "N = 1 to 2"),
        ("marginal", "N = 2 to 4"),
    ]
    assert len(levels) == 3
    assert found.filter(form="interactive", x=4.0)["value"][0] == pytest.approx(-1.6 * 0.6)
    assert found.filter(form="interactive", x=4.0)["misleads"].all(), "performance falls from 2 to 4"


def test_the_marginal_form_of_spatial_emergence_needs_no_run_of_one_robot():
    with_one = scored(*COLLAPSE, measures=["spatial_emergence"]).filter(x=4.0)["value"]
    assert scored(*COLLAPSE[1:], measures=["spatial_emergence"])["value"].to_list() == pytest.approx(with_one.to_list())
    reason = missing(*COLLAPSE[1:], measures=["spatial_emergence"], forms=["interactive"])
    assert reason == "there is no reference run of one robot, the smallest swarm has 2"


def test_distances_are_those_of_the_runs_with_the_same_seed():
    found = scored(*throttled(), measures=["reactivity", "adaptability"])
    np.testing.assert_allclose(found["value"][:3], metrics.reactivity(IDEAL, SLOWED, SIGNAL, 0.1))
    np.testing.assert_allclose(found["value"][3:], metrics.adaptability(IDEAL, SLOWED))
    np.testing.assert_allclose(found["floor"], metrics.noise_floor(IDEAL).mean())
    assert found.row(0, named=True) | {"at": "throttle 0.3", "x": 0.3, "unit": "objects (DTW)"} == found.row(
        0, named=True
    )
    assert found["distance"].to_list() == pytest.approx([1.0] * 6)
    noisy = [{**row, "criterion": "noise"} for part in throttled() for row in part]
    np.testing.assert_allclose(
        scored(noisy, measures=["noise_robustness"])["value"], metrics.noise_robustness(IDEAL, SLOWED)
    )


def handled(ideal_ticks, ticks, observed, **columns):
    """Runs under a handling cost of so many ticks; the ideal swarm delivers 4 objects in each of four intervals."""
    ideal_columns = {name: values[0] for name, values in columns.items()}
    level_columns = {name: values[1] for name, values in columns.items()}
    common = {"criterion": "handling_cost", "t_end_s": CLOCK}
    return (
        rows(3, [[4.0] * 4], criterion_value=0.0, adversity=ideal_ticks, **ideal_columns, **common),
        rows(3, [observed], criterion_value=25.0, adversity=ticks, **level_columns, **common),
    )


def test_under_a_handling_cost_twice_the_ticks_halve_what_a_reactive_swarm_does():
    # Handling takes 1, 2, 2, 1 ticks. Perfectly reactive: 4, 2, 2, 4. Perfectly adaptable: 4, 4, 4, 4. Observed: 4, 3,
    # 3, 4, so both distances are 1 + 1.
    found = scored(*handled(1.0, [1.0, 2.0, 2.0, 1.0], [4.0, 3.0, 3.0, 4.0]), measures=["reactivity", "adaptability"])
    assert found["value"].to_list() == [2.0, 2.0]
    assert found.row(0, named=True)["at"] == "handling cost 25"
    assert found["distance"].to_list() == [2.0, 2.0]


def test_a_handling_cost_is_sampled_as_a_throttle_is():
    # Means 1, 2, 2, 1 and values at the end 1, 4, 1, 1 ticks: 3 from the ideal one. As printed c_t = V / I_ec = 1, 4,
    # 1, 1 and the perfect swarm does 4, 16, 4, 4; 4 objects in each interval are 12 away. Corrected 4, 2, 2, 4: 2 + 2.
    runs = handled(1.0, [1.0, 2.0, 2.0, 1.0], [4.0] * 4, handling_cost=(1.0, [1.0, 4.0, 1.0, 1.0]))
    found = scored(*runs, measures=["reactivity"], variants=["corrected", "paper"])
    assert found["value"].to_list() == [4.0, 12.0]
    assert found["distance"].to_list() == [3.0, 3.0]


def test_reactivity_follows_the_mean_conditions_and_the_printed_form_the_sampled_ones():
    common = {"criterion": "throttle", "t_end_s": CLOCK}
    sampled = [0.1, 0.6, 0.6, 0.1]
    parts = (
        rows(9, IDEAL, criterion_value=0.0, adversity=0.1, throttle=0.1, **common),
        rows(9, SLOWED, criterion_value=0.3, adversity=SIGNAL, throttle=sampled, **common),
    )
    found = scored(*parts, measures=["reactivity"], variants=["corrected", "paper"])["value"]
    np.testing.assert_allclose(found[:3], metrics.reactivity(IDEAL, SLOWED, SIGNAL, 0.1))
    np.testing.assert_allclose(found[3:], metrics.reactivity(IDEAL, SLOWED, sampled, 0.1, model="paper"))


def failing():
    """The undisturbed swarm of 9, and two levels of repairs at once and twice the rate."""
    common = {"criterion": "population_dynamics", "t_end_s": CLOCK}
    return (
        rows(9, IDEAL, criterion="none", criterion_value=0.0, t_end_s=CLOCK, n_active=9.0),
        rows(9, SLOWED, criterion_value=1.0, malfunctions_per_s=0.02, repairs_per_s=0.03, n_active=6.0, **common),
        rows(9, SLOWED, criterion_value=2.0, malfunctions_per_s=0.04, repairs_per_s=0.06, n_active=4.5, **common),
    )


@pytest.mark.parametrize(("variant", "weight"), [("corrected", "transient"), ("paper", "paper")])
def test_population_robustness_uses_the_rates_of_the_level(variant, weight):
    found = scored(*failing(), measures=["population_robustness"], variants=[variant])["value"]
    for part, rate in ((found[:3], 0.02), (found[3:], 0.04)):
        rates = PopulationRates(lambda_bd=rate, mu_bd=1.5 * rate)
        expected = metrics.population_robustness(SLOWED, IDEAL, rates, horizon=400.0, n=9, weight=weight)
        np.testing.assert_allclose(part, expected)


def test_a_reference_whose_robots_fail_as_well_has_its_own_rates():
    levels = [
        rows(9, runs, criterion="population_dynamics", criterion_value=x, t_end_s=CLOCK, deaths_per_s=rate)
        for x, runs, rate in ((0.0, IDEAL, 0.01), (1.0, SLOWED, 0.02))
    ]
    often, rarely = PopulationRates(lambda_d=0.02), PopulationRates(lambda_d=0.01)
    expected = metrics.population_robustness(SLOWED, IDEAL, often, horizon=400.0, n=9, ideal_rates=rarely)
    np.testing.assert_allclose(scored(*levels, measures=["population_robustness"])["value"], expected)


def test_population_is_weighted_with_the_robots_recorded_at_work():
    found = scored(*failing(), measures=["recorded_population_robustness"]).filter(x=1.0)
    expected = np.sum(SLOWED, axis=1) - 6.0 / 9.0 * np.sum(IDEAL, axis=1)
    np.testing.assert_allclose(found["value"], expected, atol=1e-12)
    assert found["unit"][0] == "objects in 400 s"


def test_availability_is_told_once_per_ratio_of_rates():
    levels = [
        rows(9, IDEAL, criterion="population_dynamics", criterion_value=x, deaths_per_s=rate, **birth)
        for x, rate, birth in ((1, 0.1, {}), (2, 0.2, {}), (3, 0.1, {"births_per_s": 0.2}))
    ]
    found = scored(rows(9, IDEAL, criterion="none", criterion_value=0.0), *levels, measures=["availability"])
    assert found["value"].to_list() == [0.0, pytest.approx(metrics.availability(9, 1, 0.5))]
    assert found["x"].to_list() == [math.inf, 0.5]
    assert found["seed"].null_count() == 2, "it follows from rates, not from runs"


def changed(rows, **columns):
    return [{**row, **columns} for row in rows]


IDEAL_SWARM, LEVEL, _ = failing()
UNRATED = {"malfunctions_per_s": None, "repairs_per_s": None}
LACKING = [
    ((rows(2, IDEAL),), "scalability", "there is one swarm size only, N = 2"),
    (COLLAPSE[1:], "performance_lost", "no reference run of one robot, the smallest swarm has 2"),
    ((rows(2, IDEAL),), "adaptability", "no runs with criterion throttle or handling_cost and a value other than 0"),
    (handled(1.0, [1.0, 0.0, 2.0, 2.0], [4.0] * 4), "reactivity", "the ticks that handling takes, and 0 or less"),
    ((changed(throttled()[0], adversity=0.0), throttled()[1]), "reactivity, paper", "divides by the ideal conditions"),
    ((IDEAL_SWARM, changed(LEVEL, n_active=None)), "recorded_population_robustness", "no column n_active"),
    ((IDEAL_SWARM, changed(LEVEL, repairs_per_s=0.01)), "population_robustness, paper", "more returns than departures"),
    ((IDEAL_SWARM, changed(LEVEL, **UNRATED)), "population_robustness", "there are no rates"),
]


@pytest.mark.parametrize(("parts", "label", "words"), LACKING)
def test_what_is_lacking_is_told(parts, label, words):
    measure, _, variant = label.partition(", ")
    assert words in missing(*parts, measures=[measure], variants=[variant or "corrected"])
