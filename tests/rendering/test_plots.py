"""Plots: what their labels say, and that legends hide nothing."""

import numpy as np
import pytest

pytest.importorskip("matplotlib")

from swarm_forage_env.rendering.plots import MapRow, draw_maps
from tests.support.pictures import keep_figures


@pytest.fixture
def drawn(monkeypatch, tmp_path):
    """Figures in the order in which they would be painted."""
    monkeypatch.chdir(tmp_path)
    return keep_figures(monkeypatch)


def maps_drawn(drawn):
    few, many = np.array([[0.0, 1.0]]), np.array([[0.0, 10.0]])
    rows = [
        MapRow("few", {"density": few}, False, (2.0, 1.0), ()),
        MapRow("many", {"density": many}, False, (2.0, 1.0), ()),
        MapRow("many minus few", {"density": many - few}, True, (2.0, 1.0), ()),
        MapRow("few minus many", {"density": 0.5 * (few - many)}, True, (2.0, 1.0), ()),
    ]
    draw_maps("unused.png", rows, {"density": ("robots", "per m²")})
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
