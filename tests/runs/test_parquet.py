"""Parquet files of strangers: sizes are known before anything is unpacked."""

import json
import os
import struct
import tracemalloc
from io import BytesIO

import polars as pl
import pytest

from swarm_forage_env.runs import parquet
from swarm_forage_env.runs.parquet import ParquetError, check_texts, open_parquet, parse_parquet
from swarm_forage_env.runs.record import RecordError, RunRecord, is_record
from tests.support.forged import forge_record
from tests.support.small_files import small_file

SOURCE = small_file("record.parquet")


def test_what_polars_writes_is_read(tmp_path):
    frame = pl.DataFrame({"a": range(300_000), "b": ["x", None, "yy"] * 100_000, "c": [True, False, None] * 100_000})
    frame.write_parquet(tmp_path / "a.parquet", metadata={"key": "täxt"}, row_group_size=100_000)
    opened = open_parquet(tmp_path / "a.parquet", 2**26)
    assert (opened.n_rows, opened.stamp["key"]) == (300_000, "täxt")
    assert opened.stamp == pl.read_parquet_metadata(tmp_path / "a.parquet")
    assert opened.frame().equals(frame)


def test_a_small_file_that_unpacks_to_much_is_refused_before_it_is(tmp_path):
    file = tmp_path / "bomb.parquet"
    pl.DataFrame({"a": ["\0" * 2**27]}).write_parquet(file, compression_level=19)
    assert file.stat().st_size < 2**17
    tracemalloc.start()
    with pytest.raises(ParquetError, match="bytes unpacked"):
        open_parquet(file, 2**26)
    assert tracemalloc.get_traced_memory()[1] < 2**21
    tracemalloc.stop()


def test_a_small_file_of_many_rows_is_refused(tmp_path):
    file = tmp_path / "rows.parquet"
    pl.DataFrame({"a": pl.zeros(10_000_000, pl.Int64, eager=True)}).write_parquet(file, compression_level=19)
    assert file.stat().st_size < 2**20
    with pytest.raises(ParquetError, match=r"10,000,000 rows of 1 columns"):
        open_parquet(file, 2**26)


def test_a_text_in_many_rows_is_refused_before_it_is_written_out(tmp_path):
    frame = pl.DataFrame({"a": ["x" * 1000, "y" * 1000] * 1000})
    check_texts(frame, 2_000_000)
    with pytest.raises(ParquetError, match="texts"):
        check_texts(frame, 1_999_999)
    check_texts(pl.DataFrame({"a": [1]}), 0)


def test_lists_and_other_encodings_are_refused(tmp_path, monkeypatch):
    pl.DataFrame({"a": [[1, 2]]}).write_parquet(tmp_path / "lists.parquet")
    with pytest.raises(ParquetError, match="columns of lists"):
        open_parquet(tmp_path / "lists.parquet", 2**20)
    monkeypatch.setattr(parquet, "_ENCODINGS", frozenset((7,)))
    with pytest.raises(ParquetError, match="encoded in a way"):
        open_parquet(SOURCE, 2**28)


@pytest.mark.parametrize(
    ("head", "told"),
    [
        ({1: 9, 2: 5}, "kind 9"),
        ({1: 0, 2: 5, 5: {1: -1, 2: 0}}, "other values"),
        ({1: 2, 2: 5, 7: {1: 6, 2: 0}}, "other values"),
        ({1: 3, 2: 5, 8: {1: 3, 2: 0, 3: 3, 4: 0, 5: 4, 6: 2}}, "other levels"),
        ({1: 3, 2: 5, 8: {1: 3, 2: 0, 3: 3, 4: 0, 5: -1, 6: 2}}, "other levels"),
    ],
)
def test_a_page_that_says_what_cannot_be_is_refused(head, told):
    with pytest.raises(ParquetError, match=told):
        parquet._page(head)


def test_files_of_other_programs_may_have_lists_and_other_encodings(monkeypatch):
    content = BytesIO()
    frame = pl.DataFrame({"a": [[1, 2], None, []] * 100, "b": [{"c": "x"}, {"c": None}, None] * 100, "d": range(300)})
    frame.write_parquet(content)
    with pytest.raises(ParquetError, match="columns of lists"):
        parse_parquet(content.getvalue(), 2**20)
    monkeypatch.setattr(parquet, "_ENCODINGS", frozenset((7,)))
    assert parse_parquet(content.getvalue(), 2**20, ours=False).frame().equals(frame)
    with pytest.raises(ParquetError, match="unpacked"):
        parse_parquet(content.getvalue(), 300 * 3 * 16, ours=False)


def test_a_dictionary_behind_the_values_is_refused(tmp_path):
    """Polars begins to read at the dictionary, so pages elsewhere must not be the ones that are added up."""
    file = tmp_path / "a.parquet"
    pl.DataFrame({"a": ["x", "y"] * 100}).write_parquet(file)
    content = file.read_bytes()
    about = parquet._footer(content)[4][0][1][0][3]
    assert (about[9], about[11]) == (36, 4)
    assert open_parquet(file, 2**20).n_rows == 200
    content = content.replace(bytes((0x26, 72, 0x26, 8)), bytes((0x26, 8, 0x26, 72)))  # fields 9 and 11, of zigzag kind
    about = parquet._footer(content)[4][0][1][0][3]
    assert (about[9], about[11]) == (4, 36)
    file.write_bytes(content)
    with pytest.raises(ParquetError, match="a dictionary does not lie before the values"):
        open_parquet(file, 2**20)


@pytest.mark.parametrize("place", [4, 6, 8])
@pytest.mark.parametrize("kind", [1, 2, 3, 7, 8, 9, 12])
def test_numbers_of_other_kinds_are_refused(tmp_path, place, kind):
    """Polars reads them as the numbers that they should be."""
    file = tmp_path / "a.parquet"
    pl.DataFrame({"a": ["x", "y"] * 100}).write_parquet(file)
    content = file.read_bytes()
    assert content[4:9:2] == b"\x15" * 3  # fields 1, 2 and 3 of the first page's head, each of kind 5 and one byte
    file.write_bytes(content[:place] + bytes((0x10 + kind,)) + content[place + 1 :])
    with pytest.raises(ParquetError, match="a field of another kind"):
        open_parquet(file, 2**20)


@pytest.mark.parametrize("name", ["_FOOTER", "_PAGE"])
def test_no_other_kind_of_any_field_is_taken(name):
    def wrong_kinds(layout):
        """Yield structures in which the last field that is read has another kind."""
        for number, of in layout.items():
            allowed = of if isinstance(of, tuple) else (9,) if isinstance(of, list) else (12,)
            yield from (bytes((number << 4 | kind,)) for kind in range(16) if kind not in allowed and number < 16)
            inner = of[0] if isinstance(of, list) else of
            if isinstance(inner, dict) and number < 16:
                head = bytes((number << 4 | 9, 0x1C)) if isinstance(of, list) else bytes((number << 4 | 12,))
                yield from (head + told for told in wrong_kinds(inner))

    told = list(wrong_kinds(getattr(parquet, name)))
    assert len(told) > 300
    for content in told:
        with pytest.raises(ParquetError, match="a field of another kind"):
            parquet._Thrift(content + b"\0" * 20, 0).structure(getattr(parquet, name))


def with_footer(file, footer):
    """Write the pages of a record with another footer."""
    pages = SOURCE.read_bytes()[:5000]
    file.write_bytes(pages + footer + struct.pack("<I", len(footer)) + b"PAR1")
    return file


@pytest.mark.parametrize(
    "entry",
    [b"\x00", b"\x18\x00\x00", b"\x18\x01a\x18\x01b\x00"],
    ids=["empty", "short", "whole"],
)
def test_a_footer_of_many_values_is_refused_before_it_fills_the_memory(tmp_path, entry):
    count = parquet._MOST_FOOTER // len(entry) - 10
    size = bytes((count & 127 | 128, count >> 7 & 127 | 128, count >> 14 & 127 | 128, count >> 21))
    file = with_footer(tmp_path / "a.parquet", b"\x59\xfc" + size + entry * count + b"\x00")
    tracemalloc.start()
    with pytest.raises(ParquetError, match="more than the 131,072 values"):
        open_parquet(file, 2**28)
    assert tracemalloc.get_traced_memory()[1] < 2**25 + file.stat().st_size
    tracemalloc.stop()


def test_long_and_broken_footers_are_refused(tmp_path):
    with pytest.raises(ParquetError, match=r"4,194,305 bytes, but at most 4,194,304"):
        open_parquet(with_footer(tmp_path / "a.parquet", bytes(parquet._MOST_FOOTER + 1)), 2**28)
    for footer in (b"", b"\x00", b"\x10", b"\x15\x02" * 40):
        with pytest.raises(ParquetError, match="no Parquet file or a damaged one"):
            open_parquet(with_footer(tmp_path / "a.parquet", footer), 2**28)


@pytest.mark.parametrize("content", [b"", b"PAR1", b"PAR1" * 3, b"PAR1" + b"\xff" * 40 + b"PAR1", b"nothing" * 9])
def test_what_is_no_parquet_is_told_in_one_line(tmp_path, content):
    file = tmp_path / "a.parquet"
    file.write_bytes(content)
    with pytest.raises(ParquetError, match="no Parquet file or a damaged one"):
        open_parquet(file, 2**20)
    assert not is_record(file)
    with pytest.raises(ParquetError, match="at most 1 are expected"):
        open_parquet(SOURCE, 1)


def test_no_changed_byte_leads_to_another_error_or_to_more_on_stderr(tmp_path, capfd):
    content, file, told = SOURCE.read_bytes(), tmp_path / "a.parquet", list[str]()
    for at in range(0, len(content), 7):
        file.write_bytes(content[:at] + bytes((content[at] ^ 0x55,)) + content[at + 1 :])
        try:
            RunRecord.read(file)
        except RecordError as error:
            told.append(str(error))
    assert [text for text in told if len(text.splitlines()) > 1] == []
    assert capfd.readouterr().err == ""


@pytest.mark.parametrize("name", ["open", "dup", "nothing"])
def test_reading_leaves_no_file_open_though_there_is_no_stderr(monkeypatch, name):
    def next_number():
        place = os.pipe()
        for end in place:
            os.close(end)
        return place

    def refuse(*_):
        raise OSError

    before = next_number()
    with monkeypatch.context() as patch:
        patch.setattr(parquet.os, name, refuse, raising=False)
        with parquet.panics_untold():
            pass
    assert next_number() == before


@pytest.mark.parametrize(
    ("changes", "told"),
    [
        ({"spec": "null"}, "table of values"),
        ({"spec": "{}"}, "scenario to be a table"),
        ({"spec": '{"scenario": {}}'}, "performance to be a non-empty text"),
        ({"provenance": "[]"}, "provenance to be a table"),
        ({"provenance": '{"numpy": 2}'}, "provenance.numpy to be a text"),
        ({"provenance": '{"wall_time_s": "long"}'}, "could not convert"),
        ({"provenance": '{"cpu_time_s": "nan"}'}, "cpu_time_s to be a finite number"),
        ({"frame": lambda frame: frame.with_columns(t_end_s=pl.lit(0.0))}, "rising t_end_s"),
        ({"frame": lambda frame: frame.reverse()}, "intervals 0, 1, 2"),
        ({"frame": lambda frame: frame.with_columns(n_robots=pl.lit(0, pl.Int64))}, "n_robots"),
        ({"frame": lambda frame: frame.with_columns(seed=pl.lit(-1, pl.Int64))}, "seed"),
        ({"frame": lambda frame: frame.with_columns(controller=pl.lit("\x1b[31m"))}, "controller"),
        ({"frame": lambda frame: frame.with_columns(n_active=pl.lit(float("nan")))}, "not finite"),
    ],
)
def test_a_record_of_what_no_run_has_is_refused_though_its_digest_fits(tmp_path, changes, told):
    forge_record(SOURCE, tmp_path / "same.parquet")
    assert RunRecord.read(tmp_path / "same.parquet").same_results(RunRecord.read(SOURCE))
    forge_record(SOURCE, tmp_path / "a.parquet", **changes)
    with pytest.raises(RecordError, match=told):
        RunRecord.read(tmp_path / "a.parquet")


def test_nested_texts_are_bounded(tmp_path):
    forge_record(SOURCE, tmp_path / "a.parquet", spec=json.dumps({"scenario": {"performance": "x"}})[:-1] + ',"a":'
                 + "[" * 60 + "]" * 60 + "}")  # fmt: skip
    with pytest.raises(RecordError, match="nested levels"):
        RunRecord.read(tmp_path / "a.parquet")
