"""The checks of the house find what they are for: scripts/check_habits.py, --no-skips and --skips-to."""

import ast
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from scripts import check_habits

ROOT = Path(__file__).resolve().parents[2]
MAP = "## Where things are\n\n```\nmetrics/       the measures\n    scoring/   tables\ntests/ scripts/\n```\n"


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("import os  # noqa\n", True),
        ("import os  # noqa: F401\n", True),
        ("import os  # noqa: F401 - registers the environments\n", False),
        ("x = f()  # type: ignore\n", True),
        ("x = f()  # type: ignore[attr-defined]\n", True),
        ("x = f()  # type: ignore[attr-defined]  (the library has no types)\n", False),
        ("x = f()  # pyright: ignore[reportCallIssue]\n", True),
        ("x = f()  # pyright: ignore[reportCallIssue]  (numba hides it)\n", False),
        ("# pyright: strict=false\n", True),
        ("# numba hides its types\n# pyright: reportCallIssue=false\n", False),
        ("x = 1\n# pyright: reportCallIssue=false\n", True),
        ("text = '# noqa'\n", False),
    ],
)
def test_an_ignore_without_a_reason_is_found(source, found):
    assert bool(list(check_habits.ignores_without_reason(source))) is found


@pytest.mark.parametrize(
    ("source", "found"),
    [
        ("from metrics.scaling import _share\n", ["_share"]),
        ("from .scaling import _share\n", ["_share"]),
        ("from metrics import scaling\nscaling._share(1)\n", ["scaling._share"]),
        ("import metrics.scaling as s\ns._share(1)\n", ["s._share"]),
        ("from metrics import scaling\ndef f(scaling): scaling._share\n", []),
        ("from swarm_forage_env import _internal\n", []),
        ("from metrics.scaling import share\nshare(1)\n", []),
        ("from numpy import _core\n", []),
    ],
)
def test_a_private_name_of_another_file_is_found(source, found):
    assert [name for _, name in check_habits.private_imports(ast.parse(source), of_tests=False)] == found


def test_tests_may_reach_into_a_module_but_import_nothing_private():
    source = "from metrics import scaling\nfrom metrics.scaling import _share\nscaling._share(1)\n"
    assert [name for _, name in check_habits.private_imports(ast.parse(source), of_tests=True)] == ["_share"]


def test_the_map_is_held_to_the_tree(tmp_path, monkeypatch, capsys):
    for folder in ("metrics", "tests", "scripts"):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "file.py").touch()
    (tmp_path / "baselines").mkdir()
    (tmp_path / "baselines/new.py").write_text("from metrics.file import _share  # noqa\n")
    (tmp_path / "CONTRIBUTING.md").write_text(MAP)
    subprocess.run(["git", "init", "--quiet", "."], cwd=tmp_path, check=True)
    monkeypatch.setattr(check_habits, "ROOT", tmp_path)
    assert check_habits.main() == 1
    assert capsys.readouterr().out.splitlines() == [
        "baselines/new.py:1: expected a rule and a reason behind it, got # noqa",
        "baselines/new.py:1: _share is private to another file; give it a public name there",
        "CONTRIBUTING.md: baselines/ is missing in the map",
        "CONTRIBUTING.md: metrics/scoring/ is in the map, but not in the tree",
        "4 habits broken",
    ]


def run_tests(folder: Path, source: str, *options: str) -> subprocess.CompletedProcess[str]:
    """Run files of tests under our conftest: one with this source, and those that are there."""
    shutil.copy(ROOT / "tests/conftest.py", folder)
    (folder / "test_it.py").write_text(f"import pytest\n{source}")
    program = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", "--rootdir", str(folder), *options]
    return subprocess.run(program, cwd=folder, capture_output=True, text=True, check=False)


PASSES = "def test_passes(): pass\n"
NAMED = "def test_named(): pytest.skip('needs ray, see docs/libraries.md')\n"
UNNAMED = "def test_unnamed(): pytest.skip('no time')\n"


@pytest.mark.parametrize("spread", [(), ("-n", "2")], ids=["alone", "spread"])
def test_a_skip_without_a_name_fails_and_is_listed(tmp_path, monkeypatch, spread):
    """That of one test, and that of a file as a whole; also where two processes have them."""
    monkeypatch.setenv("NUMBA_DISABLE_JIT", "1")  # nothing is compiled first
    (tmp_path / "test_all_of_it.py").write_text(f"import pytest\npytest.importorskip('no_such_module')\n{PASSES}")
    done = run_tests(tmp_path, PASSES + NAMED + UNNAMED, "--no-skips", "--skips-to", "list", *spread)
    assert done.returncode == pytest.ExitCode.TESTS_FAILED, done.stdout
    assert sorted((tmp_path / "list").read_text().split()) == ["test_all_of_it.py", "test_it.py::test_unnamed"]
    assert "skipped, which --no-skips forbids: test_it.py::test_unnamed: no time" in done.stdout
    assert "skipped, and named: 1 x needs ray, see docs/libraries.md" in done.stdout


@pytest.mark.parametrize(("source", "options"), [(PASSES + NAMED, ["--no-skips"]), (PASSES + UNNAMED, [])])
def test_named_skips_pass_and_so_do_all_without_the_option(tmp_path, source, options):
    done = run_tests(tmp_path, source, *options)
    assert done.returncode == 0, done.stdout
    assert "forbids" not in done.stdout


@pytest.mark.parametrize(
    ("subject", "fault"),
    [
        ("world: find arrays by the types of the tuple", ""),
        ("internal, world: pass on what is given", ""),
        ("ci: feed both lanes from one list", ""),
        ("Docs: what a study shows", "no such area"),
        ("speed up", 'no "area: imperative"'),
        ("nowhere: add a table", "no such area"),
        ("world, nowhere: add a table", "no such area"),
        ("world: Add a table", "a large letter"),
        ("world: adds a table", "no imperative"),
        ("world: added a table", "no imperative"),
        ("world: adding a table", "no imperative"),
        ("world: merge two tables", "rebase instead"),
        (f"world: find {'x' * 61}", "longer than 72"),
    ],
)
def test_a_subject_that_breaks_the_habit_is_found(subject, fault, tmp_path):
    (tmp_path / "message").write_text(f"{subject}\n\nWhy it is so.\n")
    command = [ROOT / "scripts/check_subjects", "message"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
    assert (done.returncode, fault in done.stdout) == (int(bool(fault)), True), done.stdout
