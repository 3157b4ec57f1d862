"""Sheets: one frame as text, Markdown, CSV and JSON."""

import json

import polars as pl
import pytest

from swarm_forage_env._internal.fields import ConfigError
from swarm_forage_env.sheet import Sheet

FOUND = Sheet(
    title="who is best",
    frame=pl.DataFrame(
        {"policy": ["crw", "a|b"], "runs": [4000, None], "value": [1.23456, float("nan")], "ok": [True, False]}
    ),
    notes=["runs of 4,000 s"],
    below=[Sheet(notes=["the end"]), Sheet.of(("x",), [])],
)


def test_a_text_has_columns_under_each_other_and_numbers_of_four_digits():
    assert str(FOUND) == (
        "who is best\n"
        "policy  runs   value  ok\n"
        "crw     4,000  1.235  yes\n"
        "a|b            -      no\n"
        "runs of 4,000 s\n\n"
        "the end"
    )


def test_forms_are_written_by_the_ending_of_the_file(tmp_path):
    for ending in (".txt", ".md", ".tex", ".csv", ".json"):
        FOUND.write(tmp_path / f"found{ending}")
    markdown = (tmp_path / "found.md").read_text()
    assert markdown.startswith("**who is best**\n\n| policy | runs | value | ok |\n| --- | --- | --- | --- |\n")
    assert "| a\\|b |" in markdown
    latex = (tmp_path / "found.tex").read_text().splitlines()
    assert latex[:3] == ["% who is best", "% runs of 4,000 s", r"\begin{tabular}{lrrr}"]
    assert latex[4] == r"policy & runs & value & ok \\"
    assert r"1 $\pm$ 2 \% \{\textbackslash{} \\" in Sheet.of(["a"], [["1 ± 2 % {\\"]]).latex()
    assert pl.read_csv(tmp_path / "found.csv").equals(FOUND.frame, null_equal=True)
    answer = json.loads((tmp_path / "found.json").read_text())
    assert answer["who is best"][0] == {"policy": "crw", "runs": 4000, "value": 1.23456, "ok": True}
    assert (answer["who is best"][1]["value"], answer["notes"]) == (None, ["runs of 4,000 s", "the end"])
    with pytest.raises(ConfigError, match=r"ends with \.txt, \.md, \.tex, \.csv, \.json, got found\.pdf"):
        FOUND.write(tmp_path / "found.pdf")
