"""Compiled functions: nothing out of date is taken from the cache."""

import os
import subprocess
import sys
from pathlib import Path

from swarm_forage_env._internal import compiling

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
CALL = "from controllers.outer import outer; print(outer(1.0), sum(outer.stats.cache_hits.values()))"


def test_an_edit_of_one_module_reaches_what_another_has_compiled_in(tmp_path):
    package = tmp_path / "controllers"
    package.mkdir()
    (package / "__init__.py").touch()
    (package / "outer.py").write_text(OUTER)
    environ = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0"}
    environ["PYTHONDONTWRITEBYTECODE"] = "1"  # Python's own cache does not notice two edits within a second
    root = str(Path(compiling.__file__).parents[2])

    def call() -> str:
        run = subprocess.run(
            [sys.executable, "-c", f"import sys; sys.path[:0] = [{str(tmp_path)!r}, {root!r}]; {CALL}"],
            env=environ,
            capture_output=True,
            text=True,
            check=True,
        )
        return run.stdout.strip()

    (package / "inner.py").write_text(INNER.format(added=1.0))
    assert call() == "2.0 0"
    assert call() == "2.0 1", "what is up to date comes from the cache"
    (package / "inner.py").write_text(INNER.format(added=2.0))
    assert call() == "3.0 0"
