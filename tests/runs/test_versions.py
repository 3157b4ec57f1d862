"""What made a run: versions, and the digest of our code."""

import ast
import io
import sys
import tokenize
from pathlib import Path

import numpy as np
import pytest

from swarm_forage_env.runs import versions
from swarm_forage_env.runs.versions import (
    CODE_OF_RUNS,
    PACKAGES,
    VERSION_NAMES,
    code_digest,
    code_of,
    digest_of,
    identity,
    software_versions,
)


def test_versions_are_known_for_every_package():
    found = software_versions()
    assert set(PACKAGES) <= found.keys() <= set(VERSION_NAMES)
    assert found["numpy"] == np.__version__


IN_A_RUN = ("_internal", "contract", "scenarios", "world", "wrappers")
"""Folders of swarm_forage_env that every tick of a run may go through."""


def test_every_library_that_computes_in_a_run_is_in_its_record():
    package = Path(versions.__file__).parents[1]
    files = [file for folder in IN_A_RUN for file in (package / folder).rglob("*.py")]
    files += (package.parent / "baselines").rglob("*.py")
    imports = [node for file in files for node in ast.walk(_without_types(ast.parse(file.read_text())))]
    modules = {node.module for node in imports if isinstance(node, ast.ImportFrom) and node.level == 0}
    modules |= {alias.name for node in imports if isinstance(node, ast.Import) for alias in node.names}
    libraries = {module.split(".")[0] for module in modules} - sys.stdlib_module_names - {package.name}
    assert "numpy" in libraries
    assert libraries <= set(PACKAGES)


def _without_types(tree):
    """What only a type checker imports computes nothing."""
    tree.body = [
        node for node in tree.body if not (isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING")
    ]
    return tree


def test_the_commit_is_absent_outside_a_checkout(tmp_path, monkeypatch):
    monkeypatch.setattr(versions, "__file__", str(tmp_path / "versions.py"))
    assert versions._commit.__wrapped__() == ""


def test_the_digest_is_that_of_the_installed_code():
    package = Path(versions.__file__).parents[1]
    assert software_versions()["code"] == code_digest() == digest_of(package, package.parent / "baselines")


def _installed(folder):
    """Two small packages, as the real ones are laid out."""
    for name in ("swarm_forage_env/world/tick.py", "swarm_forage_env/env.py", "baselines/dpo.py"):
        file = folder / name
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text(f"name = {name!r}")
    return folder / "swarm_forage_env", folder / "baselines"


def test_the_digest_is_the_same_wherever_the_code_is_installed(tmp_path):
    here, there = _installed(tmp_path / "here"), _installed(tmp_path / "there")
    assert digest_of(*here) == digest_of(*there)


def test_the_digest_changes_with_code_that_runs_depend_on_alone(tmp_path):
    package, baselines = _installed(tmp_path)
    before = digest_of(package, baselines)
    for name in ("cli/app.py", "world/tick.md", "world/__pycache__/tick.pyc"):
        (package / name).parent.mkdir(exist_ok=True)
        (package / name).write_text("of no matter")
    assert digest_of(package, baselines) == before
    found = {before}
    for file in (package / "world" / "tick.py", package / "env.py", baselines / "dpo.py", package / "world" / "new.py"):
        file.write_text("other code")
        found.add(digest_of(package, baselines))
    (package / "world" / "new.py").rename(package / "world" / "newer.py")
    found.add(digest_of(package, baselines))
    assert len(found) == 6


PLAIN = """def drive(row):
    text = "# no comment", '"#" '
    return [
        "a string",
        row,
    ]"""
TOLD = '''"""What it is."""
# Why.

def drive(row):  # a note
    """Drive.

    No comment: #. Not the end: \\""" " '
    """

    'said in passing'  # as well
    text = "# no comment", '"#" '
    return [
        "a string",  # the first

        # And then
        row,
    ]
'''


def test_comments_docstrings_and_blank_lines_are_no_code():
    assert code_of(TOLD) == code_of(PLAIN) == PLAIN


@pytest.mark.parametrize("changed", ["# no comment", '"#" ', "a string", "row,"])
def test_strings_are_code(changed):
    assert code_of(PLAIN.replace(changed, "other")) != PLAIN


def _slowly(source):
    """The same by Python's own tokens: no comments, and no statement that is a string alone."""
    others = (tokenize.COMMENT, tokenize.NL, tokenize.INDENT, tokenize.DEDENT)
    tokens = [token for token in tokenize.generate_tokens(io.StringIO(source).readline) if token.type not in others]
    kept, statement = [], []
    for token in tokens:
        statement.append(token)
        if token.type == tokenize.NEWLINE:
            if [part.type for part in statement] != [tokenize.STRING, tokenize.NEWLINE]:
                kept += [part.string for part in statement]
            statement = []
    return _squeezed("".join(kept))


def _squeezed(text):
    """Without spaces, and without braces, which tokens of newer Pythons tell otherwise in f-strings."""
    return "".join(text.translate({ord("{"): None, ord("}"): None}).split())


def test_what_is_left_of_our_code_is_what_python_reads():
    package = Path(versions.__file__).parents[1]
    parts = [package / part for part in CODE_OF_RUNS] + [package.parent / "baselines"]
    files = [file for part in parts for file in (part.rglob("*.py") if part.is_dir() else (part,))]
    assert len(files) > 100
    for file in files:
        source = file.read_text(encoding="utf-8")
        assert _squeezed(code_of(source)) == _slowly(source), file


def test_runs_are_told_apart_by_code_and_not_by_commits():
    made = {**dict.fromkeys(PACKAGES, "1"), "code": "a", "commit": "x"}
    assert identity(made) == identity(made | {"commit": "y"}) != identity(made | {"code": "b"})
    assert identity(made) != identity(made | {"numpy": "2"})
    older = {name: version for name, version in made.items() if name != "code"}
    assert identity(older) != identity(made)
    assert identity(older) != identity(older | {"commit": "y"})
