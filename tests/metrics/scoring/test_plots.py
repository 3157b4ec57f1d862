"""Pictures of scores: what is drawn, what is left out."""

import math
from dataclasses import replace

import numpy as np
import pytest

from metrics import ScoreForms, waveform
from metrics.scoring.curves_file import study_curves
from metrics.scoring.measures import score_study
from metrics.scoring.plots import draw_scores
from metrics.scoring.score_tables import ScoreTable
from metrics.scoring.scores import MEASURE_CRITERIA, PICTURED, words_of
from tests.support.curve_tables import rows, table
from tests.support.pictures import PNG, keep_figures


def tables(*names, runs=((1.0, 2.0), (2.0, 2.0))):
    frame = table(
        rows(1, runs, interference_fraction=0.1),
        rows(4, runs, interference_fraction=0.2),
        rows(4, runs, criterion="none", criterion_value=0.0),
        rows(4, runs[::-1], criterion="noise", criterion_value=0.1),
    )
    (study,) = study_curves(frame.with_columns(frame["criterion"].fill_null("population_size")).fill_null(0.0))
    return [ScoreTable(policy=name, scenario="here", scores=score_study(study)[0]) for name in names]


def drawn(monkeypatch, path, given, **options):
    """Draw, and return the figure that was saved, unpainted."""
    figures = keep_figures(monkeypatch)
    draw_scores(given, path, **options)
    return figures[0]


def panel_of(figure, title):
    return next(axes for axes in figure.axes if axes.get_title().startswith(f"{title} ("))


def test_one_panel_per_measure_and_one_line_per_policy(tmp_path, monkeypatch):
    given = tables("mine", "theirs")
    draw_scores(given, tmp_path / "scores.png")
    assert (tmp_path / "scores.png").read_bytes().startswith(PNG)
    figure = drawn(monkeypatch, tmp_path / "scores.png", given)
    titles = [axes.get_title().partition(" (")[0] for axes in figure.axes if axes.axison]
    assert titles == [words_of(measure) for measure in dict.fromkeys(score.measure for score in given[0].scores)]
    assert panel_of(figure, "time lost").get_ylabel() == "t_lost(N, t), share of robot time"
    assert [text.get_text() for text in figure.legends[0].get_texts()] == ["mine", "theirs"]
    panel = panel_of(figure, "noise robustness")
    assert len(panel.containers) == 2
    assert panel.get_ylabel() == "B_sa, share of performance"
    summary = given[0]["noise_robustness"][0].relative
    (bar,) = panel.containers[0][2][0].get_segments()
    assert bar[:, 1].tolist() == pytest.approx([summary.mean] * 2)  # of two runs there is no interval
    dotted = [line for line in panel.get_lines() if line.get_linestyle() == ":"]
    assert [line.get_ydata()[0] for line in dotted] == [given[0]["noise_robustness"][0].relative_floor] * 2


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


def test_of_all_measures_the_usual_nine_are_drawn(tmp_path, monkeypatch):
    (given,) = tables("mine")
    some = given["scalability"][0]
    every = [replace(some, measure=measure) for measure in MEASURE_CRITERIA]
    figure = drawn(monkeypatch, tmp_path / "scores.png", [replace(given, scores=tuple(every))])
    titles = [axes.get_title().partition(" (")[0] for axes in figure.axes if axes.axison]
    assert titles == [words_of(measure) for measure in MEASURE_CRITERIA if measure in PICTURED]
    assert len(titles) == 9


def test_bands_are_two_standard_deviations_wide_and_drawn_on_request_only(tmp_path, monkeypatch):
    (given,) = tables("mine", runs=((1.0, 2.0), (2.0, 4.0), (1.5, 2.5), (3.0, 3.5)))
    for band in (True, False):
        monkeypatch.undo()
        figure = drawn(monkeypatch, tmp_path / "scores.png", [given], band=band)
        shades = panel_of(figure, "efficiency").collections[1:]  # the first are error bars
        assert len(shades) == band
        if band:
            heights = shades[0].get_paths()[0].vertices[:, 1]
            lowest, highest = zip(*(score.band for score in given["efficiency"]), strict=True)
            assert [heights.min(), heights.max()] == pytest.approx([min(lowest), max(highest)])


def test_values_that_mislead_have_hollow_marks(tmp_path, monkeypatch):
    frame = table(
        rows(1, [[1.0], [2.0]], interference_fraction=0.1),
        rows(4, [[8.0], [9.0]], interference_fraction=0.2),
        rows(8, [[2.0], [3.0]], interference_fraction=0.6),
    )
    (study,) = study_curves(frame)
    given = ScoreTable(policy="mine", scenario="", scores=score_study(study, ["spatial_emergence"])[0])
    panel = panel_of(drawn(monkeypatch, tmp_path / "scores.png", [given]), "spatial emergence")
    (hollow,) = [line for line in panel.get_lines() if line.get_markerfacecolor() == "w"]
    assert hollow.get_ydata().tolist() == [given.scores[1].relative.mean]


def test_variants_and_forms_have_panels_of_their_own(tmp_path, monkeypatch):
    frame = table(*(rows(n, [[1.0 * n]], interference_fraction=0.1) for n in (1, 2, 4)))
    (study,) = study_curves(frame)
    forms = ScoreForms(variants=("corrected", "paper"), forms=("marginal", "interactive"))
    given = ScoreTable(policy="mine", scenario="", scores=score_study(study, ["scalability"], forms)[0])
    figure = drawn(monkeypatch, tmp_path / "scores.png", [given])
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
    (study,) = study_curves(table(ideal, *levels))
    given = ScoreTable(policy="mine", scenario="", scores=score_study(study, ["reactivity"])[0])
    figure = drawn(monkeypatch, tmp_path / "scores.png", [given])
    panel = panel_of(figure, "reactivity")
    assert [text.get_text() for text in panel.get_xticklabels()] == ["7.4 (0.15)", "19.4 (0.4)"]
    assert " ".join(panel.get_xlabel().split()) == "distance from ideal conditions, DTW(I_ec, V) (amplitude)"
