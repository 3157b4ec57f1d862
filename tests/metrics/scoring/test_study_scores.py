"""From curves to scores: which experiments are compared, which further numbers and notes a score has."""

import math

import numpy as np
import pytest

import metrics
from metrics import METRICS, CurveError, PopulationRates, ScoreForms
from metrics.scoring.curves_file import study_curves
from metrics.scoring.measures import score_study
from metrics.scoring.run_curves import RunCurves, StudyCurves
from metrics.scoring.score_tables import ScoreTable
from metrics.scoring.scores import HEADER, MEASURE_CRITERIA, check_measures, criteria_of
from tests.support.curve_tables import CLOCK, CROWDING, IDEAL, SIGNAL, SLOWED, rows, scored, table, throttled


def test_measures_of_the_table_are_those_of_the_catalog():
    assert set(MEASURE_CRITERIA) == set(METRICS)
    assert check_measures(["scalability", "efficiency", "scalability"]) == ("efficiency", "scalability")


@pytest.mark.parametrize(("names", "message"), [(["scalabilty"], "Did you mean 'scalability'"), ([], "got none")])
def test_unknown_measures_are_refused(names, message):
    with pytest.raises(CurveError, match=message):
        check_measures(names)


def test_one_value_per_run_and_students_interval_over_them():
    (score,) = scored(rows(3, IDEAL), measures=["raw_performance"])
    assert score.per_seed == {0: 21.0, 1: 21.0, 2: 20.0}
    assert score.summary == metrics.aggregate([21.0, 21.0, 20.0])
    assert (score.unit, score.relative) == ("objects per run", None)


def test_the_unit_names_the_length_of_a_run_where_it_is_known():
    (score,) = scored(rows(3, IDEAL, t_end_s=CLOCK), measures=["efficiency"])
    assert score.unit == "objects per robot in 400 s"


def test_sizes_are_compared_with_the_next_smaller_one():
    found = scored(rows(1, IDEAL), rows(2, IDEAL), rows(8, IDEAL), measures=["task_emergence", "scalability"])
    assert [(score.measure, score.at, score.x, score.n_robots) for score in found] == [
        ("task_emergence", "N = 1 to 2", 2, (1, 2)),
        ("task_emergence", "N = 2 to 8", 8, (2, 8)),
        ("scalability", "N = 1 to 2", 2, (1, 2)),
        ("scalability", "N = 2 to 8", 8, (2, 8)),
    ]


def test_spatial_emergence_takes_three_swarms():
    (study,) = study_curves(CROWDING)
    found, _ = score_study(study, ["spatial_emergence"])
    assert [score.n_robots for score in found] == [(1, 2), (1, 2, 4)]


def test_distances_are_those_of_the_runs_with_the_same_seed():
    reactivity, adaptability = scored(*throttled(), measures=["reactivity", "adaptability"])
    np.testing.assert_allclose(list(reactivity.per_seed.values()), metrics.reactivity(IDEAL, SLOWED, SIGNAL, 0.1))
    np.testing.assert_allclose(list(adaptability.per_seed.values()), metrics.adaptability(IDEAL, SLOWED))
    assert (reactivity.at, reactivity.x, reactivity.unit) == ("throttle 0.3", 0.3, "objects (DTW)")


def test_distances_come_with_noise_floor_mean_curves_and_what_they_do_not_tell():
    reactivity, _ = scored(*throttled(), measures=["reactivity", "adaptability"])
    assert reactivity.noise_floor == pytest.approx(metrics.noise_floor(IDEAL).mean())
    by_hand = metrics.bootstrap_measure(
        lambda ideal, slowed: metrics.reactivity(ideal, slowed, SIGNAL, 0.1), IDEAL, SLOWED, order="mean_curve", seed=1
    )
    assert reactivity.of_mean_curves.mean == pytest.approx(by_hand.mean)
    assert reactivity.of_mean_curves.upper == pytest.approx(by_hand.upper)
    assert reactivity.beside["environment_distance"] == pytest.approx(1.0)
    assert reactivity.beside["signed_difference"] == pytest.approx((np.sum(SLOWED) - np.sum(IDEAL)) / 12)


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
    runs = handled(1.0, [1.0, 2.0, 2.0, 1.0], [4.0, 3.0, 3.0, 4.0])
    reactivity, adaptability = scored(*runs, measures=["reactivity", "adaptability"])
    assert (reactivity.summary.mean, adaptability.summary.mean) == (2.0, 2.0)
    assert (reactivity.at, reactivity.criterion) == ("handling cost 25", "handling_cost")
    assert reactivity.beside["environment_distance"] == 2.0


def test_a_handling_cost_is_sampled_as_a_throttle_is():
    # Means 1, 2, 2, 1 and values at the end 1, 4, 1, 1 ticks: 3 from the ideal one. As printed c_t = V / I_ec = 1, 4,
    # 1, 1 and the perfect swarm does 4, 16, 4, 4; 4 objects in each interval are 12 away. Corrected 4, 2, 2, 4: 2 + 2.
    runs = handled(1.0, [1.0, 2.0, 2.0, 1.0], [4.0] * 4, handling_cost=(1.0, [1.0, 4.0, 1.0, 1.0]))
    corrected, printed = scored(*runs, measures=["reactivity"], variants=("corrected", "paper"))
    assert (corrected.summary.mean, printed.summary.mean) == (4.0, 12.0)
    assert corrected.beside["environment_distance"] == 3.0


@pytest.mark.parametrize(("ideal", "ticks"), [(0.0, 2.0), (1.0, [1.0, 0.0, 2.0, 2.0])])
def test_handling_that_takes_no_tick_has_no_reactivity(ideal, ticks):
    (study,) = study_curves(table(*handled(ideal, ticks, [4.0] * 4)))
    _, missing = score_study(study, ["reactivity"])
    assert "the ticks that handling takes, and 0 or less here" in missing["reactivity"]


def test_another_disturbance_than_the_two_is_refused():
    assert criteria_of(["reactivity", "noise_robustness"], "handling_cost") == {"handling_cost", "noise"}
    with pytest.raises(CurveError, match="disturbance to be one of throttle, handling_cost, got 'noise'"):
        criteria_of(["reactivity"], "noise")


def test_one_reference_run_has_no_noise_floor():
    (score,) = scored(*throttled(IDEAL[:1], SLOWED[:1]), measures=["adaptability"])
    assert score.noise_floor is None
    assert math.isnan(score.summary.lower)


def test_values_are_told_relative_to_the_performance_they_compare_with():
    (score,) = scored(*throttled(), measures=["adaptability"])
    expected = metrics.adaptability(IDEAL, SLOWED) / np.sum(IDEAL, axis=1)
    np.testing.assert_allclose(list(score.relative_per_seed.values()), expected)
    assert score.relative.mean == pytest.approx(expected.mean())


def test_gains_are_relative_to_the_performance_of_the_larger_swarm():
    (score,) = scored(rows(2, SLOWED), rows(4, IDEAL), measures=["task_emergence"])
    expected = metrics.task_emergence(SLOWED, 2, IDEAL, 4, relative=True)
    np.testing.assert_allclose(list(score.relative_per_seed.values()), expected)


def test_interference_is_averaged_over_the_run():
    (score,) = scored(rows(2, [[1.0, 1.0]], interference_fraction=[0.1, 0.4]), measures=["t_lost_fraction"])
    assert score.summary.mean == pytest.approx(0.25)


def test_doing_nothing_is_noted_and_not_praised():
    (score,) = scored(*throttled([[0.0] * 4] * 2, [[0.0] * 4] * 2), measures=["adaptability"])
    assert score.summary.mean == 0.0
    assert math.isnan(score.relative.mean)
    assert "says nothing in 2 of 2 runs" in score.note


def test_a_note_of_many_rows_is_told_once():
    idle = [[0.0] * 4] * 2
    sizes = [rows(n, idle, criterion="population_size", criterion_value=n, t_end_s=CLOCK) for n in (2, 4, 9)]
    found = scored(
        *throttled(idle, idle), *sizes, measures=["task_emergence", "scalability", "reactivity", "adaptability"]
    )
    notes = ScoreTable(policy="mine", scenario="", scores=found).notes()
    assert [note.split(": ", 1)[0] for note in notes] == [
        "task_emergence, N = 2 to 4, N = 4 to 9; reactivity, throttle 0.3; adaptability, throttle 0.3",
        "scalability, N = 2 to 4, N = 4 to 9",
    ]


def test_undefined_and_infinite_scalability_is_noted():
    found = scored(rows(2, [[0.0], [1.0], [2.0]]), rows(4, [[0.0], [0.0], [3.0]]), measures=["scalability"])
    assert "undefined in 1 of 3 runs" in found[0].note
    assert "infinite in 1 of 3 runs" in found[0].note
    assert (found[0].summary.n_used, found[0].summary.n_nan) == (2, 1)


def test_population_measures_use_the_rates_of_the_level():
    rates = PopulationRates(lambda_bd=0.02, mu_bd=0.021)
    found = scored(
        rows(9, IDEAL, criterion="none", criterion_value=0.0, t_end_s=CLOCK),
        rows(
            9,
            SLOWED,
            criterion="population_dynamics",
            criterion_value=2.0,
            t_end_s=CLOCK,
            malfunctions_per_s=0.02,
            repairs_per_s=0.021,
        ),
        measures=["population_robustness", "availability"],
    )
    expected = metrics.population_robustness(SLOWED, IDEAL, rates, horizon=400.0, n=9)
    np.testing.assert_allclose(list(found[0].per_seed.values()), expected)
    assert found[0].beside["weight"] == pytest.approx(metrics.population_weight(rates, horizon=400.0, n=9))
    assert found[1].summary.mean == pytest.approx(metrics.availability(9, 1, 0.02 / 0.021), abs=1e-5)
    assert "the same for every policy" in found[1].note


def test_a_reference_whose_robots_fail_as_well_has_its_own_rates():
    levels = [
        rows(9, runs, criterion="population_dynamics", criterion_value=x, t_end_s=CLOCK, deaths_per_s=rate)
        for x, runs, rate in ((0.0, IDEAL, 0.01), (1.0, SLOWED, 0.02))
    ]
    (score,) = scored(*levels, measures=["population_robustness"])
    often, rarely = PopulationRates(lambda_d=0.02), PopulationRates(lambda_d=0.01)
    expected = metrics.population_robustness(SLOWED, IDEAL, often, horizon=400.0, n=9, ideal_rates=rarely)
    np.testing.assert_allclose(list(score.per_seed.values()), expected)
    weight = metrics.population_weight(often, horizon=400.0, n=9, ideal_rates=rarely)
    assert score.beside["weight"] == pytest.approx(weight)


def test_what_follows_from_rates_alone_has_no_number_of_runs():
    reference = rows(9, IDEAL, criterion="none", criterion_value=0.0)
    level = rows(9, IDEAL, criterion="population_dynamics", criterion_value=1.0, deaths_per_s=0.1)
    (score,) = scored(reference, level, measures=["availability"])
    assert dict(zip(HEADER, score.cells(), strict=True))["runs"] == "-"


def test_availability_is_told_once_per_ratio_of_rates():
    levels = [
        rows(9, IDEAL, criterion="population_dynamics", criterion_value=x, deaths_per_s=rate, **birth)
        for x, rate, birth in ((1, 0.1, {}), (2, 0.2, {}), (3, 0.1, {"births_per_s": 0.2}))
    ]
    reference = rows(9, IDEAL, criterion="none", criterion_value=0.0)
    found = scored(reference, *levels, measures=["availability"])
    assert [score.summary.mean for score in found] == [0.0, pytest.approx(metrics.availability(9, 1, 0.5))]


def lossy(n_planned: int | None, seeds: tuple[int, ...]) -> StudyCurves:
    """A study of two sizes, of which the larger has lost runs."""
    whole = RunCurves(
        criterion="population_size",
        value=1.0,
        n_robots=1,
        seeds=(0, 1, 2),
        curves={"performance": np.ones((3, 2))},
        n_planned=n_planned,
    )
    curves = {"performance": np.ones((len(seeds), 2))} if seeds else {}
    larger = RunCurves(
        criterion="population_size", value=4.0, n_robots=4, seeds=seeds, curves=curves, n_planned=n_planned
    )
    return StudyCurves(controller="mine", experiments=(whole, larger), t_end_s=np.array([1.0, 2.0]))


def test_lost_runs_are_counted_and_noted():
    (score,), _ = score_study(lossy(3, (0, 2)), ["task_emergence"])
    assert tuple(score.per_seed) == (0, 2)
    assert (score.n_lost, score.is_partial) == (1, True)
    assert score.note.startswith("1 of 3 runs failed")
    assert dict(zip(HEADER, score.cells(), strict=True))["runs"] == "2 of 3"


def test_runs_without_a_partner_are_counted_where_nobody_planned_them():
    (score,), _ = score_study(lossy(None, (0, 2)), ["task_emergence"])
    assert (score.n_lost, score.note.split(" runs")[0]) == (1, "1 of 3")


def test_an_experiment_without_a_run_keeps_its_row():
    found, missing = score_study(lossy(3, ()), ["raw_performance", "scalability"])
    assert missing == {}
    assert [math.isnan(score.summary.mean) for score in found] == [False, True, True]
    assert [score.note for score in found[1:]] == ["3 of 3 runs failed or have no partner of the same seed"] * 2


def test_tables_turn_into_frames_and_plain_values():
    found = scored(*throttled())
    result = ScoreTable(policy="mine", scenario="here", scores=found, missing={"efficiency": "no sizes"})
    frame = result.to_frame()
    assert frame["measure"].to_list() == [score.measure for score in found]
    assert frame["relative"][0] == pytest.approx(found[0].relative.mean)
    assert frame.columns[:2] == ["policy", "scenario"]
    plain = result.to_mapping()
    assert plain["scores"][0]["per_seed"]["0"] == found[0].per_seed[0]
    assert plain["missing"] == {"efficiency": "no sizes"}
    assert "efficiency is not computed: no sizes" in str(result)
    with pytest.raises(KeyError, match="no sizes"):
        result["efficiency"]
    with pytest.raises(KeyError, match="not asked for"):
        result["scalability"]


COLLAPSE = (
    rows(1, [[5.0], [5.0]], interference_fraction=0.0),
    rows(2, [[8.0], [8.0]], interference_fraction=0.2),
    rows(4, [[1.6], [1.6]], interference_fraction=0.6),
)
"""A swarm that delivers a fifth when its size doubles from 2 to 4; its scores by hand are in test_emergence.py."""


def test_where_performance_falls_spatial_emergence_is_marked_and_noted():
    steady, falling = scored(*COLLAPSE, measures=["spatial_emergence"])
    assert falling.summary.mean == pytest.approx(2.24)
    assert (steady.is_doubtful, falling.is_doubtful) == (False, True)
    assert (steady.note, "read time_emergence beside it" in falling.note) == ("", True)
    assert dict(zip(HEADER, falling.cells(), strict=True))["value"] == "2.24 ?"
    assert falling.to_mapping()["doubtful"] is True
    shown = str(ScoreTable(policy="mine", scenario="", scores=(steady, falling)))
    assert "spatial_emergence, N = 2 to 4: performance is lower than that of the next smaller swarm" in shown


def test_robot_time_and_the_parts_of_task_emergence_are_scored_beside_it():
    found = scored(*COLLAPSE, measures=["time_emergence", "task_emergence", "interference_gain", "undisturbed_gain"])
    values = {score.measure: score.summary.mean for score in found if score.x == 4}
    expected = {"time_emergence": -1.6, "task_emergence": -14.4, "interference_gain": -4.8, "undisturbed_gain": -9.6}
    assert values == pytest.approx(expected)
    shares = {score.measure: score.beside["per_robot"] for score in found if score.x == 4 and score.beside}
    assert shares == pytest.approx(
        {"task_emergence": -0.9, "interference_gain": -0.3, "undisturbed_gain": -0.6}  # of 2 * 8 objects
    )
    assert not any(score.is_doubtful for score in found)
    # Over the 1.6 objects of the larger swarm; in brackets over the 16 of four robots as good as each of the two.
    cells = {
        score.measure: dict(zip(HEADER, score.cells(), strict=True))["relative"] for score in found if score.x == 4
    }
    assert cells == {
        "time_emergence": "",
        "task_emergence": "-900 % (-90 % per robot)",
        "interference_gain": "-300 % (-30 % per robot)",
        "undisturbed_gain": "-600 % (-60 % per robot)",
    }


def test_a_swarm_without_performance_has_no_change_per_robot():
    found = scored(rows(2, [[0.0]]), rows(4, [[3.0]]), measures=["task_emergence"])
    assert [score.beside for score in found] == [{}]


def test_the_interactive_form_compares_with_lone_robots():
    measures = ["spatial_emergence", "raw_performance"]
    found = scored(*COLLAPSE, measures=measures, forms=("interactive", "marginal"))
    assert [(score.label, score.at) for score in found] == [
        ("raw_performance", "N = 1"),
        ("raw_performance", "N = 2"),
        ("raw_performance", "N = 4"),
        ("spatial_emergence, interactive", "N = 1 to 2"),
        ("spatial_emergence, interactive", "N = 1 to 4"),
        ("spatial_emergence", "N = 1 to 2"),
        ("spatial_emergence", "N = 2 to 4"),
    ]
    assert found[4].summary.mean == pytest.approx(-1.6 * 0.6)
    assert found[4].is_doubtful  # performance falls from 2 to 4, with whatever it is compared


def test_the_interactive_form_needs_a_run_of_one_robot():
    (study,) = study_curves(table(*COLLAPSE[1:]))
    found, missing = score_study(study, ["task_emergence"], ScoreForms(forms=("marginal", "interactive")))
    assert [score.label for score in found] == ["task_emergence"]
    reason = "there is no reference run of one robot, the smallest swarm has 2"
    assert missing == {"task_emergence, interactive": reason}


def test_the_marginal_form_of_spatial_emergence_needs_no_run_of_one_robot():
    forms = ScoreForms(variants=("corrected", "paper"), forms=("marginal", "interactive"))
    (study,) = study_curves(table(*COLLAPSE[1:]))
    found, missing = score_study(study, ["spatial_emergence"], forms)
    assert [(score.label, score.n_robots) for score in found] == [
        ("spatial_emergence", (2, 4)),
        ("spatial_emergence, paper", (2, 4)),
    ]
    (with_one,) = (score for score in scored(*COLLAPSE, measures=["spatial_emergence"]) if score.x == 4)
    assert found[0].summary.mean == pytest.approx(with_one.summary.mean)
    assert set(missing) == {"spatial_emergence, interactive", "spatial_emergence, interactive, paper"}
