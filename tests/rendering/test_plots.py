"""Plots: what their labels say, and that legends hide nothing."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from swarm_forage_env.rendering.figures import FigureStyle
from swarm_forage_env.rendering.plots import MapRow, draw_maps, draw_trainings
from tests.support.pictures import keep_figures


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """Figures in the order in which they would be painted."""
    monkeypatch.chdir(tmp_path)
    return keep_figures(monkeypatch)


def draw(stage_ends):
    draw_trainings(
        "unused.png",
        {"mine": ([1000, 2000], [1.0, 9.0], [0.5, 0.1])},
        beside={"crw": (8.0, 0.2)},
        stage_ends=stage_ends,
        title="a training",
        ylabel="deliveries",
    )


def test_stages_are_explained_where_there_are_some(drawn):
    draw(stage_ends=())
    draw(stage_ends=(1500, 2000))
    without, with_stages = ("new stage" in figure.axes[1].get_xlabel() for figure in drawn)
    assert (without, with_stages) == (False, True)


def test_the_legend_of_trainings_stands_beside_the_axes(drawn):
    draw(stage_ends=())
    (figure,) = drawn
    figure.draw_without_rendering()
    (legend,) = figure.legends
    assert [text.get_text() for text in legend.get_texts()] == ["mine", "CRW"]
    assert not any(legend.get_window_extent().overlaps(axes.get_window_extent()) for axes in figure.axes)


def maps_drawn(drawn, **options):
    few, many = np.array([[0.0, 1.0]]), np.array([[0.0, 10.0]])
    rows = [
        MapRow("few", {"density": few}, False, (2.0, 1.0), ()),
        MapRow("many", {"density": many}, False, (2.0, 1.0), ()),
        MapRow("many minus few", {"density": many - few}, True, (2.0, 1.0), ()),
        MapRow("few minus many", {"density": 0.5 * (few - many)}, True, (2.0, 1.0), ()),
    ]
    draw_maps("unused.png", rows, {"density": ("robots", "per m²")}, **options)
    axes = [axes for axes in drawn[-1].axes if axes.get_images()]
    return axes, [axes.get_images()[0].get_clim() for axes in axes]


def test_maps_of_one_quantity_have_one_scale_and_differences_a_symmetric_one(drawn):
    _, scales = maps_drawn(drawn)
    assert scales[0] == scales[1] == pytest.approx((0.0, 10.0), rel=0.02)
    assert scales[2] == scales[3] == pytest.approx((-9.0, 9.0), rel=0.02)


def test_maps_show_squares_where_something_is_and_outline_nests(drawn):
    crowd = np.zeros((10, 20))
    crowd[2, 5] = 1.0
    row = MapRow(
        "few", {"density": crowd, "drops": np.ones((10, 20))}, False, (40.0, 20.0), (), ((2.0, 4.0, 6.0, 16.0),)
    )
    draw_maps("unused.png", [row], {"density": ("robots", "per m²"), "drops": ("drops", "per m²")})
    part, whole = [axes for axes in drawn[-1].axes if axes.get_images()]
    assert (whole.get_xlim(), whole.get_ylim()) == ((0.0, 40.0), (0.0, 20.0))
    (x_low, x_high), (y_low, y_high) = part.get_xlim(), part.get_ylim()
    assert x_low < 10.0 < 12.0 < x_high < 20.0
    assert y_low < 4.0 < 6.0 < y_high < 10.0
    assert (x_high - x_low) / (y_high - y_low) == pytest.approx(2.0)
    assert part.get_images()[0].get_array().mask.sum() == 199
    assert [patch.get_linestyle() for patch in whole.patches] == ["--"]


def test_narrow_maps_stand_below_each_other(drawn):
    row = MapRow("few", {name: np.ones((4, 4)) for name in "abcd"}, False, (8.0, 8.0))
    columns = {name: (name, "per m²") for name in "abcd"}
    draw_maps("unused.png", [row], columns, style=FigureStyle(width_in=3.5, font_size=8))
    places = [axes.get_subplotspec() for axes in drawn[-1].axes if axes.get_images()]
    assert [(place.rowspan.start, place.colspan.start) for place in places] == [(0, 0), (0, 1), (1, 0), (1, 1)]


def test_maps_tell_their_units(drawn):
    axes, _ = maps_drawn(drawn)
    assert {(one.get_xlabel(), one.get_ylabel()) for one in axes} == {("x [m]", "y [m]")}
    bars = [one.get_images()[0].colorbar.ax.get_ylabel() for one in axes]
    assert bars == ["per m²", "per m²", "more per m²", "more per m²"]
    assert axes[0].get_images()[0].get_extent() == [0, 2.0, 0, 1.0]
