"""Pictures of scores: what is drawn, what is left out."""

import numpy as np
import polars as pl
import pytest

from metrics import MEASURES, waveform
from metrics.scoring.frame import summarized, words_of
from metrics.scoring.measures import PICTURED
from metrics.scoring.plots import draw_scores
from swarm_forage_env.rendering.figures import FigureStyle
from tests.support.curve_tables import rows, scored
from tests.support.pictures import keep_figures


def summary(*names, runs=((1.0, 2.0), (2.0, 2.0))):
    common = {"criterion": "population_size", "criterion_value": 0.0, "interference_fraction": 0.1}
    parts = [
        rows(n, made, **{**common, "controller": name, **how})
        for name in names
        for n, made, how in (
            (1, runs, {}),
            (4, runs, {"interference_fraction": 0.2}),
            (4, runs, {"criterion": "none"}),
            (4, runs[::-1], {"criterion": "noise", "criterion_value": 0.1}),
        )
    ]
    return summarized(scored(*parts))


def drawn(monkeypatch, path, given, **options):
    """Draw, and return the figure that was saved, unpainted."""
    figures = keep_figures(monkeypatch)
    draw_scores(given, path, **options)
    return figures[0]


def panel_of(figure, title):
    return next(axes for axes in figure.axes if axes.get_title().startswith(f"{title} ("))


def test_one_panel_per_measure_and_one_line_per_policy(tmp_path, monkeypatch):
    given = summary("mine", "theirs", "absent").filter((pl.col("policy") != "absent") | (pl.col("measure") == "none"))
    draw_scores(given, tmp_path / "scores.svg")
    assert "<svg" in (tmp_path / "scores.svg").read_text()
    figure = drawn(monkeypatch, tmp_path / "scores.png", given)
    titles = [axes.get_title().partition(" (")[0] for axes in figure.axes if axes.axison]
    assert titles == [words_of(name) for name in given["measure"].unique(maintain_order=True)]
    assert panel_of(figure, "time lost").get_ylabel() == "share of robot time"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["mine", "theirs"]
    panel = panel_of(figure, "noise robustness")
    assert panel.get_ylabel() == "share of performance"
    row = given.filter(measure="noise_robustness").row(0, named=True)
    (bar,) = panel.containers[0][2][0].get_segments()
    assert bar[:, 1].tolist() == pytest.approx([row["relative"]] * 2)  # of two runs there is no interval
    dotted = [line for line in panel.get_lines() if line.get_linestyle() == ":"]
    assert [line.get_ydata()[0] for line in dotted] == [row["relative_floor"]] * 2
    assert not any("Poly" in type(part).__name__ for part in panel.collections), "floors are lines"
    assert not [
        each for each in panel.collections if each not in {part for bars in panel.containers for part in bars[2]}
    ]


def test_bars_of_shares_reach_to_the_ends_of_their_intervals(tmp_path, monkeypatch):
    runs = ((1.0, 2.0), (2.0, 2.0), (2.0, 3.0), (1.0, 4.0))
    given = summary("mine", runs=runs).filter(measure="noise_robustness")
    (panel,) = drawn(monkeypatch, tmp_path / "scores.png", given).axes
    (bar,) = panel.containers[0][2][0].get_segments()
    assert bar[:, 1].tolist() == pytest.approx([*given.select("relative_lower", "relative_upper").row(0)])


@pytest.mark.parametrize("n_policies", [1, 2, 9])
def test_marks_stand_at_their_level_or_a_tenth_beside_it(n_policies, tmp_path, monkeypatch):
    given = summary(*(f"p{k}" for k in range(n_policies))).filter(measure="raw_performance")
    (panel,) = drawn(monkeypatch, tmp_path / "scores.png", given).axes
    x = np.array([bars[0].get_xdata() for bars in panel.containers])
    assert x.shape == (n_policies, 2)
    assert np.abs(x - [0.0, 1.0]).max() <= 0.1 + 1e-9
    assert x.mean(axis=0) == pytest.approx([0.0, 1.0], abs=1e-12)


def test_panels_of_a_narrow_figure_keep_their_room_under_a_long_title(tmp_path, monkeypatch):
    given = summary("mine", "theirs").filter(pl.col("measure").is_in(["raw_performance", "scalability"]))

    def heights(title):
        monkeypatch.undo()
        figure = drawn(monkeypatch, tmp_path / "scores.png", given, title=title, style=FigureStyle(width_in=3.4))
        figure.draw_without_rendering()
        return [axes.get_window_extent().height for axes in figure.axes]

    assert heights("a long title " * 12) == pytest.approx(heights("short"), rel=0.1)


def test_values_that_are_not_finite_are_left_out(tmp_path, monkeypatch):
    given = summary("mine", runs=((0.0, 0.0), (0.0, 0.0)))
    assert given.filter(measure="scalability")["mean"].is_nan().all()
    figure = drawn(monkeypatch, tmp_path / "scores.png", given)
    assert not any(axes.get_title().startswith("scalability") for axes in figure.axes)


def test_nothing_to_draw_is_refused(tmp_path):
    with pytest.raises(ValueError, match="Expected a score to draw"):
        draw_scores(summary("mine").clear(), tmp_path / "scores.png")


def test_of_all_measures_the_usual_nine_are_drawn(tmp_path, monkeypatch):
    some = summary("mine").filter(measure="scalability")
    every = pl.concat([some.with_columns(measure=pl.lit(name)) for name in MEASURES])
    figure = drawn(monkeypatch, tmp_path / "scores.png", every)
    titles = [axes.get_title().partition(" (")[0] for axes in figure.axes if axes.axison]
    assert titles == [words_of(name) for name in MEASURES if name in PICTURED]
    assert len(titles) == 9


def test_values_that_mislead_have_hollow_marks(tmp_path, monkeypatch):
    given = summarized(
        scored(
            rows(1, [[1.0], [2.0]], interference_fraction=0.1),
            rows(4, [[8.0], [9.0]], interference_fraction=0.2),
            rows(8, [[2.0], [3.0]], interference_fraction=0.6),
            measures=["spatial_emergence"],
        )
    )
    panel = panel_of(drawn(monkeypatch, tmp_path / "scores.png", given), "spatial emergence")
    (hollow,) = [line for line in panel.get_lines() if line.get_markerfacecolor() == "w"]
    assert hollow.get_ydata().tolist() == [given["relative"][1]]


def test_variants_and_forms_have_panels_of_their_own(tmp_path, monkeypatch):
    given = summarized(
        scored(
            *(rows(n, [[1.0 * n]], interference_fraction=0.1) for n in (1, 2, 4)),
            measures=["scalability"],
            variants=["corrected", "paper"],
            forms=["marginal", "interactive"],
        )
    )
    figure = drawn(monkeypatch, tmp_path / "scores.png", given)
    lone = "scalability, against lone robots"
    names = ["scalability", lone, "scalability, paper", f"{lone}, paper"]
    assert [axes.get_title().replace("\n", " ") for axes in figure.axes] == [
        f"{name} (higher is better)" for name in names
    ], "long ones are wrapped"


def test_the_x_axis_of_flexibility_is_the_distance_of_the_conditions(tmp_path, monkeypatch):
    ends = np.arange(1000, 50_001, 1000)
    levels = [
        rows(5, [[1.0] * 50], criterion="throttle", criterion_value=a, adversity=0.2, throttle=wave.tolist())
        for a in (0.15, 0.40)
        for wave in (waveform("square", ends, frequency=4e-5, amplitude=a, offset=a),)
    ]
    ideal = rows(5, [[1.0] * 50], criterion="throttle", criterion_value=0.0, adversity=0.1, throttle=0.1)
    given = summarized(scored(ideal, *levels, measures=["reactivity"]))
    figure = drawn(monkeypatch, tmp_path / "scores.png", given)
    panel = panel_of(figure, "reactivity")
    assert [text.get_text() for text in panel.get_xticklabels()] == ["7.4 (0.15)", "19.4 (0.4)"]
    assert " ".join(panel.get_xlabel().split()) == "distance from ideal conditions (amplitude)"
