"""Pictures of scores: what is drawn, what is left out."""

import math

import pytest

from metrics.scoring.curves_table import study_curves
from metrics.scoring.plots import draw_scores
from metrics.scoring.study_scores import score_study
from metrics.scoring.table import ScoreTable
from tests.support.curve_tables import rows, table

PNG = b"\x89PNG"


def tables(*names, runs=((1.0, 2.0), (2.0, 2.0))):
    frame = table(
        rows(1, runs, interference_fraction=0.1),
        rows(4, runs, interference_fraction=0.2),
        rows(4, runs, criterion="none", criterion_value=0.0),
        rows(4, runs[::-1], criterion="noise", criterion_value=0.1),
    )
    (study,) = study_curves(frame.with_columns(frame["criterion"].fill_null("population_size")).fill_null(0.0))
    return [ScoreTable(policy=name, scenario="here", scores=score_study(study)[0]) for name in names]


def drawn(monkeypatch, path, given):
    """Draw, and return the figure that was saved."""
    from matplotlib.figure import Figure

    figures = []
    save = Figure.savefig

    def keep(self, *args, **kwargs):
        figures.append(self)
        save(self, *args, **kwargs)

    monkeypatch.setattr(Figure, "savefig", keep)
    draw_scores(given, path)
    return figures[0]


def test_one_panel_per_measure_and_one_line_per_policy(tmp_path, monkeypatch):
    given = tables("mine", "theirs")
    figure = drawn(monkeypatch, tmp_path / "scores.png", given)
    assert (tmp_path / "scores.png").read_bytes().startswith(PNG)
    titles = [axes.get_title() for axes in figure.axes if axes.axison]
    measures = dict.fromkeys(score.measure for score in given[0].scores)
    assert [title.split()[0] for title in titles] == list(measures)
    assert "raw_performance (higher is better)" in titles
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["mine", "theirs"]
    panel = next(axes for axes in figure.axes if axes.get_title().startswith("noise_robustness"))
    assert len(panel.containers) == 2
    assert panel.get_ylabel() == "objects (DTW)"
    summary = given[0]["noise_robustness"][0].summary
    (bar,) = panel.containers[0][2][0].get_segments()
    assert bar[:, 1].tolist() == pytest.approx([summary.lower, summary.upper])
    dotted = [line for line in panel.get_lines() if line.get_linestyle() == ":"]
    assert [line.get_ydata()[0] for line in dotted] == [given[0]["noise_robustness"][0].noise_floor] * 2


def test_single_runs_have_no_error_bars_and_other_formats_work(tmp_path):
    draw_scores(tables("mine", runs=((1.0, 2.0),)), tmp_path / "scores.svg")
    assert "<svg" in (tmp_path / "scores.svg").read_text()


def test_values_that_are_not_finite_are_left_out(tmp_path, monkeypatch):
    given = tables("mine", runs=((0.0, 0.0), (0.0, 0.0)))
    assert math.isnan(given[0]["scalability"][0].summary.mean)
    figure = drawn(monkeypatch, tmp_path / "scores.png", given)
    assert not any(axes.get_title().startswith("scalability") for axes in figure.axes)


def test_nothing_to_draw_is_refused(tmp_path):
    with pytest.raises(ValueError, match="Expected a score to draw"):
        draw_scores([ScoreTable(policy="mine", scenario="", scores=())], tmp_path / "scores.png")
