"""The list of references: what is cited is there, links are those of the numbers, and what they are used for exists."""

import re
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
AUTHORS_AND_YEAR = re.compile(r"\b([A-Z][a-z]+(?: and [A-Z][a-z]+)? (?:19|20)\d\d)\b")
MONTHS = ("May", "June")


def test_there_are_entries_and_each_has_a_link():
    assert len(ENTRIES) > 20
    assert [name for name, text in ENTRIES if "](http" not in text] == []


def test_works_cited_by_authors_and_year_are_listed():
    cited = {name for path in SOURCES for name in AUTHORS_AND_YEAR.findall(path.read_text())}
    cited = {name for name in cited if not name.startswith(MONTHS)}
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
    assert "url: https://arxiv.org/abs/2012.04144" in (ROOT / "CITATION.cff").read_text()
