"""The report page: texts are escaped, nothing is loaded from elsewhere, nothing may be missing."""

import pytest
from jinja2 import UndefinedError

from swarm_forage_env.rendering.pages import build_report, picture_address

FIGURE = {
    "title": "a < b",
    "pictures": [{"address": picture_address(b"<svg/>"), "words": "curves", "caption": "bars"}],
    "claims": [],
    "others": [],
    "numbers": {"header": ["policy", "mean"], "rows": [("crw", 0.12345678), ("dpo", None)]},
    "pairs": {"header": [], "rows": []},
}
VALUES = {
    "title": "<b>bold</b>",
    "answers": [],
    "columns": [],
    "counts": [],
    "claims": [],
    "intuitions": [],
    "theory": [],
    "studies": [
        {
            "name": "mine",
            "anchor": "study-1",
            "title": "</script>",
            "state": "",
            "figures": [FIGURE],
            "models": [],
            "snapshot": {"address": picture_address(b"<svg/>"), "words": "the arena"},
            "conditions": {"header": [], "rows": []},
            "missing": [],
            "settings": "",
        }
    ],
    "cost": [["mine", "full", 3, 12000, 1.5e6, 2.0]],
    "version_names": [],
    "versions": [],
    "commands": "",
}


def test_texts_are_escaped():
    page = build_report(VALUES)
    assert "<title>&lt;b&gt;bold&lt;/b&gt;</title>" in page
    assert "mine: &lt;/script&gt;" in page
    assert "a &lt; b" in page


def test_the_page_holds_all_of_itself():
    page = build_report(VALUES)
    assert "default-src 'none'" in page
    assert "http://" not in page
    assert "https://" not in page
    assert 'src="data:image/svg+xml;base64,PHN2Zy8+"' in page
    assert "aria-sort" in page
    assert "@media print" in page


def test_numbers_are_short_and_keep_their_value_for_sorting():
    page = build_report(VALUES)
    assert '<td class="number" data-value="0.12345678">0.1235</td>' in page
    assert "<td>-</td>" in page
    assert "12,000" in page
    assert "1,500,000" in page


def test_without_claims_there_is_no_part_about_them():
    assert 'id="claims"' not in build_report(VALUES)


def test_a_missing_value_is_an_error():
    with pytest.raises(UndefinedError, match="commands"):
        build_report({name: value for name, value in VALUES.items() if name != "commands"})
