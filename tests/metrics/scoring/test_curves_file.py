"""Curves of others: tables of many forms become the same arrays, and a wrong one gets one line that says where."""

import re
from pathlib import Path

import polars as pl
import pytest

from metrics import CurveError, PopulationRates
from metrics.scoring.curves_file import read_curves, study_curves
from tests.support.curve_tables import CROWDING, rows, table

TWO_SIZES = table(rows(1, [[1.5, 2.0], [3.0, 1.0]]), rows(4, [[5.0, 6.5], [7.0, 8.0]]))


def only(frame, **how):
    (study,) = study_curves(frame, **how)
    return study


def by_size(study):
    return {runs.n_robots: runs.performance.tolist() for runs in study.sizes()}


def written(place, name, text):
    file = place / name
    file.write_bytes(text if isinstance(text, bytes) else text.encode())
    return file


PLAIN = "n_robots,seed,interval,performance\n1,0,0,1.5\n1,0,1,2\n4,0,0,5\n4,0,1,6.5\n"
FORMS = {
    "plain.csv": PLAIN,
    "semicolons.csv": PLAIN.replace(",", ";").replace(".", ","),
    "tabs.tsv": PLAIN.replace(",", "\t"),
    "decimal_commas_and_tabs.txt": PLAIN.replace(",", "\t").replace(".", ","),
    "mark_and_carriage_returns.csv": ("\ufeff" + PLAIN).replace("\n", "\r\n"),
    "spaces_and_empty_lines.csv": "\n" + PLAIN.replace(",", " , ").replace("\n", "\n\n"),
    "quotes.csv": re.sub(r"(\w+(\.5)?)", r'"\1"', PLAIN),
    "shuffled.csv": "n_robots,seed,interval,performance\n4,0,1,6.5\n1,0,1,2\n4,0,0,5\n1,0,0,1.5\n",
    "counted_from_1.csv": "n_robots,seed,interval,performance\n1,0,1,1.5\n1,0,2,2\n4,0,1,5\n4,0,2,6.5\n",
}


@pytest.mark.parametrize("name", FORMS)
def test_texts_of_many_forms_are_the_same_curves(tmp_path, name):
    (study,) = read_curves(written(tmp_path, name, FORMS[name]))
    assert by_size(study) == {1: [[1.5, 2.0]], 4: [[5.0, 6.5]]}
    assert (study.controller, study.note, study.t_end_s) == (Path(name).stem, "", None)


def test_parquet_is_read(tmp_path):
    TWO_SIZES.write_parquet(tmp_path / "curves.parquet")
    (study,) = read_curves(tmp_path / "curves.parquet")
    assert by_size(study) == {1: [[1.5, 2.0], [3.0, 1.0]], 4: [[5.0, 6.5], [7.0, 8.0]]}


def test_columns_have_other_names_or_one_value():
    frame = TWO_SIZES.filter(seed=0).rename({"n_robots": "swarm", "performance": "items"}).drop("seed")
    named = {"n_robots": "swarm", "performance": "items", "seed": "7"}
    assert by_size(only(frame, columns=named)) == {1: [[1.5, 2.0]], 4: [[5.0, 6.5]]}
    assert only(frame, columns=named).experiments[0].seeds == (7,)


def test_performance_is_another_column_or_its_inverse():
    frame = TWO_SIZES.filter(n_robots=1, seed=0).with_columns(wait=pl.Series([4.0, 0.0]))
    assert by_size(only(frame, columns={"performance": "wait"})) == {1: [[4.0, 0.0]]}
    inverse = only(frame, columns={"performance": "1/wait"})
    assert by_size(inverse) == {1: [[0.25, 0.0]]}
    assert not inverse.read_as.adds_up


def test_experiments_and_policies_are_told_apart():
    frame = table(
        rows(5, [[3.0]], criterion="none", controller="a"),
        rows(5, [[4.0]], criterion="noise", criterion_value=0.1, controller="a"),
        rows(5, [[5.0]], criterion="noise", criterion_value=0.2, controller="a"),
        rows(5, [[2.0]], criterion="throttle", criterion_value=0.0, controller="a"),
        rows(5, [[6.0]], criterion="throttle", criterion_value=0.4, controller="a"),
        rows(1, [[7.0]], criterion="population_size", controller="b"),
    )
    a, b = study_curves(frame.sample(fraction=1.0, shuffle=True, seed=3).sort("controller"))
    assert (a.controller, b.controller) == ("a", "b")
    assert [(base.criterion, runs.performance.item()) for base, runs in a.levels("noise")] == [
        ("none", 4.0),
        ("none", 5.0),
    ]
    assert [(base.criterion, base.value) for base, _ in a.levels("throttle")] == [("throttle", 0.0)]


def test_columns_of_some_experiments_are_there_for_those_only():
    frame = table(
        rows(2, [[1.0, 2.0]], criterion="none"),
        rows(2, [[1.0, 2.0]], criterion="throttle", criterion_value=0.2, adversity=[0.0, 0.4], deaths_per_s=0.01),
    )
    undisturbed, throttled = only(frame).experiments
    assert (undisturbed.curves.keys(), undisturbed.rates) == ({"performance"}, None)
    assert throttled.curves["adversity"].tolist() == [[0.0, 0.4]]
    assert throttled.rates == PopulationRates(lambda_d=0.01)


def test_longer_runs_are_cut_and_it_is_said():
    study = only(table(rows(1, [[1.0, 2.0, 3.0]]), rows(2, [[4.0, 5.0]])))
    assert by_size(study) == {1: [[1.0, 2.0]], 2: [[4.0, 5.0]]}
    assert study.note == "runs have from 2 to 3 intervals and are cut to the first 2"


def test_all_runs_have_one_clock():
    ends = {"t_end_s": [5.0, 10.0]}
    parts = rows(1, [[1.0, 3.0]], **ends), rows(2, [[4.0, 6.0]], **ends)
    assert only(table(*parts)).t_end_s.tolist() == only(table(*parts), interval_s=5.0).t_end_s.tolist() == [5.0, 10.0]
    assert only(TWO_SIZES, interval_s=10.0).horizon_s == 20.0
    with pytest.raises(CurveError, match="one that ends at 5 s and one at 10 s; bring the runs to one clock"):
        study_curves(table(*parts, rows(4, [[1.0, 2.0]], t_end_s=[10.0, 20.0])))
    with pytest.raises(CurveError, match="one that ends at 5 s and one at 2 s"):
        study_curves(table(*parts), interval_s=2.0)


LOG = pl.DataFrame({"n_robots": [2, 2, 2, 1, 1], "seed": 0, "time_s": [12.0, 3.0, 40.0, 0.0, 25.0]})


def test_deliveries_are_counted_in_intervals():
    study = only(LOG, events=True, interval_s=10.0)
    assert by_size(study) == {1: [[1.0, 0.0, 1.0, 0.0]], 2: [[1.0, 1.0, 0.0, 1.0]]}
    assert study.t_end_s.tolist() == [10.0, 20.0, 30.0, 40.0]
    assert study.note.startswith("deliveries are counted in 4 intervals of 10 s; all runs are taken to last 40 s")
    amounts = LOG.with_columns(performance=pl.Series([1.0, 2.0, 0.0, 0.5, 1.0]))
    assert by_size(only(amounts, events=True, interval_s=40.0)) == {1: [[1.5]], 2: [[3.0]]}


def in_row(frame, row, **cells):
    """Change cells of one row, counted from 1."""
    is_row = pl.int_range(1, pl.len() + 1) == row
    return frame.with_columns(
        pl.when(is_row).then(pl.lit(value)).otherwise(pl.col(name)).alias(name) for name, value in cells.items()
    )


LEVELS = table(rows(5, [[2.0]], criterion="none"), rows(5, [[1.0]], criterion="noise", criterion_value=0.4))
BAD_TABLES = {
    "NaN": (in_row(CROWDING, 2, performance=float("nan")), "a number >= 0 in line 2 of .*performance, got nan"),
    "a word": (CROWDING.with_columns(performance=pl.lit("many")), "line 1 .*, column performance, got 'many'"),
    "negative": (in_row(CROWDING, 3, performance=-1.0), "a number >= 0 in line 3 .* got -1.0"),
    "percent": (in_row(CROWDING, 3, interference_fraction=30.0), r"a fraction in \[0, 1\] in line 3 .* got 30.0"),
    "no robots": (CROWDING.with_columns(n_robots=0), "1 to 10,000,000 robots in line 1 .* got 0"),
    "missing columns": (CROWDING.drop("seed", "performance"), "the columns seed, performance in"),
    "misspelt column": (
        CROWDING.rename({"performance": "performence"}),
        "--columns performance=NAME names another one. Did you mean 'performence'",
    ),
    "gap in a run": (
        table(rows(2, [[1.0, 1.0, 1.0]])).filter(pl.col("interval") != 1),
        "the next interval of run 0, each once in line 2 .* got 2",
    ),
    "clock that stands": (table(rows(2, [[1.0, 1.0]], t_end_s=[10.0, 10.0])), "a later end .* line 2"),
    "criterion without value": (CROWDING.with_columns(criterion=pl.lit("noise")), "the column criterion_value"),
    "unknown criterion": (CROWDING.with_columns(criterion=pl.lit("weather")), "one of population_size, .* in line 1"),
    "column with gaps": (
        table(rows(1, [[1.0, 2.0]], adversity=[0.5, None])),
        "a value, as in other intervals with N = 1 in line 2 .*, column adversity, got nothing",
    ),
    "two rates in a level": (
        table(rows(2, [[1.0, 1.0]], criterion="none", deaths_per_s=[0.1, 0.2])),
        "the same rate in each row of none 0 in line 2 .*, column deaths_per_s, got 0.2",
    ),
}


INCOMPARABLE = {
    "missing reference run": (LEVELS.tail(1), r"a reference run for noise 0\.4, N = 5 .* got neither"),
    "reference of another size": (in_row(LEVELS, 1, n_robots=9), r"a reference run for noise 0\.4, N = 5"),
    "nothing to pair": (table(rows(1, [[1.0]]), rows(2, [[1.0]], first_seed=5)), "runs with numbers in common"),
}


@pytest.mark.parametrize(("frame", "message"), INCOMPARABLE.values(), ids=INCOMPARABLE)
def test_runs_that_compare_with_nothing_are_refused(tmp_path, frame, message):
    frame.write_csv(tmp_path / "theirs.csv")
    with pytest.raises(CurveError, match=message):
        read_curves(tmp_path / "theirs.csv")


@pytest.mark.parametrize(("frame", "message"), BAD_TABLES.values(), ids=BAD_TABLES)
def test_bad_tables_get_one_line_that_says_where(frame, message):
    with pytest.raises(CurveError, match=f"^Expected .*{message}") as caught:
        study_curves(frame, where="theirs.csv")
    assert "theirs.csv" in str(caught.value)
    assert "\n" not in str(caught.value)


BAD_REQUESTS = {
    "unknown column": ({"columns": {"performance": "itms"}}, "a column itms for performance .* Did you mean 'items'"),
    "unknown name of ours": ({"columns": {"performence": "items"}}, "Did you mean 'performance'"),
    "place of a named column": (
        {"columns": {"performance": "items"}},
        r"line 1 of .*, column items \(performance\), got 'x'",
    ),
    "no interval for events": ({"events": True}, "the length of an interval"),
    "interval of 0 s": ({"interval_s": 0.0}, "an interval of more than 0 s"),
    "events without time": ({"events": True, "interval_s": 1.0}, "the column time_s"),
}


@pytest.mark.parametrize(("how", "message"), BAD_REQUESTS.values(), ids=BAD_REQUESTS)
def test_bad_requests_get_one_line(how, message):
    with pytest.raises(CurveError, match=message):
        study_curves(CROWDING.with_columns(items=pl.lit("x")), **how)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("curves.csv", b"", "the file is empty"),
        ("curves.csv", b"\xff\x80", "text in UTF-8, got other bytes from byte 0"),
        ("curves.csv", b"seed,interval\n\n1,2,3\n", "2 values with commas in line 3 of .*, got 3"),
        ("curves.csv", PLAIN.encode() + b"4,0,2,x\n", "a number >= 0 in line 6 of .*, column performance, got 'x'"),
        ("curves.parquet", b"", "as Parquet"),
        ("gone.csv", None, "Cannot read .*: No such file"),
    ],
)
def test_files_that_hold_no_curves_are_refused(tmp_path, name, content, message):
    if content is not None:
        written(tmp_path, name, content)
    with pytest.raises(CurveError, match=message) as caught:
        read_curves(tmp_path / name)
    assert "\n" not in str(caught.value)
