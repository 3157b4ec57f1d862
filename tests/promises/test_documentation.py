"""The documents are right: examples run, commands are one line, links lead to files."""

import json
import re
from pathlib import Path

import pytest

from scripts import update_docs
from scripts.results_numbers import results_fields
from swarm_forage_env.runs import workers

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("**/*.md"))]
BLOCK = re.compile(r"(?:<!-- (not run: .+|needs \w+) -->\n)?^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
"""A Python example. One that takes too long for a test, or needs an extra, says so in a comment before it."""


def examples(page: Path) -> list[tuple[str, str]]:
    """(what the comment says or nothing, the code) of each example that a test can run."""
    return [(needs, block) for needs, block in BLOCK.findall(page.read_text()) if not needs.startswith("not run")]


def run_all(blocks, page):
    names: dict[str, object] = {}
    for number, block in enumerate(blocks, 1):
        exec(compile(block, f"{page.name}, example {number}", "exec"), names)  # noqa: S102 - our own documentation


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES if "```python" in page.read_text()], ids=lambda page: page.name
)
def test_python_examples_run(page, tmp_path, monkeypatch):
    """The examples of a page run one after the other, as a user would type them, without any extra."""
    # Processes take longer to start than these runs.
    monkeypatch.setattr(workers, "processes_of", lambda *_: 1)
    monkeypatch.chdir(tmp_path)
    run_all([block for needs, block in examples(page) if not needs], page)


@pytest.mark.slow
@pytest.mark.parametrize(
    "page", [page for page in PAGES if "<!-- needs " in page.read_text()], ids=lambda page: page.name
)
def test_python_examples_run_with_their_extras(page, tmp_path, monkeypatch):
    for needs, _ in examples(page):
        if needs:
            pytest.importorskip(needs.removeprefix("needs "))
    monkeypatch.chdir(tmp_path)
    run_all([block for _, block in examples(page)], page)


@pytest.mark.parametrize("file", sorted((ROOT / "docs/examples").glob("*.py")), ids=lambda file: file.name)
def test_files_of_examples_stand_in_a_page_or_are_linked_from_one(file):
    shown, linked = f"```python\n{file.read_text()}```\n", f"](examples/{file.name})"
    texts = [page.read_text() for page in PAGES]
    assert any(shown in text or linked in text for text in texts), f"{file}: no page shows it as it is, or links to it"


def test_relative_links_lead_to_files():
    targets = [
        (page, link) for page in PAGES for link in re.findall(r"\]\((?!https?://|#)([^)#\s]+)", page.read_text())
    ]
    assert [(page.name, target) for page, target in targets if not (page.parent / target).exists()] == []


def test_index_lists_every_page():
    items = "".join(re.findall(r"^- .*$", (ROOT / "docs/index.md").read_text(), re.MULTILINE))  # as docs/conf.py reads
    listed = set(re.findall(r"\]\((\w+\.md)\)", items))
    assert {page.name for page in (ROOT / "docs").glob("*.md")} - {"index.md"} == listed


def test_table_of_worlds_names_every_scenario():
    from swarm_forage_env import SCENARIO_NAMES, scenario

    page = (ROOT / "docs" / "worlds.md").read_text()
    rows = re.findall(r"^\| `\w+` \| [\d.]+ x .+? \|.+?\|.+?\|", page, re.MULTILINE)
    configs = [scenario(name) for name in SCENARIO_NAMES]
    assert rows == [
        f"| `{c.name}` | {c.arena.width_m:g} x {c.arena.height_m:g} m | {c.robots.n_robots} | {c.objects.n_objects} |"
        for c in configs
    ]


def test_numbers_of_runs_are_those_of_the_store():
    store = json.loads(update_docs.STORE.read_text())
    known = update_docs.known(store)
    for page in update_docs.PAGES:
        text = page.read_text()
        assert update_docs.written(text, known) == text, f"{page}: scripts/update_docs"
        by_hand = update_docs.BLOCK.sub("", text)
        numbers = {values[name] for source, values in store.items() for name in update_docs.SOURCES[source][1]}
        assert [number for number in numbers if number in by_hand] == [], f"{page}: a number outside of a block"


def test_answers_and_means_are_those_beside_the_results(tmp_path):
    (tmp_path / "runs.csv").write_text("set,runs,version,hours\nS1a,1200,0.1.0,0.26\nS1b,40,0.1.0,\n")
    (tmp_path / "measures.csv").write_text(
        "set,measure,form,rules,others,policy,value,mean\n"
        "S1a,raw_performance,marginal,described,,crw,128.0,456.375\n"
        "S2a,raw_performance,marginal,described,walk_probability 0,crw,128.0,1\n"
        "S1a,spatial_emergence,interactive,described,,crw,4.0,1\n"
    )
    (tmp_path / "verdicts.csv").write_text(
        "claim,rules,reading,is_main,answer,n_held,n_statements\n"
        "R1,described,amounts,false,supported,2,2\nR1,described,shares,true,contradicted,0,2\n"
        "R1,described,bands,false,open,1,2\nR1,program,amounts,false,supported,2,2\n"
        "R1,program,shares,true,supported,2,2\nR1,program,bands,false,open,1,2\n"
        "V1,described,amounts,true,supported,0,0\nV1,program,amounts,true,supported,0,0\n"
    )
    (tmp_path / "contrasts.csv").write_text(
        "claim,rules,reading,mean,lower,upper\nR1,described,shares,,,\nR1,described,shares,0.0512,0.021,0.0833\n"
    )
    found = results_fields(tmp_path)
    assert (found["V1"], found["R1"]) == ("supported, supported", "contradicted, supported")
    assert (found["R1_amounts"], found["R1_shares_described"]) == ("supported, supported", "0 of 2")
    assert found["R1_2_shares_described"] == "5.1 % (2.1 to 8.3)"
    assert [name for name in found if name.startswith(("S1", "S2"))] == [
        "S1a_raw_performance_described_crw_128",
        "S2a_raw_performance_described_crw_128_walk_probability_0",
    ]
    assert found["S1a_raw_performance_described_crw_128"] == "456.4"
    assert (found["runs"], found["sets"], found["hours"], found["version"]) == ("1,240", "2", "0.3", "0.1.0")
    assert found["contradicted"] == "None."
    assert found["split"].splitlines()[2].endswith("| contradicted | supported |")
    assert found["answers"].splitlines()[2].startswith("| described | 1 | 1 | 0 | 0 | 0 |")
    assert found["readings"].splitlines()[2] == "| R1 | +/-/? | +/+/? |"
    block = "<!-- generated: results.split by scripts/update_docs -->"
    assert f"{block}\n\n| claim |" in update_docs.written(f"{block}<!-- end -->", {"results": found})
