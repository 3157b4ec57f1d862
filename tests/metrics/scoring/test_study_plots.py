"""Figures of studies: what they show, and the numbers behind them."""

import re
from dataclasses import replace

import numpy as np
import polars as pl
import pytest

from metrics import CurveError, plot
from metrics.scoring import study_panels
from metrics.scoring.study_plots import caption, draw_figure, draw_forest, study_figures
from metrics.statistics import aggregate
from swarm_forage_env.studies.study_file import Axis
from tests.support.made_tables import FOUR, made_study, made_table
from tests.support.pictures import PNG, words_in

SIZES = Axis(name="population_size", values=(2, 4, 8))


def by_policy(place):
    return (4.0 + FOUR.index(place.policy)) * (1.0 + float(place.values[-1]))


def figures(*axes, lost=(), name="S1a", performance=by_policy, **changes):
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
        plot(made_table(made_study(), by_policy), tmp_path, formats=("gif",))
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
