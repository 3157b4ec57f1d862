"""Pairs of policies in a figure."""

import numpy as np
import pytest

from metrics.scoring import study_figures, study_panels
from metrics.scoring.study_numbers import policy_pairs
from metrics.significance import holm, paired_p
from swarm_forage_env.runs.policy_spec import PolicySpec
from swarm_forage_env.studies.study import Axis
from tests.support.made_tables import FOUR, made_study, made_table

HEIGHTS = dict(zip(FOUR, (4.0, 4.0, 6.0, 9.0), strict=True))


def panels(measure, **lost):
    spec = made_study("S1a", Axis(name="population_size", values=(1, 2, 4)))
    table = made_table(spec, lambda place: HEIGHTS[place.policy] * place.values[-1], **lost)
    (figure,) = study_figures(study_panels(table, measures=(measure,)))
    return figure.panels


def test_every_pair_has_a_probability_and_tests():
    rows = policy_pairs(panels("raw_performance")).rows(named=True)
    assert [(row["first"], row["second"]) for row in rows][:2] == [("crw", "dpo"), ("crw", "stochm")]
    same, lower = rows[0], rows[1]
    assert (same["p_better"], same["first_better"], same["second_better"]) == (0.5, 0, 0)
    assert (lower["p_better"], lower["first_better"], lower["second_better"], lower["n_levels"]) == (0.0, 0, 3, 3)


def test_tests_are_corrected_over_all_pairs_and_levels():
    (panel,) = panels("raw_performance")
    pairs = [(a, b) for i, a in enumerate(FOUR) for b in FOUR[i + 1 :]]
    p_values = [paired_p(level) for a, b in pairs for level in panel.scores[a] - panel.scores[b]]
    rows = policy_pairs([panel])
    assert rows["first_better"].sum() + rows["second_better"].sum() == int((holm(np.array(p_values)) <= 0.05).sum())


def test_lower_is_better_where_the_measure_says_so():
    spec = made_study("S1c", Axis(name="throttle", values=(0.0, 0.2, 0.4)), reference=0.0)
    table = made_table(
        spec,
        lambda place: 5.0 - (2.0 if place.policy == "crw" and place.values[-1] else 0.0),
        adversity=lambda place: 0.1 + place.values[-1],
    )
    (figure,) = study_figures(study_panels(table, measures=("adaptability",)))
    first = policy_pairs(figure.panels).row(0, named=True)
    assert first["first"] == "crw"
    assert first["p_better"] == 0.0, "it moved furthest from its undisturbed curve"


def test_a_policy_without_runs_is_left_open():
    spec = made_study("S1a", Axis(name="population_size", values=(1, 2, 4)))
    lost = {(place, seed) for place in spec.places if place.policy == "dpo" for seed in spec.seeds}
    first = policy_pairs(panels("raw_performance", lost=lost)).row(0, named=True)
    assert (first["p_better"], first["n_levels"]) == (None, 0)
    assert first["lower"] == pytest.approx(None)


def test_a_single_policy_has_no_pairs():
    spec = made_study(
        "mine", Axis(name="population_size", values=(1, 2, 4)), policies=(PolicySpec(label="crw", policy="crw"),)
    )
    (figure,) = study_figures(study_panels(made_table(spec, lambda place: 5.0), measures=("raw_performance",)))
    assert policy_pairs(figure.panels).height == 0
