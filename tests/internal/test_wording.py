"""Tables of texts fit into a terminal."""

import pytest

from swarm_forage_env._internal.wording import aligned, folded

ROWS = [["name", "what it is"], ["one", "a text of words that is too long"], ["another", "short"]]


@pytest.mark.parametrize("width", [20, 30])
def test_a_table_that_is_too_wide_wraps_its_widest_cells(width):
    lines = aligned(ROWS, width=width)
    assert max(map(len, lines)) <= width
    assert " ".join(" ".join(lines).split()) == "name what it is one a text of words that is too long another short"
    assert lines[2].startswith(" " * len("another  "))


def test_a_table_that_fits_has_one_line_per_row():
    assert aligned(ROWS, width=200) == aligned(ROWS)
    assert len(aligned(ROWS)) == len(ROWS)


def test_no_word_of_a_table_is_broken():
    assert aligned([["swarm-forage", "a b"]], width=5) == ["swarm-forage  a", "              b"]


def test_an_empty_cell_stays_in_its_column():
    assert aligned([["", "a b", "c"]], width=5) == ["  a  c", "  b"]


def test_a_line_of_columns_goes_on_below_its_last_column():
    lines = folded("  64  cargo  row of what it carries", 22).split("\n")
    assert lines == ["  64  cargo  row of", "             what it", "             carries"]


@pytest.mark.parametrize("line", ["swarm-forage rerun results/run.parquet --jobs 1", "  64  cargo"])
def test_a_command_and_a_line_that_fits_stay_whole(line):
    assert folded(line, 20) == line
