"""From tables of studies to panels of scores."""

from types import SimpleNamespace

import numpy as np
import pytest

from metrics.claims import EXPERIMENTS, PanelName
from metrics.scoring import StudyPanel, study_panels
from metrics.scoring.frame import scores
from metrics.scoring.run_curves import study_lines
from swarm_forage_env import read_study, run_study
from swarm_forage_env.runs.store import record_file
from swarm_forage_env.studies.study import load_study, set_names
from swarm_forage_env.studies.study_file import Axis
from tests.support.made_tables import FOUR, made_study, made_table
from tests.support.tiny_study import RANDOM, tiny_study

SIMPLE_FIRST = {"crw": 10.0, "dpo": 11.0, "stochm": 5.0, "stochx": 4.0}


def by_policy(place):
    return SIMPLE_FIRST[place.policy] * place.values[-1]


def panels_of(spec, performance=by_policy, measure="raw_performance", **told):
    panels, _ = study_panels(made_table(spec, performance, **told))
    return [panel for panel in panels if panel.measure == measure]


def test_a_panel_has_a_row_per_level_and_a_column_per_seed():
    table = made_table(made_study(), by_policy)
    panel = study_panels(table)[0][0]
    assert (panel.rules, panel.name) == ("described", PanelName("S1a", "raw_performance"))
    assert panel.x.tolist() == panel.levels.tolist() == [1.0, 2.0, 4.0]
    assert tuple(panel.scores) == FOUR
    _, curves = table.curves(table.spec.places[1], "performance")
    np.testing.assert_allclose(panel.scores["crw"][1], curves["performance"].sum(axis=1))
    claimed = panel.for_claims()
    np.testing.assert_array_equal(claimed.scores["dpo"], panel.scores["dpo"])
    np.testing.assert_allclose(claimed.unit, np.mean([*panel.scores.values()], axis=(0, 2)))
    assert (claimed.margin, claimed.shares) == (0.05, None)


def test_a_level_without_deliveries_is_left_out_of_claims():
    (panel,) = panels_of(made_study(), lambda place: 0.0 if place.values[-1] == 1 else by_policy(place))
    assert panel.for_claims().curves(["crw"], shares=False).levels.tolist() == [2.0, 4.0]


def test_a_panel_per_value_of_the_first_axis():
    walking = Axis(name="walk_probability", values=(0.0, 0.001, 0.3))
    spec = made_study("S2a", walking, Axis(name="population_size", values=(2, 4)))
    found = [(panel.lines[0].others, panel.name.experiment) for panel in panels_of(spec)]
    assert found == [
        ({"walk_probability": 0.0}, "S2a still"),
        ({"walk_probability": 0.001}, "S2a slow"),
        ({"walk_probability": 0.3}, ""),
    ]
    assert [panel.x.tolist() for panel in panels_of(spec, measure="spatial_emergence")] == [[4.0]] * 3, "no lone robot"
    assert study_panels(made_table(spec, by_policy))[1].keys() == {("spatial_emergence", "corrected", "interactive")}


def test_spatial_emergence_has_a_panel_beside_robots_alone_and_one_beside_the_next_smaller_swarm():
    alone, smaller = panels_of(made_study(), lambda place: 10.0 * place.values[-1] ** 2, "spatial_emergence")
    assert (alone.form, smaller.form) == ("interactive", "marginal")
    np.testing.assert_allclose(alone.scores["crw"][0], smaller.scores["crw"][0])  # the smaller swarm is one robot
    assert not np.allclose(alone.scores["crw"][1], smaller.scores["crw"][1])


def test_throttles_are_placed_by_the_distance_of_conditions():
    axis = Axis(name="throttle", values=(0.0, 0.2, 0.4))
    spec = made_study("S1c", axis, reference=0.0, set={"n_objects": 20, "n_robots": 4})
    told = {"measure": "reactivity", "adversity": lambda place: 0.1 + place.values[-1]}
    (panel,) = panels_of(spec, lambda place: 5.0 - place.values[-1], **told)
    assert panel.x.tolist() == [0.2, 0.4]
    assert panel.levels.tolist() == pytest.approx([0.4, 0.8]), "two intervals, 0.2 and 0.4 from the ideal"


def test_distances_are_shown_to_claims_as_amounts_and_as_shares_above_the_floor():
    spec = made_study("S1e", Axis(name="noise", values=(0.0, 0.01, 0.02)), reference=0.0)
    (panel,) = panels_of(spec, lambda place: 10.0 * (1.0 - 10.0 * place.values[-1]), "noise_robustness")
    claimed, totals = panel.for_claims(), panel.of("total")
    np.testing.assert_allclose(claimed.unit, np.mean([*totals.values()], axis=(0, 2)))
    np.testing.assert_allclose(claimed.shares["crw"], panel.of("excess")["crw"] / totals["crw"])
    assert panel.floors["crw"] == pytest.approx(panel.frame["floor"][0])


def test_units_are_those_of_the_measures_and_small_swarms_do_not_interact():
    sizes = Axis(name="population_size", values=(1, 4, 8, 16))
    panels, _ = study_panels(made_table(made_study("S1a", sizes), by_policy))
    found = {(panel.measure, panel.form): panel.for_claims() for panel in panels}
    assert found["raw_performance", "marginal"].levels.tolist() == [1.0, 4.0, 8.0, 16.0]
    scaled, spatial = found["scalability", "marginal"], found["spatial_emergence", "interactive"]
    assert scaled.levels.tolist() == spatial.levels.tolist() == [8.0, 16.0]
    assert (scaled.unit.tolist(), scaled.margin) == ([1.0, 1.0], 0.1)
    lost = 0.1 * found["raw_performance", "marginal"].unit[2:]  # a tenth of the time
    np.testing.assert_allclose(spatial.unit, lost)
    np.testing.assert_allclose(found["task_emergence", "marginal"].unit, 10.0 * lost)
    shares = {name: values / panel_total(panels, name) / 0.1 for name, values in spatial.scores.items()}
    np.testing.assert_allclose(spatial.shares["dpo"], shares["dpo"])


def panel_total(panels, policy):
    """What a policy delivers in each run with 8 and 16 robots."""
    (panel,) = (one for one in panels if one.measure == "raw_performance")
    return panel.scores[policy][2:]


def test_rates_of_a_population_are_told_in_events():
    spec = made_study("S1g", Axis(name="population_dynamics", values=(0.0, 1.0, 2.0)), reference=0.0)
    (panel,) = panels_of(spec, lambda place: 10.0, "population_robustness")
    assert panel.levels.tolist() == [1.0, 2.0], "of which claims speak"
    assert panel.departures.tolist() == pytest.approx([5.0, 10.0])


def test_a_study_over_a_field_has_performance_where_the_axis_has_numbers():
    spec = made_study("mine", Axis(name="n_objects", values=(30, 10)), set={})
    (panel,) = panels_of(spec, lambda place: 2.0)
    assert (panel.criterion, panel.x.tolist()) == ("n_objects", [10.0, 30.0])
    np.testing.assert_allclose(panel.scores["crw"].mean(), 4 * 2.0, rtol=0.05)
    words = made_study("mine", Axis(name="caches", values=("none", "static")), set={"n_objects": 60})
    assert panels_of(words, lambda place: 1.0) == []


def test_every_experiment_of_the_claims_is_in_a_set():
    """By name, and by the value on the first axis where a set has two. A second: it reads all sets."""
    about = {"frame": None, "measure": "", "variant": "corrected", "form": "marginal", "criterion": "", "unit": ""}
    found = set()
    for spec in (load_study(name, "paper", rules=("described",)) for name in set_names()):
        for others in {place.values[:-1] for place in spec.places}:
            line = SimpleNamespace(others=dict(enumerate(others)))
            found.add(StudyPanel(spec=spec, lines=(line,), **about).name.experiment)
    assert found - {""} == set(EXPERIMENTS)


@pytest.fixture
def made(tmp_path):
    """Run a study in this process and return its table."""

    def make(*axes, **changes):
        run_study(tiny_study(*axes, policies=(RANDOM,), **changes), tmp_path, jobs=1)
        return read_study(tmp_path)

    return make


def test_a_line_is_what_differs_on_the_last_axis(made):
    table = made(Axis(name="walk_probability", values=(0.0, 0.5)), Axis(name="noise", values=(0.0, 0.02, 0.03)))
    lines = study_lines(table)
    assert [(line.rules, line.policy, line.others) for line in lines] == [
        ("described", "random", {"walk_probability": 0.0}),
        ("described", "random", {"walk_probability": 0.5}),
    ]
    for line in lines:
        assert [place.values[-1] for place in line.places] == [0.0, 0.02, 0.03]
        pairs = line.curves.levels("noise")
        assert [(reference.criterion, level.value) for reference, level in pairs] == [("none", 0.02), ("none", 0.03)]
        found, missing = scores([line.curves], ["noise_robustness"])
        assert found.select("x", "seed").rows() == [(0.02, 0), (0.02, 1), (0.03, 0), (0.03, 1)]
        assert missing == {}


def test_sizes_are_scored_from_the_smallest(made):
    (line,) = study_lines(made(Axis(name="population_size", values=(1, 2)), reference=1))
    found, missing = scores([line.curves], ["scalability", "time_emergence", "raw_performance"])
    assert set(found["measure"]) == {"scalability", "time_emergence", "raw_performance"}
    assert missing == {}
    assert line.curves.horizon_s == 4.0


def test_the_lowest_rates_may_be_the_reference(made):
    """The authors compare with their lowest level; both forms of the measure then use the same runs."""
    (line,) = study_lines(made(Axis(name="population_dynamics", values=(1.0, 2.0, 4.0)), reference=1.0,
                               set={"n_robots": 4, "n_objects": 20}))  # fmt: skip
    pairs = line.curves.levels("population_dynamics")
    assert [(reference.value, level.value) for reference, level in pairs] == [(1.0, 2.0), (1.0, 4.0)]
    assert all(reference.rates.lambda_bd == pytest.approx(0.005) for reference, _ in pairs), "0.001 per tick of 0.2 s"
    found, _ = scores([line.curves], ["population_robustness"])
    assert found["x"].unique(maintain_order=True).to_list() == [2.0, 4.0]


def test_lost_runs_are_counted(made, tmp_path):
    table = made(Axis(name="noise", values=(0.0, 0.02)))
    noisy = table.spec.places[-1]
    record_file(tmp_path / "runs", table.spec.specs_of(noisy)[1].run_id).unlink()
    (line,) = study_lines(read_study(tmp_path))
    reference, level = line.curves.experiments
    assert (reference.n_lost, level.n_lost, level.seeds) == (0, 1, (0,))
