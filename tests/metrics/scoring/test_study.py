"""Studies: their panels, figures with the numbers behind them, and what they say of the claims."""

import re
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import polars as pl
import pytest

from metrics import CLAIMS, CurveError, plot, verdict
from metrics.claims import EXPERIMENTS, INTUITIONS, PanelName
from metrics.scoring import StudyPanel, StudyVerdict, study_panels
from metrics.scoring.frame import scores
from metrics.scoring.run_curves import study_lines
from metrics.scoring.study_plots import caption, draw_figure, draw_forest, study_figures
from metrics.statistics import aggregate
from swarm_forage_env import read_study, run_study
from swarm_forage_env.runs.store import record_file
from swarm_forage_env.studies.results import StudyTable
from swarm_forage_env.studies.study import load_study, set_names
from swarm_forage_env.studies.study_file import Axis
from tests.support.pictures import PNG, words_in
from tests.support.tiny_study import FOUR, RANDOM, made_study, made_table, tiny_study

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


SIZES = Axis(name="population_size", values=(2, 4, 8))


def by_order(place):
    return (4.0 + FOUR.index(place.policy)) * (1.0 + float(place.values[-1]))


def figures(*axes, lost=(), name="S1a", performance=by_order, **changes):
    return study_figures(study_panels(made_table(made_study(name, *axes, **changes), performance, lost=lost))[0])


def words_of(file):
    """All words of a picture; headlines are wrapped."""
    return " ".join(words_in(file))


def bars_of(monkeypatch, figure, tmp_path, band="ci"):
    """Where the policies stand, and how far their bars reach down and up, (policies, 2, levels)."""
    from matplotlib.axes import Axes

    drawn = []
    monkeypatch.setattr(Axes, "errorbar", lambda _, x, mean, yerr, **__: drawn.append((x, mean, yerr)))
    draw_figure(figure, [tmp_path / "figure.svg"], band=band)
    monkeypatch.undo()
    return [np.array(part) for part in zip(*drawn, strict=True)]


def with_scores(figure, scores):
    """The same figure with these scores (L, R) of every policy."""
    panel = figure.panels[0]
    frame = panel.frame.sort("policy", "x", "seed").with_columns(value=pl.Series(np.tile(scores, (4, 1)).ravel()))
    return replace(figure, panels=(replace(panel, frame=frame),))


def test_a_study_has_a_figure_per_measure_and_reading():
    names = [figure.name for figure in figures(rules=("described", "program"))]
    assert names[:3] == [
        "S1a_raw_performance_described",
        "S1a_spatial_emergence_interactive_described",
        "S1a_spatial_emergence_described",
    ]
    assert len(names) == 10


def test_the_numbers_behind_a_figure():
    frame = figures(lost={(made_study().places[0], 2)})[0].to_frame()
    assert len(frame) == len(FOUR) * 3
    row = frame.row(0, named=True)
    assert (row["policy"], row["population_size"], row["n_runs"], row["seed_2"]) == ("crw", 1.0, 5, None)
    expected = aggregate([row[f"seed_{seed}"] for seed in (0, 1, 3, 4, 5)])
    assert (row["mean"], row["lower"], row["upper"], row["sd"]) == pytest.approx(
        (expected.mean, expected.lower, expected.upper, expected.std)
    )


def test_a_figure_shows_its_words_and_numbers(tmp_path):
    figure = figures()[0]
    files = [tmp_path / "figure.svg", tmp_path / "figure.png"]
    draw_figure(figure, files, band="sd")
    assert files[1].read_bytes().startswith(PNG)
    words = words_of(files[0])
    title = "S1a: raw performance (higher is better), rules described"
    for shown in ("CRW", "DPO", "STOCHM", "STOCHX", "robots N", "P(N), objects in 40 s", title):
        assert shown in words
    assert "bars: mean ± 2 standard deviations of runs; dots: runs" in words


def test_fewer_than_four_runs_have_no_bar_and_the_caption_says_why(tmp_path, monkeypatch):
    assert caption(figures(SIZES, seeds=(0, 1, 2, 3))[0], "ci") == "bars: 95 % interval of the mean; dots: runs"
    places = made_study("S1a", SIZES).places
    figure = figures(SIZES, seeds=(0, 1, 2, 3), lost={(place, 3) for place in places if place.values[-1] != 4})[0]
    _, mean, reach = bars_of(monkeypatch, figure, tmp_path)
    assert np.isfinite(mean).all()
    assert np.isfinite(reach).tolist() == [[[False, True, False]] * 2] * len(FOUR)
    assert caption(figure, "ci").endswith("\nno bar: fewer than 4 runs of a condition, which tell too little")


@pytest.mark.parametrize("band", ["ci", "sd"])
def test_bars_stay_within_the_range_of_the_measure(tmp_path, monkeypatch, band):
    """Objects are counted: fewer than none cannot be, however far runs lie apart."""
    runs = np.array([0.0, 0.0, 0.0, 100.0])
    figure = with_scores(figures(SIZES, seeds=(0, 1, 2, 3))[0], np.tile(runs, (3, 1)))
    _, mean, reach = bars_of(monkeypatch, figure, tmp_path, band)
    assert (mean - reach[:, 0]).tolist() == [[0.0, 0.0, 0.0]] * len(FOUR)
    expected = {"ci": aggregate(runs).upper - 25.0, "sd": 2.0 * runs.std(ddof=1)}[band]
    np.testing.assert_allclose(reach[:, 1], expected)


def test_distances_have_their_noise_floor_beside_them(tmp_path):
    noise = Axis(name="noise", values=(0.0, 0.01, 0.02))
    (figure,) = figures(noise, name="S1e", reference=0.0, performance=lambda place: 10.0 + place.values[0])
    assert caption(figure, "ci").endswith("\ndotted: two undisturbed runs")
    draw_figure(figure, [tmp_path / "floors.svg"])
    assert len(re.findall(r"stroke-dasharray: 1,1\.65", (tmp_path / "floors.svg").read_text())) == len(FOUR)
    (panel,) = figure.panels
    for row in figure.to_frame().filter(noise=0.02).rows(named=True):
        assert row["noise_floor"] == pytest.approx(panel.floors[row["policy"]])
    assert "noise_floor" not in figures()[0].to_frame().columns


def test_what_cannot_be_drawn_is_told(tmp_path):
    words = made_table(made_study("mine", Axis(name="caches", values=("none",)), set={"n_objects": 60}), lambda _: 1.0)
    with pytest.raises(CurveError, match="numbers on its last axis, got mine, which gives nothing to draw"):
        plot(words, tmp_path)
    with pytest.raises(ValueError, match="gif"):
        plot(made_table(made_study(), by_order), tmp_path, formats=("gif",))
    with pytest.raises(ValueError, match="sigma"):
        plot(words, tmp_path, band="sigma")
    spec = made_study()
    assert figures(lost={(place, seed) for place in spec.places for seed in spec.seeds}) == ()


def test_claims_are_drawn_a_row_per_statement(tmp_path):
    about = {"statement": "crw - dpo", "mean": 0.1, "lower": 0.05, "upper": 0.2, "margin": 0.05}
    rows = [
        {"claim": claim, "where": "S1c", "rules": rules, "reading": reading, **about}
        for claim in ("R1", "R2")
        for rules in ("described", "program")
        for reading in ("amounts", "shares")
    ]
    rows.append({**rows[-1], "claim": "R3", "mean": float("nan")})
    draw_forest(pl.DataFrame(rows), [tmp_path / "forest.svg"], "flexibility")
    words = words_in(tmp_path / "forest.svg")
    for word in ("R1  CRW - DPO  [S1c]", "described, amounts", "program, shares", "R3  CRW - DPO  [S1c]"):
        assert any(word in one for one in words), (word, words)


def answers(found, **where):
    mine = found.frame.filter("is_main", **where)
    return dict(mine.select("claim", "answer").iter_rows())


@pytest.fixture(scope="module")
def both():
    """Of two studies of one set, each under its own rules."""
    told = []
    program = made_table(made_study(rules=("program",)), by_policy)
    found = verdict(made_table(made_study(), by_policy), program, tell=told.append)
    assert told == ["scoring S1a"] * 2
    return found


def test_claims_are_answered_under_all_rules_and_in_all_readings(both):
    found = answers(both, rules="program")
    assert (found["P2"], found["R1"], found["V1"], found["D5"]) == ("supported", "no runs", "supported", "untestable")
    assert both.frame.filter(claim="P2", rules="described")["reading"].to_list() == ["amounts", "bands"]
    assert both.frame.filter(claim="R1", rules="described")["reading"].to_list() == ["amounts", "shares", "bands"]
    lacking = both.frame.filter("is_main", claim="D2", rules="program")["why"].to_list()
    assert lacking == ["no runs of S1h population robustness; no runs of S1b task emergence, S1h population robustness"]
    row = both.frame.filter(claim="P2", rules="described", reading="amounts").row(0, named=True)
    assert [row[name] for name in ("claimed", "reversed", "tied", "open", "n_runs")] == [12, 0, 0, 0, 6]
    assert [row[f"at_{margin}"] for margin in ("0.025", "0.05", "0.1", "0.2")] == ["supported"] * 4
    (part,) = both.parts.filter(claim="P2", rules="described", reading="amounts").iter_rows(named=True)
    assert (part["statement"], part["where"]) == ("crw, dpo - stochm, stochx", "S1a raw performance")
    assert part["mean"] == pytest.approx((10.5 - 4.5) / 7.5, rel=0.02)
    assert part["p"] < 0.001


def test_claims_are_counted_and_at_a_glance(both):
    counts, claims, intuitions, behind, waiting = both.sheets()
    assert counts.frame["rules"].to_list() == ["described", "program"]
    assert {sum(row[1:]) for row in counts.frame.rows()} == {len(CLAIMS)}
    shown = {row[0]: row[2:] for row in claims.frame.rows()}
    assert shown["P2"] == ("supported", "", "supported") * 2
    assert shown["D5"] == ("untestable", "", "untestable") * 2
    assert "R1" not in shown
    assert claims.notes == [f"{len(CLAIMS) - len(shown)} of {len(CLAIMS)} wait for runs."]
    assert intuitions.notes == [f"{len(INTUITIONS)} of {len(INTUITIONS)} wait for runs."]
    assert {"P2", "V1"} <= {*behind.frame["claim"]}
    assert any("no runs of S1e noise robustness" in line for line in waiting.notes)
    told = both.to_mapping()
    assert told["counts"]["program"]["no runs"] == counts.frame["no runs"][1]
    assert [row["n_runs"] for row in told["claims"] if row["claim"] == "V1"] == [0] * 4


def test_claims_about_distances_are_read_as_shares_too():
    spec = made_study("S1e", Axis(name="noise", values=(0.0, 0.01, 0.02, 0.03)), reference=0.0)
    found = verdict(made_table(spec, lambda place: 10.0 * (1.0 - 10.0 * place.values[-1])))
    mine = found.frame.filter(claim="N1")
    assert mine.select("reading", "tied").rows() == [("amounts", 3), ("shares", 3), ("bands", 3)]
    assert mine.filter("is_main")["reading"].to_list() == ["shares"]


def test_the_opposite_order_contradicts_and_no_run_decides_nothing():
    heights = dict(zip(SIMPLE_FIRST, reversed(SIMPLE_FIRST.values()), strict=True))
    table = made_table(made_study(), lambda place: heights[place.policy])
    assert answers(verdict(table))["P2"] == "contradicted"
    nothing = StudyTable(spec=table.spec, frame=table.frame.clear(), versions=())
    assert answers(verdict(nothing))["P2"] == "no runs"


@pytest.mark.parametrize(
    ("specs", "message"),
    [
        ([made_study(), made_study()], r"Expected each study once under the same rules, got S1a \(described\), S1a"),
        ([made_study("mine")], "sets, S1a, .*; got study 'mine'. 'swarm-forage study plot' takes any study"),
        (
            [made_study(policies=({"policy": "random", "label": "crw"},))],
            "Expected scores of dpo, got those of crw",
        ),
    ],
)
def test_what_no_claim_is_about_is_refused(specs, message):
    with pytest.raises(CurveError, match=message):
        verdict(*(made_table(spec, by_policy) for spec in specs))


def test_what_sets_have_less_of_than_the_paper_is_told_in_a_line():
    """A second: it reads sets."""

    def told(budget, *names):
        tables = tuple(SimpleNamespace(spec=load_study(name, budget)) for name in names)
        return StudyVerdict(tables=tables).remarks

    assert told("reduced", "S1a", "S1c") == ("S1c: budget reduced, without throttle 0.2, 0.35",)
    assert told("paper", "S1a", "S1c") == ()
    (smoke,) = told("smoke", "S1a")
    assert smoke.startswith("S1a: budget smoke, runs of 1,000 s instead of 10,000 s, without population_size ")
