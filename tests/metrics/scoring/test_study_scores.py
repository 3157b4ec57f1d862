"""From curves to scores: which experiments are compared, which further numbers and notes a score has."""

import math

import numpy as np
import pytest

import metrics
from metrics import METRICS, CurveError, PopulationRates, ScoreForms
from metrics.scoring.curves_table import study_curves
from metrics.scoring.measures import MEASURE_CRITERIA, check_measures, criteria_of
from metrics.scoring.studies import RunCurves, StudyCurves
from metrics.scoring.study_scores import score_study
from metrics.scoring.table import HEADER, ScoreTable
from tests.support.curve_tables import CROWDING, rows, table

IDEAL = [[4.0, 6.0, 5.0, 6.0], [5.0, 5.0, 7.0, 4.0], [6.0, 4.0, 5.0, 5.0]]
SLOWED = [[4.0, 5.0, 2.0, 3.0], [5.0, 5.0, 3.0, 2.0], [5.0, 4.0, 2.0, 3.0]]
CLOCK = [100.0, 200.0, 300.0, 400.0]
SIGNAL = [0.1, 0.1, 0.6, 0.6]


def scored(*parts, measures=None, **forms):
    (study,) = study_curves(table(*parts))
    return score_study(study, measures, ScoreForms(**forms))[0]


def throttled(ideal=IDEAL, slowed=SLOWED):
    common = {"criterion": "throttle", "t_end_s": CLOCK}
    return (
        rows(9, ideal, criterion_value=0.0, adversity=0.1, **common),
        rows(9, slowed, criterion_value=0.3, adversity=SIGNAL, **common),
    )


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


@pytest.mark.parametrize("lowest", [0.0, 1.0])
def test_under_a_handling_cost_twice_the_ticks_halve_what_a_reactive_swarm_does(lowest):
    # Handling takes 1, 2, 2, 1 ticks. Perfectly reactive: 4, 2, 2, 4. Perfectly adaptable: 4, 4, 4, 4. Observed: 4, 3,
    # 3, 4, so both distances are 1 + 1. A waveform below 1 stands for one tick, too.
    reactivity, adaptability = scored(
        rows(3, [[4.0] * 4], criterion="handling_cost", criterion_value=0.0, adversity=lowest),
        rows(
            3,
            [[4.0, 3.0, 3.0, 4.0]],
            criterion="handling_cost",
            criterion_value=25.0,
            adversity=[lowest, 2.0, 2.0, lowest],
        ),
        measures=["reactivity", "adaptability"],
    )
    assert (reactivity.summary.mean, adaptability.summary.mean) == (2.0, 2.0)
    assert (reactivity.at, reactivity.criterion) == ("handling cost 25", "handling_cost")
    assert reactivity.beside["environment_distance"] == 2.0


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
    found = scored(*throttled(idle, idle), *sizes)
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


def test_the_programs_form_takes_the_first_size_for_one_robot():
    (score,) = scored(*COLLAPSE[1:], measures=["spatial_emergence"], variants=("sierra",), forms=("interactive",))
    few, many = ([8.0], [0.2]), ([1.6], [0.6])
    expected = metrics.spatial_emergence(*few, 2, *many, 4, *few, variant="sierra", n_reference=2)
    assert score.summary.mean == pytest.approx(float(expected))
    assert (score.label, score.unit) == ("spatial_emergence, interactive, sierra", "share of performance")


SIZES = (
    rows(1, [[1.0, 2.0], [2.0, 1.0]], interference_fraction=0.1, t_end_s=[10.0, 20.0]),
    rows(2, [[3.0, 5.0], [2.0, 6.0]], interference_fraction=0.2, t_end_s=[10.0, 20.0]),
)
ONE, TWO = np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([[3.0, 5.0], [2.0, 6.0]])
F1, F2 = np.full((2, 2), 0.1), np.full((2, 2), 0.2)
BY_HAND = {
    "raw_performance, sierra": lambda: [5.0, 6.0],
    "efficiency, sierra": lambda: [2.5, 3.0],
    "t_lost_fraction": lambda: [0.2, 0.2],
    "performance_lost, sierra": lambda: [5.0 * 0.2 - 2.0 * 0.1, 6.0 * 0.2 - 1.0 * 0.1],
    "spatial_emergence, paper": lambda: metrics.spatial_emergence(ONE, F1, 1, TWO, F2, 2, ONE, F1, variant="paper"),
    "spatial_emergence, sierra": lambda: metrics.spatial_emergence(ONE, F1, 1, TWO, F2, 2, ONE, F1, variant="sierra"),
    "task_emergence, sierra": lambda: [5.0 - 2 * 2.0, 6.0 - 2 * 1.0],
    "scalability, paper": lambda: [2 * (1 - 3.0) + 2 * (1 - 2.5), 2 * (1 - 1.0) + 2 * (1 - 6.0)],
    "scalability, sierra": lambda: [2 * (1 - 2.5), 2 * (1 - 6.0)],
}


@pytest.mark.parametrize("label", BY_HAND)
def test_variants_of_measures_of_size_by_hand(label):
    measure, _, variant = label.partition(", ")
    found = scored(*SIZES, measures=[measure], variants=(variant or "paper",))
    assert found[-1].label == label
    np.testing.assert_allclose(list(found[-1].per_seed.values()), BY_HAND[label]())
    assert ("reverses the order" in found[-1].note) == (measure == "scalability")
    assert variant != "sierra" or found[-1].relative is None


def test_a_measure_without_the_asked_forms_is_scored_once():
    found = scored(*SIZES, measures=["time_emergence"], variants=("paper", "corrected", "sierra"))
    assert [score.label for score in found] == ["time_emergence"]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"variants": ("papr",)}, "Unknown variant 'papr'. Did you mean 'paper'"),
        ({"variants": ()}, "one or more variants of paper"),
        ({"forms": ("both",)}, "Unknown form 'both'"),
    ],
)
def test_unknown_variants_and_forms_are_refused(options, message):
    with pytest.raises(CurveError, match=message):
        ScoreForms(**options)


def test_variants_of_distances_by_hand():
    """In the program's form the curves are rates on a clock of 100 s, so nothing is shifted in time."""
    reactivity, printed, programmed, _, adaptability = scored(
        *throttled(), measures=["reactivity", "adaptability"], variants=("corrected", "paper", "sierra")
    )
    assert [s.label for s in (printed, programmed, adaptability)] == [
        "reactivity, paper",
        "reactivity, sierra",
        "adaptability, sierra",
    ]
    paper = metrics.reactivity(IDEAL, SLOWED, SIGNAL, 0.1, model="paper")
    np.testing.assert_allclose(list(printed.per_seed.values()), paper)
    followed = (1 - (np.array(SIGNAL) - 0.1)) * np.array(IDEAL)
    np.testing.assert_allclose(list(programmed.per_seed.values()), metrics.aligned_l1(followed, SLOWED))
    np.testing.assert_allclose(list(adaptability.per_seed.values()), metrics.aligned_l1(IDEAL, SLOWED))
    first, second = np.triu_indices(3, k=1)
    unwarped = metrics.aligned_l1(np.array(IDEAL)[first], np.array(IDEAL)[second])
    assert adaptability.noise_floor == pytest.approx(unwarped.mean())
    assert reactivity.unit == "objects (DTW)"
    assert adaptability.unit == "objects (DTW with clock)"


def test_the_printed_reactivity_does_not_exist_under_perfect_conditions():
    common = {"criterion": "throttle", "t_end_s": CLOCK}
    parts = (
        rows(9, IDEAL, criterion_value=0.0, adversity=0.0, **common),
        rows(9, SLOWED, criterion_value=0.3, adversity=SIGNAL, **common),
    )
    (study,) = study_curves(table(*parts))
    found, missing = score_study(study, ["reactivity"], ScoreForms(variants=("paper", "sierra")))
    assert [score.variant for score in found] == ["sierra"]
    assert missing == {"reactivity, paper": "the printed form divides by the ideal conditions, which are 0 here"}


def test_the_programs_distances_need_a_clock():
    common = {"criterion": "noise"}
    parts = (rows(9, IDEAL, criterion_value=0.0, **common), rows(9, SLOWED, criterion_value=0.3, **common))
    (study,) = study_curves(table(*parts))
    assert (
        "no column t_end_s" in score_study(study, None, ScoreForms(variants=("sierra",)))[1]["noise_robustness, sierra"]
    )


def test_floors_are_told_relative_to_performance():
    (score,) = scored(*throttled(), measures=["adaptability"])
    assert score.relative_floor == pytest.approx(score.noise_floor / np.sum(IDEAL, axis=1).mean())
    floor = dict(zip(HEADER, score.cells(), strict=True))["noise floor"]
    assert floor == f"{score.noise_floor:.4g} ({100 * score.relative_floor:.3g} %)"


WAVES = [
    ("square", 4e-5, [0.15, 0.20, 0.25, 0.30, 0.35, 0.40], [7.4, 9.8, 12.2, 14.6, 17.0, 19.4]),
    ("sine", 2e-5, [0.15, 0.20, 0.25, 0.30, 0.35, 0.40, 0.45], [5.04, 7.18, 9.44, 11.76, 14.13, 16.52, 18.92]),
]


@pytest.mark.parametrize(("kind", "frequency", "amplitudes", "paper"), WAVES, ids=["square", "sine"])
def test_environment_distances_are_those_of_the_papers_figures(kind, frequency, amplitudes, paper):
    """Conditions are sampled at the ends of 50 intervals; their means over intervals would give other distances."""
    ticks = np.arange(1, 50_001)
    parts = [rows(5, [[1.0] * 50], criterion="throttle", criterion_value=0.0, adversity=0.1, throttle=0.1)]
    for a in amplitudes:
        wave = metrics.waveform(kind, ticks, frequency=frequency, amplitude=a, offset=a).reshape(50, 1000)
        means, ends = wave.mean(axis=1).tolist(), wave[:, -1].tolist()
        parts.append(rows(5, [[1.0] * 50], criterion="throttle", criterion_value=a, adversity=means, throttle=ends))
    found = scored(*parts, measures=["reactivity"])
    np.testing.assert_allclose([s.beside["environment_distance"] for s in found], paper, atol=0.005)


def test_reactivity_follows_the_mean_conditions_and_the_other_forms_the_sampled_ones():
    common = {"criterion": "throttle", "t_end_s": CLOCK}
    sampled = [0.1, 0.6, 0.6, 0.1]
    parts = (
        rows(9, IDEAL, criterion_value=0.0, adversity=0.1, throttle=0.1, **common),
        rows(9, SLOWED, criterion_value=0.3, adversity=SIGNAL, throttle=sampled, **common),
    )
    mean, printed = scored(*parts, measures=["reactivity"], variants=("corrected", "paper"))
    np.testing.assert_allclose(list(mean.per_seed.values()), metrics.reactivity(IDEAL, SLOWED, SIGNAL, 0.1))
    expected = metrics.reactivity(IDEAL, SLOWED, sampled, 0.1, model="paper")
    np.testing.assert_allclose(list(printed.per_seed.values()), expected)


def failing():
    """The undisturbed swarm of 9, and two levels of repairs at once and twice the rate."""
    common = {"criterion": "population_dynamics", "t_end_s": CLOCK}
    return (
        rows(9, IDEAL, criterion="none", criterion_value=0.0, t_end_s=CLOCK, n_active=9.0),
        rows(9, SLOWED, criterion_value=1.0, malfunctions_per_s=0.02, repairs_per_s=0.03, n_active=6.0, **common),
        rows(9, SLOWED, criterion_value=2.0, malfunctions_per_s=0.04, repairs_per_s=0.06, n_active=4.5, **common),
    )


def test_population_is_weighted_with_the_robots_recorded_at_work():
    found = scored(*failing(), measures=["recorded_population_robustness"])
    expected = np.sum(SLOWED, axis=1) - 6.0 / 9.0 * np.sum(IDEAL, axis=1)
    np.testing.assert_allclose(list(found[0].per_seed.values()), expected, atol=1e-12)
    assert [score.beside["weight"] for score in found] == pytest.approx([6 / 9, 0.5])
    assert (found[0].unit, found[0].relative is None) == ("objects in 400 s", False)


def test_recorded_robots_have_to_be_there():
    ideal, level, _ = failing()
    (study,) = study_curves(table(ideal, [{**row, "n_active": None} for row in level]))
    _, missing = score_study(study, ["recorded_population_robustness"])
    assert "no column n_active" in missing["recorded_population_robustness"]
    (study,) = study_curves(table([{**row, "n_active": 0.0} for row in ideal], level))
    _, missing = score_study(study, ["recorded_population_robustness"])
    assert "no robot of the reference run" in missing["recorded_population_robustness"]


def test_variants_of_population_robustness_by_hand():
    first, second, programmed = scored(*failing(), measures=["population_robustness"], variants=("paper", "sierra"))
    rates = PopulationRates(lambda_bd=0.02, mu_bd=0.03)
    expected = metrics.population_robustness(SLOWED, IDEAL, rates, horizon=400.0, weight="paper")
    np.testing.assert_allclose(list(first.per_seed.values()), expected)
    assert second.beside["weight"] == pytest.approx((400 - (1 / 0.02 + 1 / 0.06)) / 400)
    assert programmed.at == "population 2"  # against the lowest rate, whose time away is twice as long
    assert programmed.beside["weight"] == pytest.approx(2.0)
    last = np.array(SLOWED)[:, -1]
    np.testing.assert_allclose(list(programmed.per_seed.values()), last - 2.0 * last)
    assert (programmed.unit, programmed.relative) == ("objects in the last interval", None)


def test_forms_of_population_robustness_that_do_not_exist_say_why():
    reference, level, _ = failing()
    (study,) = study_curves(table(reference, [{**row, "repairs_per_s": 0.01} for row in level]))
    found, missing = score_study(study, ["population_robustness"], ScoreForms(variants=("paper", "sierra")))
    assert found == ()
    assert "more returns than departures" in missing["population_robustness, paper"]
    assert "one level of population dynamics only" in missing["population_robustness, sierra"]


def test_bands_are_shown_on_request_and_always_in_json():
    (score,) = scored(rows(3, IDEAL), measures=["raw_performance"])
    mean, std = 62 / 3, np.std([21.0, 21.0, 20.0], ddof=1)
    assert score.band == pytest.approx((mean - 2 * std, mean + 2 * std))
    assert score.to_mapping()["two_sd"] == pytest.approx(score.band)
    result = ScoreTable(policy="mine", scenario="", scores=(score,))
    assert "19.51 to 21.82" in result.text(band=True)
    assert "mean ± 2 sd" in result.text(band=True)
    assert "mean ± 2 sd" not in str(result)
