"""Figures of studies: what they show, and the numbers behind them."""

import re
from dataclasses import replace

import numpy as np
import pytest

from metrics.scoring import study_panels
from metrics.scoring.study_plots import caption, draw_figure, study_figures
from metrics.statistics import aggregate
from swarm_forage_env.studies.study_file import Axis
from tests.support.made_tables import FOUR, made_study, made_table
from tests.support.pictures import PNG, words_in

WALKING = Axis(name="walk_probability", values=(0.0, 0.3))
SIZES = Axis(name="population_size", values=(2, 4, 8))


def by_policy(place):
    return (4.0 + FOUR.index(place.policy)) * (1.0 + float(place.values[-1]))


def figures(*axes, lost=(), name="S1a", **changes):
    return study_figures(study_panels(made_table(made_study(name, *axes, **changes), by_policy, lost=lost)))


def test_a_study_has_a_figure_per_measure_and_reading():
    names = [figure.name for figure in figures(rules=("described", "program"))]
    assert names[:3] == [
        "S1a_raw_performance_described",
        "S1a_spatial_emergence_interactive_described",
        "S1a_spatial_emergence_described",
    ]
    assert len(names) == 10


def test_the_numbers_behind_a_figure():
    spec = made_study()
    first = spec.places[0]
    figure = figures(lost={(first, 2)})[0]
    frame = figure.to_frame()
    assert len(frame) == len(FOUR) * 3
    row = frame.row(0, named=True)
    assert (row["policy"], row["population_size"], row["n_runs"]) == ("crw", 1.0, 5)
    assert row["seed_2"] is None
    expected = aggregate([row[f"seed_{seed}"] for seed in (0, 1, 3, 4, 5)])
    assert (row["mean"], row["lower"], row["upper"], row["sd"]) == pytest.approx(
        (expected.mean, expected.lower, expected.upper, expected.std)
    )


@pytest.mark.parametrize("band", ["ci", "sd"])
def test_a_figure_is_drawn(tmp_path, band):
    figure = figures()[0]
    files = [tmp_path / "figure.svg", tmp_path / "figure.png"]
    draw_figure(figure, files, band=band)
    assert files[1].read_bytes().startswith(PNG)
    drawn = words_in(files[0])
    title = "S1a: raw performance (higher is better), rules described"
    assert {"CRW", "DPO", "STOCHM", "STOCHX", "robots N", "P(N), objects in 40 s", title} <= {*drawn}
    assert ("bars: 95 % interval of the mean; dots: runs" in drawn) == (band == "ci")
    again = tmp_path / "again.svg"
    draw_figure(figure, [again], band=band)
    assert again.read_bytes() == files[0].read_bytes()


def test_many_dots_are_an_image_in_vector_pictures(tmp_path):
    few, many = (figures(seeds=tuple(range(n)))[0] for n in (6, 60))
    for name, figure in (("few", few), ("many", many)):
        draw_figure(figure, [tmp_path / f"{name}.svg"])
    assert "<image" not in (tmp_path / "few.svg").read_text()
    assert "<image" in (tmp_path / "many.svg").read_text()


def test_one_level_is_drawn(tmp_path):
    figure = figures(Axis(name="population_size", values=(2,)))[0]
    draw_figure(figure, [tmp_path / "one.svg"])
    assert "2" in words_in(tmp_path / "one.svg")


def few_figures(n_seeds, *, performance=by_policy, lost=(), levels=SIZES):
    """The figure of performance of so many runs per condition."""
    spec = made_study("S1a", levels, seeds=tuple(range(n_seeds)))
    drawn = study_figures(study_panels(made_table(spec, performance, lost=lost)))
    return next(one for one in drawn if one.panels[0].measure == "raw_performance")


def bars_of(monkeypatch, figure, tmp_path):
    """Where the policies stand, and how far their bars reach down and up, (policies, 2, levels)."""
    from matplotlib.axes import Axes

    drawn = []
    monkeypatch.setattr(Axes, "errorbar", lambda _, x, mean, yerr, **__: drawn.append((x, mean, yerr)))
    draw_figure(figure, [tmp_path / "figure.svg"])
    monkeypatch.undo()
    return [np.array(part) for part in zip(*drawn, strict=True)]


def with_scores(figure, scores):
    """The same figure with these scores (L, R) of every policy, or of each by name."""
    panel = figure.panels[0]
    given = scores if isinstance(scores, dict) else dict.fromkeys(panel.scores, np.asarray(scores))
    return replace(figure, panels=(replace(panel, scores=given),))


def test_fewer_than_four_runs_are_dots_and_a_mean_and_the_caption_says_why(tmp_path, monkeypatch):
    figure = few_figures(3)
    assert np.isnan(bars_of(monkeypatch, figure, tmp_path)[2]).all()
    assert (
        caption(figure, "ci") == "lines: means; dots: runs\nno bars: fewer than 4 runs of a condition tell too little"
    )
    assert np.isfinite(bars_of(monkeypatch, few_figures(4), tmp_path)[2]).all()
    assert caption(few_figures(4), "ci") == "bars: 95 % interval of the mean; dots: runs"
    places = made_study("S1a", SIZES, seeds=(0, 1, 2, 3)).places
    figure = few_figures(4, lost={(place, 3) for place in places if place.values[-1] != 4})
    assert np.isfinite(bars_of(monkeypatch, figure, tmp_path)[2]).tolist() == [[[False, True, False]] * 2] * len(FOUR)
    assert caption(figure, "ci").endswith("no bar: conditions with fewer than 4 runs, which tell too little")


def test_bars_stay_within_the_range_of_the_measure(tmp_path, monkeypatch):
    """Objects are counted: fewer than none cannot be, however far runs lie apart."""
    figure = with_scores(few_figures(4), np.tile([0.0, 0.0, 0.0, 100.0], (3, 1)))
    _, mean, reach = bars_of(monkeypatch, figure, tmp_path)
    assert (mean - reach[:, 0]).tolist() == [[0.0, 0.0, 0.0]] * len(FOUR)


def test_policies_stand_beside_each_other_and_closer_than_levels(tmp_path, monkeypatch):
    close = Axis(name="noise", values=(0.0, 0.001, 0.002, 0.1))
    x, *_ = bars_of(monkeypatch, figures(close, name="S1e", reference=0.0)[0], tmp_path)
    assert (np.diff(x, axis=0) > 0.0).all(), "no bar covers another"
    assert (x[-1, :-1] < x[0, 1:]).all(), "nor stands at the next level"


def test_performance_over_sizes_has_two_logarithmic_axes(tmp_path):
    figure = next(one for one in figures() if one.panels[0].measure == "raw_performance")
    grown = np.array([[1.0] * 6, [100.0] * 6, [10_000.0] * 6])
    draw_figure(with_scores(figure, grown), [tmp_path / "grown.svg"])
    assert {"1", "100", "10,000"} <= {*words_in(tmp_path / "grown.svg")}
    draw_figure(with_scores(figure, 0.0 * grown), [tmp_path / "nothing.svg"])


def test_distances_have_their_noise_floor_and_those_of_mean_curves_beside_them(tmp_path):
    spec = made_study("S1e", Axis(name="noise", values=(0.0, 0.01, 0.02)), reference=0.0)
    (figure,) = study_figures(study_panels(made_table(spec, lambda place: 10.0 + place.values[0])))
    assert caption(figure, "ci").endswith("\ndotted: two undisturbed runs; hollow: mean curves")
    draw_figure(figure, [tmp_path / "floors.svg"])
    assert len(re.findall(r"stroke-dasharray: 1,1\.65", (tmp_path / "floors.svg").read_text())) == len(FOUR)
    (panel,) = figure.panels
    for row in figure.to_frame().filter(noise=0.02).rows(named=True):
        assert row["noise_floor"] == pytest.approx(panel.floors[row["policy"]].mean())
        assert row["of_mean_curves"] == pytest.approx(panel.of_mean_curves[row["policy"]][-1].mean())
    assert "noise_floor" not in figures()[0].to_frame().columns


def test_rates_of_a_population_are_shown_as_events(tmp_path):
    spec = made_study("S1g", Axis(name="population_dynamics", values=(0.0, 1.0, 2.0)), reference=0.0)
    drawn = study_figures(study_panels(made_table(spec, lambda place: 10.0)))
    figure = next(one for one in drawn if one.panels[0].measure == "population_robustness")
    assert figure.panels[0].levels.tolist() == [1.0, 2.0], "of which claims speak"
    assert figure.panels[0].drawn_at.tolist() == pytest.approx([5.0, 10.0])
    draw_figure(figure, [tmp_path / "rates.svg"])
    assert "departures λ, robots per 1,000 s" in words_in(tmp_path / "rates.svg")


def test_two_axes_give_a_panel_per_value(tmp_path):
    figure = figures(WALKING, SIZES, name="S2a")[0]
    assert [panel.others for panel in figure.panels] == [{"walk_probability": 0.0}, {"walk_probability": 0.3}]
    draw_figure(figure, [tmp_path / "panels.svg"])
    assert "walk probability 0.3" in words_in(tmp_path / "panels.svg")


def test_a_study_over_a_field_shows_performance():
    (figure,) = figures(SIZES, Axis(name="n_objects", values=(30, 10)), set={}, name="mine")
    assert [panel.criterion for panel in figure.panels] == ["n_objects"] * 3
    frame = figure.to_frame()
    assert frame["n_objects"].to_list()[:2] == [10.0, 30.0]
    assert frame["mean"][0] == pytest.approx(4 * 4.0 * 11.0, rel=0.05), "four intervals"


def test_words_on_the_last_axis_and_studies_without_runs_have_no_figure():
    words = made_study("mine", Axis(name="caches", values=("none", "static")), set={"n_objects": 60})
    assert study_figures(study_panels(made_table(words, lambda place: 1.0))) == ()
    spec = made_study()
    assert figures(lost={(place, seed) for place in spec.places for seed in spec.seeds}) == ()
