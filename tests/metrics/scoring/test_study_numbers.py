"""From tables of studies to panels, and from panels to verdicts on the paper's claims."""

from types import SimpleNamespace

import numpy as np
import pytest

from metrics import CurveError
from metrics.claims import EXPERIMENTS, INTUITIONS, PanelName
from metrics.scoring import judge_claims, study_panels
from metrics.scoring.study_numbers import experiment_of
from metrics.scoring.study_verdict import VARIANTS, StudyVerdict
from swarm_forage_env.studies.results import StudyTable
from swarm_forage_env.studies.study import load_study, set_names
from swarm_forage_env.studies.study_file import Axis
from tests.support.made_tables import FOUR, made_study, made_table

SIMPLE_FIRST = {"crw": 10.0, "dpo": 11.0, "stochm": 5.0, "stochx": 4.0}


def by_policy(place):
    return SIMPLE_FIRST[place.policy] * place.values[-1]


@pytest.fixture
def of_sizes():
    return made_table(made_study(), by_policy)


def test_what_sets_have_less_of_than_the_paper_is_told_in_a_line():
    def told(budget, *names):
        tables = tuple(SimpleNamespace(spec=load_study(name, budget)) for name in names)
        return StudyVerdict(tables=tables).remarks

    assert told("smoke", "S1a") == (
        "S1a, budget smoke: runs of 1,000 s instead of 10,000 s, 4 of 8 values of population_size",
    )
    assert told("reduced", "S1a", "S1c") == ("S1a, S1c, budget reduced: S1c 5 of 7 values of throttle",)
    assert told("paper", "S1a", "S1c") == ()


def only(panels, measure, **where):
    (found,) = [
        panel
        for panel in panels
        if panel.measure == measure and all(getattr(panel, name) == value for name, value in where.items())
    ]
    return found


def test_a_panel_has_a_row_per_level_and_a_column_per_seed(of_sizes):
    panel = only(study_panels(of_sizes).panels, "raw_performance")
    assert (panel.study, panel.rules, panel.others, panel.experiment) == ("S1a", "described", {}, "S1a")
    assert panel.x.tolist() == panel.levels.tolist() == [1.0, 2.0, 4.0]
    assert tuple(panel.scores) == FOUR
    assert panel.scores["dpo"].shape == (3, 6)
    seeds, curves = of_sizes.curves(of_sizes.spec.places[1], "performance")
    assert seeds == panel.seeds
    np.testing.assert_allclose(panel.scores["crw"][1], curves["performance"].sum(axis=1))
    assert panel.for_claims().scores["crw"].shape == (3, 6)


def test_measures_that_compare_sizes_leave_the_smallest_out(of_sizes):
    assert only(study_panels(of_sizes).panels, "scalability").x.tolist() == [2.0, 4.0]


def test_a_level_without_deliveries_leaves_the_margins_of_others():
    panel = only(
        study_panels(made_table(made_study(), lambda place: 0.0 if place.values[-1] == 1 else by_policy(place))).panels,
        "raw_performance",
    )
    margins = panel.for_claims().margins
    assert panel.compared_with[0] == 0.0
    np.testing.assert_allclose(margins[1:], 0.1 * panel.compared_with[1:])
    assert margins[0] > 0.0


def test_a_missing_run_is_no_score():
    spec = made_study()
    place = spec.places[2]  # four robots
    panels = study_panels(made_table(spec, by_policy, lost={(place, 3)})).panels
    assert np.argwhere(np.isnan(only(panels, "raw_performance").scores["crw"])).tolist() == [[2, 3]]
    assert np.isfinite(only(panels, "raw_performance").scores["dpo"]).all()


def test_a_panel_per_value_of_the_first_axis():
    walking = Axis(name="walk_probability", values=(0.0, 0.001, 0.3))
    spec = made_study("S2a", walking, Axis(name="population_size", values=(2, 4)))
    scored = study_panels(made_table(spec, by_policy))
    found = [(panel.others, panel.experiment) for panel in scored.panels if panel.measure == "raw_performance"]
    assert found == [
        ({"walk_probability": 0.0}, "S2a still"),
        ({"walk_probability": 0.001}, "S2a slow"),
        ({"walk_probability": 0.3}, None),
    ]
    assert only(scored.panels, "spatial_emergence", experiment="S2a slow").x.tolist() == [4.0], "without one robot"


def test_spatial_emergence_has_a_panel_beside_robots_alone_and_one_beside_the_next_smaller_swarm():
    table = made_table(made_study(), lambda place: 10.0 * place.values[-1] ** 2)
    panels = [one for one in study_panels(table).panels if one.measure == "spatial_emergence"]
    assert [one.name for one in panels] == [
        PanelName("S1a", "spatial_emergence", "interactive"),
        PanelName("S1a", "spatial_emergence", "marginal"),
    ]
    alone, smaller = (one.scores["crw"] for one in panels)
    np.testing.assert_allclose(alone[0], smaller[0])  # the smaller swarm is one robot
    assert not np.allclose(alone[1], smaller[1])


def test_throttles_are_placed_by_the_distance_of_conditions():
    axis = Axis(name="throttle", values=(0.0, 0.2, 0.4))
    spec = made_study("S1c", axis, reference=0.0, set={"n_objects": 20, "n_robots": 4})
    table = made_table(spec, lambda place: 5.0 - place.values[-1], adversity=lambda place: 0.1 + place.values[-1])
    panel = only(study_panels(table).panels, "reactivity")
    assert panel.x.tolist() == [0.2, 0.4]
    assert panel.levels.tolist() == pytest.approx([0.4, 0.8]), "two intervals, 0.2 and 0.4 from the ideal"
    assert not panel.higher_is_better


def test_a_measure_has_a_panel_in_each_variant_that_it_has(of_sizes):
    panels = study_panels(of_sizes, VARIANTS, ("raw_performance", "scalability", "reactivity")).panels
    assert [(panel.variant, panel.measure) for panel in panels] == [
        ("corrected", "raw_performance"),
        ("corrected", "scalability"),
        ("paper", "scalability"),
    ]
    with pytest.raises(CurveError, match="Unknown variant 'papr'"):
        study_panels(of_sizes, ("papr",))


def test_every_experiment_of_the_claims_is_in_a_set():
    """By name, and by the value on the first axis where a set has two."""
    specs = [load_study(name, "paper", rules=("described",)) for name in set_names()]
    found = {experiment_of(spec.name, place.values[:-1]) for spec in specs for place in spec.places}
    assert found - {None} == set(EXPERIMENTS)


def test_claims_are_answered_in_each_reading_and_variant():
    spec = made_study(rules=("described", "program"))
    table = made_table(spec, by_policy)
    judged, waiting = judge_claims([table], [study_panels(table, VARIANTS)])
    answers = {(one.claim.name, one.rules, one.variant): one.verdict.answer for one in judged}
    assert {key[0] for key in answers} == {"V1", "V2", "V3", "D5", "P2", "C5", "E1", "E2", "E3"}
    assert answers["V1", "", "corrected"] == "supported"
    for rules in spec.rules:
        assert [key[2] for key in answers if key[:2] == ("P2", rules)] == ["corrected"]
        assert answers["P2", rules, "corrected"] == "supported"
        assert [key[2] for key in answers if key[:2] == ("E3", rules)] == [*VARIANTS]
    lacking = {one.claim.name: one.lacks for one in waiting if (one.rules, one.variant) == ("program", "corrected")}
    assert lacking["D2"] == (PanelName("S1h", "population_robustness"), PanelName("S1b", "task_emergence"))
    assert not {"V1", "V2", "P2"} & {one.claim.name for one in waiting}


def test_the_opposite_order_contradicts():
    heights = dict(zip(SIMPLE_FIRST, reversed(SIMPLE_FIRST.values()), strict=True))
    table = made_table(made_study(), lambda place: heights[place.policy])
    judged, _ = judge_claims([table], [study_panels(table)], ("corrected",))
    assert {one.claim.name: one.verdict.answer for one in judged}["P2"] == "contradicted"


def test_a_claim_may_need_two_studies():
    tables = [made_table(made_study(name), by_policy) for name in ("S1a", "S1b")]
    panels = [study_panels(table) for table in tables]
    judged, _ = judge_claims(tables, panels, ("corrected",), INTUITIONS)
    assert {"H1", "H3", "H12"} <= {one.claim.name for one in judged}
    assert {one.to_mapping()["claim"] for one in judged} == {one.claim.name for one in judged}


def test_what_cannot_be_computed_is_told_with_the_claim():
    axes = (Axis(name="walk_probability", values=(0.001,)), Axis(name="population_size", values=(2,)))
    table = made_table(made_study("S2a", *axes), by_policy)
    _, waiting = judge_claims([table], [study_panels(table)], ("corrected",))
    (one,) = [one for one in waiting if one.claim.name == "E9"]
    assert "there is one swarm size only" in one.to_mapping()["reasons"][0]


def test_the_claim_on_spatial_emergence_of_search_and_rescue_needs_no_lone_robot():
    axes = (Axis(name="walk_probability", values=(0.001,)), Axis(name="population_size", values=(12, 51)))
    table = made_table(made_study("S2a", *axes), by_policy)
    judged, _ = judge_claims([table], [study_panels(table, VARIANTS)])
    assert [one.variant for one in judged if one.claim.name == "E9"] == list(VARIANTS)


@pytest.mark.parametrize(
    ("specs", "message"),
    [
        ([made_study(), made_study()], r"Expected each study once under the same rules, got S1a \(described\), S1a"),
        ([made_study("mine")], "Expected studies of the paper's sets, S1a, .*; got study 'mine'"),
        ([made_study(policies=({"policy": "random", "label": "crw"},))], "it has no dpo, stochm, stochx"),
    ],
)
def test_what_no_claim_is_about_is_refused(specs, message):
    tables = [made_table(spec, by_policy) for spec in specs]
    with pytest.raises(CurveError, match=message):
        judge_claims(tables, [study_panels(table) for table in tables])


def test_a_study_without_a_finished_run_decides_nothing():
    spec = made_study()
    table = made_table(spec, by_policy)
    nothing = StudyTable(spec=spec, frame=table.frame.clear(), versions=())
    judged, _ = judge_claims([nothing], [study_panels(nothing)], ("corrected",))
    assert {one.claim.name: one.verdict.answer for one in judged}["P2"] == "no scores"
