"""Plots: what their labels say, and that legends hide nothing."""

import pytest

pytest.importorskip("matplotlib")

from matplotlib.figure import Figure

from swarm_forage_env.rendering.plots import draw_trainings


@pytest.fixture
def drawn(monkeypatch):
    """Figures in the order in which they would be written."""
    figures: list[Figure] = []
    monkeypatch.setattr(Figure, "savefig", lambda figure, path, **_: figures.append(figure))
    return figures


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
    assert [text.get_text() for text in legend.get_texts()] == ["mine", "crw"]
    assert not any(legend.get_window_extent().overlaps(axes.get_window_extent()) for axes in figure.axes)
