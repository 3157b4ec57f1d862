"""The documents are right: examples run, links lead to files, names are listed, notebooks hold what they print."""

import json
import re
import subprocess
import sys
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path

import numpy as np
import pytest

from scripts import update_docs
from swarm_forage_env import RunSpec, World, run_one, scenario
from swarm_forage_env.runs import workers
from swarm_forage_env.training.evaluation import read_evaluations
from swarm_forage_env.training.plan import read_plan

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
    assert file.stem in {*NEEDS, "leave_rules_out"}, "each is tried"


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
    from swarm_forage_env import SCENARIO_NAMES

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


LISTED = [
    name
    for page in (ROOT / "docs/api").glob("*.md")
    for row in re.findall(r"^\| (`.+?`) \|", page.read_text(), re.MULTILINE)
    for name in re.findall(r"`([\w.]+)`", row)
]


@pytest.mark.parametrize("package", ["swarm_forage_env", "metrics"])
def test_every_public_name_is_listed_once(package):
    names = [name.rpartition(".")[2] for name in LISTED]
    assert [name for name in import_module(package).__all__ if names.count(name) != 1] == []


@pytest.fixture(params=sorted((ROOT / "docs/notebooks").glob("*.ipynb")), ids=lambda path: path.stem)
def notebook(request):
    return json.loads(request.param.read_text(encoding="utf-8"))


def test_notebooks_hold_what_their_cells_print(notebook):
    cells = [cell for cell in notebook["cells"] if cell["cell_type"] == "code"]
    outputs = [output for cell in cells for output in cell["outputs"]]
    assert [cell["execution_count"] for cell in cells] == list(range(1, len(cells) + 1))
    assert outputs
    assert {output["output_type"] for output in outputs} <= {"stream", "display_data", "execute_result"}, "no errors"
    assert {output.get("name", "stdout") for output in outputs} == {"stdout"}, "no warnings"


# Examples for learning libraries, each in a process of its own, where the library is installed

NEEDS = {
    "agilerl_ppo": "agilerl",
    "benchmarl_ippo": "benchmarl",
    "cleanrl_ppo": "torch",
    "evolve_network": "numpy",
    "mappo": "torch",
    "optuna_search": "optuna",
    "rllib_ppo": "ray",
    "sb3_contrib_recurrent_ppo": "sb3_contrib",
    "stable_baselines3_ppo": "stable_baselines3",
    "torchrl_ppo": "torchrl",
}
"""Example -> module that it needs."""
PLANNED = ("evolve_network", "mappo", "sb3_contrib_recurrent_ppo")
"""Examples that train by a plan, here one of two stages."""
TOLD = (str(ROOT / "tests/support/tiny_plan.toml"), "1", "trained")
LENGTH = re.compile(r"^N_DECISIONS = [\d_]+", re.MULTILINE)
"""How long an example trains: minutes, here until all of its code has run once."""


@pytest.mark.slow
@pytest.mark.parametrize("name", NEEDS)
def test_an_example_trains_a_policy_that_runs(name, tmp_path):
    if find_spec(NEEDS[name]) is None:
        pytest.skip(f"needs {NEEDS[name]}, see docs/libraries.md")
    program, n_lengths = LENGTH.subn("N_DECISIONS = 1_000", (ROOT / "docs/examples" / f"{name}.py").read_text())
    assert n_lengths == (name not in ("optuna_search", *PLANNED))
    (tmp_path / "example.py").write_text(program)
    command = [sys.executable, "-W", "ignore", "example.py", *(TOLD if name in PLANNED else ())]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-4000:]
    if name in PLANNED:
        last = read_evaluations(tmp_path / "trained/evaluations.csv")[-1]
        assert last.steps >= read_plan(tmp_path / "trained/plan.json").total_steps
    policy = next(tmp_path.rglob("policy.*"))
    small = scenario("warehouse_small", n_robots=8, horizon_s=200.0)
    record = run_one(RunSpec(world=World(small), policy=str(policy), seed=1))
    assert np.isfinite(record["performance"]).all()
