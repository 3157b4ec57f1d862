"""The report on studies in a real browser: it fits, sorts, and asks for nothing."""

import re
from base64 import b64decode
from functools import cache

import pytest

from metrics.claims import CLAIMS, INTUITIONS
from metrics.scoring import report
from swarm_forage_env.studies.study import Axis
from swarm_forage_env.studies.study_file import load_study
from tests.support.browser import Browser, chromium
from tests.support.made_tables import FOUR, made_study, made_table

LOADED = "document.readyState === 'complete'"


def by_policy(place):
    return (10.0 - FOUR.index(place.policy)) * place.values[-1]


def rows_of(text, table, name):
    """The rows of a claim in one of the tables: each claim has one, wherever it is."""
    tables = re.findall(rf'<table[^>]* id="{table}(?:-waiting)?">(.*?)</table>', text, re.DOTALL)
    rows = [part for table in tables for part in table.split("<tbody>")[1:]]
    return [row for row in rows if f'id="claim-{name}"' in row]


def in_order(name):
    """A1, A2, ..., A10."""
    return name[0], int(name[1:])


@cache
def page(*specs):
    """The page about studies; several tests read the same one."""
    tables = [made_table(spec, by_policy) for spec in specs]
    return report(*tables).html()


def page_of_two() -> str:
    """A page about two sets, one with two axes."""
    walking = Axis(name="walk_probability", values=(0.0, 0.051))
    return page(made_study(), made_study("S2a", walking, Axis(name="population_size", values=(2, 4))))


@pytest.fixture(scope="module")
def written(tmp_path_factory):
    """The page of two in a file."""
    chromium()  # skips before the page is made
    folder = tmp_path_factory.mktemp("report")
    (folder / "report.html").write_text(page_of_two())
    return folder / "report.html"


@pytest.mark.parametrize("width", [390, 1280])
def test_it_fits_and_asks_for_nothing(written, tmp_path, width):
    with Browser(tmp_path, width=width, height=900) as browser:
        browser.open(written, LOADED)
        assert browser.ask("document.documentElement.scrollWidth") <= width
        assert [address for address in browser.requests if not address.startswith("data:")] == []
        assert browser.complaints == []
        browser.ask("for (const one of document.querySelectorAll('details')) one.open = true")
        assert browser.ask("document.documentElement.scrollWidth") <= width, "unfolded, too"
        browser.wait_for("[...document.images].every((image) => image.naturalWidth > 100)")
        shown = "[...document.images].filter((image) => !image.closest('details')).length"
        assert browser.ask(shown) == 17, "five and four figures, four of them with a map, and four of theory"


def test_all_answers_are_seen_at_1300_pixels(tmp_path):
    (tmp_path / "report.html").write_text(page(made_study(rules=("described", "program"))))
    with Browser(tmp_path, width=1300, height=900) as browser:
        browser.open(tmp_path / "report.html", LOADED)
        headings = "[...document.querySelectorAll('#verdicts th')].map((one) => one.innerText)"
        assert len(browser.ask(headings)) == 2 + 6
        assert (
            browser.ask("(box => box.scrollWidth - box.clientWidth)(document.querySelector('#verdicts').parentElement)")
            == 0
        )


def test_tables_are_sorted_by_a_click(written, tmp_path):
    names = "[...document.querySelectorAll('#verdicts .name')].map((condition) => condition.textContent)"
    with Browser(tmp_path, width=1280, height=900) as browser:
        browser.open(written, LOADED)
        before = browser.ask(names)
        below = (
            "[...document.querySelectorAll('#verdicts .behind')].map((row) => row.innerText.match(/[A-Z][0-9]+/)[0])"
        )
        browser.click("#verdicts th button")
        assert browser.ask(names) == browser.ask(below) == sorted(before, key=in_order)
        browser.click("#verdicts th button")
        assert browser.ask(names) == sorted(before, key=in_order, reverse=True)
        assert browser.ask("document.querySelector('#verdicts th').getAttribute('aria-sort')") == "descending"


def test_printing_unfolds_what_is_folded(written, tmp_path):
    n_open = "document.querySelectorAll('details[open]').length"
    with Browser(tmp_path, width=1280, height=900) as browser:
        browser.open(written, LOADED)
        assert browser.ask(n_open) == 0
        browser.ask("dispatchEvent(new Event('beforeprint'))")
        assert browser.ask(n_open) == browser.ask("document.querySelectorAll('details').length") > 0
        browser.ask("dispatchEvent(new Event('afterprint'))")
        assert browser.ask(n_open) == 0


def test_a_set_is_run_again_by_its_name():
    spec = load_study("S1a", "smoke", seeds=1, rules=("described",))
    text = page(spec)
    assert "<pre>swarm-forage study run S1a --budget smoke --seeds 1 --rules described</pre>" in text
    assert spec.study_id in text


def test_a_figure_has_its_claims_beside_it():
    text = page(made_study())
    article = next(part for part in text.split("<article") if "<h3>S1a: raw performance" in part)
    assert "<strong>P2</strong></a> The small warehouse shows the same picture." in article
    assert "<strong>E1</strong>" not in article
    assert "supported" in article.split("P2</strong>")[1]
    organised = next(part for part in text.split("<article") if "<h3>S1a: task emergence" in part)
    assert 'class="claims"' not in organised, "the paper claims nothing of it"


def test_a_claim_that_needs_another_set_says_which():
    article = next(part for part in page(made_study("S1b")).split("<article") if "<h3>S1b: task emergence" in part)
    assert re.search(r"<b>corrected; [^<]+</b> <small>waits</small>", article)
    (row,) = rows_of(page(made_study("S1b")), "verdicts", "D2")
    assert "<small>waits for S1h population robustness" in row


def test_what_the_paper_expected_stands_below_its_claims():
    table = page_of_two().split('id="intuitions"')[1].split("</table>")[0]
    assert "CRW: Moving objects do not affect it" in table, "H14 needs no other set"
    assert '<span class="answer supported">' in table
    assert "waits" not in table, "those that do are folded"
    assert [len(rows_of(page_of_two(), "intuitions", name)) for name in INTUITIONS] == [1] * len(INTUITIONS)


def test_every_claim_is_listed_with_what_stands_behind_its_answers():
    text = page(made_study())
    claims = {name: row for name in CLAIMS for row in rows_of(text, "verdicts", name)}
    assert [*claims] == [*CLAIMS]
    (told,) = re.findall(r"<b>described, corrected(?:;[^<]*)?</b>(.*?)</p>", claims["P2"])
    assert re.search(r"supported.*by bands \w+, statistic [-\d.]+, effect [\d.]+ %, 6 runs: \w", told)
    assert "waits for S1b task emergence" in claims["E5"]
    assert "<b>formula</b>" in claims["V1"]
    assert re.search(r"<b>formula</b> .*supported.*statistic 0\.4018", claims["V1"])


def test_reasons_and_titles_are_said_once():
    text = page(made_study())
    reasons = re.findall(r"<small>([^<]{40,})</small>", text)
    assert len(reasons) > 20
    by_row = [
        re.findall(r"<small>([^<]{40,})</small>", row) for name in CLAIMS for row in rows_of(text, "verdicts", name)
    ]
    assert all(len(set(row)) == len(row) for row in by_row)
    assert [part for part in text.split("<article")[1:] if re.search(r"<small>[^<]{40,}</small>", part)] == []
    first = text.split('class="pictures"')[1]
    picture = b64decode(re.findall(r'src="data:image/svg\+xml;base64,([^"]+)"', first)[0]).decode()
    assert "rules described" not in picture
    assert "<figcaption>bars: 95 % interval of the mean; dots: runs</figcaption>" in first


def test_a_study_shows_its_arena():
    (words,) = re.findall(r'<img src="data:image/png;base64,[^"]+" alt="([^"]+)">', page(made_study()))
    assert words == "S1a: the arena when a run begins"


def test_what_follows_from_formulas_stands_beside_its_curves():
    theory = page(made_study()).split('id="theory"')[1].split("</section>")[0]
    articles = {part.split("</h3>")[0].split("<h3>")[1]: part for part in theory.split("<article")[1:]}
    (availability,) = (part for title, part in articles.items() if "availability" in title)
    assert re.findall(r"<strong>(\w+)</strong>", theory) == re.findall(r"<strong>(\w+)</strong>", availability)
    assert re.findall(r"<strong>(\w+)</strong>", availability) == ["V1", "V2", "V3"]
    assert re.search(r"<b>formula</b> .*supported", availability)
    assert len(articles) == 4, "self-organisation, flexibility, availability, the task graph"


def test_other_forms_of_a_measure_are_drawn_where_claims_are_judged_by_them():
    articles = {part.split("</h3>")[0].split("<h3>")[1]: part for part in page(made_study()).split("<article")[1:]}
    forms = {title: part.count("The same, measured as") for title, part in articles.items()}
    assert forms["S1a: raw performance (higher is better), rules described"] == 1, "as in the program"
    assert forms["S1a: task emergence (higher is better), rules described"] == 0, "no claim is about it"
