"""Curves from a file: a documented file gives a table, a wrong one gives one clear error."""

import re
from pathlib import Path

import polars as pl
import pytest

from metrics import CurveError, score_curves
from metrics.scoring.run_curves import CURVE_COLUMNS, REQUIRED_COLUMNS
from tests.support.curve_tables import CROWDING, rows, table

PAGE = Path(__file__).resolve().parents[3] / "docs" / "scoring.md"

THROTTLED = table(
    rows(5, [[2.0, 2.0], [3.0, 1.0]], criterion="throttle", criterion_value=0.0, adversity=0.1, t_end_s=[10.0, 20.0]),
    rows(5, [[1.0, 2.0], [1.0, 1.0]], criterion="throttle", criterion_value=0.4, adversity=0.6, t_end_s=[10.0, 20.0]),
)


def written(frame: pl.DataFrame, path: Path) -> Path:
    if path.suffix == ".csv":
        frame.write_csv(path)
    else:
        frame.write_parquet(path)
    return path


@pytest.mark.parametrize("suffix", [".csv", ".parquet", ".CSV"])
def test_a_crowding_swarm_scores_as_computed_by_hand(tmp_path, suffix):
    if suffix == ".CSV":
        path = tmp_path / "crowding.CSV"
        path.write_bytes(CROWDING.write_csv().encode())
    else:
        path = written(CROWDING, tmp_path / f"crowding{suffix}")
    (scored,) = score_curves(path)
    assert scored.policy == "crowding"
    means = {(score.measure, score.at): score.summary.mean for score in scored.scores}
    assert means["performance_lost", "N = 2"] == pytest.approx(0.16)
    assert means["performance_lost", "N = 4"] == pytest.approx(0.56)
    assert means["spatial_emergence", "N = 1 to 2"] == pytest.approx(-0.16)
    assert means["spatial_emergence", "N = 2 to 4"] == pytest.approx(-0.24)
    assert means["task_emergence", "N = 2 to 4"] == pytest.approx(-0.4)
    assert means["scalability", "N = 2 to 4"] == pytest.approx(2.0 * (1.0 - 1.8 / 3.2))
    assert means["efficiency", "N = 4"] == pytest.approx(0.8)
    assert means["t_lost_fraction", "N = 4"] == pytest.approx(0.3)


def test_what_the_columns_do_not_allow_is_told_with_the_reason(tmp_path):
    (scored,) = score_curves(written(CROWDING, tmp_path / "curves.csv"))
    assert scored.missing.keys() == {
        "reactivity",
        "adaptability",
        "noise_robustness",
        "population_robustness",
        "recorded_population_robustness",
        "availability",
    }
    assert "criterion throttle" in scored.missing["reactivity"]
    with pytest.raises(KeyError, match="criterion noise"):
        scored["noise_robustness"]
    assert any(note.startswith("reactivity is not computed: there are no runs") for note in scored.notes())


def test_missing_sizes_are_told(tmp_path):
    path = written(CROWDING.filter(pl.col("n_robots") == 4), tmp_path / "curves.csv")
    assert "one swarm size only, N = 4" in score_curves(path)[0].missing["scalability"]
    with pytest.raises(CurveError, match=r"Cannot compute scalability.*one swarm size only, N = 4"):
        score_curves(path, measures=["scalability"])


@pytest.mark.parametrize(
    ("column", "measure", "reason"),
    [
        ("interference_fraction", "t_lost_fraction", "no column interference_fraction"),
        ("adversity", "reactivity", "no column adversity"),
    ],
)
def test_missing_optional_columns_are_told(tmp_path, column, measure, reason):
    frame = CROWDING if column in CROWDING.columns else THROTTLED
    (scored,) = score_curves(written(frame.drop(column), tmp_path / "curves.csv"))
    assert reason in scored.missing[measure]


def test_population_measures_need_rates_and_a_clock(tmp_path):
    levels = table(
        rows(10, [[2.0, 2.0]], criterion="none", criterion_value=0.0, t_end_s=[10.0, 20.0]),
        rows(10, [[1.0, 2.0]], criterion="population_dynamics", criterion_value=1.0, t_end_s=[10.0, 20.0]),
    )
    wanted = ["population_robustness"]
    with pytest.raises(CurveError, match="no rates"):
        score_curves(written(levels, tmp_path / "a.csv"), measures=wanted)
    rated = levels.with_columns(deaths_per_s=pl.when(pl.col("criterion") == "none").then(None).otherwise(0.01))
    with pytest.raises(CurveError, match="no column t_end_s"):
        score_curves(written(rated.drop("t_end_s"), tmp_path / "b.csv"), measures=wanted)
    (scored,) = score_curves(written(rated, tmp_path / "c.csv"), measures=wanted)
    assert scored.scores[0].summary.n_used == 1
    assert 0.98 < scored.scores[0].beside["weight"] < 1.0


def test_swarm_sizes_need_no_criterion_value(tmp_path):
    sizes = CROWDING.drop("criterion_value", strict=False).with_columns(criterion=pl.lit("population_size"))
    expected = score_curves(written(CROWDING, tmp_path / "curves.csv"))[0].to_frame()
    assert score_curves(written(sizes, tmp_path / "curves.csv"))[0].to_frame().equals(expected)
    empty = sizes.with_columns(criterion_value=pl.lit(None, pl.Float64))
    assert score_curves(written(empty, tmp_path / "curves.csv"))[0].to_frame().equals(expected)
    undisturbed = empty.with_columns(criterion=pl.lit("none"))
    with pytest.raises(CurveError, match=r"Expected a number in column criterion_value .*, got nothing in row 1"):
        score_curves(written(undisturbed, tmp_path / "curves.csv"))


def test_a_file_may_hold_several_policies(tmp_path):
    frame = pl.concat([CROWDING.with_columns(controller=pl.lit(name)) for name in ("mine", "theirs")])
    assert [scored.policy for scored in score_curves(written(frame, tmp_path / "both.csv"))] == ["mine", "theirs"]


def edited(frame: pl.DataFrame, **columns: object) -> pl.DataFrame:
    return frame.with_columns(**{name: pl.lit(value) for name, value in columns.items()})


def in_row(frame: pl.DataFrame, row: int, **cells: object) -> pl.DataFrame:
    """Change cells of one row, counted from 1."""
    changed = frame.with_row_index("row", offset=1)
    for name, value in cells.items():
        changed = changed.with_columns(
            pl.when(pl.col("row") == row).then(pl.lit(value)).otherwise(pl.col(name)).alias(name)
        )
    return changed.drop("row")


NAN, INF = float("nan"), float("inf")
BAD_TABLES = {
    "NaN": (in_row(CROWDING, 2, performance=NAN), r"Expected a number in column performance .* got nan in row 2\."),
    "nothing": (in_row(CROWDING, 2, performance=None), "Expected a number in column performance .* got nothing in row"),
    "a word": (
        edited(CROWDING, performance="many"),
        "Expected a number in column performance .* 'many' in row 1 and",
    ),
    "infinity": (in_row(CROWDING, 1, performance=INF), "Expected a finite number in column performance .* got inf"),
    "negative": (
        in_row(CROWDING, 3, performance=-1.0),
        "Expected no negative number in column performance .* -1.0",
    ),
    "interference above 1": (in_row(CROWDING, 3, interference_fraction=30.0), r"a fraction in \[0, 1\] .* got 30.0"),
    "half a robot": (edited(CROWDING, n_robots=2.5), "Expected a whole number >= 0 in column n_robots .* got 2.5"),
    "no robots": (edited(CROWDING, n_robots=0), "Expected n_robots from 1 to 10,000,000 .* got 0"),
    "missing columns": (CROWDING.drop("seed", "performance"), "Expected the columns seed, performance in"),
    "misspelt column": (
        CROWDING.rename({"performance": "performence"}),
        "Expected the column performance in .* Is 'performence' meant to be 'performance'",
    ),
    "no rows": (CROWDING.clear(), "column names without a row"),
    "unequal lengths of runs": (
        table(rows(2, [[1.0, 1.0], [1.0]])),
        "Expected curves of equal length, N = 2 of .*, got 2 for seed 0, 1 for seed 1",
    ),
    "unequal lengths of sizes": (
        table(rows(1, [[1.0]]), rows(2, [[1.0, 2.0]])),
        "Expected runs of equally many intervals .* got 1 at N = 1, 2 at N = 2",
    ),
    "gap in a run": (
        table(rows(2, [[1.0, 1.0, 1.0]])).filter(pl.col("interval") != 1),
        "Expected the intervals 0, 1, 2, ... once each for seed 0, N = 2 of .* got 0, 2",
    ),
    "doubled rows": (pl.concat([CROWDING, CROWDING]), "once each for seed 0, N = 1 of .* got 0, 0"),
    "sizes in falling order": (CROWDING.reverse(), "Expected the swarm sizes of .* in rising order, got 4, 2, 1"),
    "value of a size": (
        edited(CROWDING, criterion="population_size", criterion_value=7.0),
        "Expected criterion_value = n_robots .* got 7 and 1",
    ),
    "criterion without value": (
        edited(CROWDING, criterion="noise"),
        "Expected the column criterion_value beside criterion",
    ),
    "clock that goes back": (
        table(rows(2, [[1.0, 1.0]], t_end_s=[20.0, 10.0])),
        "Expected the same rising t_end_s in all runs",
    ),
    "unknown criterion": (
        edited(CROWDING, criterion="weather", criterion_value=1.0),
        "Expected criterion in .* to be one of population_size, .* got 'weather'",
    ),
    "missing reference run": (
        THROTTLED.filter(pl.col("criterion_value") > 0.0),
        "Expected a reference run for throttle 0.4, N = 5 .* got neither",
    ),
    "nothing to pair": (
        table(rows(1, [[1.0]], first_seed=0), rows(2, [[1.0]], first_seed=5)),
        "Expected runs with numbers in common",
    ),
    "column with gaps": (
        table(rows(1, [[1.0, 2.0]], adversity=[0.5, None])),
        "Expected column adversity in every interval or in none, N = 1 of .* got gaps",
    ),
    "different clocks": (
        table(rows(1, [[1.0]], t_end_s=10.0), rows(2, [[1.0]], t_end_s=20.0)),
        "Expected the same rising t_end_s in all runs",
    ),
    "two rates in a level": (
        table(rows(2, [[1.0, 1.0]], criterion="population_dynamics", criterion_value=1.0, deaths_per_s=[0.1, 0.2])),
        r"Expected one deaths_per_s for population_dynamics 1, N = 2 of .* got \[0.1, 0.2\]",
    ),
}


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
@pytest.mark.parametrize(("frame", "message"), BAD_TABLES.values(), ids=BAD_TABLES)
def test_bad_curves_get_one_clear_error(tmp_path, frame, message, suffix):
    path = written(frame, tmp_path / f"curves{suffix}")
    with pytest.raises(CurveError, match=message) as caught:
        score_curves(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("curves.csv", b"", "the file is empty"),
        ("curves.csv", b" \n\n", "the file is empty"),
        ("curves.parquet", b"", "the file is empty"),
        ("curves.parquet", b"PAR1 not really", "Cannot read .* as PARQUET"),
        ("curves.parquet", b"n_robots,seed\n1,2\n", "Cannot read .* as PARQUET"),
        ("curves.csv", b"n_robots,seed\n1,2,3,4\n", "Cannot read .* as CSV|Expected the columns"),
        ("curves.csv", b"PAR1\x00\x80\xff\x15\x00\n\x80\x81", "Cannot read .* as CSV|Expected the columns"),
        ("curves.txt", b"n_robots\n1\n", r"Expected curves as a \.csv or \.parquet file"),
    ],
)
def test_files_of_another_kind_are_refused(tmp_path, name, content, message):
    path = tmp_path / name
    path.write_bytes(content)
    with pytest.raises(CurveError, match=message) as caught:
        score_curves(path)
    assert "\n" not in str(caught.value)


def test_a_missing_file_and_a_folder_are_refused(tmp_path):
    with pytest.raises(CurveError, match=r"Cannot read .*: No such file"):
        score_curves(tmp_path / "curves.csv")
    (tmp_path / "folder.csv").mkdir()
    with pytest.raises(CurveError, match=r"Cannot read .*folder\.csv"):
        score_curves(tmp_path / "folder.csv")


def test_the_page_lists_every_column():
    _, _, section = PAGE.read_text().partition("## Curves from other sources")
    listed = re.findall(r"^\| `(\w+)`( \\\*)? \|", section, re.MULTILINE)
    assert [name for name, _ in listed] == list(CURVE_COLUMNS)
    assert {name for name, star in listed if star} == set(REQUIRED_COLUMNS)


COLUMNS_OF_ODD_TYPES = {
    "lists": lambda n: pl.Series([[1]] * n),
    "tables": lambda n: pl.Series([{"a": 1}] * n),
    "bytes": lambda n: pl.Series([b"\xff"] * n),
    "fixed lists": lambda n: pl.Series([[1, 2]] * n, dtype=pl.Array(pl.Int64, 2)),
    "dates": lambda n: pl.Series([0] * n).cast(pl.Date),
    "beyond 64 bits": lambda n: pl.Series([1e20] * n),
    "unsigned": lambda n: pl.Series([2**63] * n, dtype=pl.UInt64),
    "huge": lambda n: pl.Series([1e308] * n),
    "escape sequences": lambda n: pl.Series(["\x1b[31m"] * n),
    "text from right to left": lambda n: pl.Series(["\u202ecrw"] * n),
}


@pytest.mark.parametrize("column", ["n_robots", "seed", "interval", "performance", "interference_fraction"])
@pytest.mark.parametrize("kind", COLUMNS_OF_ODD_TYPES)
def test_columns_of_types_that_no_curve_has_are_refused(tmp_path, column, kind):
    odd = CROWDING.with_columns(COLUMNS_OF_ODD_TYPES[kind](len(CROWDING)).alias(column))
    with pytest.raises(CurveError, match=f"Expected .* in column {column} of "):
        score_curves(written(odd, tmp_path / "odd.parquet"))


def test_names_in_all_languages_are_read(tmp_path):
    name = "\u0645\u06cc\u200c\u062e\u0648"
    (scored,) = score_curves(written(CROWDING.with_columns(controller=pl.lit(name)), tmp_path / "named.csv"))
    assert scored.policy == name


@pytest.mark.parametrize("kind", ["lists", "bytes", "dates", "escape sequences", "text from right to left"])
def test_names_of_types_that_no_name_has_are_refused(tmp_path, kind):
    odd = CROWDING.with_columns(COLUMNS_OF_ODD_TYPES[kind](len(CROWDING)).alias("controller"))
    with pytest.raises(CurveError, match=r"Expected .*text.* in column controller of "):
        score_curves(written(odd, tmp_path / "odd.parquet"))


def test_categories_are_texts(tmp_path):
    named = CROWDING.with_columns(pl.lit("crowd", dtype=pl.Categorical).alias("controller"))
    (scored,) = score_curves(written(named, tmp_path / "named.parquet"))
    assert scored.policy == "crowd"


def test_no_changed_byte_leads_to_another_error_or_to_a_word_on_stderr(tmp_path, capfd):
    path = written(CROWDING, tmp_path / "curves.csv")
    content, told = path.read_bytes(), list[str]()
    for at in range(12, len(content), 14):
        path.write_bytes(content[:at] + bytes((content[at] ^ 0x55,)) + content[at + 1 :])
        try:
            score_curves(path)
        except CurveError as error:
            told.append(str(error))
    assert [text for text in told if len(text.splitlines()) > 1] == []
    assert capfd.readouterr().err == ""
