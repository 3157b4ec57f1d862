"""Figures of studies: what they show, and the numbers behind them."""

import re
from dataclasses import replace

import numpy as np
import pytest

from metrics.scoring import study_panels
from metrics.scoring.study_plots import caption, draw_figure, draw_map, limit_height, study_figures
from metrics.statistics import aggregate
from swarm_forage_env.studies.study import Axis
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
    assert {"CRW", "DPO", "STOCHM", "STOCHX", "robots", "objects in 40 s", title} <= {*drawn}
    assert ("shaded: 95 % interval of the mean; dots: runs" in drawn) == (band == "ci")
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
    assert not figure.has_map
    draw_figure(figure, [tmp_path / "one.svg"])
    assert "2" in words_in(tmp_path / "one.svg")


def few_figures(n_seeds, *, performance=by_policy, lost=(), levels=SIZES):
    """The figure of performance of so many runs per condition."""
    spec = made_study("S1a", levels, seeds=tuple(range(n_seeds)))
    drawn = study_figures(study_panels(made_table(spec, performance, lost=lost)))
    return next(one for one in drawn if one.panels[0].measure == "raw_performance")


def bands_of(monkeypatch, figure, tmp_path):
    """The corners of each band that is drawn, the lines of each isolated one, and the widths of lines."""
    from matplotlib.axes import Axes

    drawn = {"fill_between": [], "vlines": []}
    for name, kept in drawn.items():
        monkeypatch.setattr(Axes, name, lambda _, x, low, high, kept=kept, **__: kept.append((low, high)))
    draw_figure(figure, [tmp_path / "figure.svg"])
    monkeypatch.undo()
    return drawn["fill_between"], drawn["vlines"]


def test_fewer_than_four_runs_are_dots_and_a_mean_and_the_caption_says_why(tmp_path, monkeypatch):
    figure = few_figures(3)
    bands, alone = bands_of(monkeypatch, figure, tmp_path)
    assert all(np.isnan(edge).all() for band in bands for edge in band)
    assert all(low.size == 0 for low, _ in alone)
    assert (
        caption(figure, "ci") == "lines: means; dots: runs\nno bands: fewer than 4 runs of a condition tell too little"
    )
    bands, _ = bands_of(monkeypatch, few_figures(4), tmp_path)
    assert all(np.isfinite(edge).all() for band in bands for edge in band)
    assert caption(few_figures(4), "ci") == "shaded: 95 % interval of the mean; dots: runs"


def test_a_band_with_no_neighbours_is_a_line(tmp_path, monkeypatch):
    places = made_study("S1a", SIZES, seeds=(0, 1, 2, 3)).places
    figure = few_figures(4, lost={(place, 3) for place in places if place.values[-1] != 4})
    bands, alone = bands_of(monkeypatch, figure, tmp_path)
    assert [np.isfinite(low).tolist() for low, _ in bands] == [[False, True, False]] * len(FOUR)
    assert [low.size for low, _ in alone] == [1] * len(FOUR)
    assert caption(figure, "ci").endswith("no band: conditions with fewer than 4 runs, which tell too little")


def test_bands_stay_within_the_range_of_the_measure(tmp_path, monkeypatch):
    """Objects are counted: fewer than none cannot be, however far runs lie apart."""
    figure = few_figures(4)
    panel = figure.panels[0]
    scores = {name: np.tile([0.0, 0.0, 0.0, 100.0], (3, 1)) for name in panel.scores}
    bands, _ = bands_of(monkeypatch, replace(figure, panels=(replace(panel, scores=scores),)), tmp_path)
    assert [low.tolist() for low, _ in bands] == [[0.0, 0.0, 0.0]] * len(FOUR)


@pytest.mark.filterwarnings("error")
def test_equal_runs_have_a_band_that_is_seen(tmp_path):
    figure = few_figures(4)
    panel = figure.panels[0]
    widths = []
    for spread in (0.0, 1.0):
        scores = {name: np.tile(7.0 + spread * np.arange(4), (3, 1)) for name in panel.scores}
        file = tmp_path / f"{spread}.svg"
        draw_figure(replace(figure, panels=(replace(panel, scores=scores),)), [file])
        widths.append(
            len(re.findall(r"<path d=\"M [^z]*?\" [^>]*stroke-opacity: 0.2[^>]*stroke-width: 5", file.read_text()))
        )
    assert widths == [len(FOUR), 0]


def test_two_axes_give_a_panel_per_value_and_a_map(tmp_path):
    figure = figures(WALKING, SIZES, name="S2a")[0]
    assert [panel.others for panel in figure.panels] == [{"walk_probability": 0.0}, {"walk_probability": 0.3}]
    draw_figure(figure, [tmp_path / "panels.svg"])
    assert "walk probability 0.3" in words_in(tmp_path / "panels.svg")
    assert figure.has_map
    draw_map(figure, [tmp_path / "map.svg"])
    mean = np.mean(figure.panels[1].scores["stochx"][2])
    assert {"CRW", "STOCHX", "walk probability", f"{mean:.4g}"} <= {*words_in(tmp_path / "map.svg")}


def test_words_on_the_first_axis_have_no_map():
    caches = Axis(name="caches", values=("none", "static"))
    figure = figures(caches, SIZES, settings={"n_objects": 60})[0]
    assert len(figure.panels) == 2
    assert not figure.has_map


def test_a_study_over_a_field_shows_performance():
    (figure,) = figures(SIZES, Axis(name="n_objects", values=(30, 10)), settings={}, name="mine")
    assert [panel.criterion for panel in figure.panels] == ["n_objects"] * 3
    frame = figure.to_frame()
    assert frame["n_objects"].to_list()[:2] == [10.0, 30.0]
    assert frame["mean"][0] == pytest.approx(4 * 4.0 * 11.0, rel=0.05), "four intervals"


def test_words_on_the_last_axis_and_studies_without_runs_have_no_figure():
    words = made_study("mine", Axis(name="caches", values=("none", "static")), settings={"n_objects": 60})
    assert study_figures(study_panels(made_table(words, lambda place: 1.0))) == ()
    spec = made_study()
    assert figures(lost={(place, seed) for place in spec.places for seed in spec.seeds}) == ()


def test_the_interval_of_two_runs_does_not_flatten_the_picture():
    from matplotlib.figure import Figure

    (figure,) = (one for one in figures(seeds=(0, 1)) if one.panels[0].measure == "raw_performance")
    place = Figure().subplots()
    place.set_ylim(-1e6, 1e6)
    limit_height(place, figure)
    runs = np.concatenate([scores.ravel() for scores in figure.panels[0].scores.values()])
    bottom, top = place.get_ylim()
    assert runs.min() - np.ptp(runs) < bottom < runs.min()
    assert runs.max() < top < runs.max() + np.ptp(runs)
