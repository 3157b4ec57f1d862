"""Scores in every variant and form, by hand, and the conditions that distances are told with."""

from dataclasses import replace

import numpy as np
import pytest

import metrics
from metrics import CurveError, PopulationRates, ScoreForms
from metrics.scoring.curves_file import study_curves
from metrics.scoring.measures import score_study
from metrics.scoring.run_curves import RunCurves
from metrics.scoring.score_tables import ScoreTable
from metrics.scoring.scores import HEADER, pseudo_values
from tests.support.curve_tables import CLOCK, IDEAL, SIGNAL, SLOWED, rows, scored, table, throttled

SIZES = (
    rows(1, [[1.0, 2.0], [2.0, 1.0]], interference_fraction=0.1, t_end_s=[10.0, 20.0]),
    rows(2, [[3.0, 5.0], [2.0, 6.0]], interference_fraction=0.2, t_end_s=[10.0, 20.0]),
)
ONE, TWO = np.array([[1.0, 2.0], [2.0, 1.0]]), np.array([[3.0, 5.0], [2.0, 6.0]])
F1, F2 = np.full((2, 2), 0.1), np.full((2, 2), 0.2)
BY_HAND = {
    "t_lost_fraction": lambda: [0.2, 0.2],
    "spatial_emergence, paper": lambda: metrics.spatial_emergence(ONE, F1, 1, TWO, F2, 2, ONE, F1, variant="paper"),
    "scalability, paper": lambda: [2 * (1 - 3.0) + 2 * (1 - 2.5), 2 * (1 - 1.0) + 2 * (1 - 6.0)],
}


@pytest.mark.parametrize("label", BY_HAND)
def test_variants_of_measures_of_size_by_hand(label):
    measure, _, variant = label.partition(", ")
    found = scored(*SIZES, measures=[measure], variants=(variant or "paper",))
    assert found[-1].label == label
    np.testing.assert_allclose(list(found[-1].per_seed.values()), BY_HAND[label]())
    assert ("reverses the order" in found[-1].note) == (measure == "scalability")


def test_pseudo_values_by_hand():
    curves = {"performance": np.array([[1.0], [3.0]])}
    runs = RunCurves(criterion="noise", value=1.0, n_robots=1, seeds=(0, 1), curves=curves)
    # The square of the mean is 4, without the first run 9, without the second 1, 5 on average.
    squares, shares = pseudo_values(lambda it: it.performance[..., 0] ** 2, (runs,), 0)
    assert squares.tolist() == [4.0 + (5.0 - 9.0), 4.0 + (5.0 - 1.0)]
    assert shares.tolist() == [1.0, 3.0], "of what is a mean, the values of the runs"
    (infinite,) = pseudo_values(lambda it: it.performance[..., 0] + np.inf, (runs,), None)
    assert np.isnan(infinite).all(), "and there is no warning"


def test_a_measure_without_the_asked_forms_is_scored_once():
    found = scored(*SIZES, measures=["time_emergence"], variants=("paper", "corrected"))
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


def test_the_printed_reactivity_does_not_exist_under_perfect_conditions():
    common = {"criterion": "throttle", "t_end_s": CLOCK}
    parts = (
        rows(9, IDEAL, criterion_value=0.0, adversity=0.0, **common),
        rows(9, SLOWED, criterion_value=0.3, adversity=SIGNAL, **common),
    )
    (study,) = study_curves(table(*parts))
    found, missing = score_study(study, ["reactivity"], ScoreForms(variants=("paper",)))
    assert found == ()
    assert missing == {"reactivity, paper": "the printed form divides by the ideal conditions, which are 0 here"}


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
    first, second = scored(*failing(), measures=["population_robustness"], variants=("paper",))
    rates = PopulationRates(lambda_bd=0.02, mu_bd=0.03)
    expected = metrics.population_robustness(SLOWED, IDEAL, rates, horizon=400.0, weight="paper")
    np.testing.assert_allclose(list(first.per_seed.values()), expected)
    assert second.beside["weight"] == pytest.approx((400 - (1 / 0.02 + 1 / 0.06)) / 400)


def test_forms_of_population_robustness_that_do_not_exist_say_why():
    reference, level, _ = failing()
    (study,) = study_curves(table(reference, [{**row, "repairs_per_s": 0.01} for row in level]))
    found, missing = score_study(study, ["population_robustness"], ScoreForms(variants=("paper",)))
    assert found == ()
    assert "more returns than departures" in missing["population_robustness, paper"]


def test_bands_are_shown_on_request_and_always_in_json():
    (score,) = scored(rows(3, IDEAL), measures=["raw_performance"])
    mean, std = 62 / 3, np.std([21.0, 21.0, 20.0], ddof=1)
    assert score.band == pytest.approx((mean - 2 * std, mean + 2 * std))
    assert score.to_mapping()["two_sd"] == pytest.approx(score.band)
    result = ScoreTable(policy="mine", scenario="", scores=(score,))
    assert "19.51 to 21.82" in str(replace(result, band=True))
    assert "mean ± 2 sd" in str(replace(result, band=True))
    assert "mean ± 2 sd" not in str(result)
