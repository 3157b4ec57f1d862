"""The frame of scores: pairs of runs, shares, summaries, and which differences are certain."""

import math
from dataclasses import replace
from typing import Any

import numpy as np
import polars as pl
import pytest

import metrics
from metrics import waveform
from metrics.scoring.frame import SCHEMA, differences, scores, summarized, words_of
from metrics.scoring.plots import draw_scores
from metrics.scoring.run_curves import RunCurves, StudyCurves
from metrics.statistics import holm
from tests.support.curve_tables import IDEAL, SLOWED, rows, scored, throttled
from tests.support.pictures import keep_figures

NAN = math.nan


def test_one_row_per_run_and_students_interval_over_them():
    found = scored(rows(3, IDEAL), measures=["raw_performance"])
    assert found.columns == list(SCHEMA)
    assert dict(found.select("seed", "value").iter_rows()) == {0: 21.0, 1: 21.0, 2: 20.0}
    assert found["unit"].unique().to_list() == ["objects per run"]
    expected = metrics.aggregate([21.0, 21.0, 20.0])
    row = summarized(found).row(0, named=True)
    assert [row[name] for name in ("mean", "lower", "upper", "sd")] == [
        expected.mean,
        expected.lower,
        expected.upper,
        expected.std,
    ]
    assert (row["runs"], row["lost"], math.isnan(row["relative"])) == (3, 0, True)


def test_amounts_are_shares_of_the_performance_that_they_are_compared_with():
    found = scored(*throttled(), measures=["adaptability"])
    np.testing.assert_allclose(found["relative"], metrics.adaptability(IDEAL, SLOWED) / np.sum(IDEAL, axis=1))
    row = summarized(found).row(0, named=True)
    assert row["relative_floor"] == pytest.approx(metrics.noise_floor(IDEAL).mean() / np.sum(IDEAL, axis=1).mean())
    gains = scored(rows(2, SLOWED), rows(4, IDEAL), measures=["task_emergence"])
    np.testing.assert_allclose(gains["relative"], metrics.task_emergence(SLOWED, 2, IDEAL, 4, relative=True))


def test_the_excess_is_over_two_undisturbed_runs_and_beside_the_next_map_where_maps_differ():
    ideal, noisy = (
        RunCurves(criterion="noise", value=value, n_robots=1, seeds=(0, 1, 2), curves={"performance": np.array(values)})
        for value, values in ((0.0, [[4.0], [6.0], [5.0]]), (1.0, [[1.0], [3.0], [9.0]]))
    )

    def found(*runs):
        return scores([StudyCurves(controller="p", experiments=runs, t_end_s=None)], ["noise_robustness"])[0]

    same = found(ideal, noisy)  # distances 3, 3, 4; between undisturbed runs 2, 1, 1
    assert same.select("value", "excess").rows() == [(3.0, 1.0), (3.0, 2.0), (4.0, 3.0)]
    assert same["floor"][0] == pytest.approx(4.0 / 3.0)
    own = found(*(replace(runs, maps_differ=True) for runs in (ideal, noisy)))  # 4 to 3, 6 to 9, 5 to 1
    assert own["excess"].to_list() == [1.0 - 2.0, 3.0 - 1.0, 4.0 - 1.0]
    assert own["floor"].null_count() == 3


def test_doing_nothing_is_not_praised():
    found = summarized(scored(*throttled([[0.0] * 4] * 2, [[0.0] * 4] * 2), measures=["adaptability"]))
    assert found.select("mean", "idle").rows() == [(0.0, 2)]
    assert math.isnan(found["relative"][0])


def test_undefined_and_infinite_scalability_is_counted():
    found = scored(rows(2, [[0.0], [1.0], [2.0]]), rows(4, [[0.0], [0.0], [3.0]]), measures=["scalability"])
    assert summarized(found).select("runs", "undefined").rows() == [(2, 1)]


def lossy(n_planned: int | None, seeds: tuple[int, ...]) -> StudyCurves:
    """A study of two sizes, of which the larger has lost runs."""
    whole, larger = (
        RunCurves(
            criterion="population_size",
            value=float(n),
            n_robots=n,
            seeds=of,
            curves={"performance": np.ones((len(of), 2))} if of else {},
            n_planned=n_planned,
        )
        for n, of in ((1, (0, 1, 2)), (4, seeds))
    )
    return StudyCurves(controller="mine", experiments=(whole, larger), t_end_s=np.array([1.0, 2.0]))


@pytest.mark.parametrize("n_planned", [3, None])
def test_runs_without_a_partner_are_counted(n_planned):
    found, _ = scores([lossy(n_planned, (0, 2))], ["task_emergence"])
    assert found["seed"].to_list() == [0, 2]
    assert found["lost"].to_list() == [1, 1]


def test_a_level_without_a_run_keeps_its_row():
    found, missing = scores([lossy(3, ())], ["raw_performance", "scalability"])
    assert missing == {}
    told = summarized(found).select("x", "runs", "lost").rows()
    assert told == [(1.0, 3, 0), (4.0, 0, 3), (4.0, 0, 3)]


def frame(**policies: Any) -> pl.DataFrame:
    """Scores made by hand: policy -> values by seed at N = 4, or level -> such values."""
    parts: list[dict[str, Any]] = []
    for policy, levels in policies.items():
        for (measure, at), values in (
            levels if isinstance(levels, dict) else {("raw_performance", "N = 4"): levels}
        ).items():
            given = values if isinstance(values, tuple) else (values, [None] * len(values))
            parts += [
                {"policy": policy, "measure": measure, "variant": "corrected", "form": "marginal", "at": at, "x": 4.0}
                | {"criterion": "population_size", "n_robots": 4, "seed": seed, "value": value, "relative": share}
                for seed, (value, share) in enumerate(zip(*given, strict=True))
                if value is not None
            ]
    return pl.DataFrame(parts, schema={name: SCHEMA[name] for name in parts[0]})


def test_differences_pair_runs_by_seed():
    found = differences(frame(a=[5.0, 7.0, None, 9.0], b=[3.0, 4.0, 100.0]))
    assert found.select("difference", "pairs").rows() == [(2.5, 2)]


@pytest.mark.parametrize(("measure", "better"), [("raw_performance", "a"), ("adaptability", "b"), ("scalability", "a")])
def test_the_better_policy_is_named_by_the_direction_of_the_measure(measure, better):
    high, low = [10.0, 11.0, 10.5, 10.2], [1.0, 1.2, 0.9, 1.1]
    assert differences(frame(a={(measure, "x"): high}, b={(measure, "x"): low}))["better"].to_list() == [better]
    assert differences(frame(a=[1.0, 2.0, 3.0], b=[2.0, 1.0, 3.5]))["better"].to_list() == [""]


def test_the_correction_is_over_levels_and_pairs_of_a_measure_and_nothing_else():
    rng = np.random.default_rng(1)
    made = {name: [rng.normal(size=6).tolist() for _ in range(2)] for name in "abc"}
    found = differences(
        frame(
            **{
                name: {
                    ("raw_performance", "N = 2"): runs[0],
                    ("raw_performance", "N = 4"): runs[1],
                    ("scalability", "N = 4"): runs[0],
                }
                for name, runs in made.items()
            }
        )
    )
    for measure, n_tests in (("raw_performance", 6), ("scalability", 3)):
        mine = found.filter(measure=measure)
        assert len(mine) == n_tests
        np.testing.assert_allclose(mine["p_holm"], holm(mine["p"].to_numpy()))
    against = differences(frame(a=made["a"][0], b=made["b"][0], c=made["c"][0]), [("a", "c"), ("b", "c")])
    assert against.select("first", "second").rows() == [("a", "c"), ("b", "c")]
    np.testing.assert_allclose(against["p_holm"], holm(against["p"].to_numpy()))


def test_nobody_is_better_by_a_difference_that_the_correction_takes_away():
    clear, nothing, zero = [1.0, 1.6, 0.4, 1.2], [0.1, -0.1, 0.2, -0.2], [0.0] * 4
    levels = [("raw_performance", f"N = {n}") for n in range(4, 9)]
    found = differences(
        frame(a=dict(zip(levels, [clear, *[nothing] * 4], strict=True)), b=dict.fromkeys(levels, zero))
    ).row(0, named=True)
    assert found["p"] <= 0.05 < found["p_holm"]
    assert found["better"] == ""


def test_shares_are_tested_on_their_own():
    level = ("adaptability", "throttle 0.3")
    found = differences(
        frame(
            a={level: ([10.0, 11.0, 12.0], [0.5, 0.6, 0.4])},
            b={level: ([1.0, 2.2, 2.9], [0.4, 0.6, 0.5])},
        )
    )
    assert found.select("is_relative", "better").rows() == [(False, "b"), (True, "")]
    assert found["p_holm"].to_list() == found["p"].to_list(), "each is the only test of its family"


def test_undefined_runs_do_not_count_and_infinite_ones_forbid_the_test():
    assert differences(frame(a=[1.0, NAN, 3.0], b=[0.0, 1.0, 1.5]))["pairs"].to_list() == [2]
    found = differences(frame(a=[1.0, -math.inf], b=[0.0, 1.0])).row(0, named=True)
    assert math.isnan(found["p"])
    assert found["better"] == ""


def summary(*names):
    runs = (1.0, 2.0), (2.0, 2.0)
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
