"""Numbers of the paper's equations agree wherever they are cited: catalog, docstrings, equations, errata.

The table of docs/equations.md says which equation defines what. Everything else is held against it.
"""

import ast
import re
from pathlib import Path

import pytest

import metrics
from metrics import METRICS
from tests.support.public_names import homes_of

ROOT = Path(__file__).resolve().parents[2]
PAGE = (ROOT / "docs/equations.md").read_text()
ERRATA = (ROOT / "docs/errata.md").read_text()
N_EQUATIONS = 13
CITED = re.compile(r"\bEq(?:\.\s\(?(\d+)|s\.\s\(?(\d+)\)?(,| and| to)\s\(?(\d+))")
"""Eq. (7), Eqs. (5) and (6), Eqs. (9) to (11), and the same without brackets."""
MODULES = sorted((ROOT / "metrics").rglob("*.py"))


def cited(text: str) -> set[int]:
    """Equation numbers in a text."""
    numbers = set()
    for one, first, word, last in CITED.findall(text):
        numbers |= set(range(int(first), int(last) + 1)) if word == " to" else {int(n) for n in (one, first, last) if n}
    return numbers


ROWS = [
    (int(number), symbol.strip(), set(re.findall(r"`(\w+)`", functions)), {int(n) for n in re.findall(r"\d+", errata)})
    for number, symbol, functions, errata in re.findall(
        r"^\| \((\d+)\) \|([^|]+)\|([^|]+)\|([^|]*)\|$", PAGE, re.MULTILINE
    )
]
"""Rows of the page's table: number, symbol, functions, errata."""
FUNCTIONS = sorted(set().union(*(functions for _, _, functions, _ in ROWS)))
HEADS = {int(number): head for number, head in re.findall(r"^\*\*(\d+)\. (.+?)\*\*", ERRATA, re.MULTILINE | re.DOTALL)}
"""Erratum -> what it says in bold."""


def numbers_of(function: str) -> set[int]:
    return {number for number, _, functions, _ in ROWS if function in functions}


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("as in Eq. (7).", {7}),
        ("Eqs. (5) and (6): distance", {5, 6}),
        ("Eqs. (9) to (11)", {9, 10, 11}),
        ("(Eqs. 10, 11)", {10, 11}),
        ("(Eq. 4) and Eq.\n13 rho", {4, 13}),
        ("Eq. (12), 3 robots", {12}),
        ("equation 4 of 5", set()),
    ],
)
def test_citations_are_read(text, expected):
    assert cited(text) == expected


def test_the_page_has_one_row_and_one_heading_for_each_equation():
    assert [number for number, _, _, _ in ROWS] == list(range(1, N_EQUATIONS + 1))
    headings = re.findall(r"^## .*$", PAGE, re.MULTILINE)
    numbers = [
        int(n) for heading in headings for group in re.findall(r"\(([\d, ]+)\)", heading) for n in group.split(",")
    ]
    assert numbers == list(range(1, N_EQUATIONS + 1))


@pytest.mark.parametrize("function", FUNCTIONS)
def test_docstrings_cite_the_equations_of_the_page(function):
    assert cited(getattr(metrics, function).__doc__) == numbers_of(function)


@pytest.mark.parametrize("function", ["availability", "ratio_for_team", "availability_curves", "time_emergence"])
def test_l_is_robots_away_and_has_no_other_meaning(function):
    assert "| L | mean number of robots away | robots |" in PAGE
    assert not re.search(r"\bL\b", getattr(metrics, function).__doc__)


@pytest.mark.parametrize("name", [name for name, measure in METRICS.items() if measure.equation.startswith("ours")])
def test_measures_of_our_own_have_a_section_with_an_example(name):
    symbol = METRICS[name].symbol.split("(")[0]
    (section,) = [
        part for part in re.split(r"^## ", PAGE, flags=re.MULTILINE) if symbol in part.splitlines()[0].split()
    ]
    assert f"{name}(" in section
    assert "```math" in section


@pytest.mark.parametrize("name", METRICS)
def test_the_catalog_cites_the_equations_of_the_page(name):
    """A measure that the page does not list is not the paper's, and does not claim to be."""
    source = METRICS[name].equation
    assert cited(source) == numbers_of(name) if numbers_of(name) else not source.startswith("Eq")


@pytest.mark.parametrize("name", sorted({homes_of(metrics)[function] for function in FUNCTIONS}))
def test_modules_cite_what_their_functions_define(name):
    """A module's own docstring names no equation that none of its functions cites."""
    tree = ast.parse((ROOT / f"metrics/{name}.py").read_text())
    inside = set()
    for node in ast.walk(tree):
        if isinstance(node, ast.FunctionDef | ast.ClassDef):
            inside |= cited(ast.get_docstring(node) or "")
    assert cited(ast.get_docstring(tree) or "") <= inside


@pytest.mark.parametrize("erratum", sorted(HEADS))
def test_errata_cite_the_equations_of_the_page(erratum):
    listed = {number for number, _, _, errata in ROWS if erratum in errata}
    assert cited(HEADS[erratum]) == listed, "the column of errata in docs/equations.md says otherwise"


def test_symbols_beside_a_citation_in_the_errata_are_those_of_the_equation():
    symbols = {number: symbol for number, symbol, _, _ in ROWS}
    pairs = re.findall(r"\b(\w+) \(Eq\. (\d+)\)", ERRATA)
    known = [(symbol, int(number)) for symbol, number in pairs if symbol in symbols.values()]
    assert len(known) >= 4, "C, P_lost, E_S and B_pd"
    assert [(symbol, number) for symbol, number in known if symbols[number] != symbol] == []


def test_nothing_cites_an_equation_that_the_paper_does_not_have():
    pages = [*(ROOT / "docs").rglob("*.md"), ROOT / "README.md", *MODULES]
    found = set().union(*(cited(path.read_text()) for path in pages))
    assert found == set(range(1, N_EQUATIONS + 1))
