"""Compiled controllers: nothing out of date is taken from the cache, and records keep their kinds apart."""

import os
import shutil
import subprocess
import sys
from itertools import permutations
from pathlib import Path

import numpy as np
from numba import from_dtype

from baselines import compiling
from baselines.cache_memory import CACHE
from baselines.crw import CRWPolicy
from baselines.dpo import DPOPolicy
from baselines.stochx import STOCHXPolicy
from tests.policies.observations import make_task

INNER = """
from .compiling import kernel

@kernel
def inner(x: float) -> float:
    return x + {added}
"""
OUTER = """
from .compiling import kernel
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
    shutil.copy(compiling.__file__, package)
    (package / "outer.py").write_text(OUTER)
    environ = os.environ | {"NUMBA_CACHE_DIR": str(tmp_path / "cache"), "NUMBA_DISABLE_JIT": "0"}
    environ["PYTHONDONTWRITEBYTECODE"] = "1"  # Python's own cache does not notice two edits within a second
    root = str(Path(compiling.__file__).parents[1])

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


def test_no_record_passes_for_a_shorter_one():
    """Otherwise numba takes a function compiled for the one for the other as well, with a warning at every call."""
    robots, constants = [], []
    for policy in (CRWPolicy(), DPOPolicy(), STOCHXPolicy()):
        policy.reset(make_task(), np.random.default_rng(0))
        robots.append(from_dtype(policy._robots.dtype))
        constants.append(from_dtype(policy._constants.dtype))
    assert robots[0] == robots[1] != robots[2]
    records = [*robots[1:], *constants, from_dtype(CACHE)]
    for one, other in permutations(records, 2):
        assert one.can_convert_to(None, other) is None
