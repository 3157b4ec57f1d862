"""The list of references: what is cited is there, links are those of the numbers, and what they are used for exists."""

import re
from calendar import month_name
from pathlib import Path

import pytest

import metrics

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/references.md").read_text()
ENTRIES = re.findall(r"^(?:- |\| )\*\*\[(.+?)\]\*\*(.+?)(?=^- |^\||^#|\Z)", PAGE, re.MULTILINE | re.DOTALL)
"""Name and text of each entry."""
SOURCES = [
    path
    for folder in ("docs", "metrics", "baselines", "swarm_forage_env")
    for path in sorted((ROOT / folder).rglob("*"))
    if path.suffix in (".py", ".md") and path.name != "references.md"
]
YEAR = r"(?:19|20)\d\d"
AUTHORS_AND_YEAR = re.compile(rf"\b([A-Z][a-z]+ and [A-Z][a-z]+ {YEAR})\b|\(([A-Z][a-z]+ {YEAR})\)")
"""Hecker and Moses 2015, or (Holm 1979); but not June 2021, nor 2000 after any capitalised word."""


def test_there_are_entries_and_each_has_a_link():
    assert len(ENTRIES) > 20
    assert [name for name, text in ENTRIES if "](http" not in text] == []


def test_works_cited_by_authors_and_year_are_listed():
    found = {name for path in SOURCES for pair in AUTHORS_AND_YEAR.findall(path.read_text()) for name in pair if name}
    cited = {name for name in found if name.split()[0] not in month_name}
    assert {"Holm 1979", "Hecker and Moses 2015"} <= cited
    assert cited - {name for name, _ in ENTRIES} == set()


@pytest.mark.parametrize("name", ["Karp and Flatt", "Sakoe and Chiba", "Little", "STOCH-N1", "Student"])
def test_works_cited_by_name_are_listed(name):
    assert any(name in path.read_text() for path in SOURCES)
    assert name in [entry for entry, _ in ENTRIES]


@pytest.mark.parametrize(("kind", "site"), [("doi", "https://doi.org/"), ("arXiv", "https://arxiv.org/abs/")])
def test_numbers_lead_where_they_say(kind, site):
    links = re.findall(rf"\[{kind}:([^\]]+)\]\(([^)]+)\)", PAGE)
    assert links
    assert [(number, link) for number, link in links if link != site + number] == []
    assert len({number for number, _ in links}) == len(links)


def test_what_a_work_is_used_for_exists():
    named = set(re.findall(r"`([\w/.]+)`", PAGE))
    assert {"scalability", "mean_away"} <= named
    assert [name for name in named if not (name in metrics.__all__ or (ROOT / name).exists())] == []


def test_the_paper_has_the_same_number_wherever_it_is_cited():
    (paper,) = (text for name, text in ENTRIES if name == "the paper")
    assert "https://arxiv.org/abs/2012.04144" in paper
    doi = "10.48550/arXiv.2012.04144"  # arXiv gives one to every paper, by its number
    citation, bibliography = ((ROOT / name).read_text() for name in ("CITATION.cff", "paper/paper.bib"))
    assert f"\n    doi: {doi}\n    url: https://arxiv.org/abs/2012.04144\n" in citation
    assert f"doi = {{{doi}}}" in bibliography
    assert f"https://doi.org/{doi}" in paper
