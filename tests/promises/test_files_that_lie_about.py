"""No file runs code because it lies in the current folder, though nobody named it."""

import ast
import json
import os
import pickle
import re
import subprocess
import sys
from functools import cache
from importlib.util import find_spec
from pathlib import Path

import pytest
from numba.core.caching import UserProvidedCacheLocator

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]
PACKAGES = ("swarm_forage_env", "baselines", "metrics")
SHORT = ("--robots", "2", "--set", "n_objects=10", "--horizon", "4", "--set", "interval_s=2")


def importers_of_numba() -> list[str]:
    """Names of our modules that import numba."""
    files = [file for package in PACKAGES for file in (ROOT / package).rglob("*.py")]
    importing = [file for file in files if re.search(r"^\s*(from|import) numba\b", file.read_text(), re.MULTILINE)]
    return [".".join(file.relative_to(ROOT).with_suffix("").parts) for file in importing]


class Evil:
    """Opening the pickle of it writes a file."""

    def __init__(self, marker: Path) -> None:
        self.marker = marker

    def __reduce__(self):
        return Path.touch, (self.marker,)


@cache
def kernels() -> list[tuple[Path, str, int]]:
    """File, name and first line of all functions that may be kept compiled."""
    return [
        (file, node.name, node.decorator_list[0].lineno)
        for package in PACKAGES
        for file in (ROOT / package).rglob("*.py")
        for node in ast.parse(file.read_text()).body
        if isinstance(node, ast.FunctionDef) and node.decorator_list
    ]


@pytest.fixture
def marker(tmp_path):
    """A file that is there as soon as a forged one was opened."""
    return tmp_path / "marker"


@pytest.fixture
def forged(tmp_path, marker):
    """The cache that the file in `here` names, with forged functions."""
    folder = tmp_path / "cache"
    abi = f"py{sys.version_info[0]}{sys.version_info[1]}{sys.abiflags}"
    for file, name, line in kernels():
        place = folder / UserProvidedCacheLocator.get_suitable_cache_subpath(str(file))
        place.mkdir(parents=True, exist_ok=True)
        for mark in ("", "-called", "-callback"):
            (place / f"{file.stem}.{name}-{line}.{abi}{mark}.nbi").write_bytes(pickle.dumps(Evil(marker)))


@pytest.fixture
def here(tmp_path):
    """A folder with a file that tells numba to use another cache; JSON is YAML, too."""
    folder, other = tmp_path / "here", tmp_path / "cache"
    folder.mkdir()
    (folder / ".numba_config.yaml").write_text(
        json.dumps({"cache_dir": str(other), "chrome_trace": str(other / "trace"), "boundscheck": 1})
    )
    return folder


def python(here: Path, *words: str, **environ: str) -> subprocess.CompletedProcess[str]:
    """Run Python in a folder, with PyYAML or what numba takes for it."""
    places = [str(ROOT)]
    if find_spec("yaml") is None:
        places.append(str(here.parent))
        (here.parent / "yaml.py").write_text("from json import load as safe_load\n")
    told = {**os.environ, "PYTHONPATH": os.pathsep.join(places), **environ}
    ended = subprocess.run([sys.executable, "-P", *words], cwd=here, env=told, capture_output=True, text=True,
                           timeout=300, check=False)  # fmt: skip
    assert ended.returncode == 0, ended.stderr
    return ended


def command(here: Path, *words: str, **environ: str) -> subprocess.CompletedProcess[str]:
    return python(here, "-m", "swarm_forage_env.cli", *words, **environ)


def test_a_forged_cache_that_a_file_names_is_not_opened(here, forged, marker):
    ended = command(here, "run", "crw", *SHORT, "--jobs", "1")
    assert "swarm-forage: .numba_config.yaml in the current folder is not read" in ended.stderr
    program = "from metrics.distance import dtw; dtw([0.0, 1.0], [1.0, 1.0])"
    python(here, "-c", program)
    assert not marker.exists()
    python(here, "-c", program, NUMBA_CACHE_DIR=str(here.parent / "cache"))
    assert marker.exists(), "the forgery is none"


@pytest.mark.parametrize("module", importers_of_numba())
def test_numba_has_no_settings_from_a_file(here, module):
    """Whichever module is imported first, and whenever numba looks."""
    look = "from numba.core import config; print(config.CACHE_DIR, config.CHROME_TRACE, config.BOUNDSCHECK)"
    again = "config.reload_config(); print(config.CACHE_DIR, config.CHROME_TRACE, config.BOUNDSCHECK)"
    lines = python(here, "-c", f"import {module}; {look}; {again}").stdout.splitlines()
    assert lines == ["  None"] * 2


CONSOLE = """
import sys
from swarm_forage_env.cli import main
if __name__ == "__main__":
    sys.exit(main())
"""
FOREIGN = ("numpy", "numba", "yaml", "matplotlib", "cyclopts", "polars", "baselines", "metrics", "swarm_forage_env")
PLUGIN = "[swarm_forage_env.policies]\nevil = multiprocessing:Evil\n[numba_extensions]\ninit = multiprocessing:evil\n"


@pytest.fixture
def console(tmp_path, here, marker, forged):
    """The console command, as an installer writes it, in a folder where whatever might be taken for something lies."""
    evil = f"import os; os.close(os.open({str(marker)!r}, os.O_CREAT)); raise ImportError('a file of somebody else')\n"
    for name in {*sys.stdlib_module_names, *FOREIGN, "sitecustomize", "usercustomize"}:
        (here / f"{name}.py").write_text(evil)
    (here / "evil-1.0.dist-info").mkdir()
    (here / "evil-1.0.dist-info" / "METADATA").write_text("Metadata-Version: 2.1\nName: evil\nVersion: 1.0\n")
    (here / "evil-1.0.dist-info" / "entry_points.txt").write_text(PLUGIN)
    (here / "matplotlibrc").write_text("text.usetex: True\nbackend: module://multiprocessing\n")
    (here / ".env").write_text(
        f"NUMBA_CACHE_DIR={tmp_path / 'cache'}\nIMAGEIO_FFMPEG_EXE={tmp_path / 'bin' / 'latex'}\n"
    )
    for name in ("dask.yaml", "distributed.yaml"):
        (here / name).write_text("distributed: {worker: {preload: [multiprocessing.py]}}\n")
    programs = tmp_path / "bin"
    programs.mkdir()
    (programs / "swarm-forage").write_text(CONSOLE)
    (programs / "latex").write_text(f"#!/bin/sh\ntouch {marker}\n")
    (programs / "latex").chmod(0o755)

    def call(*words):
        told = {**os.environ, "PYTHONPATH": str(ROOT), "PATH": f"{programs}{os.pathsep}{os.environ['PATH']}"}
        return subprocess.run([sys.executable, programs / "swarm-forage", *words], cwd=here, env=told, text=True,
                              capture_output=True, timeout=300, check=False)  # fmt: skip

    return call


@pytest.mark.parametrize(
    ("words", "needed"),
    [
        (("list",), "numba"),
        (("run", "random", *SHORT, "--seeds", "2", "--jobs", "2"), "matplotlib"),
        (("record", "random", *SHORT[:4], "--seconds", "2", "--file", "film.mp4"), "imageio_ffmpeg"),
        (("study", "run", "tiny.toml", "--cluster", "local", "--jobs", "1"), "distributed"),
    ],
)
def test_no_file_is_read_because_of_its_name(console, here, marker, words, needed):
    pytest.importorskip(needed)
    (here / "tiny.toml").write_text(
        'name = "tiny"\nscenario = "warehouse_small"\npolicies = ["random"]\n[set]\nn_objects = 10\n'
        '[[axis]]\ncriterion = "population_size"\nvalues = [2]\n'
        "[budget.tiny]\nseeds = 1\nhorizon_s = 4.0\ninterval_s = 2.0\n"
    )
    ended = console(*words)
    assert (ended.returncode, marker.exists()) == (0, False), ended.stderr
    assert ended.stderr.count(".numba_config.yaml") <= 1
    if words[0] == "run":
        assert list(here.glob("results/warehouse_small*/*.png"))


def test_both_guards_are_the_same():
    """Neither package may import the other."""
    ours, metrics = (ROOT / f"{place}/numba_settings.py" for place in ("swarm_forage_env/_internal", "metrics"))
    assert ours.read_text() == metrics.read_text()
