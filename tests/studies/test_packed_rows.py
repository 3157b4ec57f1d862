"""Packed studies of strangers: rows that are not those of the study are refused, though the digest fits."""

from pathlib import Path

import polars as pl
import pytest

from swarm_forage_env.runs.record import RecordError
from swarm_forage_env.studies import study_table
from swarm_forage_env.studies.study_table import read_study
from tests.support.console import answer
from tests.support.forged import forge_study

SOURCE = Path(__file__).parents[1] / "support" / "blessed.parquet"


def with_value(column, value, *, row=5):
    """A change of one value."""
    return lambda frame: frame.with_columns(
        pl.when(pl.int_range(pl.len()) == row).then(pl.lit(value)).otherwise(column).cast(frame[column].dtype)
        .alias(column)
    )  # fmt: skip


def test_a_forged_study_that_is_whole_is_read(tmp_path):
    forge_study(SOURCE, tmp_path / "a.parquet")
    assert read_study(tmp_path / "a.parquet").frame.equals(read_study(SOURCE).frame)


@pytest.mark.parametrize(("most", "told"), [(100, "its texts have more"), (200_000, "rows of 43 columns")])
def test_what_would_not_be_read_again_is_not_written(tmp_path, monkeypatch, most, told):
    table, file = read_study(SOURCE), tmp_path / "a.parquet"
    table.write(file)
    before = file.read_bytes()
    monkeypatch.setattr(study_table, "MOST_BYTES", most)
    with pytest.raises(RecordError, match=rf"Cannot pack study blessed: .*{told}.*; split it"):
        table.write(file)
    assert {path: path.read_bytes() for path in tmp_path.iterdir()} == {file: before}
    with pytest.raises(RecordError):
        read_study(file)


@pytest.mark.parametrize(
    ("change", "told"),
    [
        (lambda frame: frame.drop("state"), "no column state"),
        (lambda frame: frame.with_columns(pl.col("seed").cast(pl.String)), "'seed' is of String"),
        (lambda frame: frame.with_columns(pl.col("collected").cast(pl.String)), "'collected' is of String"),
        (lambda frame: frame.with_columns(extra=pl.lit("x")), "'extra' is of String"),
        (lambda frame: frame.with_columns(extra=pl.lit(float("inf"))), "'extra' holds numbers that are not finite"),
        (with_value("seed", None), "seed has empty places"),
        (with_value("cell", 99, row=383), "in the order of the"),
        (lambda frame: frame.clear(), "in the order of the"),
        (with_value("state", "gone"), "got 'gone'"),
        (with_value("interval", None), "intervals of finished runs"),
        (with_value("seed", 77, row=0), "seeds of its study|one after the other"),
        (lambda frame: frame.tail(-1), "seeds of its study"),
        (lambda frame: frame.filter(pl.col("seed") != 0), "seeds of its study"),
        (with_value("interval", 7, row=1), "of each run one after the other"),
        (with_value("run_id", "another", row=1), "of each run one after the other"),
        (with_value("t_end_s", 0.0), "t_end_s above 0"),
        (lambda frame: frame.with_columns(run_id="../" + pl.col("run_id")), "part of a file name"),
        (lambda frame: frame.filter(pl.int_range(pl.len()) != frame.height - 1), "one length"),
    ],
)
def test_rows_that_are_not_those_of_the_study_are_refused(tmp_path, change, told):
    forge_study(SOURCE, tmp_path / "a.parquet", frame=change)
    with pytest.raises(RecordError, match=told) as refused:
        read_study(tmp_path / "a.parquet")
    assert len(str(refused.value).splitlines()) == 1


@pytest.mark.parametrize(
    "changes",
    [
        {"study": {"budget": "/../../outside"}},
        {"study": {"budget": "../outside"}},
        {"study": {"name": "../outside"}},
        {"frame": lambda frame: frame.with_columns(run_id="../../../" + pl.col("run_id"))},
        {"frame": lambda frame: frame.with_columns(run_id="/tmp/" + pl.col("run_id"))},
        {"study": "null"},
        {"study": "["},
        {"versions": '{"a": 1}'},
        {"versions": '[{"a": 1}]'},
    ],
)
def test_unpack_writes_nothing_through_names_in_a_file(tmp_path, monkeypatch, capsys, changes):
    place = tmp_path / "a" / "b"
    place.mkdir(parents=True)
    monkeypatch.chdir(place)
    forge_study(SOURCE, tmp_path / "forged.parquet", **changes)
    before = set(tmp_path.rglob("*"))
    assert answer("study", "unpack", str(tmp_path / "forged.parquet"), "--out", "out") == 2
    assert set(tmp_path.rglob("*")) == before
    assert len(capsys.readouterr().err.splitlines()) == 1
