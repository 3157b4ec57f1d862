"""The documents are right: examples run, commands are one line, links lead to files."""

import importlib.util
import json
import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[2]
PAGES = [ROOT / "README.md", ROOT / "CONTRIBUTING.md", *sorted((ROOT / "docs").glob("**/*.md"))]
BLOCK = re.compile(r"(<!-- not run: .+ -->\n)?^```python\n(.*?)^```", re.DOTALL | re.MULTILINE)
"""A Python example; one that takes too long for a test says so in a comment before it."""


@pytest.mark.compiled
@pytest.mark.parametrize(
    "page", [page for page in PAGES if "```python" in page.read_text()], ids=lambda page: page.name
)
def test_python_examples_run(page, tmp_path, monkeypatch):
    """The examples of a page run one after the other, as a user would type them."""
    monkeypatch.chdir(tmp_path)
    names: dict[str, object] = {}
    for number, (skipped, block) in enumerate(BLOCK.findall(page.read_text()), 1):
        if not skipped:
            exec(compile(block, f"{page.name}, example {number}", "exec"), names)  # noqa: S102 - our own documentation


@pytest.mark.parametrize("name", ["run", "tests"])
def test_marked_commands_of_the_readme_are_one_line_each(name):
    text = (ROOT / "README.md").read_text()
    blocks = re.findall(rf"^<!-- ci:{name} -->\n```bash\n(.*?)^```", text, re.DOTALL | re.MULTILINE)
    assert len(blocks) == 1
    assert len(blocks[0].splitlines()) == 1


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_relative_links_lead_to_files(page):
    targets = re.findall(r"\]\((?!https?://|#)([^)#]+)", page.read_text())
    assert [target for target in targets if not (page.parent / target).exists()] == []


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_code_blocks_are_closed_before_the_next_begins(page):
    fences = re.findall(r"^```(.*)$", page.read_text(), re.MULTILINE)
    assert len(fences) % 2 == 0
    assert [language for language in fences[1::2] if language] == []


def test_index_lists_every_page():
    listed = set(re.findall(r"\]\((\w+\.md)\)", (ROOT / "docs/index.md").read_text()))
    assert {page.name for page in (ROOT / "docs").glob("*.md")} - {"index.md"} == listed


def test_readme_table_names_every_scenario():
    from swarm_forage_env import SCENARIO_NAMES, scenario

    rows = re.findall(
        r"^\| `(\w+)` \| (\d+) x (\d+) m \| (\d+) \| (\d+) \|", (ROOT / "README.md").read_text(), re.MULTILINE
    )
    configs = [scenario(name) for name in SCENARIO_NAMES]
    assert rows == [
        (c.name, f"{c.arena.width_m:.0f}", f"{c.arena.height_m:.0f}", str(c.robots.n_robots), str(c.objects.n_objects))
        for c in configs
    ]


@pytest.fixture(scope="module")
def update_docs():
    spec = importlib.util.spec_from_file_location("update_docs", ROOT / "scripts/update_docs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_numbers_of_runs_are_those_of_the_store(update_docs):
    store = json.loads(update_docs.STORE.read_text())
    for page in update_docs.PAGES:
        text = page.read_text()
        assert update_docs.written(text, store) == text, f"{page}: scripts/update_docs"
        by_hand = update_docs.BLOCK.sub("", text)
        numbers = {value for values in store.values() for name, value in values.items() if name != "table"}
        assert [number for number in numbers if number in by_hand] == [], f"{page}: a number outside of a block"


def test_a_block_is_written_from_the_store(update_docs):
    page = "before <!-- generated: run.crw by scripts/update_docs -->1.00 ± 0.10<!-- end --> after"
    assert update_docs.written(page, {"run": {"crw": "2.00 ± 0.20"}}) == page.replace("1.00 ± 0.10", "2.00 ± 0.20")


def test_deliveries_are_read_from_a_printed_table(update_docs):
    printed = json.loads(update_docs.STORE.read_text())["run"]["table"]
    stored = update_docs.fields(f"said before\n{printed}\nsaid after\n", update_docs.FIVE)
    assert stored == json.loads(update_docs.STORE.read_text())["run"]
    with pytest.raises(ValueError, match="deliveries of crw"):
        update_docs.fields(printed, ("crw",))
