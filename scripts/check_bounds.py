"""Crowded runs and pictures in which compiled kernels check every index, as the interpreter would.

    python scripts/check_bounds.py

Compiled code reads and writes beyond the end of an array without a word. Here numba compiles the checks in, into a
cache of their own, and robots that grasp and let go all the time meet walls, objects, caches and each other under both
engines and all wrappers; shapes are painted beyond the edge of a picture. Exit code 1 if an index was wrong, or if a
kernel was not reached.
"""

import ast
import os
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PLACES = ("policies/kernels/*.py", "world/kernels/*.py")
"""Where they are, in `swarm_forage_env`."""
TESTS = (
    "tests/policies/test_interface_twins.py",
    "tests/policies/test_network_twin.py",
    "tests/promises/test_conservation.py",
    "tests/rendering/test_paint.py",
    "tests/views/test_arenas.py",
    "tests/world/test_neighbourhood.py",
    "tests/wrappers/test_noise.py",
)
CHOICE = (
    "(test_objects_are_conserved and warehouse_small and busy) or test_paint or ticks_one_by_one or gains_from_outside "
    "or they_are_those_of_the_twins or as_by_the_twin or test_interface_twins or test_network_twin"
)
"""Every kind of caches with Chipmunk; shapes beyond the edge; decisions of learners, wrapped and not, with the
compiled engine; noise on wheels; neighbours and messages."""
ELSEWHERE = {
    "tick.run": "whole runs by one kernel need a compiled policy, which would be compiled, too",
    "counting.add_task_shares": "a part of tick.run",
    "disturbances.disturb_wheels": "a part of tick.run",
}
"""Kernel -> why these tests do not reach it."""


def kernels() -> set[str]:
    """Return the names of all kernels in `PLACES`, as file.function."""
    return {
        f"{file.stem}.{node.name}"
        for place in PLACES
        for file in (ROOT / "swarm_forage_env").glob(place)
        for node in ast.parse(file.read_text(encoding="utf-8")).body
        if isinstance(node, ast.FunctionDef)
        and {ast.unparse(decorator) for decorator in node.decorator_list} & {"kernel", "part"}
    }


def compiled(cache: Path) -> set[str]:
    """Return the names of the kernels that a cache holds, whose files are named file.function-line.python.nbi."""
    return {file.name.partition("-")[0] for file in cache.rglob("*.nbi")}


def main() -> int:
    """Run the tests and say what they did not reach."""
    with tempfile.TemporaryDirectory() as cache:
        environ = os.environ | {"NUMBA_BOUNDSCHECK": "1", "NUMBA_CACHE_DIR": cache, "NUMBA_DISABLE_JIT": "0"}
        words = [sys.executable, "-m", "pytest", "-q", "-x", *TESTS, "-k", CHOICE]
        code = subprocess.run(words, cwd=ROOT, env=environ, check=False).returncode
        missed = kernels() - compiled(Path(cache)) - set(ELSEWHERE)
    if missed and not code:
        print(f"Not reached: {', '.join(sorted(missed))}. Add a test of them to TESTS or CHOICE.")
    return int(bool(code or missed))


if __name__ == "__main__":
    sys.exit(main())
