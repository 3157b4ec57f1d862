"""Compiled functions: outdated results are never taken from the cache; kernels that are handed to other kernels."""

import ast
import copy
import logging
import os
import pickle
import re
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any, NamedTuple

import numba
import numpy as np
import pytest

from swarm_forage_env._internal import compiling
from swarm_forage_env._internal.compiling import Callback, direct, kernel
from swarm_forage_env._internal.held import hold
from tests.support.branches import pickled

INNER = """
from swarm_forage_env._internal.compiling import kernel

@kernel
def inner(x: float) -> float:
    return x + {added}
"""
OUTER = """
from swarm_forage_env._internal.compiling import kernel
from .inner import inner

@kernel
def outer(x: float) -> float:
    return inner(x)
"""


@pytest.fixture
def package(tmp_path):
    folder = tmp_path / "controllers"
    folder.mkdir()
    (folder / "__init__.py").touch()
    return folder


def call(folder: Path, program: str) -> str:
    """Run a program that can import `folder`, in a process of its own with a cache beside the folder."""
    places = [str(folder.parent), str(Path(compiling.__file__).parents[2])]
    environ = os.environ | {"NUMBA_CACHE_DIR": str(folder.parent / "cache"), "NUMBA_DISABLE_JIT": "0"}
    environ["PYTHONDONTWRITEBYTECODE"] = "1"  # Python's own cache does not notice two edits within a second
    run = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:0] = {places!r}; {program}"],
        env=environ,
        capture_output=True,
        text=True,
        check=False,
    )
    assert run.returncode == 0, run.stderr
    return run.stdout.strip()


def test_an_edit_of_one_module_reaches_what_another_has_compiled_in(package):
    program = "from controllers.outer import outer; print(outer(1.0), sum(outer.stats.cache_hits.values()))"
    (package / "outer.py").write_text(OUTER)
    (package / "inner.py").write_text(INNER.format(added=1.0))
    assert call(package, program) == "2.0 0"
    assert call(package, program) == "2.0 1", "what is up to date comes from the cache"
    (package / "inner.py").write_text(INNER.format(added=2.0))
    assert call(package, program) == "3.0 0"
    (of_folder,) = (package.parent / "cache").glob("controllers-*")
    assert len(list(of_folder.iterdir())) == 1, "what was made of former sources is gone"


ROOT = Path(compiling.__file__).parents[2]


def has_kernels(file: Path) -> bool:
    return re.search(r"^@(inline_kernel|kernel|part)$", file.read_text(), re.MULTILINE) is not None


FOLDERS = sorted(
    {
        file.parent
        for package in ("swarm_forage_env", "baselines")
        for file in (ROOT / package).rglob("*.py")
        if has_kernels(file)
    }
)


def imported_files(file: Path) -> set[Path]:
    """Files of this distribution that a module imports, by its import statements."""
    found: set[Path] = set()
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom) and node.module is not None:
            base = ROOT.joinpath(*node.module.split(".")) if node.level == 0 else file.parent / node.module
            found |= {base.with_suffix(".py"), *(base / f"{alias.name}.py" for alias in node.names)}
    return {path for path in found if path.is_file()}


NOT_COMPILED_IN = {
    ROOT / f"swarm_forage_env/{name}.py"
    for name in (
        "contract/types",  # annotations
        "contract/policy",  # a protocol and a dataclass, for the policies beside the kernels
        "contract/kernel_policy",  # what calls the kernels
        "scenarios/quirks",  # a dataclass; kernels are handed single switches
        "_internal/numba_settings",  # where numba looks for settings
        "_internal/rng",  # kernels are handed the numbers
        "_internal/fields",  # checks of configurations
        "_internal/wording",  # error messages
    )
}
"""Imported beside kernels, but never compiled into them."""


@pytest.mark.parametrize("folder", FOLDERS, ids=lambda folder: folder.relative_to(ROOT).as_posix())
def test_every_source_of_a_kernel_is_watched(folder):
    """From the imports: what a module with kernels imports may be compiled into them, and so on."""
    reached: set[Path] = set()
    todo = set(filter(has_kernels, folder.glob("*.py")))
    while todo:
        file = todo.pop()
        reached.add(file)
        todo |= imported_files(file) - reached - NOT_COMPILED_IN
    assert reached <= set(compiling.sources_of(folder))


@compiling.kernel
def _doubled(values: np.ndarray, factor: float, out: np.ndarray) -> int:
    for i in range(values.shape[0]):
        out[i] = factor * values[i]
    return values.shape[0]


def test_a_direct_call_does_what_the_kernel_does_for_arrays_of_any_length():
    call_it = compiling.direct(_doubled, np.zeros(3), 1.0, np.zeros(3))
    for length in (0, 3, 7):
        values, out = np.arange(float(length)), np.zeros(length)
        assert call_it(values, 2.0, out) == length
        np.testing.assert_array_equal(out, 2.0 * values)


@kernel
def double(numbers):
    for i in range(numbers.size):
        numbers[i] *= 2.0


@kernel
def negate(numbers):
    for i in range(numbers.size):
        numbers[i] = -numbers[i]


@kernel
def change_thrice(change, numbers):
    for _ in range(3):
        change(numbers)


def test_a_kernel_takes_any_function_of_a_type_as_an_argument():
    """Compiled once, for one function; another takes its place."""
    numbers = np.array([1.0, 3.0])
    call = direct(change_thrice, Callback(double, numbers), numbers)
    for function, expected in ((double, [8.0, 24.0]), (negate, [-8.0, -24.0])):
        call(Callback(function, numbers), numbers)
        assert numbers.tolist() == expected


# Caches that cannot be used


@pytest.fixture
def inner(tmp_path, monkeypatch, caplog):
    """Load the module of a kernel anew, with a cache in `tmp_path`; returns its kernel."""
    monkeypatch.setattr(numba.config, "CACHE_DIR", str(tmp_path / "cache"))
    compiling._say.cache_clear()
    compiling._place_for.cache_clear()
    file = tmp_path / "inner.py"
    file.write_text(INNER.format(added=1.0))

    def load():
        caplog.clear()
        spec = spec_from_file_location("inner", file)
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        assert module.inner(1.0) == 2.0
        return module.inner

    return load


def hits(function) -> int:
    return sum(function.stats.cache_hits.values())


def test_a_first_run_is_told_once_and_a_second_one_is_none(inner, caplog):
    with caplog.at_level(logging.WARNING, "swarm_forage_env"):
        function = inner()
        caplog.clear()
        compiling._say.cache_clear()
        numba.njit(lambda x: x)(1.0)
        assert caplog.text == "", "it is a function of others"
        function(1)
        function(np.float32(1))
        assert [(record.levelname, record.message[:9]) for record in caplog.records] == [("WARNING", "Compiling")]
        compiling._say.cache_clear()
        inner()
        assert caplog.text == "", "it comes from the cache"


def test_without_a_place_for_compiled_functions_they_are_compiled_in_every_process(inner, monkeypatch, caplog):
    # Not by permissions: whoever runs the tests may be allowed to write everywhere.
    monkeypatch.setattr(os, "access", lambda *_: False)
    assert hits(inner()) == 0
    told, _ = [record.getMessage() for record in caplog.records]
    assert "Compiled functions cannot be kept" in told
    assert "Set NUMBA_CACHE_DIR" in told


BEYOND = """
from swarm_forage_env._internal.compiling import kernel

@kernel
def beyond(row: object) -> float:
    return row[5]
"""


@pytest.mark.slow
def test_kernels_check_every_index_where_numba_is_told_to(package, monkeypatch):
    (package / "beyond.py").write_text(BEYOND)
    monkeypatch.setenv("NUMBA_BOUNDSCHECK", "1")
    reading = "import numpy as np; from controllers.beyond import beyond\ntry: beyond(np.zeros(3))"
    assert call(package, f"{reading}\nexcept IndexError: print('refused')") == "refused"


class Inner(NamedTuple):
    counts: np.ndarray
    is_odd: bool


class Outer(NamedTuple):
    inner: Inner
    places: tuple[int, float]
    values: np.ndarray


@kernel
def add_up(outer: Any) -> None:
    if outer.inner.is_odd:
        outer.values[0, 0] += outer.inner.counts[1] + outer.places[0] * outer.places[1]


def new_outer() -> Outer:
    return Outer(Inner(np.array([1, 2], np.int32), True), (3, 0.5), np.zeros((2, 2)))


def test_a_held_tuple_is_read_and_written_as_the_tuple_is():
    plain, outer = new_outer(), new_outer()
    held = hold(outer)
    for _ in range(3):
        add_up(plain)
        add_up(held)
        outer.inner.counts[1] += 1
        plain.inner.counts[1] += 1
    assert outer.values[0, 0] == plain.values[0, 0] == 2 + 3 + 4 + 3 * 1.5


def test_what_is_compiled_for_a_tuple_can_be_read_without_its_class():
    assert b"Outer" not in pickle.dumps(numba.typeof(hold(new_outer())))


def test_copies_have_arrays_of_their_own():
    outer = new_outer()
    pair = outer, hold(outer)
    for theirs, held in (copy.deepcopy(pair), pickled(pair)):
        add_up(held)
        assert theirs.values[0, 0] == 3.5
    assert outer.values[0, 0] == 0.0
