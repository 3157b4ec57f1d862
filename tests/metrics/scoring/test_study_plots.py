"""Figures of studies: what they show, and the numbers behind them."""

from xml.etree import ElementTree as ET

import numpy as np
import pytest

from metrics.scoring import study_panels
from metrics.scoring.study_plots import draw_figure, draw_map, limit_height, study_figures
from metrics.statistics import aggregate
from swarm_forage_env.study.studies import Axis
from tests.support.made_tables import FOUR, made_study, made_table

WALKING = Axis(name="walk_probability", values=(0.0, 0.3))
SIZES = Axis(name="population_size", values=(2, 4, 8))


def by_policy(cell):
    return (4.0 + FOUR.index(cell.policy)) * (1.0 + float(cell.values[-1]))


def figures(*axes, lost=(), name="S1a", **changes):
    return study_figures(study_panels(made_table(made_study(name, *axes, **changes), by_policy, lost=lost)))


def texts(path):
    """The words in a picture; matplotlib notes them beside the outlines of their letters."""
    return path.read_text()


def test_a_study_has_a_figure_per_measure_and_reading():
    names = [figure.name for figure in figures(readings=("described", "program"))]
    assert names[:3] == [
        "S1a_raw_performance_described",
        "S1a_spatial_emergence_interactive_described",
        "S1a_spatial_emergence_described",
    ]
    assert len(names) == 10


def test_the_numbers_behind_a_figure():
    spec = made_study()
    first = spec.cells[0]
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
    assert files[1].read_bytes().startswith(b"\x89PNG")
    drawn = texts(files[0])
    assert ET.fromstring(drawn).tag.endswith("svg")
    for word in (*FOUR, "<!-- robots -->", "<!-- objects in 40 s -->", "S1a: raw performance (higher is better)"):
        assert word in drawn
    assert ("95 % interval" in drawn) == (band == "ci")
    again = tmp_path / "again.svg"
    draw_figure(figure, [again], band=band)
    assert again.read_bytes() == files[0].read_bytes()


def test_many_dots_are_an_image_in_vector_pictures(tmp_path):
    few, many = (figures(seeds=tuple(range(n)))[0] for n in (6, 60))
    for name, figure in (("few", few), ("many", many)):
        draw_figure(figure, [tmp_path / f"{name}.svg"])
    assert "<image" not in texts(tmp_path / "few.svg")
    assert "<image" in texts(tmp_path / "many.svg")


def test_one_level_is_drawn(tmp_path):
    figure = figures(Axis(name="population_size", values=(2,)))[0]
    assert not figure.has_map
    draw_figure(figure, [tmp_path / "one.svg"])
    assert "<!-- 2 -->" in texts(tmp_path / "one.svg")


def test_two_axes_give_a_panel_per_value_and_a_map(tmp_path):
    figure = figures(WALKING, SIZES, name="S2a")[0]
    assert [panel.others for panel in figure.panels] == [{"walk_probability": 0.0}, {"walk_probability": 0.3}]
    draw_figure(figure, [tmp_path / "panels.svg"])
    assert "walk probability 0.3" in texts(tmp_path / "panels.svg")
    assert figure.has_map
    draw_map(figure, [tmp_path / "map.svg"])
    drawn = texts(tmp_path / "map.svg")
    mean = np.mean(figure.panels[1].scores["stochx"][2])
    assert f"<!-- {mean:.4g} -->" in drawn
    assert all(word in drawn for word in (*FOUR, "<!-- walk probability -->"))


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
    assert study_figures(study_panels(made_table(words, lambda cell: 1.0))) == ()
    spec = made_study()
    assert figures(lost={(cell, seed) for cell in spec.cells for seed in spec.seeds}) == ()


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
